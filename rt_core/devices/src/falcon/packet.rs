//! The packets of the Falcon's firmware, 16 bytes each way, and their limits in a stream of bytes.
//!
//! A packet is `<`, twelve letters, a status letter, a letter of unknown use, `>`. Each four letters are one number of
//! 16 bits, lowest bits first: a letter is `A` plus four bits. The numbers are the torques of the motors in a packet to
//! the device, and the counts of the encoders in a packet from it. There is no check sum, sequence number or time
//! stamp. No letter is below `A`, so neither `<` nor `>` can occur inside a packet. A cut packet is therefore
//! recognized, and no packet after it is lost.
//!
//! Users of libnifalcon report packets of 14 bytes, which libnifalcon misread as homing and buttons (its pull request
//! 30). This module refuses such a packet.
//!
//! Source: the protocol in libnifalcon (BSD).
#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used,
    )
)]

/// Length of a packet (bytes).
pub const LENGTH: usize = 16;
/// First byte of a packet.
pub const START: u8 = b'<';
/// Last byte of a packet.
pub const END: u8 = b'>';
/// The letter of zero.
const ZERO: u8 = b'A';

/// The lights of the Falcon.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lights {
    /// The red light.
    pub red: bool,
    /// The green light.
    pub green: bool,
    /// The blue light.
    pub blue: bool,
}

/// A packet to the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Command {
    /// Torque counts of the three motors; see [`torque_counts`](super::geometry::torque_counts).
    pub torques: [i16; 3],
    /// The lights.
    pub lights: Lights,
    /// Whether the device looks for the references of its axes.
    pub homing: bool,
}

/// A packet from the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Counts of the three encoders. They are relative to the reference only if the axis is homed.
    pub encoders: [i16; 3],
    /// The four buttons of the grip, lowest bit first.
    pub buttons: u8,
    /// Whether each axis has found its reference.
    pub homed: [bool; 3],
}

/// A letter that no sender should send.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("byte {at} of a packet of the Falcon is {found:#04x}, which is no letter of its alphabet")]
pub struct LetterError {
    /// Index of the byte in the packet.
    pub at: usize,
    /// The byte.
    pub found: u8,
}

// Bits of the status letter to the device, from the code of libnifalcon (its comment differs).
const HOMING: u8 = 1;
const GREEN: u8 = 2;
const BLUE: u8 = 4;
const RED: u8 = 8;
/// Bits of the buttons in the status letter from the device.
const BUTTONS: u8 = 0x0f;
/// Lowest bit of the homed axes in the status letter from the device.
const HOMED: u8 = 0x10;

/// A packet of three numbers and a status.
fn encode(numbers: [i16; 3], status: u8) -> [u8; LENGTH] {
    let mut packet = [ZERO; LENGTH];
    let [first, inner @ .., last] = &mut packet;
    (*first, *last) = (START, END);
    let nibbles = numbers
        .into_iter()
        .flat_map(|number| [0, 4, 8, 12].map(|shift| (number.cast_unsigned() >> shift) as u8 & 0xf))
        .chain([status]);
    for (letter, nibble) in inner.iter_mut().zip(nibbles) {
        *letter = ZERO.wrapping_add(nibble);
    }
    packet
}

/// The three numbers and the status of a packet. Its first and its last byte are not checked.
fn decode(packet: &[u8; LENGTH]) -> Result<([i16; 3], u8), LetterError> {
    let mut nibbles = [0; 12];
    let mut status = 0;
    let mut inner = packet.iter().enumerate().skip(1);
    for ((at, &found), place) in inner.clone().zip(&mut nibbles) {
        *place = found.wrapping_sub(ZERO);
        if *place > 0xf {
            return Err(LetterError { at, found });
        }
    }
    if let Some((at, &found)) = inner.nth(nibbles.len()) {
        status = found.checked_sub(ZERO).ok_or(LetterError { at, found })?;
    }
    let mut numbers = [0; 3];
    let (fours, _) = nibbles.as_chunks::<4>();
    for (number, nibbles) in numbers.iter_mut().zip(fours) {
        let [a, b, c, d] = nibbles.map(u16::from);
        *number = (a | b << 4 | c << 8 | d << 12).cast_signed();
    }
    Ok((numbers, status))
}

impl Command {
    /// The bytes of the packet.
    ///
    /// ```
    /// use devices::falcon::packet::{Command, Lights};
    ///
    /// let command = Command {
    ///     torques: [0, -1, 0x1234],
    ///     lights: Lights { blue: true, ..Lights::default() },
    ///     homing: true,
    /// };
    /// assert_eq!(&command.encode(), b"<AAAAPPPPEDCBFA>");
    /// assert_eq!(Command::decode(&command.encode()), Ok(command));
    /// ```
    pub fn encode(&self) -> [u8; LENGTH] {
        let bit = |on: bool, bit: u8| if on { bit } else { 0 };
        let Lights { red, green, blue } = self.lights;
        let status = bit(self.homing, HOMING) | bit(green, GREEN) | bit(blue, BLUE) | bit(red, RED);
        encode(self.torques, status)
    }

