//! What every [`Device`] keeps to, drivers and wrappers alike, as one suite.
//!
//! [`Suite::check`] puts devices from one maker through the same ticks and panics with what was broken:
//!
//! 1. what it can do is constant, finite and without contradiction;
//! 2. a state is sound: finite, its rotation one, the identity where none is sensed;
//! 3. its clock never goes back;
//! 4. any time may come: the same twice, one far ahead, one that lies behind;
//! 5. any wrench may come: one beyond the largest, one that is not a number. The states stay sound, and the motors hold
//!    no more than they can;
//! 6. no tick's call allocates, as far as the caller's counter tells ([`Suite::watched`]);
//! 7. it may leave at any time, after a wrench as well as before its first reading.
//!
//! An error is an answer like any other: a suite says how many states it expects at least ([`Suite::states`]).

use rt_core::{Capabilities, Device, DeviceState, Freedom, Vec3, Wrench};
use std::ops::DerefMut;

/// Ticks of the long part.
const TICKS: u64 = 500;
/// The tick's period (ns).
const PERIOD_NS: u64 = 1_000_000;
/// By how much the length of a rotation's quaternion may differ from one: what the loop believes.
const SKEW: f64 = 0.01;
/// By how much a wrench that is held may be beyond the largest, relative: rounding, and a report's half unit.
const ROUNDING: f64 = 1e-6;

/// The suite, with what is known of the devices that it is about.
pub struct Suite<'a> {
    name: &'a str,
    states: u64,
    watch: &'a dyn Fn(&mut dyn FnMut()),
}

impl<'a> Suite<'a> {
    /// For devices that messages call `name`, each of which has a state in every tick.
    pub fn new(name: &'a str) -> Self {
        Self {
            name,
            states: TICKS,
            watch: &|call| call(),
        }
    }

    /// The same for devices that have at least so many states in five hundred ticks.
    pub fn states(self, states: u64) -> Self {
        Self { states, ..self }
    }

    /// The same with every call of a device run by `watch`, which may count what the call does.
    pub fn watched(self, watch: &'a dyn Fn(&mut dyn FnMut())) -> Self {
        Self { watch, ..self }
    }

    /// Puts devices of `make`, each in a box of its own, through the suite.
    ///
    /// # Panics
    /// Where a device breaks one of the promises, with the promise and what was found.
    pub fn check<D: Device + ?Sized, B: DerefMut<Target = D>>(&self, mut make: impl FnMut() -> B) {
        self.steady_ticks(&mut *make());
        self.odd_times(&mut *make());
        self.odd_wrenches(&mut *make());
        // A device may leave before its first reading.
        drop(make());
    }

    /// What it says of itself, once and again.
    fn capabilities<D: Device + ?Sized>(&self, device: &D) -> Capabilities {
        let found = device.capabilities();
        let name = self.name;
        for (what, number) in [
            ("largest force", found.max_force),
            ("workspace", found.workspace_radius),
            ("encoder count", found.position_step),
        ] {
            assert!(
                number.is_finite() && number > 0.0,
                "{name}: {what} {number}"
            );
        }
        let turns = found.actuated == Freedom::Six;
        assert!(
            found.max_moment.is_finite() && (found.max_moment > 0.0) == turns,
            "{name}: largest moment {} with {:?}",
            found.max_moment,
            found.actuated
        );
        found
    }

