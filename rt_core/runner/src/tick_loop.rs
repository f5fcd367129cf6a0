//! One tick with its rings and histograms, without clock or thread.
//!
//! Under the real clock [`crate::thread`] calls it once a deadline; under virtual time the host calls it
//! with times it makes up. Both run exactly this.
//!
//! [`TickLoop::tick`] is the hot path: no allocation, no lock, no system call but those of the devices.

use crate::latency::Latencies;
use crate::link::TickEnd;
use rt_core::{Controller, Device, Telemetry, Wrench, cycle};

/// A device of any kind, as the loop holds it.
pub type AnyDevice = Box<dyn Device + Send>;

/// A controller, its devices, its end of the link and its histograms.
pub struct TickLoop {
    /// The law.
    pub controller: Controller,
    /// The devices, in the controller's order.
    pub devices: Vec<AnyDevice>,
    /// The tick's end of the link.
    pub end: TickEnd,
    /// How late, how long, how old.
    pub latencies: Latencies,
    /// Ticks done.
    pub ticks: u64,
    /// Wrenches that a device did not take.
    pub refused_wrenches: u64,
}

impl TickLoop {
    /// Before the first tick. Allocates the histograms.
    pub fn new(controller: Controller, devices: Vec<AnyDevice>, end: TickEnd) -> Self {
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

    /// One tick: takes the newest local models, reads, computes and writes, hands on the record.
    ///
    /// `now_ns` is the tick's nominal time since the start of the run; it advances by the deadlines that
    /// were skipped as well. `lateness_ns` is how late the tick woke (zero under virtual time). In the
    /// record, `tick` counts the ticks done and `time_ns` is `now_ns`.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn tick(&mut self, now_ns: u64, lateness_ns: u64) -> Telemetry {
        #[cfg(feature = "mutations")]
        crate::mutation::strike(self.ticks);
        let controller = &mut self.controller;
        self.end.take_models(|body, model| {
            // The controller counts what it refuses, by reason.
            let _ = controller.accept(body, model);
        });
        let (mut telemetry, refused) = cycle(controller, &mut self.devices, now_ns);
        telemetry.lateness_ns = lateness_ns;
        self.end.push(&telemetry);
        self.latencies.lateness.record(lateness_ns);
        for (age, body) in self.latencies.model_age.iter_mut().zip(telemetry.bodies()) {
            // Zero: no model yet, so no age.
            if body.sequence > 0 {
                age.record(body.age_ns);
            }
        }
        self.refused_wrenches += u64::from(refused);
        self.ticks += 1;
        telemetry
    }

    /// Commands no force on every device, twice, whatever they answer. For the end of a run.
    pub fn release(&mut self, now_ns: u64) {
        for _ in 0..2 {
            for device in &mut self.devices {
                // A device that does not take it holds its last wrench until its own watchdog drops it.
                let _ = device.write(now_ns, &Wrench::zero());
            }
        }
    }
}
