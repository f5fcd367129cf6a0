//! The readings and models of a run of the built-in scene, recorded so that parts of its ticks can be repeated alone.

use devices::Scripted;
use host::engine::pacer::Due;
use host::engine::stats::WallStopwatch;
use palpate_tests::default_session;
use rt_core::Reading;
use rt_core::{LocalModel, Wrench};
use runner::{AnyDevice, TickLoop};
use std::mem::take;
use std::sync::{Arc, Mutex, MutexGuard};

/// Measured ticks of the built-in scene: at rest, then pulling, then holding.
pub(crate) const TICKS: usize = 3000;
/// The scene's host steps and publishes at 250 Hz; a model arrives one period after its step began.
pub(crate) const HOST_EVERY: usize = 4;

/// A device with its recorded readings and wrenches.
struct Tape {
    device: AnyDevice,
    readings: Vec<Reading>,
    wrenches: Vec<Wrench>,
}

/// A device that records its readings and wrenches on the returned tape.
fn recorder(device: AnyDevice) -> (AnyDevice, Arc<Mutex<Tape>>) {
    let capabilities = device.capabilities();
    let tape = Arc::new(Mutex::new(Tape {
        device,
        readings: Vec::with_capacity(TICKS),
        wrenches: Vec::with_capacity(TICKS),
    }));
    let (by_read, by_write) = (Arc::clone(&tape), Arc::clone(&tape));
    let read = move |now_ns| {
        let mut tape = lock(&by_read);
        let reading = tape.device.read(now_ns);
        tape.readings.push(reading);
        reading
    };
    let write = move |now_ns, wrench: &Wrench| {
        let mut tape = lock(&by_write);
        tape.wrenches.push(*wrench);
        tape.device.write(now_ns, wrench)
    };
    (Box::new(Scripted::new(capabilities, read, write)), tape)
}

fn lock(tape: &Mutex<Tape>) -> MutexGuard<'_, Tape> {
    tape.lock().expect("no device panics")
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
    let setup = default_session(1.0);
    let (mut host, mut log, mut engine) = (setup.host, setup.log, setup.engine);
    let period_ns = setup.timing.period_ns;
    let recorders = setup.tick.devices.into_iter().map(recorder);
    let (devices, tapes): (_, Vec<_>) = recorders.unzip();
    let mut tick = TickLoop::new(setup.tick.controller, devices, setup.tick.end);
    let watch = WallStopwatch::start();
    let mut models = vec![None; TICKS + HOST_EVERY];
    for k in 0..TICKS {
        let now = k as u64 * period_ns;
        if let Some(model) = &models[k] {
            let _ = host.publish(0, model);
        }
        tick.tick(now);
        log.drain(|_| {});
        host.drain(|record| engine.follow(record));
        if k % HOST_EVERY == 0 {
            let due = Due {
                time_ns: now,
                publishes: true,
            };
            engine.step(due, &watch, &mut |_, model| {
                models[k + HOST_EVERY] = Some(*model);
            });
        }
    }
    let kept = tapes.iter().map(|tape| {
        let mut tape = lock(tape);
        (take(&mut tape.readings), take(&mut tape.wrenches))
    });
    let (readings, wrenches) = kept.unzip();
    Recording {
        readings,
        wrenches,
        models,
        period_ns,
    }
}
