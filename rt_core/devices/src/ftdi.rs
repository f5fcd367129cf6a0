//! FTDI's USB serial chips (FT232 type): their requests, and their streams of bytes.
//!
//! The chip turns USB into a serial line. Requests on its control pipe set the line ([`Control`]). Bytes go out on one
//! bulk pipe unchanged. Each incoming packet begins with two bytes of modem status, and may contain nothing else
//! ([`strip`]). The chip sends a packet when 62 bytes wait, when its latency timer ends, when a modem line changes, or
//! when the event character arrives (FTDI AN232B-04).
//!
//! [`Usb`] is the raw connection ([`crate::usbfs`], or an emulator). [`Chip`] is the chip on this connection. A
//! protocol takes any [`Ftdi`].
//!
//! Sources: FTDI's application notes AN232B-04 (latency, event character) and AN232B-05 (baud rates), and the numbers
//! of the requests as the drivers of Linux and libftdi document them.

use crate::transport::Transport;
use std::time::Duration;

/// Length of a USB packet at full speed (bytes).
pub const PACKET: usize = 64;
/// Number of status bytes at the start of each incoming packet.
pub const STATUS: usize = 2;
/// Type of all requests here: vendor, to the device, without data.
const OUT: u8 = 0x40;

/// One of the chip's two buffers. The documents disagree on the direction of each number, so a driver purges both
/// buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Buffer {
    /// The buffer of request value 1.
    One,
    /// The buffer of request value 2.
    Two,
}

/// A request to the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Empties one of the chip's buffers.
    Purge(Buffer),
    /// Sets the modem lines that are not `None`; true is high.
    Signals {
        /// Data terminal ready.
        dtr: Option<bool>,
        /// Request to send.
        rts: Option<bool>,
    },
    /// No flow control.
    NoFlow,
    /// The divisor of 3 MHz that gives the baud rate: 14 bits of its whole part, and two bits for a half, a quarter or
    /// an eighth (AN232B-05).
    Divisor(u16),
    /// Eight data bits, no parity, one stop bit.
    EightNone,
    /// The character whose arrival makes the chip send, or `None` for none.
    EventCharacter(Option<u8>),
    /// The latency timer (ms), 1 to 255.
    Latency(u8),
}

/// A request on the control pipe of a USB device, without data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SetupPacket {
    /// `bmRequestType`.
    pub kind: u8,
    /// `bRequest`.
    pub request: u8,
    /// `wValue`.
    pub value: u16,
    /// `wIndex`.
    pub index: u16,
}

impl Control {
    /// The request in the form of USB, for a chip of one port.
    ///
    /// ```
    /// use devices::ftdi::Control;
    ///
    /// // 9600 baud: 3 MHz / 312.5.
    /// let setup = Control::Divisor(0x4138).setup();
    /// assert_eq!((setup.kind, setup.request, setup.value, setup.index), (0x40, 3, 0x4138, 0));
    /// ```
    pub fn setup(self) -> SetupPacket {
        let line = |level: Option<bool>, bit: u16| match level {
            // The high byte says which lines change.
            Some(high) => bit << 8 | if high { bit } else { 0 },
            None => 0,
        };
        let (request, value) = match self {
            Self::Purge(Buffer::One) => (0, 1),
            Self::Purge(Buffer::Two) => (0, 2),
            Self::Signals { dtr, rts } => (1, line(dtr, 1) | line(rts, 2)),
            Self::NoFlow => (2, 0),
            Self::Divisor(divisor) => (3, divisor),
            Self::EightNone => (4, 8),
            Self::EventCharacter(None) => (6, 0),
            Self::EventCharacter(Some(character)) => (6, 0x100 | u16::from(character)),
            Self::Latency(ms) => (9, u16::from(ms)),
        };
        SetupPacket {
            kind: OUT,
            request,
            value,
            index: 0,
        }
    }

