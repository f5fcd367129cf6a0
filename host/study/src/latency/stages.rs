//! The stages of a tick, and the time that each of them took.

use rt_core::Telemetry;
use std::fmt;

/// A stage of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// From the deadline to the wake-up.
    Wake,
    /// The newest models and patches are taken from their rings.
    Take,
    /// The device of this index is read.
    Read(usize),
    /// The wrenches are computed.
    Compute,
    /// The device of this index is given its wrench.
    Write(usize),
}

/// The stages of a tick in their order, with the time of each (ns).
pub type Stages = Vec<(Stage, u64)>;

/// The stages of the tick of `telemetry`.
pub fn stages(telemetry: &Telemetry) -> Stages {
    let stamps = &telemetry.stamps;
    let devices = usize::from(telemetry.device_count);
    let mut stages = vec![(Stage::Wake, telemetry.lateness_ns)];
    let mut last = 0;
    let mut push = |stage, until: u64| {
        stages.push((stage, until.saturating_sub(last)));
        last = until;
    };
    push(Stage::Take, stamps.began_ns);
    for (device, &read_ns) in stamps.read_ns.iter().take(devices).enumerate() {
        push(Stage::Read(device), read_ns);
    }
    push(Stage::Compute, telemetry.took_ns);
    for (device, &written_ns) in stamps.written_ns.iter().take(devices).enumerate() {
        push(Stage::Write(device), written_ns);
    }
    stages
}

/// The time from the deadline of a tick to its last command (ns).
pub fn whole(stages: &[(Stage, u64)]) -> u64 {
    stages.iter().map(|(_, ns)| ns).sum()
}

/// The name of a stage, with the names of the devices.
pub struct Named<'a>(pub Stage, pub &'a [String]);

impl fmt::Display for Named<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let device = |index: usize| self.1.get(index).map_or("", String::as_str);
        match self.0 {
            Stage::Wake => f.write_str("wake-up"),
            Stage::Take => f.write_str("taking of models"),
            Stage::Read(index) => write!(f, "read of {}", device(index)),
            Stage::Compute => f.write_str("computation"),
            Stage::Write(index) => write!(f, "write to {}", device(index)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stages_of_a_tick_follow_each_other_and_add_up_to_the_whole() {
        let mut telemetry = Telemetry::empty();
        telemetry.device_count = 2;
        telemetry.lateness_ns = 7;
        telemetry.stamps.began_ns = 1;
        telemetry.stamps.read_ns[..2].copy_from_slice(&[4, 9]);
        telemetry.took_ns = 20;
        telemetry.stamps.written_ns[..2].copy_from_slice(&[22, 25]);
        let stages = stages(&telemetry);
        let names = ["left".to_owned(), "right".to_owned()];
        let named: Vec<_> = stages
            .iter()
            .map(|(stage, ns)| (Named(*stage, &names).to_string(), *ns))
            .collect();
        let expected = [
            ("wake-up", 7),
            ("taking of models", 1),
            ("read of left", 3),
            ("read of right", 5),
            ("computation", 11),
            ("write to left", 2),
            ("write to right", 3),
        ];
        assert_eq!(named, expected.map(|(name, ns)| (name.to_owned(), ns)));
        assert_eq!(whole(&stages), 7 + 25);
    }
}
