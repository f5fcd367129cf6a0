//! A HID device made by a program: the kernel's `/dev/uhid`.
//!
//! A program writes events of a fixed layout to the file and reads events from it (Linux, `Documentation/hid/uhid.rst`
//! and `include/uapi/linux/uhid.h`, read for the layout). The kernel then shows a HID device like any other, with its
//! hidraw file. The device exists as long as the file is open. An account that may open `/dev/uhid` may make any input
//! device, so the file usually belongs to root.

use devices::Transport;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::{Duration, Instant};

/// The file of the kernel.
pub const FILE: &str = "/dev/uhid";
/// Numbers of the events that are written and read.
mod event {
    pub(super) const DESTROY: u32 = 1;
    pub(super) const OUTPUT: u32 = 6;
    pub(super) const GET_REPORT: u32 = 9;
    pub(super) const GET_REPORT_REPLY: u32 = 10;
    pub(super) const CREATE: u32 = 11;
    pub(super) const INPUT: u32 = 12;
    pub(super) const SET_REPORT: u32 = 13;
    pub(super) const SET_REPORT_REPLY: u32 = 14;
}
/// Length of the data of a report, or of a report descriptor, in an event.
const DATA: usize = 4096;
/// Length of an event: its number, and the largest of the kinds (creation).
const EVENT: usize = 4 + 128 + 64 + 64 + 2 + 2 + 4 * 4 + DATA;
/// The bus of the device: USB.
const BUS_USB: u16 = 3;
/// Error number for a request that the device does not serve (EIO).
const REFUSED: u16 = 5;

/// The identity that a HID device states.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Name of the device, cut to 127 bytes.
    pub name: String,
    /// Serial number, cut to 63 bytes.
    pub serial: String,
    /// Vendor of the USB device.
    pub vid: u16,
    /// Product of the USB device.
    pub pid: u16,
    /// Length of the reports, both ways (bytes), at most 255.
    pub report: u8,
}

/// A HID device that lives as long as this value.
#[derive(Debug)]
pub struct Uhid {
    file: File,
}

impl Uhid {
    /// Makes a device with unnumbered reports of a vendor's own usage.
    ///
    /// # Errors
    /// The error of the system: `/dev/uhid` is missing (`modprobe uhid`), or may not be opened (it belongs to root).
    pub fn create(identity: &Identity) -> io::Result<Self> {
        let flags = rustix::fs::OFlags::NONBLOCK.bits() as i32;
        let mut options = OpenOptions::new();
        let mut file = options
            .read(true)
            .write(true)
            .custom_flags(flags)
            .open(Path::new(FILE))?;
        file.write_all(&creation(identity))?;
        Ok(Self { file })
    }

    fn send(&mut self, event: &[u8]) -> Result<(), i32> {
        match rustix::io::write(&self.file, event) {
            Ok(_) => Ok(()),
            Err(error) => Err(error.raw_os_error()),
        }
    }
}

impl Drop for Uhid {
    fn drop(&mut self) {
        let _ = self.send(&event::DESTROY.to_ne_bytes());
    }
}

