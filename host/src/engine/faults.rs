//! Faults of the host, made on purpose: they show the force on the hand when the physics fails.
//!
//! `Failing` wraps the engine, and the host's loop under either clock drives the wrapper. The response of the tick
//! (the force fades, bad models and patches are refused and counted) is that of the product: nothing from here reaches the tick
//! except models and patches that a failing host could send.

use super::Engine;
use super::pacer::Due;
use super::stats::{EngineStats, Stopwatch};
use rt_core::tool::Patch;
use rt_core::{LocalModel, TickRecord};

/// A kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// The host does nothing for a while.
    Stall,
    /// The host's thread panics.
    Panic,
    /// The host publishes models and patches with values that are not numbers.
    NotANumber,
    /// The host publishes models whose handles are not those of the body, and patches whose triangles have no sites.
    Topology,
}

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
        match self.kind {
            FaultKind::Stall => "the host stalls",
            FaultKind::Panic => "the host panics",
            FaultKind::NotANumber => "the host publishes numbers that are not finite",
            FaultKind::Topology => "the host publishes models for other handles",
        }
    }

    fn lasts_at(&self, time_ns: u64) -> bool {
        let time = time_ns as f64 * 1e-9;
        (self.at..self.at + self.duration).contains(&time)
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

    /// The faults of what is published at `now_ns`.
    fn due(&self, now_ns: u64) -> impl Iterator<Item = FaultKind> + '_ {
        let due = self.pending.iter();
        let due = due.filter(move |fault| fault.lasts_at(now_ns));
        due.map(|fault| fault.kind)
    }

    /// A spoilt copy of the model that is published at `now_ns`, if a fault is due. A sound model is not copied,
    /// since it takes some 39 kB.
    fn spoilt(&self, now_ns: u64, model: &LocalModel) -> Option<LocalModel> {
        self.due(now_ns).next()?;
        let mut model = *model;
        for kind in self.due(now_ns) {
            match kind {
                FaultKind::NotANumber => {
                    model.stiffness[0][0][(0, 0)] = f64::NAN;
                    model.handles[0].wrench.force.x = f64::NAN;
                }
                FaultKind::Topology => {
                    // One handle less, and the devices in another order.
                    model.head.handle_count = model.head.handle_count.saturating_sub(1).max(1);
                    for handle in &mut model.handles {
                        handle.device ^= 1;
                    }
                }
                FaultKind::Stall | FaultKind::Panic => {}
            }
        }
        Some(model)
    }

    /// Spoils a patch that is published at `now_ns`. A patch without sites is spoilt, too.
    fn spoil(&self, now_ns: u64, patch: &mut Patch) {
        for kind in self.due(now_ns) {
            match kind {
                FaultKind::NotANumber => {
                    patch.head.stiffness = f64::NAN;
                    patch.sites[0].place.x = f64::NAN;
                }
                FaultKind::Topology => {
                    patch.head.triangle_count = patch.head.triangle_count.max(1);
                    patch.head.triangles[0].corners = [patch.head.site_count; 3];
                }
                FaultKind::Stall | FaultKind::Panic => {}
            }
        }
    }
}

/// An engine that fails at given times.
pub(crate) struct Failing {
    engine: Engine,
    faults: Faults,
    /// The patches that the last step published, if they are spoilt, each with the device of its tool.
    spoilt: Vec<(usize, Patch)>,
}

impl Failing {
    /// `engine`, with `faults`.
    pub(crate) fn new(engine: Engine, faults: Faults) -> Self {
        Self {
            engine,
            faults,
            spoilt: Vec::new(),
        }
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

    /// As [`Engine::step`], with spoilt models and patches if a fault is due.
    ///
    /// # Panics
    /// If a panic is due.
    pub(crate) fn step(
        &mut self,
        due: Due,
        watch: &dyn Stopwatch,
        publish: &mut (dyn FnMut(usize, &LocalModel) + Send),
    ) {
        let faults = &self.faults;
        faults.panic_if_due(due.time_ns);
        self.engine.step(due, watch, &mut |body, model| {
            let spoilt = faults.spoilt(due.time_ns, model);
            publish(body, spoilt.as_ref().unwrap_or(model));
        });
        self.spoilt.clear();
        if faults.due(due.time_ns).next().is_some() {
            let sound = self.engine.patches();
            self.spoilt.extend(sound.map(|(device, patch)| {
                let mut patch = patch.clone();
                faults.spoil(due.time_ns, &mut patch);
                (device, patch)
            }));
        }
    }

    /// The engine.
    pub(crate) fn engine(&self) -> &Engine {
        &self.engine
    }

    /// The engine, to be changed.
    pub(crate) fn engine_mut(&mut self) -> &mut Engine {
        &mut self.engine
    }

    /// As [`Engine::patches`], spoilt if a fault was due in the last step.
    pub(crate) fn patches(&self) -> impl Iterator<Item = (usize, &Patch)> {
        let sound = self.engine.patches().filter(|_| self.spoilt.is_empty());
        let spoilt = self.spoilt.iter();
        spoilt.map(|(device, patch)| (*device, patch)).chain(sound)
    }

    /// As [`Engine::stats`].
    pub(crate) fn stats(&self) -> &EngineStats {
        self.engine.stats()
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
    fn a_stall_begins_once_and_a_window_ends() {
        let fault = |kind, at, duration| HostFault { kind, at, duration };
        let mut faults = Faults::new(vec![
            fault(FaultKind::Stall, 1.0, 0.5),
            fault(FaultKind::NotANumber, 2.0, 1.0),
        ]);
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

    #[test]
    fn a_model_for_other_handles_differs_in_number_and_order() {
        let faults = Faults::new(vec![HostFault {
            kind: FaultKind::Topology,
            at: 1.0,
            duration: 1.0,
        }]);
        let mut model = LocalModel::empty();
        model.head.handle_count = 2;
        let spoilt = faults.spoilt(1_000_000_000, &model).expect("a fault");
        assert_eq!(spoilt.head.handle_count, 1);
        assert_ne!(spoilt.handles[0].device, model.handles[0].device);
        assert!(faults.spoilt(2_000_000_000, &model).is_none());
    }

    #[test]
    fn a_patch_without_sites_is_spoilt() {
        let spoilt = |kind| {
            let faults = Faults::new(vec![HostFault {
                kind,
                at: 1.0,
                duration: 1.0,
            }]);
            let mut patch = Patch::empty();
            faults.spoil(2_000_000_000, &mut patch);
            assert_eq!(patch, Patch::empty());
            faults.spoil(1_000_000_000, &mut patch);
            patch.head
        };
        assert!(spoilt(FaultKind::NotANumber).stiffness.is_nan());
        let head = spoilt(FaultKind::Topology);
        assert!(
            head.triangles()
                .any(|triangle| triangle.corners[0] >= head.site_count)
        );
    }

    #[test]
    fn a_panic_comes_at_its_time() {
        let faults = Faults::new(vec![HostFault {
            kind: FaultKind::Panic,
            at: 1.0,
            duration: 0.0,
        }]);
        let panics = |now_ns| std::panic::catch_unwind(|| faults.panic_if_due(now_ns)).is_err();
        assert_eq!([999_999_999, 1_000_000_000].map(panics), [false, true]);
    }
}
