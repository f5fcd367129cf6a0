//! The properties of every [`Device`], drivers and wrappers alike, as one suite.
//!
//! [`Suite::check`] runs devices from one maker through the same ticks. It panics with the property that a device
//! violates:
//!
//! 1. The capabilities are constant, finite and consistent.
//! 2. A state is valid: it is finite, its rotation has unit length, its rotation is the identity if none is sensed,
//!    and its position and velocity are zero along axes that are not sensed.
//! 3. The clock of the device never decreases.
//! 4. Any time is accepted: the same time twice, a time far ahead, an earlier time.
//! 5. Any wrench is accepted: a wrench beyond the largest, a wrench with a NaN. The states stay valid, and the motors
//!    hold no more than their largest wrench, and no force along an axis that is not actuated.
//! 6. No call inside a tick allocates, according to the caller's counter ([`Suite::watched`]).
//! 7. The device may be dropped at any time, after a wrench as well as before its first reading.
//!
//! An error is a valid result of a call. The suite requires a minimal number of states ([`Suite::states`]).

use rt_core::{Capabilities, Device, DeviceState, Vec3, Wrench};
use std::ops::DerefMut;

/// Number of ticks of the long part.
const TICKS: u64 = 500;
/// Period of the tick (ns).
const PERIOD_NS: u64 = 1_000_000;
/// Tolerance on the unit length of a rotation's quaternion: the tolerance of the loop itself.
const SKEW: f64 = 0.01;
/// Relative tolerance on the largest wrench: rounding, and half a unit of a report.
const ROUNDING: f64 = 1e-6;

/// The suite, with the expected behaviour of the devices.
pub struct Suite<'a> {
    name: &'a str,
    states: u64,
    rounding: f64,
    watch: &'a dyn Fn(&mut dyn FnMut()),
}

impl<'a> Suite<'a> {
    /// A suite for devices that messages call `name`, each of which has a state in every tick.
    pub fn new(name: &'a str) -> Self {
        Self {
            name,
            states: TICKS,
            rounding: ROUNDING,
            watch: &|call| call(),
        }
    }

    /// The same suite for devices that have at least `states` states in five hundred ticks.
    pub fn states(self, states: u64) -> Self {
        Self { states, ..self }
    }

    /// The same suite for devices whose largest wrench is rounded by this fraction of it.
    pub fn rounded(self, rounding: f64) -> Self {
        Self { rounding, ..self }
    }

    /// The same suite, with every call of a device run inside `watch`, which may count the effects of the call.
    pub fn watched(self, watch: &'a dyn Fn(&mut dyn FnMut())) -> Self {
        Self { watch, ..self }
    }

    /// Runs devices of `make`, each a new one, through the suite.
    ///
    /// # Panics
    /// If a device violates a property. The message has the property and the values found.
    pub fn check<D: Device + ?Sized, B: DerefMut<Target = D>>(&self, mut make: impl FnMut() -> B) {
        self.steady_ticks(&mut *make());
        self.odd_times(&mut *make());
        self.odd_wrenches(&mut *make());
        // A device may be dropped before its first reading.
        drop(make());
    }

    /// Checks the capabilities of a device and returns them.
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
        let turns = found.actuated.turns();
        assert!(
            found.max_moment.is_finite() && (found.max_moment > 0.0) == turns,
            "{name}: largest moment {} with {:?}",
            found.max_moment,
            found.actuated
        );
        found
    }

    /// Runs one read. Its state, if there is one, must be valid, and its time must not be earlier than `clock_ns`.
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
        let sensed = device.capabilities().sensed;
        for vector in [&state.pose.position, &state.twist.linear] {
            assert_eq!(
                sensed.part(vector),
                *vector,
                "{name}: moves along an axis that it does not sense"
            );
        }
        if !sensed.turns() {
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

    /// Runs one write. The motors must then hold at most the largest wrench.
    fn write<D: Device + ?Sized>(&self, device: &mut D, now_ns: u64, wrench: &Wrench) {
        (self.watch)(&mut || {
            // An error is allowed here.
            let _ = device.write(now_ns, wrench);
        });
        let Some(probe) = device.probe() else { return };
        let (held, most) = (probe.held, device.capabilities());
        let within = held.force.norm() <= most.max_force * (1.0 + self.rounding)
            && held.moment.norm() <= most.max_moment * (1.0 + self.rounding);
        assert!(
            held.is_finite() && within,
            "{}: its motors hold {held:?} after {wrench:?}",
            self.name
        );
        for (what, vector) in [
            ("force", &held.force),
            ("position", &probe.pose.position),
            ("velocity", &probe.twist.linear),
        ] {
            assert_eq!(
                most.actuated.part(vector),
                *vector,
                "{}: a {what} along an axis that it does not actuate",
                self.name
            );
        }
        assert!(
            probe.pose.is_finite() && probe.twist.is_finite(),
            "{}: it truly is at {probe:?}",
            self.name
        );
    }

    /// Five hundred ordinary ticks under a spring to the origin.
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

    /// Times that do not occur in a run, then ordinary times again.
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

    /// Wrenches that the last stage never passes, each held for a few ticks.
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
            Wrench {
                force: Vec3::new(0.1, -0.2, 0.3) * most.max_force,
                moment: Vec3::zeros(),
            },
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