impl Transport for Uhid {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        let start = Instant::now();
        loop {
            let left = wait.saturating_sub(start.elapsed());
            let timeout = Timespec::try_from(left).ok();
            match poll(
                &mut [PollFd::new(&self.file, PollFlags::IN)],
                timeout.as_ref(),
            ) {
                Ok(0) | Err(Errno::INTR) => return Ok(0),
                Ok(_) => {}
                Err(error) => return Err(error.raw_os_error()),
            }
            let mut event = [0; EVENT];
            match rustix::io::read(&self.file, &mut event) {
                Ok(_) => {}
                Err(Errno::AGAIN | Errno::INTR) => return Ok(0),
                Err(error) => return Err(error.raw_os_error()),
            }
            match Event::of(&event) {
                Event::Output(report) => {
                    let count = report.len().min(buffer.len());
                    for (to, from) in buffer.iter_mut().zip(report) {
                        *to = *from;
                    }
                    return Ok(count);
                }
                Event::Asks { id, reply } => self.send(&refusal(id, reply))?,
                Event::Other => {}
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        self.send(&input(bytes))
    }
}

/// An event from the kernel.
#[derive(Debug, PartialEq, Eq)]
enum Event<'a> {
    /// A report from the host, without its number.
    Output(&'a [u8]),
    /// The kernel asks for a report, or sends one, over the control pipe, and waits for a reply.
    Asks { id: u32, reply: u32 },
    /// Start, stop, open, close.
    Other,
}

impl<'a> Event<'a> {
    fn of(event: &'a [u8; EVENT]) -> Self {
        let number = |at: usize| {
            let bytes = event
                .get(at..at + 4)
                .and_then(|bytes| bytes.try_into().ok());
            bytes.map_or(0, u32::from_ne_bytes)
        };
        match number(0) {
            event::OUTPUT => {
                let size = event.get(4 + DATA..4 + DATA + 2);
                let size = size.and_then(|bytes| bytes.try_into().ok());
                let size = usize::from(size.map_or(0, u16::from_ne_bytes)).min(DATA);
                let data = event.get(4..4 + size).unwrap_or_default();
                // hidraw passes the number 0 of unnumbered reports on.
                Self::Output(match data {
                    [0, report @ ..] => report,
                    data => data,
                })
            }
            event::GET_REPORT => Self::Asks {
                id: number(4),
                reply: event::GET_REPORT_REPLY,
            },
            event::SET_REPORT => Self::Asks {
                id: number(4),
                reply: event::SET_REPORT_REPLY,
            },
            _ => Self::Other,
        }
    }
}

/// The event that makes a device.
fn creation(identity: &Identity) -> Vec<u8> {
    let descriptor = descriptor(identity.report);
    let mut event = Vec::with_capacity(EVENT);
    event.extend(event::CREATE.to_ne_bytes());
    put_text(&mut event, &identity.name, 128);
    put_text(&mut event, "palpate", 64);
    put_text(&mut event, &identity.serial, 64);
    event.extend((descriptor.len() as u16).to_ne_bytes());
    event.extend(BUS_USB.to_ne_bytes());
    for number in [u32::from(identity.vid), u32::from(identity.pid), 0, 0] {
        event.extend(number.to_ne_bytes());
    }
    event.extend(&descriptor);
    event.resize(EVENT, 0);
    event
}

/// A text of a fixed length that ends with a zero byte.
fn put_text(event: &mut Vec<u8>, text: &str, length: usize) {
    let end = event.len() + length;
    event.extend(text.bytes().filter(|byte| *byte != 0).take(length - 1));
    event.resize(end, 0);
}

/// The report descriptor (USB HID 1.11, section 6.2.2): one report of `length` bytes each way, of a vendor's own usage.
pub(crate) fn descriptor(length: u8) -> Vec<u8> {
    vec![
        0x06, 0x00, 0xff, // usage page: vendor
        0x09, 0x01, // usage 1
        0xa1, 0x01, // collection: application
        0x15, 0x00, // logical minimum 0
        0x26, 0xff, 0x00, // logical maximum 255
        0x75, 0x08, // size 8 bits
        0x95, length, // count
        0x09, 0x01, // usage 1
        0x81, 0x02, // input: data, variable, absolute
        0x95, length, // count
        0x09, 0x01, // usage 1
        0x91, 0x02, // output: data, variable, absolute
        0xc0, // end of the collection
    ]
}

/// The event of a report to the host.
fn input(report: &[u8]) -> Vec<u8> {
    let report = report.get(..DATA).unwrap_or(report);
    let mut event = Vec::with_capacity(6 + report.len());
    event.extend(event::INPUT.to_ne_bytes());
    event.extend((report.len() as u16).to_ne_bytes());
    event.extend(report);
    event
}

/// The answer to a request over the control pipe, which these devices do not serve.
fn refusal(id: u32, reply: u32) -> Vec<u8> {
    let mut event = Vec::with_capacity(14);
    event.extend(reply.to_ne_bytes());
    event.extend(id.to_ne_bytes());
    event.extend(REFUSED.to_ne_bytes());
    // A reply with a report also has the length of the report.
    event.extend(0_u16.to_ne_bytes());
    event
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_creation_has_the_layout_of_the_kernel() {
        let identity = Identity {
            name: "x".repeat(200),
            serial: "left".into(),
            vid: 0x1209,
            pid: 0xc0de,
            report: 64,
        };
        let event = creation(&identity);
        assert_eq!(event.len(), 4376);
        assert_eq!(event[..4], 11_u32.to_ne_bytes());
        // The name is cut, and ends with a zero byte.
        assert_eq!((event[4 + 126], event[4 + 127]), (b'x', 0));
        assert_eq!(&event[196..201], b"left\0");
        assert_eq!(event[260..262], 27_u16.to_ne_bytes());
        assert_eq!(event[262..264], 3_u16.to_ne_bytes());
        assert_eq!(event[264..268], 0x1209_u32.to_ne_bytes());
        assert_eq!(event[268..272], 0xc0de_u32.to_ne_bytes());
        assert_eq!(event[280..283], [0x06, 0x00, 0xff]);
    }

    #[test]
    fn events_are_read_as_the_kernel_writes_them() {
        let mut event = [0; EVENT];
        event[..4].copy_from_slice(&6_u32.to_ne_bytes());
        event[4..8].copy_from_slice(&[0, 1, 2, 3]);
        event[4100..4102].copy_from_slice(&4_u16.to_ne_bytes());
        assert_eq!(Event::of(&event), Event::Output(&[1, 2, 3]));
        // A length beyond the data is cut.
        event[4100..4102].copy_from_slice(&u16::MAX.to_ne_bytes());
        assert!(matches!(Event::of(&event), Event::Output(data) if data.len() == 4095));
        event[..4].copy_from_slice(&9_u32.to_ne_bytes());
        event[4..8].copy_from_slice(&77_u32.to_ne_bytes());
        assert_eq!(Event::of(&event), Event::Asks { id: 77, reply: 10 });
        event[..4].copy_from_slice(&4_u32.to_ne_bytes());
        assert_eq!(Event::of(&event), Event::Other);
        assert_eq!(input(&[5, 6])[4..], [2, 0, 5, 6]);
    }
}
