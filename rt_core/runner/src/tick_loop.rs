//! One tick with its rings and histograms, without a clock or a thread.
//!
//! Under the real clock, [`crate::thread`] calls `TickLoop::tick` once per deadline. Under virtual time, the host calls
//! `TickLoop::tick` with its own times. Both run the same code.
//!
//! [`TickLoop::tick`] is the hot path: no allocation, no lock, and no system call except those of the devices.

use crate::latency::{DeviceTimes, Latencies};
use crate::link::TickEnd;
use rt_core::record::Stamps;
use rt_core::{Controller, Device, Telemetry, TickTime, Wrench, cycle_timed};

/// A device of any kind, as the loop holds it.
pub type AnyDevice = Box<dyn Device + Send>;

/// A controller with its devices, its end of the link and its histograms.
///
/// ```
/// use rt_core::{Controller, ControllerConfig};
/// use runner::{LinkConfig, TickLoop, link};
///
/// // The smallest loop: no devices and no bodies. Ticks at 1 kHz, models at 60 Hz.
/// let (tick, mut host, _log) = link(&LinkConfig::new(1000.0, 60.0));
/// let controller = Controller::new(&ControllerConfig::default());
/// let mut tick_loop = TickLoop::new(controller, Vec::new(), tick);
/// for tick in 0..3_u64 {
///     tick_loop.tick(tick * 1_000_000);
/// }
/// assert_eq!(tick_loop.ticks, 3);
/// // The host receives the record of every tick.
/// assert_eq!(host.newest().expect("a record").time_ns, 2_000_000);
/// ```
pub struct TickLoop {
    /// The controller.
    pub controller: Box<Controller>,
    /// The devices, in the controller's order.
    pub devices: Vec<AnyDevice>,
    /// The tick's end of the link.
    pub end: TickEnd,
    /// Histograms of the lateness, of the duration of a tick and of the age of the models.
    pub latencies: Latencies,
    /// Number of ticks since the start.
    pub ticks: u64,
    /// Number of wrenches that a device did not accept.
    pub refused_wrenches: u64,
}

impl TickLoop {
    /// A loop before its first tick. Allocates the histograms.
    pub fn new(
        controller: impl Into<Box<Controller>>,
        devices: Vec<AnyDevice>,
        end: TickEnd,
    ) -> Self {
        let controller = controller.into();
        #[cfg(feature = "mutations")]
        crate::mutation::arm();
        let bodies = controller.coupling_counters().count();
        Self {
            controller,
            devices,
            end,
            latencies: Latencies::new(bodies),
            ticks: 0,
            refused_wrenches: 0,
        }
    }

    /// From now on, measures the duration of each device's reads and writes, and keeps the device's motion to force.
    /// Use this under the real clock. Allocates the histograms.
    pub fn measure_devices(&mut self) {
        self.latencies.devices = self.devices.iter().map(|_| DeviceTimes::new()).collect();
    }

    /// Runs one tick of virtual time, which is never late and takes no time. `now_ns` is the time since the start of the
    /// run.
    pub fn tick(&mut self, now_ns: u64) -> Telemetry {
        self.timed(now_ns.into(), || 0)
    }

    /// Runs one tick: takes the newest local models and patches, reads the devices, computes and writes the wrenches, and sends the
    /// record to host and log. `took` returns the time since the tick woke (ns), and stamps the record. In the record, `tick`
    /// is the number of earlier ticks.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn timed(&mut self, time: TickTime, took: impl Fn() -> u64) -> Telemetry {
        #[cfg(feature = "mutations")]
        crate::mutation::strike(self.ticks);
        let controller = &mut self.controller;
        self.end.take_models(|body, model| {
            // The controller counts what it refuses, by reason.
            let _ = controller.accept(body, model);
        });
        self.end.take_patches(|device, patch| {
            let _ = controller.accept_patch(device, patch);
        });
        let (telemetry, refused) = cycle_timed(controller, &mut self.devices, time, took);
        measure(&mut self.latencies, &telemetry);
        self.end.push(&telemetry);
        self.latencies.lateness.record(telemetry.lateness_ns);
        for (age, body) in self.latencies.model_age.iter_mut().zip(telemetry.bodies()) {
            // A sequence number of zero means that no model has arrived, so there is no age.
            if body.sequence > 0 {
                age.record(body.age_ns);
            }
        }
        self.refused_wrenches += u64::from(refused);
        self.ticks += 1;
        telemetry
    }

    /// Commands zero force on every device, twice, and ignores the devices' errors. Call this at the end of a run.
    pub fn release(&mut self, now_ns: u64) {
        for _ in 0..2 {
            for device in &mut self.devices {
                // A device that refuses the command holds its last wrench until its own watchdog releases the force.
                let _ = device.write(now_ns, &Wrench::zero());
            }
        }
    }
}

/// Records the times of each device in a tick, and of the computation between reads and writes.
fn measure(latencies: &mut Latencies, telemetry: &Telemetry) {
    let Stamps {
        began_ns,
        read_ns,
        written_ns,
        motion_to_force_ns,
    } = &telemetry.stamps;
    let (mut began, mut computed) = (*began_ns, telemetry.took_ns);
    let each = read_ns.iter().zip(written_ns).zip(motion_to_force_ns);
    for (times, ((&read, &written), &motion_to_force)) in latencies.devices.iter_mut().zip(each) {
        times.read.record(read.saturating_sub(began));
        times.write.record(written.saturating_sub(computed));
        if motion_to_force > 0 {
            times.motion_to_force.record(motion_to_force);
        }
        (began, computed) = (read, written);
    }
    // No clock runs under virtual time.
    if telemetry.took_ns > 0 {
        latencies
            .compute
            .record(telemetry.took_ns.saturating_sub(began));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_a_device_is_that_of_its_own_call() {
        let mut latencies = Latencies::new(0);
        latencies.devices = vec![DeviceTimes::new(), DeviceTimes::new()];
        let mut telemetry = Telemetry::empty();
        telemetry.stamps.began_ns = 4;
        telemetry.stamps.read_ns[..2].copy_from_slice(&[14, 34]);
        telemetry.took_ns = 534;
        telemetry.stamps.written_ns[..2].copy_from_slice(&[537, 544]);
        telemetry.stamps.motion_to_force_ns[1] = 900;
        measure(&mut latencies, &telemetry);
        measure(&mut latencies, &telemetry);
        let times = &latencies.devices;
        for (times, (read, write)) in times.iter().zip([(10, 3), (20, 7)]) {
            for (histogram, ns) in [(&times.read, read), (&times.write, write)] {
                let summary = histogram.summary();
                assert_eq!((summary.count, summary.min, summary.max), (2, ns, ns));
            }
        }
        let answers = times
            .iter()
            .map(|times| times.motion_to_force.summary().max);
        assert!(answers.eq([0, 900]), "a device without a new time has none");
        assert_eq!(latencies.compute.summary().max, 500);
    }
}
