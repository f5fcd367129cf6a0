//! Faults of the host, made on purpose: they show the force on the hand when the physics fails.
//!
//! `Failing` wraps the engine, and the host's loop under either clock drives the wrapper. The response of the tick
//! (the force fades, bad models are refused and counted) is that of the product: nothing from here reaches the tick
//! except models that a failing host could send.

use super::Engine;
use super::pacer::Due;
use super::stats::Stopwatch;
use rt_core::{LocalModel, TickRecord};
use std::str::FromStr;

/// A kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// The host does nothing for a while.
    Stall,
    /// The host's thread panics.
    Panic,
    /// The host publishes models with values that are not numbers.
    NotANumber,
    /// The host publishes models whose handles are not those of the body.
    Topology,
}

/// The kinds of fault, each with its name on the command line and its name in a summary.
const NAMES: [(&str, FaultKind, &str); 4] = [
    ("stall", FaultKind::Stall, "the host stalls"),
    ("panic", FaultKind::Panic, "the host panics"),
    (
        "nan",
        FaultKind::NotANumber,
        "the host publishes what is not a number",
    ),
    (
        "topology",
        FaultKind::Topology,
        "the host publishes models for other handles",
    ),
];

/// One fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HostFault {
    /// Its kind.
    pub kind: FaultKind,
    /// Start (s).
    pub at: f64,
    /// Duration (s); zero for a panic.
    pub duration: f64,
}

impl HostFault {
    /// Its name in a summary.
    pub fn name(&self) -> &'static str {
        NAMES
            .iter()
            .find(|(_, kind, _)| *kind == self.kind)
            .map_or("", |(_, _, name)| name)
    }

    fn lasts_at(&self, time_ns: u64) -> bool {
        let time = time_ns as f64 * 1e-9;
        (self.at..self.at + self.duration).contains(&time)
    }
}

/// A text from the command line that names no fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "found \"{0}\", allowed: stall@TIME+DURATION, nan@TIME+DURATION, topology@TIME+DURATION or \
     panic@TIME, in seconds, such as stall@1.5+0.5"
)]
pub struct FaultSyntax(String);

impl FromStr for HostFault {
    type Err = FaultSyntax;

    fn from_str(text: &str) -> Result<Self, FaultSyntax> {
        let refuse = || FaultSyntax(text.to_owned());
        let (name, when) = text.split_once('@').ok_or_else(refuse)?;
        let (_, kind, _) = NAMES
            .iter()
            .find(|(known, _, _)| *known == name)
            .ok_or_else(refuse)?;
        let seconds = |text: &str| {
            let value = text.parse::<f64>().ok();
            value
                .filter(|v| v.is_finite() && *v >= 0.0)
                .ok_or_else(refuse)
        };
        let (at, duration) = match (kind, when.split_once('+')) {
            (FaultKind::Panic, None) => (seconds(when)?, 0.0),
            (FaultKind::Panic, Some(_)) | (_, None) => return Err(refuse()),
            (_, Some((at, duration))) => (seconds(at)?, seconds(duration)?),
        };
        Ok(Self {
            kind: *kind,
            at,
            duration,
        })
    }
}

/// All faults of a run.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    pending: Vec<HostFault>,
}

impl Faults {
    /// The given faults, each at its time.
    pub fn new(faults: Vec<HostFault>) -> Self {
        Self { pending: faults }
    }

    /// The end (ns) of a stall that begins at `now_ns`, if one does. Each stall begins once.
    pub(crate) fn stall(&mut self, now_ns: u64) -> Option<u64> {
        let begins = |f: &HostFault| f.kind == FaultKind::Stall && f.at * 1e9 <= now_ns as f64;
        let index = self.pending.iter().position(begins)?;
        let fault = self.pending.swap_remove(index);
        Some(now_ns.saturating_add((fault.duration * 1e9) as u64))
    }

    /// # Panics
    /// If a panic is due.
    fn panic_if_due(&self, now_ns: u64) {
        let due = |f: &HostFault| f.kind == FaultKind::Panic && f.at * 1e9 <= now_ns as f64;
        assert!(!self.pending.iter().any(due), "a fault on purpose");
    }

