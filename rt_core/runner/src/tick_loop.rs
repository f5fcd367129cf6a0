//! One tick with its rings and histograms, without a clock or a thread.
//!
//! Under the real clock, [`crate::thread`] calls `TickLoop::tick` once per deadline. Under virtual time, the host calls
//! `TickLoop::tick` with its own times. Both run the same code.
//!
//! [`TickLoop::tick`] is the hot path: no allocation, no lock, and no system call except those of the devices.

use crate::clock;
use crate::latency::{DeviceTimes, Latencies};
use crate::link::TickEnd;
use rt_core::{Controller, Device, Stage, Telemetry, TickTime, Wrench, cycle_watched};

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
    /// record to host and log. `took` is called just before the wrenches are written and returns the time since the tick
    /// woke (ns). In the record, `tick` is the number of earlier ticks.
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
        let times = &mut self.latencies.devices;
        let mut last = 0;
        let (telemetry, refused) = cycle_watched(controller, &mut self.devices, time, |stage| {
            if !times.is_empty() {
                measure(times, &mut last, stage, clock::now_ns());
            }
            match stage {
                Stage::Computed => took(),
                _ => 0,
            }
        });
        for (times, device) in times.iter_mut().zip(&self.devices) {
            if let Some(ns) = device.motion_to_force_ns() {
                times.motion_to_force.record(ns);
            }
        }
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

/// Records the duration of a stage of the tick. The stage ended at `now_ns`; `last_ns` is the end of the stage before.
fn measure(times: &mut [DeviceTimes], last_ns: &mut u64, stage: Stage, now_ns: u64) {
    let took = now_ns.saturating_sub(*last_ns);
    *last_ns = now_ns;
    match stage {
        Stage::Begun | Stage::Computed => {}
        Stage::Read(device) => {
            if let Some(times) = times.get_mut(device) {
                times.read.record(took);
            }
        }
        Stage::Written(device) => {
            if let Some(times) = times.get_mut(device) {
                times.write.record(took);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_a_device_is_that_of_its_own_stage() {
        let mut times = [DeviceTimes::new(), DeviceTimes::new()];
        let mut last = 0;
        // Two ticks of two devices, with a pause between: the end of each stage (ns).
        for start in [1_000, 90_000] {
            for (stage, after) in [
                (Stage::Begun, 0),
                (Stage::Read(0), 10),
                (Stage::Read(1), 10 + 20),
                (Stage::Computed, 10 + 20 + 500),
                (Stage::Written(0), 10 + 20 + 500 + 3),
                (Stage::Written(1), 10 + 20 + 500 + 3 + 7),
            ] {
                measure(&mut times, &mut last, stage, start + after);
            }
        }
        for (times, (read, write)) in times.iter().zip([(10, 3), (20, 7)]) {
            for (histogram, ns) in [(&times.read, read), (&times.write, write)] {
                let summary = histogram.summary();
                assert_eq!((summary.count, summary.min, summary.max), (2, ns, ns));
            }
        }
        // A device that is not measured is left out.
        measure(&mut times, &mut last, Stage::Read(2), 100_000);
        measure(&mut times, &mut last, Stage::Written(2), 100_000);
    }
}
