//! Firmware for a microcontroller in QEMU: the images of `firmware_proto/board`.
//!
//! QEMU's `mps2-an386` has a Cortex-M4 and UARTs. The first UART is the line to the host, at a TCP address. The second
//! UART belongs to the simulated mechanism behind the registers of the firmware. Through it, a test gives commands to
//! the mechanism, and asks for its true position and forces.
//!
//! QEMU does not keep the time of this machine, and its UART is slow towards the board; see [`crate::paced`].

use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::os::fd::OwnedFd;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// QEMU's time for one instruction (ns): 31 million instructions a second, about as many as a Cortex-M4 at 25 MHz.
pub const INSTRUCTION_NS: u32 = 1 << SHIFT;
const SHIFT: u32 = 5;
/// Longest time that a test waits for an answer of the mechanism. Even a busy machine needs less time.
const ANSWER: Duration = Duration::from_secs(600);

/// The reason why a board cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum BoardError {
    /// QEMU could not be started.
    #[error("cannot start qemu-system-arm: {0} (apt-get install qemu-system-arm)")]
    Start(#[source] io::Error),
    /// QEMU has ended, or does not answer.
    #[error("QEMU does not answer ({source}). It printed: {printed}")]
    Ended {
        /// The error of the connection.
        source: io::Error,
        /// The messages of QEMU.
        printed: String,
    },
}

/// A board in QEMU, which ends with this value.
#[derive(Debug)]
pub struct Board {
    qemu: Child,
    line: SocketAddr,
    mechanism: TcpStream,
}

/// The state of the simulated mechanism.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Truth {
    /// Number of ticks of the hardware so far; wraps.
    pub ticks: u32,
    /// Time that the processor has slept so far (cycles of the board's clock, 40 ns each); wraps.
    pub slept_cycles: u32,
    /// True position (nm).
    pub position_nm: [i32; 3],
    /// True forces on the handle (uN).
    pub force: [i32; 3],
    /// The amplifiers are on.
    pub enabled: bool,
}

impl Board {
    /// Starts the image of a firmware. The firmware begins to run with the first connection to its line.
    ///
    /// # Errors
    /// [`BoardError`].
    pub fn start(image: &Path) -> Result<Self, BoardError> {
        let (line, line_address) = listener().map_err(BoardError::Start)?;
        let (mechanism, mechanism_address) = listener().map_err(BoardError::Start)?;
        let socket =
            |name, file| format!("socket,id={name},fd={file},server=on,wait=on,nodelay=on");
        // QEMU gets the listening sockets as its files 0 and 1, so no other program can take a port in between.
        let qemu = Command::new("qemu-system-arm")
            .args(["-M", "mps2-an386", "-cpu", "cortex-m4", "-nodefaults"])
            .args(["-display", "none", "-icount", &format!("shift={SHIFT}")])
            .args(["-chardev", &socket("mechanism", 1)])
            .args(["-chardev", &socket("line", 0)])
            .args(["-serial", "chardev:line", "-serial", "chardev:mechanism"])
            .arg("-kernel")
            .arg(image)
            .stdin(OwnedFd::from(line))
            .stdout(OwnedFd::from(mechanism))
            .stderr(Stdio::piped())
            .spawn()
            .map_err(BoardError::Start)?;
        let mechanism = TcpStream::connect(mechanism_address).map_err(BoardError::Start)?;
        mechanism.set_nodelay(true).map_err(BoardError::Start)?;
        mechanism
            .set_read_timeout(Some(ANSWER))
            .map_err(BoardError::Start)?;
        Ok(Self {
            qemu,
            line: line_address,
            mechanism,
        })
    }

    /// The address of the line to the host. QEMU takes one connection at a time.
    pub fn line(&self) -> SocketAddr {
        self.line
    }

    /// Gives the mechanism a command; `firmware_proto/board/src/plant.rs` lists the commands.
    ///
    /// # Errors
    /// [`BoardError::Ended`].
    pub fn command(&mut self, command: u8) -> Result<(), BoardError> {
        let written = self.mechanism.write_all(&[command]);
        written.map_err(|error| self.ended(error))
    }

    /// The state of the mechanism. The mechanism answers only while the firmware runs.
    ///
    /// # Errors
    /// [`BoardError::Ended`].
    pub fn truth(&mut self) -> Result<Truth, BoardError> {
        self.command(b'?')?;
        let mut words = [0_i32; 9];
        for word in &mut words {
            let mut bytes = [0; 4];
            let read = self.mechanism.read_exact(&mut bytes);
            read.map_err(|error| self.ended(error))?;
            *word = i32::from_le_bytes(bytes);
        }
        let [ticks, slept, x, y, z, force_x, force_y, force_z, enabled] = words;
        Ok(Truth {
            ticks: ticks.cast_unsigned(),
            slept_cycles: slept.cast_unsigned(),
            position_nm: [x, y, z],
            force: [force_x, force_y, force_z],
            enabled: enabled != 0,
        })
    }

    fn ended(&mut self, source: io::Error) -> BoardError {
        // A running QEMU would not close its messages.
        let _ = self.qemu.kill();
        let mut printed = String::new();
        if let Some(messages) = &mut self.qemu.stderr {
            let _ = messages.read_to_string(&mut printed);
        }
        BoardError::Ended { source, printed }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

/// A port of this machine alone, and its address.
fn listener() -> io::Result<(TcpListener, SocketAddr)> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    let address = listener.local_addr()?;
    Ok((listener, address))
}
