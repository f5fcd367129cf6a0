//! The totals of one device over the ticks of a run. The summary and the frames for viewers use the same code, so that
//! their numbers are equal.

use rt_core::Vec3;
use rt_core::coupling::HostState;
use rt_core::record::DeviceTelemetry;
use rt_core::safety::SafetyState;

/// Totals of one device over a run. Forces act on the hand, in the axes of the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct DeviceTotals {
    /// Largest force (N).
    pub peak_force: f64,
    /// Time of the largest force (s).
    pub peak_time: f64,
    /// Work that the device did on the hand (J): the sum of each tick's force times the displacement of the device until
    /// the next tick.
    pub work: f64,
    /// Largest distance from the first position (m).
    pub reach: f64,
    /// Largest slip of the proxy against its hand (m).
    pub slip: f64,
}

/// Sums up the telemetry of one device.
#[derive(Clone, Debug)]
pub(crate) struct DeviceSum {
    /// Metres of the scene per metre of the device.
    scale: f64,
    totals: DeviceTotals,
    /// Position without slips and force at the last tick, and the first position.
    last: Option<(Vec3, Vec3, Vec3)>,
}

impl DeviceSum {
    /// A sum for a device whose proxy moves by `scale` metres for each metre of the device.
    pub(crate) fn new(scale: f64) -> Self {
        Self {
            scale,
            totals: DeviceTotals::default(),
            last: None,
        }
    }

    /// Takes the telemetry of the tick at `time` (s).
    pub(crate) fn take(&mut self, time: f64, device: &DeviceTelemetry) {
        let totals = &mut self.totals;
        // A slip moves the proxy, and not the hand.
        let (position, force) = (device.pose.position - device.slip, device.wrench.force);
        totals.slip = totals.slip.max(device.slip.norm());
        if force.norm() > totals.peak_force {
            totals.peak_force = force.norm();
            totals.peak_time = time;
        }
        let start = self.last.map_or(position, |(_, _, start)| start);
        if let Some((before, held, _)) = self.last {
            // The force acts on the hand, and the proxy moves by `scale` times the displacement of the hand.
            totals.work += held.dot(&(position - before)) / self.scale;
        }
        totals.reach = totals.reach.max((position - start).norm());
        self.last = Some((position, force, start));
    }

    /// Continues after a tick with these totals, the position and the force of that tick, and the first position.
    pub(crate) fn resume(
        &mut self,
        totals: DeviceTotals,
        (position, force): (Vec3, Vec3),
        start: Vec3,
    ) {
        self.totals = totals;
        self.last = Some((position, force, start));
    }

    /// The first position (m); `None` before the first tick.
    pub(crate) fn start(&self) -> Option<Vec3> {
        self.last.map(|(_, _, start)| start)
    }

    /// The totals of the ticks so far.
    pub(crate) fn totals(&self) -> &DeviceTotals {
        &self.totals
    }
}

/// The limit of the last stage that acts in a state, in words; `None` where none acts.
pub(crate) fn acting_limit(safety: SafetyState) -> Option<&'static str> {
    match safety {
        SafetyState::Normal | SafetyState::Recovering => None,
        SafetyState::Limited => Some("force limited"),
        SafetyState::Slewed => Some("force at its slew limit"),
        SafetyState::TooFast => Some("too fast, force fading"),
        SafetyState::OutOfReach => Some("out of reach, force fading"),
        SafetyState::Hot => Some("motors hot, force limited"),
        SafetyState::Engaging => Some("engaging, force coming in"),
        SafetyState::HandsOff => Some("dead-man button not held, no force"),
        SafetyState::Disarmed => Some("disarmed, no force"),
        SafetyState::Stopped => Some("emergency stop, no force"),
        SafetyState::DeviceStale => Some("device silent"),
        SafetyState::LetGo => Some("the device renders no force"),
        SafetyState::DeviceFault => Some("fault of the device, no force"),
        SafetyState::NotANumber => Some("force not a number"),
    }
}

/// The effect of a model that is too old, in words; `None` where the model is young enough.
pub(crate) fn old_model(state: HostState) -> Option<&'static str> {
    match state {
        HostState::Waiting | HostState::Live => None,
        HostState::Fading => Some("model too old, force fading"),
        HostState::Held => Some("model too old, safe hold"),
    }
}
