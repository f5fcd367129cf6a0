//! Streams of bytes: serial lines, ptys and TCP.
//!
//! A worker of the kernel with ordinary priority (`flush_to_ldisc`) passes on the bytes that a tty receives, so a
//! loaded machine delays them. TCP on the same machine has no such worker.

use super::{Transport, lock, now, wait_for, write_all};
use rustix::event::PollFlags;
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::fs::{File, OpenOptions};
use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::Duration;

/// Time within which a TCP connection must be made.
const CONNECT: Duration = Duration::from_secs(2);
/// Error number of a stream whose other end was closed (ENODEV, as for a device that was unplugged).
const CLOSED: i32 = 19;

/// An open stream of bytes.
#[derive(Debug)]
pub struct Stream {
    end: OwnedFd,
}

impl Stream {
    /// Opens the serial line or the pty at `path`, at `baud` bits a second, eight data bits, no parity, one stop bit, raw.
    /// A pty ignores the speed. While the line is open, no other program can open it.
    ///
    /// # Errors
    /// The error of the system. There is an error, too, if `path` is no terminal, or if another program has the line.
    pub fn tty(path: &Path, baud: u32) -> io::Result<Self> {
        use rustix::fs::OFlags;
        let flags = (OFlags::NONBLOCK | OFlags::NOCTTY).bits() as i32;
        let mut options = OpenOptions::new();
        let file: File = options
            .read(true)
            .write(true)
            .custom_flags(flags)
            .open(path)?;
        rustix::termios::ioctl_tiocexcl(&file)?;
        lock(&file)?;
        let mut settings = tcgetattr(&file)?;
        settings.make_raw();
        settings.set_speed(baud)?;
        tcsetattr(&file, OptionalActions::Flush, &settings)?;
        Ok(Self { end: file.into() })
    }

    /// Connects to `address`, such as `localhost:4000`.
    ///
    /// # Errors
    /// The error of the system for the last address of the name.
    pub fn tcp(address: &str) -> io::Result<Self> {
        let mut last = io::Error::from(io::ErrorKind::AddrNotAvailable);
        for address in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, CONNECT) {
                Ok(stream) => return Self::connected(stream),
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    /// An existing TCP connection. Small packets are sent at once.
    ///
    /// # Errors
    /// The error of the system.
    pub fn connected(stream: TcpStream) -> io::Result<Self> {
        stream.set_nodelay(true)?;
        stream.set_nonblocking(true)?;
        Ok(Self { end: stream.into() })
    }

    /// A file that reads and writes without waiting, such as the master of a pty.
    ///
    /// # Errors
    /// The error of the system.
    pub fn nonblocking(end: OwnedFd) -> io::Result<Self> {
        let flags = rustix::fs::fcntl_getfl(&end)?;
        rustix::fs::fcntl_setfl(&end, flags | rustix::fs::OFlags::NONBLOCK)?;
        Ok(Self { end })
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        // Otherwise, a pty that its other end holds open stays exclusive, and only root can open it again. A file that
        // is no terminal refuses the call.
        let _ = rustix::termios::ioctl_tiocnxcl(&self.end);
    }
}

impl AsFd for Stream {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.end.as_fd()
    }
}