    /// The request in a setup, as the chip reads it; `None` for any other setup.
    pub fn from_setup(setup: SetupPacket) -> Option<Self> {
        let [low, high] = setup.value.to_le_bytes();
        let line = |bit: u8| (high & bit != 0).then_some(low & bit != 0);
        let control = match (setup.request, setup.value) {
            (0, 1) => Self::Purge(Buffer::One),
            (0, 2) => Self::Purge(Buffer::Two),
            (1, _) => Self::Signals {
                dtr: line(1),
                rts: line(2),
            },
            (2, 0) => Self::NoFlow,
            (3, divisor) => Self::Divisor(divisor),
            (4, 8) => Self::EightNone,
            (6, _) => Self::EventCharacter((high & 1 != 0).then_some(low)),
            (9, _) => Self::Latency(low),
            _ => return None,
        };
        (control.setup() == setup).then_some(control)
    }
}

/// A stream of bytes through the chip, and the chip's settings. A read may return zero bytes before its wait is over.
pub trait Ftdi: Transport {
    /// Sends a request to the chip and waits until the chip has taken it.
    ///
    /// # Errors
    /// The error number of the system.
    fn control(&mut self, request: Control) -> Result<(), i32>;
}

impl<T: Ftdi + ?Sized> Ftdi for Box<T> {
    fn control(&mut self, request: Control) -> Result<(), i32> {
        (**self).control(request)
    }
}

/// A raw USB device with a control pipe and one bulk pipe each way.
pub trait Usb: Send {
    /// A request on the control pipe.
    ///
    /// # Errors
    /// The error number of the system.
    fn request(&mut self, setup: SetupPacket) -> Result<(), i32>;

    /// Waits at most for `wait` for one packet, and returns its length; zero if no packet came.
    ///
    /// # Errors
    /// The error number of the system.
    fn bulk_in(&mut self, packet: &mut [u8; PACKET], wait: Duration) -> Result<usize, i32>;

    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// The error number of the system.
    fn bulk_out(&mut self, bytes: &[u8]) -> Result<(), i32>;
}

/// Removes the two status bytes at the start of each packet of [`PACKET`] bytes in a transfer, in place. Returns the
/// number of bytes that are left at the start of the buffer. A packet of a single byte is no packet of the chip, and is
/// dropped.
///
/// ```
/// let mut transfer = [1, 0x60, b'<', b'A'];
/// assert_eq!(devices::ftdi::strip(&mut transfer), 2);
/// assert_eq!(&transfer[..2], b"<A");
/// // Status alone.
/// assert_eq!(devices::ftdi::strip(&mut [1, 0x60]), 0);
/// ```
pub fn strip(transfer: &mut [u8]) -> usize {
    let mut kept: usize = 0;
    for at in 0..transfer.len() {
        if at % PACKET < STATUS {
            continue;
        }
        let byte = transfer.get(at).copied();
        if let (Some(place), Some(byte)) = (transfer.get_mut(kept), byte) {
            *place = byte;
            kept = kept.saturating_add(1);
        }
    }
    kept
}

/// The chip on a raw USB device: a stream of bytes without status bytes.
#[derive(Debug)]
pub struct Chip<U> {
    usb: U,
    packet: [u8; PACKET],
    /// The bytes of the last packet that no read has taken yet.
    from: usize,
    to: usize,
}

impl<U: Usb> Chip<U> {
    /// The chip on `usb`.
    pub fn new(usb: U) -> Self {
        Self {
            usb,
            packet: [0; PACKET],
            from: 0,
            to: 0,
        }
    }
}

impl<U: Usb> Transport for Chip<U> {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        if self.from >= self.to {
            let length = self.usb.bulk_in(&mut self.packet, wait)?;
            // The caller's clock bounds its whole wait, so a packet of status alone ends this read.
            let transfer = self.packet.get_mut(..length).unwrap_or_default();
            (self.from, self.to) = (0, strip(transfer));
        }
        let rest = self.packet.get(self.from..self.to).unwrap_or_default();
        let count = rest.len().min(buffer.len());
        for (place, byte) in buffer.iter_mut().zip(rest) {
            *place = *byte;
        }
        self.from = self.from.saturating_add(count);
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        self.usb.bulk_out(bytes)
    }
}