    /// One read. Its state, if it has one, is sound and of no earlier time than `clock_ns`.
    fn read<D: Device + ?Sized>(
        &self,
        device: &mut D,
        now_ns: u64,
        clock_ns: &mut u64,
    ) -> Option<DeviceState> {
        let mut reading = None;
        (self.watch)(&mut || reading = Some(device.read(now_ns)));
        let state = reading?.ok()?;
        let name = self.name;
        assert!(state.is_finite(), "{name}: not finite: {state:?}");
        let length = state.pose.rotation.coords.norm();
        assert!(
            (length - 1.0).abs() <= SKEW,
            "{name}: no rotation: {length}"
        );
        if device.capabilities().sensed == Freedom::Three {
            let turns = state.pose.rotation.scaled_axis() + state.twist.angular;
            assert_eq!(turns, Vec3::zeros(), "{name}: turns without sensing it");
        }
        assert!(
            state.device_time_ns >= *clock_ns,
            "{name}: its clock went back from {clock_ns} ns to {} ns",
            state.device_time_ns
        );
        *clock_ns = state.device_time_ns;
        Some(state)
    }

    /// One write; then the motors hold what they can at most.
    fn write<D: Device + ?Sized>(&self, device: &mut D, now_ns: u64, wrench: &Wrench) {
        (self.watch)(&mut || {
            // A device that refuses says so, and that is all there is to it.
            let _ = device.write(now_ns, wrench);
        });
        let Some(probe) = device.probe() else { return };
        let (held, most) = (probe.held, device.capabilities());
        let within = held.force.norm() <= most.max_force * (1.0 + ROUNDING)
            && held.moment.norm() <= most.max_moment * (1.0 + ROUNDING);
        assert!(
            held.is_finite() && within,
            "{}: its motors hold {held:?} after {wrench:?}",
            self.name
        );
        assert!(
            probe.pose.is_finite() && probe.twist.is_finite(),
            "{}: it truly is at {probe:?}",
            self.name
        );
    }

    /// Five hundred ticks as any run has them, under a spring to the origin.
    fn steady_ticks<D: Device + ?Sized>(&self, device: &mut D) {
        let capabilities = self.capabilities(device);
        let (mut clock, mut states) = (0, 0);
        let mut wrench = Wrench::zero();
        for now in (0..TICKS).map(|k| k * PERIOD_NS) {
            if let Some(state) = self.read(device, now, &mut clock) {
                states += 1;
                wrench.force = state.pose.position * -100.0;
                wrench.moment = state.pose.rotation.scaled_axis() * -0.1;
            }
            self.write(device, now, &wrench);
        }
        assert!(
            states >= self.states,
            "{}: {states} states in {TICKS} ticks, expected {} at least",
            self.name,
            self.states
        );
        assert_eq!(capabilities, self.capabilities(device), "{}", self.name);
    }

    /// Times that no run has, and a run goes on after them.
    fn odd_times<D: Device + ?Sized>(&self, device: &mut D) {
        let mut clock = 0;
        let second = 1_000_000_000;
        for now in [
            0,
            0,
            PERIOD_NS,
            PERIOD_NS,
            1,
            second,
            second - PERIOD_NS,
            100 * second,
            u64::MAX - 1,
            u64::MAX,
            0,
            PERIOD_NS,
        ] {
            self.read(device, now, &mut clock);
            self.write(device, now, &Wrench::zero());
        }
    }

    /// Wrenches that the last stage never lets through, each held for a few ticks.
    fn odd_wrenches<D: Device + ?Sized>(&self, device: &mut D) {
        let most = self.capabilities(device);
        let along = |force: f64, moment: f64| Wrench {
            force: Vec3::new(force, 0.0, 0.0),
            moment: Vec3::new(0.0, moment, 0.0),
        };
        let mut clock = 0;
        let mut now = 0;
        for wrench in [
            along(most.max_force, most.max_moment),
            along(-2.0 * most.max_force, 2.0),
            along(f64::MAX, f64::MAX),
            along(f64::NAN, 0.0),
            along(0.0, f64::NAN),
            along(f64::INFINITY, f64::NEG_INFINITY),
            along(f64::MIN_POSITIVE, 0.0),
        ] {
            for _ in 0..5 {
                self.write(device, now, &wrench);
                now += PERIOD_NS;
                self.read(device, now, &mut clock);
            }
        }
        self.write(device, now, &Wrench::zero());
    }
}