    /// A spoilt copy of the model that is published at `now_ns`, if a fault is due. A sound model is not copied,
    /// since it takes some 10 kB.
    fn spoilt(&self, now_ns: u64, model: &LocalModel) -> Option<LocalModel> {
        let due = || self.pending.iter().filter(|fault| fault.lasts_at(now_ns));
        due().next()?;
        let mut model = *model;
        for fault in due() {
            match fault.kind {
                FaultKind::NotANumber => {
                    model.stiffness[0][0][(0, 0)] = f64::NAN;
                    model.handles[0].wrench.force.x = f64::NAN;
                }
                FaultKind::Topology => {
                    // One handle less, and the devices in another order.
                    model.handle_count = model.handle_count.saturating_sub(1).max(1);
                    for handle in &mut model.handles {
                        handle.device ^= 1;
                    }
                }
                FaultKind::Stall | FaultKind::Panic => {}
            }
        }
        Some(model)
    }
}

/// An engine that fails at given times.
pub(crate) struct Failing {
    engine: Engine,
    faults: Faults,
}

impl Failing {
    /// `engine`, with `faults`.
    pub(crate) fn new(engine: Engine, faults: Faults) -> Self {
        Self { engine, faults }
    }

    /// The end (ns) of a stall that begins at `now_ns`, if one does. The loop that drives the engine waits until
    /// then.
    pub(crate) fn stall(&mut self, now_ns: u64) -> Option<u64> {
        self.faults.stall(now_ns)
    }

    /// As [`Engine::follow`].
    pub(crate) fn follow(&mut self, record: &TickRecord) {
        self.engine.follow(record);
    }

    /// As [`Engine::step`], with models spoilt where a fault is due.
    ///
    /// # Panics
    /// If a panic is due.
    pub(crate) fn step(
        &mut self,
        due: Due,
        watch: &impl Stopwatch,
        mut publish: impl FnMut(usize, &LocalModel),
    ) {
        let faults = &self.faults;
        faults.panic_if_due(due.time_ns);
        self.engine.step(due, watch, |body, model| {
            let spoilt = faults.spoilt(due.time_ns, model);
            publish(body, spoilt.as_ref().unwrap_or(model));
        });
    }

    /// The engine alone.
    pub(crate) fn into_engine(self) -> Engine {
        self.engine
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read_as_the_help_states() {
        let stall: HostFault = "stall@1.5+0.5".parse().expect("is one");
        assert_eq!(
            stall,
            HostFault {
                kind: FaultKind::Stall,
                at: 1.5,
                duration: 0.5
            }
        );
        assert!("panic@2".parse::<HostFault>().is_ok());
        for wrong in [
            "",
            "stall",
            "stall@1",
            "panic@1+2",
            "stall@x+1",
            "stall@-1+1",
            "nan@inf+1",
        ] {
            let error = wrong.parse::<HostFault>().expect_err(wrong).to_string();
            assert!(
                error.contains(&format!("found \"{wrong}\", allowed: ")),
                "{error}"
            );
        }
    }

    #[test]
    fn a_stall_begins_once_and_a_window_ends() {
        let faults = ["stall@1+0.5", "nan@2+1"].map(|f| f.parse().expect("is one"));
        let mut faults = Faults::new(faults.to_vec());
        assert_eq!(faults.stall(999_999_999), None);
        assert_eq!(faults.stall(1_000_000_000), Some(1_500_000_000));
        assert_eq!(faults.stall(1_600_000_000), None);
        let spoilt = |time_ns| {
            let spoilt = faults.spoilt(time_ns, &LocalModel::empty());
            spoilt.is_some_and(|model| model.handles[0].wrench.force.x.is_nan())
        };
        assert_eq!(
            [1_999_999_999, 2_000_000_000, 2_999_999_999, 3_000_000_000].map(spoilt),
            [false, true, true, false]
        );
    }
}
