//! Reports in a stream of bytes: a UART, a pseudoterminal, a TCP connection.
//!
//! A packet is the report in consistent-overhead byte stuffing (Cheshire and Baker 1999), then a zero: [`PACKET`] bytes.
//! The stuffing removes every zero from the report, so a zero always ends a packet. After any garbage, a receiver that
//! waits for the next zero is synchronized again. The receiver never searches for a marker inside the data of a packet,
//! never goes back, and does the same bounded work for each byte. A marker in front of plain bytes would cost as much
//! (two bytes a report), and could occur inside a report.
//!
//! A sender first sends one zero, which ends all earlier bytes. Empty packets have no meaning.

use crate::report::LENGTH;

/// The length of a packet in bytes: the report, one byte of stuffing, and the zero at the end.
pub const PACKET: usize = LENGTH + 2;

/// The packet of a report.
///
/// ```
/// use firmware_proto::stream::{Decoder, packet};
///
/// let report = [0x5A; 64];
/// let mut decoder = Decoder::new();
/// let mut received = Vec::new();
/// // Garbage, a zero that ends the garbage, and the packet.
/// for byte in [1, 2, 3, 0].into_iter().chain(packet(&report)) {
///     received.extend(decoder.push(byte).copied());
/// }
/// assert_eq!((received, decoder.refused()), (vec![report], 1));
/// ```
pub fn packet(report: &[u8; LENGTH]) -> [u8; PACKET] {
    let mut packet = [0; PACKET];
    // Each zero, and the place in front of the report, holds the distance to the next zero. From the end backwards, the
    // distance is known.
    let mut distance = 1_u8;
    let (front, rest) = packet.split_at_mut(1);
    for (byte, &from) in rest.iter_mut().zip(report).rev() {
        if from == 0 {
            *byte = distance;
            distance = 1;
        } else {
            *byte = from;
            // A report is shorter than 254 bytes.
            distance = distance.saturating_add(1);
        }
    }
    for byte in front {
        *byte = distance;
    }
    packet
}

/// Takes a stream byte by byte, and finds the reports in it. The decoder does not check the content of a report.
///
/// A decoder that starts in the middle of a stream, or after garbage, is synchronized at the next zero. It finds every
/// packet that follows a zero.
#[derive(Clone, Copy, Debug)]
pub struct Decoder {
    report: [u8; LENGTH],
    /// Number of bytes in `report`, one more if there were too many.
    length: usize,
    /// Number of bytes until the next zero of the report.
    left: u8,
    /// Whether the packet has begun.
    begun: bool,
    refused: u32,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder at the beginning of a packet.
    pub const fn new() -> Self {
        Self {
            report: [0; LENGTH],
            length: 0,
            left: 0,
            begun: false,
            refused: 0,
        }
    }

    /// Number of packets that were no report; saturates.
    pub fn refused(&self) -> u32 {
        self.refused
    }

    /// Takes the next byte; returns the report that the byte completes.
    pub fn push(&mut self, byte: u8) -> Option<&[u8; LENGTH]> {
        if byte == 0 {
            return self.end();
        }
        if self.left > 0 {
            self.left = self.left.saturating_sub(1);
            self.append(byte);
        } else {
            if self.begun {
                self.append(0);
            }
            self.begun = true;
            self.left = byte.saturating_sub(1);
        }
        None
    }

    fn end(&mut self) -> Option<&[u8; LENGTH]> {
        let whole = self.length == LENGTH && self.left == 0;
        let begun = self.begun;
        self.length = 0;
        self.left = 0;
        self.begun = false;
        if whole {
            return Some(&self.report);
        }
        self.refused = self.refused.saturating_add(u32::from(begun));
        None
    }

    fn append(&mut self, byte: u8) {
        match self.report.get_mut(self.length) {
            Some(place) => {
                *place = byte;
                self.length = self.length.saturating_add(1);
            }
            // Too long: no length but that of a report is accepted.
            None => self.length = usize::MAX,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn decoded(decoder: &mut Decoder, bytes: &[u8]) -> Vec<[u8; LENGTH]> {
        let mut reports = Vec::new();
        for &byte in bytes {
            reports.extend(decoder.push(byte).copied());
        }
        reports
    }

    /// A report, often with many zeros.
    fn report() -> impl Strategy<Value = [u8; LENGTH]> {
        let byte = prop_oneof![Just(0_u8), Just(1), Just(255), any::<u8>()];
        prop::collection::vec(byte, LENGTH).prop_map(|bytes| {
            let mut report = [0; LENGTH];
            report.copy_from_slice(&bytes);
            report
        })
    }

    #[test]
    fn the_packet_is_that_of_the_paper() {
        let mut report = [0; LENGTH];
        report[0] = 0x11;
        report[2] = 0x22;
        report[3] = 0x33;
        let packet = packet(&report);
        // The first zero is two bytes on, the next three, and then one byte each.
        assert_eq!(packet[..6], [0x02, 0x11, 0x03, 0x22, 0x33, 0x01]);
        assert!(packet[5..65].iter().all(|&byte| byte == 1));
        assert_eq!(packet[65], 0);
        let full = super::packet(&[7; LENGTH]);
        assert_eq!((full[0], full[64], full[65]), (65, 7, 0));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn frames_hold_one_zero_and_come_back(reports in prop::collection::vec(report(), 1..5)) {
            let mut bytes = Vec::new();
            for report in &reports {
                let packet = packet(report);
                prop_assert_eq!(packet.iter().position(|&byte| byte == 0), Some(PACKET - 1));
                bytes.extend(packet);
            }
            let mut decoder = Decoder::new();
            prop_assert_eq!(decoded(&mut decoder, &bytes), reports);
            prop_assert_eq!(decoder.refused(), 0);
        }

        #[test]
        fn a_packet_behind_a_zero_is_found_whatever_came_before(
            parts in prop::collection::vec((prop::collection::vec(any::<u8>(), 0..200), report()), 1..6),
        ) {
            let mut decoder = Decoder::new();
            for (garbage, report) in parts {
                decoded(&mut decoder, &garbage);
                decoder.push(0);
                prop_assert_eq!(decoded(&mut decoder, &packet(&report)), [report]);
            }
        }

        #[test]
        fn a_damaged_packet_costs_at_most_the_next(
            first in report(), second in report(), third in report(),
            place in 0..PACKET, value: u8, cut in 0..PACKET,
        ) {
            let mut damaged = packet(&first).to_vec();
            damaged[place] = value;
            damaged.remove(cut);
            let mut decoder = Decoder::new();
            decoded(&mut decoder, &damaged);
            decoded(&mut decoder, &packet(&second));
            prop_assert_eq!(decoded(&mut decoder, &packet(&third)), [third]);
        }

        #[test]
        fn what_is_accepted_is_a_packet(bytes in prop::collection::vec(0..70_u8, 0..400)) {
            let mut decoder = Decoder::new();
            let mut last = Vec::new();
            for byte in bytes {
                last.push(byte);
                if let Some(report) = decoder.push(byte) {
                    prop_assert_eq!(&packet(report)[..], &last[..]);
                }
                if byte == 0 {
                    last.clear();
                }
            }
        }
    }
}
