//! The faults on the way between an emulated device and its driver.

use std::fmt;

/// A kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// No fault, for comparison.
    Nothing,
    /// The cable is pulled, and plugged in again. The device has power of its own.
    Unplugged,
    /// The device is switched off and on.
    Reset,
    /// Every packet, both ways, has one byte changed.
    Corrupt,
    /// Every packet, both ways, is the last one before the fault.
    Stale,
    /// Packets come in pairs, the later one first.
    Reordered,
    /// Packets are lost, both ways.
    Silent,
    /// The device sends twenty times as many packets.
    Flooding,
    /// The device is 10 % faster than the tick.
    Fast,
    /// The device is 10 % slower than the tick.
    Slow,
    /// The process of the host is stopped, and continues.
    Stopped,
    /// The process of the host ends without a last word.
    Killed,
    /// The commands are lost, and the device's own watchdog lets go. Its states arrive, if it sends them by itself.
    Deaf,
    /// The commands of 20 ms are lost.
    BrieflyDeaf,
    /// The emergency stop at the device is pressed, and released. A device of the firmware protocol then starts anew, and
    /// knows its place at once.
    EmergencyStop,
    /// The motors have no power for a while.
    MotorsOff,
    /// The hand lets go of the dead-man button, and presses it again.
    HandsOff,
    /// An order stops the device, and another one arms it.
    Ordered,
    /// The host publishes no model, and the last one grows too old.
    StaleHost,
    /// The thread of the tick is kept from its processor between the reading of the device and the command.
    Preempted,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 20] = [
        Self::Nothing,
        Self::Unplugged,
        Self::Reset,
        Self::Corrupt,
        Self::Stale,
        Self::Reordered,
        Self::Silent,
        Self::Flooding,
        Self::Fast,
        Self::Slow,
        Self::Stopped,
        Self::Killed,
        Self::Deaf,
        Self::BrieflyDeaf,
        Self::EmergencyStop,
        Self::MotorsOff,
        Self::HandsOff,
        Self::Ordered,
        Self::StaleHost,
        Self::Preempted,
    ];
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Nothing => "none",
            Self::Unplugged => "unplugged",
            Self::Reset => "reset",
            Self::Corrupt => "corrupt",
            Self::Stale => "stale",
            Self::Reordered => "reordered",
            Self::Silent => "silent",
            Self::Flooding => "flooding",
            Self::Fast => "10 % fast",
            Self::Slow => "10 % slow",
            Self::Stopped => "host stopped",
            Self::Killed => "host killed",
            Self::Deaf => "commands lost",
            Self::BrieflyDeaf => "20 ms of commands lost",
            Self::EmergencyStop => "emergency stop",
            Self::MotorsOff => "motors off",
            Self::HandsOff => "dead-man button",
            Self::Ordered => "stop and arm",
            Self::StaleHost => "no models",
            Self::Preempted => "tick preempted",
        })
    }
}

/// A fault and its times (ns).
#[derive(Clone, Copy, Debug)]
pub struct Injected {
    /// The kind.
    pub kind: Kind,
    /// When the fault begins (ns).
    pub from_ns: u64,
    /// When the fault ends (ns).
    pub to_ns: u64,
}

impl Injected {
    /// Whether a fault of this kind is there.
    pub fn is(&self, kind: Kind, now_ns: u64) -> bool {
        self.kind == kind && (self.from_ns..self.to_ns).contains(&now_ns)
    }
}