impl<U: Usb> Ftdi for Chip<U> {
    fn control(&mut self, request: Control) -> Result<(), i32> {
        if matches!(request, Control::Purge(_)) {
            (self.from, self.to) = (0, 0);
        }
        self.usb.request(request.setup())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::VecDeque;

    /// A device that gives packets in order, and keeps the last request.
    struct Script(VecDeque<Vec<u8>>, Option<SetupPacket>);

    impl Usb for Script {
        fn request(&mut self, setup: SetupPacket) -> Result<(), i32> {
            self.1 = Some(setup);
            Ok(())
        }
        fn bulk_in(&mut self, packet: &mut [u8; PACKET], _wait: Duration) -> Result<usize, i32> {
            let next = self.0.pop_front().unwrap_or_default();
            packet[..next.len()].copy_from_slice(&next);
            Ok(next.len())
        }
        fn bulk_out(&mut self, _bytes: &[u8]) -> Result<(), i32> {
            Ok(())
        }
    }

    #[test]
    fn requests_have_the_documented_numbers() {
        for (control, request, value) in [
            (Control::Purge(Buffer::One), 0, 1),
            (Control::Purge(Buffer::Two), 0, 2),
            (
                Control::Signals {
                    dtr: Some(true),
                    rts: None,
                },
                1,
                0x0101,
            ),
            (
                Control::Signals {
                    dtr: Some(false),
                    rts: Some(false),
                },
                1,
                0x0300,
            ),
            (
                Control::Signals {
                    dtr: None,
                    rts: Some(true),
                },
                1,
                0x0202,
            ),
            (Control::NoFlow, 2, 0),
            (Control::Divisor(0x4138), 3, 0x4138),
            (Control::EightNone, 4, 8),
            (Control::EventCharacter(Some(b'>')), 6, 0x013e),
            (Control::EventCharacter(None), 6, 0),
            (Control::Latency(16), 9, 16),
        ] {
            let setup = control.setup();
            assert_eq!(
                (setup.kind, setup.request, setup.value, setup.index),
                (0x40, request, value, 0),
                "{control:?}"
            );
            assert_eq!(Control::from_setup(setup), Some(control));
        }
    }

    #[test]
    fn a_small_buffer_gets_a_packet_in_parts_and_a_purge_forgets_the_rest() {
        let packets = [
            vec![1, 0x60],
            vec![1, 0x60, 1, 2, 3],
            vec![],
            vec![1, 0x60, 4, 5],
        ];
        let mut chip = Chip::new(Script(packets.into(), None));
        let mut buffer = [0; 2];
        let mut read = |chip: &mut Chip<Script>| {
            let count = chip.read(&mut buffer, Duration::ZERO).unwrap();
            buffer[..count].to_vec()
        };
        // Status alone is no byte, and neither is a packet that did not come.
        let expected: [&[u8]; 4] = [&[], &[1, 2], &[3], &[]];
        for bytes in expected {
            assert_eq!(read(&mut chip), bytes);
        }
        let mut one = [0; 1];
        assert_eq!(chip.read(&mut one, Duration::ZERO), Ok(1));
        assert_eq!(one, [4]);
        // A chip in a box is a chip.
        let mut chip = Box::new(chip);
        Ftdi::control(&mut chip, Control::Purge(Buffer::Two)).unwrap();
        assert_eq!(chip.usb.1.map(|setup| setup.value), Some(2));
        assert_eq!(chip.read(&mut one, Duration::ZERO), Ok(0));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn stripping_leaves_the_stream(stream in proptest::collection::vec(any::<u8>(), 0..400)) {
            let mut transfer: Vec<u8> = stream
                .chunks(PACKET - STATUS)
                .flat_map(|chunk| [&[1, 0x60], chunk].concat())
                .collect();
            let kept = strip(&mut transfer);
            prop_assert_eq!(&transfer[..kept], &stream[..]);
        }

        #[test]
        fn any_setup_is_read_without_a_panic(
            kind in any::<u8>(), request in 0..12_u8, value in any::<u16>(), index in 0..2_u16,
        ) {
            let setup = SetupPacket { kind, request, value, index };
            if let Some(control) = Control::from_setup(setup) {
                prop_assert_eq!(control.setup(), setup);
            }
        }
    }
}