impl Transport for Stream {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        if !wait_for(&self.end, PollFlags::IN, wait)? {
            return Ok(0);
        }
        match rustix::io::read(&self.end, &mut *buffer) {
            // A stream that can be read and has no bytes has ended.
            Ok(0) if !buffer.is_empty() => Err(CLOSED),
            result => now(result),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        write_all(&self.end, bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::io::Errno;
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use std::net::TcpListener;

    const LONG: Duration = Duration::from_secs(10);

    /// A pty: its master, and the path of its other end.
    fn pty() -> (Stream, std::path::PathBuf) {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pty");
        grantpt(&master).expect("ours");
        unlockpt(&master).expect("ours");
        let name = ptsname(&master, Vec::new()).expect("a name");
        let path = std::path::PathBuf::from(name.to_str().expect("plain text"));
        (Stream::nonblocking(master).expect("a file"), path)
    }

    /// Reads until `count` bytes have come.
    fn read_exactly(from: &mut Stream, count: usize) -> Vec<u8> {
        let mut all = Vec::new();
        while all.len() < count {
            let mut buffer = [0; 64];
            let got = from.read(&mut buffer, LONG).expect("open");
            assert!(got > 0, "{all:?}");
            all.extend_from_slice(&buffer[..got]);
        }
        all
    }

    /// Every byte, both ways; nothing if nothing was sent; an error if the other end is gone.
    fn passes_bytes(mut near: Stream, mut far: Stream) {
        let every: Vec<u8> = (0..=255).collect();
        for (from, to) in [(true, false), (false, true)] {
            assert_ne!(from, to);
            let (from, to) = if from {
                (&mut near, &mut far)
            } else {
                (&mut far, &mut near)
            };
            from.write(&every).expect("open");
            assert_eq!(read_exactly(to, every.len()), every);
        }
        let mut buffer = [0; 4];
        assert_eq!(near.read(&mut buffer, Duration::ZERO), Ok(0));
        drop(far);
        let gone = near.read(&mut buffer, LONG);
        assert!(gone.is_err(), "{gone:?}");
    }

    #[test]
    fn a_pty_passes_every_byte_unchanged() {
        let (master, path) = pty();
        let slave = Stream::tty(&path, 115_200).expect("a terminal");
        passes_bytes(slave, master);
    }

    /// Whether the kernel refuses another program the line.
    #[allow(unsafe_code)]
    fn is_exclusive(line: &Stream) -> bool {
        use std::os::fd::AsRawFd;
        let mut exclusive: libc::c_int = 0;
        // SAFETY: the kernel writes one integer, which lives until the call returns.
        let result =
            unsafe { libc::ioctl(line.end.as_raw_fd(), libc::TIOCGEXCL, &raw mut exclusive) };
        assert_eq!(result, 0);
        exclusive != 0
    }

    #[test]
    fn a_line_that_is_open_is_open_to_nobody_else() {
        let (master, path) = pty();
        let first = Stream::tty(&path, 115_200).expect("a terminal");
        // Root may open a line in exclusive mode, but the line is also locked.
        assert!(is_exclusive(&first));
        let refused = Stream::tty(&path, 115_200).expect_err("it is open");
        assert_eq!(refused.kind(), io::ErrorKind::ResourceBusy, "{refused}");
        // The refused attempt has not opened the line to others.
        assert!(is_exclusive(&first));
        drop(first);
        assert!(is_exclusive(
            &Stream::tty(&path, 115_200).expect("it is free")
        ));
        drop(master);
    }

    #[test]
    fn tcp_passes_every_byte_unchanged() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("a port").to_string();
        let near = Stream::tcp(&address).expect("it listens");
        let (far, _) = listener.accept().expect("connected");
        passes_bytes(near, Stream::connected(far).expect("connected"));
    }

    #[test]
    fn what_is_no_terminal_is_refused() {
        let error = Stream::tty(Path::new("/dev/null"), 115_200).expect_err("no terminal");
        assert_eq!(error.raw_os_error(), Some(25), "{error}");
        // Nobody listens on port 1.
        assert!(Stream::tcp("127.0.0.1:1").is_err());
    }

    /// A device that takes no bytes does not hold up its driver, and gets bytes again as soon as it takes them.
    #[test]
    fn a_write_waits_for_room_for_a_bounded_time() {
        let (mut master, path) = pty();
        let mut slave = Stream::tty(&path, 115_200).expect("a terminal");
        let stuck = (0..1000).find_map(|_| master.write(&[7; 1024]).err());
        assert_eq!(stuck, Some(Errno::TIMEDOUT.raw_os_error()));
        let mut buffer = [0; 1024];
        while slave.read(&mut buffer, Duration::ZERO) != Ok(0) {}
        assert_eq!(master.write(&[8, 9]), Ok(()));
        assert_eq!(read_exactly(&mut slave, 2), [8, 9]);
    }

    /// A protocol takes any transport, also behind a reference or a box, and cut into packets.
    #[test]
    fn a_transport_passes_its_bytes_through_every_wrapper() {
        fn asks(mut near: impl Transport, far: &mut Stream) {
            near.write(&[1, 2, 3]).expect("open");
            assert_eq!(read_exactly(far, 3), [1, 2, 3]);
            far.write(&[4, 5, 6]).expect("open");
            let mut buffer = [0; 3];
            assert_eq!(near.read(&mut buffer, LONG), Ok(3));
            assert_eq!(buffer, [4, 5, 6]);
            assert_eq!(near.read(&mut buffer, Duration::ZERO), Ok(0));
        }
        let (mut master, path) = pty();
        let mut slave = Stream::tty(&path, 115_200).expect("a terminal");
        asks(&mut slave, &mut master);
        asks(crate::transport::Packets::new(&mut slave, 3), &mut master);
        let boxed: Box<dyn Transport> = Box::new(slave);
        asks(boxed, &mut master);
    }

    /// The kernel takes the number of the report, zero for unnumbered reports, before the report itself.
    #[test]
    fn a_report_of_hid_follows_the_report_number() {
        use crate::transport::Hidraw;
        let (mut master, path) = pty();
        // The terminal stays raw.
        drop(Stream::tty(&path, 115_200).expect("a terminal"));
        let mut device = Hidraw::open(&path).expect("nobody has it");
        for length in [0, 2, 64] {
            let report = vec![7; length];
            assert_eq!(device.write(&report), Ok(()));
            let sent = read_exactly(&mut master, length + 1);
            assert_eq!((sent[0], &sent[1..]), (0, &report[..]));
        }
        let too_long = Errno::MSGSIZE.raw_os_error();
        assert_eq!(device.write(&[7; 65]), Err(too_long));
        let mut buffer = [0; 4];
        assert_eq!(device.read_now(&mut buffer), Ok(0));
        assert_eq!(device.read(&mut buffer, Duration::ZERO), Ok(0));
        master.write(&[1, 2]).expect("open");
        assert_eq!(device.read(&mut buffer, LONG), Ok(2));
        master.write(&[3]).expect("open");
        while device.read_now(&mut buffer) == Ok(0) {
            std::thread::yield_now();
        }
        assert_eq!(buffer, [3, 2, 0, 0]);
    }

    #[test]
    fn nothing_is_asked_for_and_nothing_is_the_answer() {
        let (mut master, path) = pty();
        let mut line = Stream::tty(&path, 115_200).expect("a line");
        let flags = rustix::fs::fcntl_getfl(line.as_fd()).expect("an open file");
        // A write to a full line must not wait in the system.
        assert!(flags.contains(rustix::fs::OFlags::NONBLOCK));
        master.write(&[1, 2, 3]).expect("open");
        assert_eq!(line.read(&mut [], LONG), Ok(0));
        assert_eq!(read_exactly(&mut line, 3), [1, 2, 3]);
    }
}
