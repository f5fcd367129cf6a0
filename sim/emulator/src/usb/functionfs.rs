//! The bytes of FunctionFS: the descriptors and texts that make a program the function of a gadget, and the events that
//! the program reads.
//!
//! A program writes its descriptors and its texts to the file `ep0`. Then the kernel has a file for each endpoint, `ep1`
//! and `ep2` in the order of the descriptors, and events come from `ep0`. All numbers are little-endian.
//!
//! Source: `linux/usb/functionfs.h`, and chapter 9 of the USB 2.0 specification for the descriptors.

use devices::ftdi::SetupPacket;

/// First word of descriptors in version 2.
const DESCRIPTORS: u32 = 3;
/// First word of texts.
const TEXTS: u32 = 2;
/// There are descriptors for full speed.
const FULL_SPEED: u32 = 1;
/// There are descriptors for high speed.
const HIGH_SPEED: u32 = 2;
/// Requests to the device come as events, too, not only those to its interface and its endpoints.
const ALL_REQUESTS: u32 = 64;
/// Length of an event (bytes): a setup packet, the kind of the event, three bytes of padding.
pub const EVENT: usize = 12;
/// The direction bit of an endpoint's address and of a request: to the host.
pub const TO_HOST: u8 = 0x80;
/// Largest packet of a bulk endpoint at high speed.
const HIGH_SPEED_PACKET: u16 = 512;
/// Largest packet of a bulk endpoint at full speed.
const FULL_SPEED_PACKET: u16 = 64;

/// An interface of a vendor's own class with two bulk endpoints, as its descriptors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interface {
    /// Address of the endpoint to the host, whose file is `ep1`.
    pub to_host: u8,
    /// Address of the endpoint from the host, whose file is `ep2`.
    pub from_host: u8,
}

impl Interface {
    /// The descriptors for full and high speed, as `ep0` takes them.
    pub fn descriptors(self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for word in [DESCRIPTORS, 0, FULL_SPEED | HIGH_SPEED | ALL_REQUESTS] {
            bytes.extend(word.to_le_bytes());
        }
        // Three descriptors for each speed.
        for _ in 0..2 {
            bytes.extend(3_u32.to_le_bytes());
        }
        for packet in [FULL_SPEED_PACKET, HIGH_SPEED_PACKET] {
            // Length, kind, number, alternative, endpoints, class, subclass, protocol, text.
            bytes.extend([9, 4, 0, 0, 2, 0xff, 0xff, 0xff, 1]);
            for address in [self.to_host, self.from_host] {
                let [low, high] = packet.to_le_bytes();
                // Length, kind, address, bulk, largest packet, interval.
                bytes.extend([7, 5, address, 2, low, high, 0]);
            }
        }
        with_length(bytes)
    }
}

/// The one text of an interface, in English, as `ep0` takes it.
pub fn texts(interface: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    // One text, in one language.
    for word in [TEXTS, 0, 1, 1] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(0x0409_u16.to_le_bytes());
    bytes.extend(interface.bytes().filter(|byte| *byte != 0));
    bytes.push(0);
    with_length(bytes)
}

/// Puts the length of all bytes into the second word.
fn with_length(mut bytes: Vec<u8>) -> Vec<u8> {
    let length = (bytes.len() as u32).to_le_bytes();
    for (place, byte) in bytes.iter_mut().skip(4).zip(length) {
        *place = byte;
    }
    bytes
}

/// A request of the host to the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostRequest {
    /// The request.
    pub setup: SetupPacket,
    /// Number of bytes that follow, or that the host expects.
    pub length: u16,
}

impl HostRequest {
    /// Whether the host expects bytes from the device.
    pub fn is_to_host(self) -> bool {
        self.setup.kind & TO_HOST != 0
    }
}

/// An event from the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The gadget was bound to a controller.
    Bound,
    /// The gadget is no longer bound.
    Unbound,
    /// A host has configured the device: its endpoints work.
    Enabled,
    /// The host has reset the device, or is gone.
    Disabled,
    /// A request, which waits for an answer.
    Request(HostRequest),
    /// The host has suspended or resumed the device, or the event is a newer one.
    Other,
}

