//! The totals of one device over the ticks of a run. The summary and the frames for viewers use the same code, so that
//! their numbers are equal.

use nalgebra::UnitQuaternion;
use rt_core::Reading;
use rt_core::Vec3;
use rt_core::record::DeviceTelemetry;

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

/// Where a device is (m, device axes), if it gave a state in this tick that is believed.
pub(crate) fn place(device: &DeviceTelemetry, reading: &Reading) -> Option<Vec3> {
    let state = reading.as_ref().ok().filter(|_| device.fresh)?;
    Some(state.pose.position)
}

/// Sums up the telemetry of one device.
#[derive(Clone, Debug)]
pub(crate) struct DeviceSum {
    /// The rotation from the device's axes to those of the scene.
    rotation: UnitQuaternion<f64>,
    totals: DeviceTotals,
    /// The first position of the proxy without slips (m).
    start: Option<Vec3>,
    /// The last position of the device (m, device axes).
    place: Option<Vec3>,
    /// The force of the last tick (N).
    force: Vec3,
}

impl DeviceSum {
    /// A sum for a device, with the rotation from its axes to those of the scene.
    pub(crate) fn new(rotation: UnitQuaternion<f64>) -> Self {
        Self {
            rotation,
            totals: DeviceTotals::default(),
            start: None,
            place: None,
            force: Vec3::zeros(),
        }
    }

    /// Takes the telemetry of the tick at `time` (s), in which the device was at `place` (m, device axes).
    pub(crate) fn take(&mut self, time: f64, device: &DeviceTelemetry, place: Option<Vec3>) {
        let totals = &mut self.totals;
        // A slip moves the proxy, and not the hand.
        let (position, force) = (device.pose.position - device.slip, device.wrench.force);
        totals.slip = totals.slip.max(device.slip.norm());
        if force.norm() > totals.peak_force {
            totals.peak_force = force.norm();
            totals.peak_time = time;
        }
        let start = *self.start.get_or_insert(position);
        totals.reach = totals.reach.max((position - start).norm());
        if let Some(place) = place {
            // The force acts on the hand, whose displacement is that of the device. The proxy follows the device scaled,
            // and by a part only while the force comes in.
            if let Some(before) = self.place.replace(place) {
                totals.work += self.force.dot(&(self.rotation * (place - before)));
            }
        }
        self.force = force;
    }

    /// Continues after a tick with these totals, this `force` (N), the device at `place` (m, device axes), and the first
    /// position (m).
    pub(crate) fn resume(
        &mut self,
        totals: DeviceTotals,
        force: Vec3,
        place: Option<Vec3>,
        start: Vec3,
    ) {
        self.totals = totals;
        self.force = force;
        self.place = place;
        self.start = Some(start);
    }

    /// The first position (m); `None` before the first tick.
    pub(crate) fn start(&self) -> Option<Vec3> {
        self.start
    }

    /// The last position of the device (m, device axes); `None` before its first state.
    pub(crate) fn place(&self) -> Option<Vec3> {
        self.place
    }

    /// The totals of the ticks so far.
    pub(crate) fn totals(&self) -> &DeviceTotals {
        &self.totals
    }
}
