//! The protocols that emulated devices speak.

use std::fmt;

/// A device and its protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Protocol {
    /// The firmware protocol, in reports (HID).
    Reports,
    /// The firmware protocol, in a stream of bytes (tty, TCP).
    Stream,
    /// WoodenHaptics: HID reports without sequence, time and check sum.
    WoodenHaptics,
    /// The Falcon: packets of letters through an FTDI chip.
    Falcon,
}

impl Protocol {
    /// All protocols.
    pub const ALL: [Self; 4] = [
        Self::Reports,
        Self::Stream,
        Self::WoodenHaptics,
        Self::Falcon,
    ];

    /// Whether each packet has a check sum, a number and a session, so that a receiver detects every wrong packet.
    pub fn is_checked(self) -> bool {
        matches!(self, Self::Reports | Self::Stream)
    }
}

impl fmt::Display for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Reports => "firmware, HID",
            Self::Stream => "firmware, stream",
            Self::WoodenHaptics => "WoodenHaptics",
            Self::Falcon => "Falcon",
        })
    }
}