impl Event {
    /// The event in its bytes.
    pub fn of(bytes: &[u8; EVENT]) -> Self {
        let [kind, request, v0, v1, i0, i1, l0, l1, event, ..] = *bytes;
        match event {
            0 => Self::Bound,
            1 => Self::Unbound,
            2 => Self::Enabled,
            3 => Self::Disabled,
            4 => Self::Request(HostRequest {
                setup: SetupPacket {
                    kind,
                    request,
                    value: u16::from_le_bytes([v0, v1]),
                    index: u16::from_le_bytes([i0, i1]),
                },
                length: u16::from_le_bytes([l0, l1]),
            }),
            _ => Self::Other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn word(bytes: &[u8], at: usize) -> u32 {
        u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
    }

    #[test]
    fn descriptors_have_the_layout_of_the_kernel() {
        let bytes = Interface {
            to_host: 0x81,
            from_host: 0x02,
        }
        .descriptors();
        // Head of 12 bytes, two counts, and at each speed an interface of 9 bytes and two endpoints of 7 bytes.
        assert_eq!(bytes.len(), 12 + 8 + 2 * (9 + 2 * 7));
        let head = [0, 4, 8, 12, 16].map(|at| word(&bytes, at));
        assert_eq!(head, [3, 66, 0x43, 3, 3]);
        // Each descriptor begins with its length and its kind: a walk by the lengths meets the ends.
        let mut at = 20;
        let mut kinds = Vec::new();
        while at < bytes.len() {
            let descriptor = &bytes[at..at + usize::from(bytes[at])];
            kinds.push((descriptor.len(), descriptor[1], descriptor[2]));
            at += descriptor.len();
        }
        assert_eq!(at, bytes.len());
        let each = [(9, 4, 0), (7, 5, 0x81), (7, 5, 0x02)];
        assert_eq!(kinds, [each, each].concat());
        // The interface has two endpoints, a vendor's class and the first text.
        assert_eq!(bytes[20 + 4..20 + 9], [2, 0xff, 0xff, 0xff, 1]);
        // Bulk, 64 bytes at full speed and 512 at high speed.
        assert_eq!(bytes[29 + 3..29 + 7], [2, 64, 0, 0]);
        assert_eq!(bytes[52 + 3..52 + 7], [2, 0, 2, 0]);
    }

    #[test]
    fn texts_have_the_layout_of_the_kernel() {
        let bytes = texts("a\0b");
        assert_eq!(bytes.len(), 16 + 2 + 3);
        assert_eq!([0, 4, 8, 12].map(|at| word(&bytes, at)), [2, 21, 1, 1]);
        assert_eq!(bytes[16..], [0x09, 0x04, b'a', b'b', 0]);
    }

    #[test]
    fn events_are_read_as_the_kernel_writes_them() {
        let setup = [0x40, 9, 0x10, 0x01, 0x02, 0x03, 0x04, 0x05];
        let event = |kind| {
            let mut bytes = [0; EVENT];
            bytes[..8].copy_from_slice(&setup);
            // The kind is at offset 8, with three bytes of padding.
            bytes[8] = kind;
            bytes[9..].fill(0xee);
            Event::of(&bytes)
        };
        let expected = HostRequest {
            setup: SetupPacket {
                kind: 0x40,
                request: 9,
                value: 0x0110,
                index: 0x0302,
            },
            length: 0x0504,
        };
        assert_eq!(event(4), Event::Request(expected));
        assert!(!expected.is_to_host());
        let plain = [
            Event::Bound,
            Event::Unbound,
            Event::Enabled,
            Event::Disabled,
        ];
        assert_eq!([0, 1, 2, 3].map(event), plain);
        assert_eq!([5, 6, 7, 255].map(event), [Event::Other; 4]);
    }
}