    /// The command in a packet, as the device reads it.
    ///
    /// # Errors
    /// [`LetterError`] if a byte is no letter of the alphabet.
    pub fn decode(packet: &[u8; LENGTH]) -> Result<Self, LetterError> {
        let (torques, status) = decode(packet)?;
        let on = |bit: u8| status & bit != 0;
        Ok(Self {
            torques,
            lights: Lights {
                red: on(RED),
                green: on(GREEN),
                blue: on(BLUE),
            },
            homing: on(HOMING),
        })
    }
}

impl Report {
    /// The bytes of the packet. Buttons beyond the fourth are left out.
    pub fn encode(&self) -> [u8; LENGTH] {
        let [x, y, z] = self.homed.map(u8::from);
        let homed = x | y << 1 | z << 2;
        encode(self.encoders, self.buttons & BUTTONS | homed << 4)
    }

    /// The report in a packet. A fourth bit above those of the axes is ignored; its use is unknown.
    ///
    /// # Errors
    /// [`LetterError`] if a byte is no letter of the alphabet.
    pub fn decode(packet: &[u8; LENGTH]) -> Result<Self, LetterError> {
        let (encoders, status) = decode(packet)?;
        Ok(Self {
            encoders,
            buttons: status & BUTTONS,
            homed: [HOMED, HOMED << 1, HOMED << 2].map(|bit| status & bit != 0),
        })
    }

    /// Whether all three axes have found their references.
    pub fn is_homed(&self) -> bool {
        self.homed == [true; 3]
    }
}

/// Finds the packets in a stream of bytes. A framer holds one packet at most, and allocates nothing.
///
/// ```
/// use devices::falcon::packet::Framer;
///
/// let mut framer = Framer::new();
/// // The end of a packet, a packet of 14 bytes, and a packet.
/// let stream = b"AAAAAAAAAA><AAAAAAAAAAAA><AAAABAAACAAAqA>";
/// let found: Vec<_> = stream.iter().filter_map(|byte| framer.push(*byte)).collect();
/// assert_eq!(found, [*b"<AAAABAAACAAAqA>"]);
/// assert_eq!((framer.refused, framer.stray), (1, 11));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Framer {
    packet: [u8; LENGTH],
    filled: usize,
    /// Number of packets that began, but were too short or too long.
    pub refused: u64,
    /// Number of bytes outside packets.
    pub stray: u64,
}

impl Framer {
    /// A framer at the start of a stream.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the next byte; returns the packet that it completes, from [`START`] to [`END`].
    pub fn push(&mut self, byte: u8) -> Option<[u8; LENGTH]> {
        if byte == START {
            self.refuse();
        } else if self.filled == 0 {
            self.stray = self.stray.saturating_add(1);
            return None;
        }
        let place = self.packet.get_mut(self.filled)?;
        *place = byte;
        self.filled = self.filled.saturating_add(1);
        match (byte == END, self.filled == LENGTH) {
            (true, true) => {
                self.filled = 0;
                Some(self.packet)
            }
            (false, false) => None,
            _ => {
                self.refuse();
                None
            }
        }
    }

    /// Forgets the packet that has begun, as after a purge.
    pub fn restart(&mut self) {
        self.filled = 0;
    }

