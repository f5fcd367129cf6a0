//! The readings and models of a run of the built-in scene, recorded so that parts of its ticks can be repeated alone.

use host::engine::pacer::Due;
use host::engine::stats::WallStopwatch;
use palpate_tests::default_setup;
use rt_core::controller::Reading;
use rt_core::device::DeviceError;
use rt_core::{Capabilities, Device, LocalModel, Wrench};
use runner::tick_loop::TickLoop;

/// Measured ticks of the built-in scene: at rest, then pulling, then holding.
pub(crate) const TICKS: usize = 3000;
/// The scene's host steps and publishes at 250 Hz; a model arrives one period after its step began.
pub(crate) const HOST_EVERY: usize = 4;

/// A device that records its readings and wrenches.
struct Recorder<D> {
    device: D,
    readings: Vec<Reading>,
    wrenches: Vec<Wrench>,
}

impl<D: Device> Device for Recorder<D> {
    fn capabilities(&self) -> Capabilities {
        self.device.capabilities()
    }
    fn read(&mut self, now_ns: u64) -> Reading {
        let reading = self.device.read(now_ns);
        self.readings.push(reading);
        reading
    }
    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        self.wrenches.push(*wrench);
        self.device.write(now_ns, wrench)
    }
}

/// A device that replays recorded readings and accepts every wrench.
pub(crate) struct Player<'a> {
    pub(crate) capabilities: Capabilities,
    pub(crate) readings: std::slice::Iter<'a, Reading>,
}

impl Device for Player<'_> {
    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }
    fn read(&mut self, _: u64) -> Reading {
        self.readings
            .next()
            .copied()
            .unwrap_or(Err(DeviceError::NoReport))
    }
    fn write(&mut self, _: u64, _: &Wrench) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// The recording of a run of the scene: readings and wrenches by device, and the models by tick of arrival.
pub(crate) struct Recording {
    pub(crate) readings: Vec<Vec<Reading>>,
    pub(crate) wrenches: Vec<Vec<Wrench>>,
    pub(crate) models: Vec<Option<LocalModel>>,
    pub(crate) period_ns: u64,
}

/// Runs the scene once.
pub(crate) fn record() -> Recording {
    let setup = default_setup(1.0);
    let (mut host, mut log, mut engine) = (setup.host, setup.log, setup.engine);
    let period_ns = setup.timing.period_ns;
    let devices = setup.tick.devices.into_iter().map(|device| Recorder {
        device,
        readings: Vec::with_capacity(TICKS),
        wrenches: Vec::with_capacity(TICKS),
    });
    let mut tick = TickLoop::new(setup.tick.controller, devices.collect(), setup.tick.end);
    let watch = WallStopwatch::start();
    let mut models = vec![None; TICKS + HOST_EVERY];
    for k in 0..TICKS {
        let now = k as u64 * period_ns;
        if let Some(model) = &models[k] {
            let _ = host.publish(0, model);
        }
        tick.tick(now, 0);
        log.drain(|_| {});
        host.drain(|record| engine.follow(record));
        if k % HOST_EVERY == 0 {
            let due = Due {
                time_ns: now,
                publishes: true,
            };
            engine.step(due, &watch, |_, model| {
                models[k + HOST_EVERY] = Some(*model);
            });
        }
    }
    let (readings, wrenches) = tick
        .devices
        .into_iter()
        .map(|device| (device.readings, device.wrenches))
        .unzip();
    Recording {
        readings,
        wrenches,
        models,
        period_ns,
    }
}