    /// Forgets the packet that has begun, and counts it.
    fn refuse(&mut self) {
        self.refused = self.refused.saturating_add(u64::from(self.filled > 0));
        self.filled = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Bytes from before a restart are no part of a packet.
    #[test]
    fn a_restart_forgets_the_packet_that_has_begun() {
        let packet = Report::default().encode();
        let mut framer = Framer::new();
        let (begun, rest) = packet.split_at(7);
        assert!(begun.iter().all(|byte| framer.push(*byte).is_none()));
        framer.restart();
        assert!(rest.iter().all(|byte| framer.push(*byte).is_none()));
        let found: Vec<_> = packet
            .iter()
            .filter_map(|byte| framer.push(*byte))
            .collect();
        assert_eq!(found, [packet]);
    }

    fn report() -> impl Strategy<Value = Report> {
        (any::<[i16; 3]>(), 0..16_u8, any::<[bool; 3]>()).prop_map(|(encoders, buttons, homed)| {
            Report {
                encoders,
                buttons,
                homed,
            }
        })
    }

    /// Bytes of which many have a meaning.
    fn byte() -> impl Strategy<Value = u8> {
        prop_oneof![Just(START), Just(END), 0x41..0x51_u8, any::<u8>()]
    }

    #[test]
    fn golden_bytes() {
        // Four letters a number, lowest first; status q = 0x71 - 0x41 = 0x30: the first two axes homed.
        let bytes = b"<AAAABAAAAPPPqA>";
        let report = Report::decode(bytes).unwrap();
        assert_eq!(report.encoders, [0, 1, -16]);
        assert_eq!((report.buttons, report.homed), (0, [true, true, false]));
        assert!(!report.is_homed());
        assert_eq!(&report.encode(), bytes);
        // All homed, buttons 1 and 8: 0x41 + 0x79.
        let mut bytes = *b"<AAAAAAAAAAAA.A>";
        bytes[13] = 0xba;
        let report = Report::decode(&bytes).unwrap();
        assert!(report.is_homed() && report.buttons == 9);
        // The lights and homing, each by its bit.
        for (status, lights, homing) in [
            (b'B', [false; 3], true),
            (b'C', [false, true, false], false),
            (b'E', [false, false, true], false),
            (b'I', [true, false, false], false),
        ] {
            let [red, green, blue] = lights;
            let command = Command {
                torques: [4096, -4096, i16::MIN],
                lights: Lights { red, green, blue },
                homing,
            };
            let mut bytes = *b"<AAABAAAPAAAI.A>";
            bytes[13] = status;
            assert_eq!(command.encode(), bytes);
        }
    }

    #[test]
    fn a_byte_outside_the_alphabet_is_named() {
        let mut bytes = Report::default().encode();
        bytes[5] = b'Q';
        let error = LetterError { at: 5, found: b'Q' };
        assert_eq!(Report::decode(&bytes), Err(error));
        assert!(error.to_string().contains("byte 5") && error.to_string().contains("0x51"));
        let mut bytes = Report::default().encode();
        bytes[13] = b'0';
        assert_eq!(
            Report::decode(&bytes),
            Err(LetterError {
                at: 13,
                found: b'0'
            })
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn packets_come_back(report in report(), torques in any::<[i16; 3]>(), bits in any::<[bool; 4]>()) {
            prop_assert_eq!(Report::decode(&report.encode()), Ok(report));
            let [red, green, blue, homing] = bits;
            let command = Command { torques, lights: Lights { red, green, blue }, homing };
            prop_assert_eq!(Command::decode(&command.encode()), Ok(command));
        }

        #[test]
        fn every_packet_is_found_between_any_bytes(
            pieces in proptest::collection::vec(
                (proptest::collection::vec(byte(), 0..40), report()), 1..8),
        ) {
            let mut framer = Framer::new();
            let mut found = Vec::new();
            for (noise, report) in &pieces {
                found.extend(noise.iter().filter_map(|byte| framer.push(*byte)).map(|_| None));
                found.extend(report.encode().iter().filter_map(|byte| framer.push(*byte)).map(Some));
            }
            // Packets in the noise count as found, too; the sent ones all follow it unchanged.
            let sent: Vec<_> = found.into_iter().flatten().collect();
            let expected: Vec<_> = pieces.iter().map(|(_, report)| report.encode()).collect();
            prop_assert_eq!(sent, expected);
        }

        #[test]
        fn any_bytes_are_counted_and_none_makes_a_panic(
            bytes in proptest::collection::vec(byte(), 0..200),
        ) {
            let mut framer = Framer::new();
            let mut found = 0;
            for byte in &bytes {
                if let Some(packet) = framer.push(*byte) {
                    found += 1;
                    prop_assert_eq!((packet[0], packet[15]), (START, END));
                    let _ = (Report::decode(&packet), Command::decode(&packet));
                }
            }
            let starts = bytes.iter().map(|byte| u64::from(*byte == START)).sum::<u64>();
            prop_assert_eq!(found + framer.refused + u64::from(framer.filled > 0), starts);
        }

        #[test]
        fn a_packet_with_a_byte_missing_or_doubled_is_refused(
            report in report(), at in 1..15_usize, doubled in any::<bool>(),
        ) {
            let mut bytes = report.encode().to_vec();
            if doubled {
                bytes.insert(at, bytes[at]);
            } else {
                bytes.remove(at);
            }
            let mut framer = Framer::new();
            let found = bytes.iter().filter_map(|byte| framer.push(*byte)).count();
            prop_assert_eq!((found, framer.refused), (0, 1));
            // The next packet is found.
            let next = report.encode();
            let found: Vec<_> = next.iter().filter_map(|byte| framer.push(*byte)).collect();
            prop_assert_eq!(found, [next]);
        }
    }
}
