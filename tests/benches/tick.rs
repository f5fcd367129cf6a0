//! One tick: `cargo bench --bench tick`.
//!
//! **Law** (divan): `Controller::tick` alone, per force scheme, for one body with 1, 2 or 4 handles, each
//! held by a device that moves and turns (one that does not turn costs less). Three kinds of tick:
//! between models, in the middle of a blend, and the tick that checks and takes in a new model, which is
//! the dearest.
//!
//! **Whole** (a table): every tick of the first seconds of the built-in scene, two simulated devices
//! behind their firmware reports on one sheet, with the models that its host published. The same ticks
//! run whole, from recorded readings in the place of the devices, as the law alone, and as the devices
//! alone; one after the other in one process, so that the parts can be compared.

mod common;

use common::{Spread, tables_wanted};
use divan::{Bencher, black_box};
use host::engine::pacer::Due;
use host::engine::stats::WallStopwatch;
use host::run::setup::Setup;
use palpate_tests::default_setup;
use palpate_tests::law::{HANDLES, Limits, SCHEMES, law, model, reading, scheme};
use rt_core::controller::Reading;
use rt_core::device::DeviceError;
use rt_core::{Capabilities, Controller, Device, LocalModel, MAX_DEVICES, Wrench};
use runner::link::{HostEnd, LogEnd};
use runner::tick_loop::TickLoop;
use std::time::Instant;

/// Ticks until every smooth start is over.
const SETTLE: usize = 300;
/// When the law's ticks happen (ns); the model is young then.
const NOW_NS: u64 = 2_000_000;

fn main() {
    if tables_wanted() {
        whole_tick();
    }
    divan::main();
}

/// 64 different sets of readings, to be cycled through.
fn readings() -> Vec<[Reading; MAX_DEVICES]> {
    (0..64).map(|k| reading(0.1 * f64::from(k))).collect()
}

/// Measures ticks that follow a model of this publication period (s).
fn ticks(bencher: Bencher, scheme_name: &str, handles: usize, publication: f64) {
    let mut law = law(scheme(scheme_name), handles, Limits::WIDE);
    assert_eq!(law.accept(0, &model(handles, publication)), Ok(()));
    let readings = readings();
    let mut readings = readings.iter().cycle();
    let mut tick = move || readings.next().map(|r| law.tick(NOW_NS, black_box(r)));
    for _ in 0..SETTLE {
        tick();
    }
    bencher.bench_local(tick);
}

#[divan::bench(consts = HANDLES, args = SCHEMES, sample_count = 1000)]
fn law_between_models<const N: usize>(bencher: Bencher, scheme: &str) {
    ticks(bencher, scheme, N, 0.004);
}

/// A model that is published once in years takes as long to take over.
#[divan::bench(consts = HANDLES, args = SCHEMES, sample_count = 1000)]
fn law_in_a_blend<const N: usize>(bencher: Bencher, scheme: &str) {
    ticks(bencher, scheme, N, 1e9);
}

#[divan::bench(consts = HANDLES, args = SCHEMES, sample_count = 1000)]
fn law_taking_a_model<const N: usize>(bencher: Bencher, name: &str) {
    let mut law = law(scheme(name), N, Limits::WIDE);
    let mut model = model(N, 0.004);
    let readings = readings();
    let mut readings = readings.iter().cycle();
    bencher.bench_local(|| {
        model.sequence += 1;
        model.time_ns += 1;
        let accepted = law.accept(0, black_box(&model));
        (
            accepted,
            readings
                .next()
                .map(|r| law.tick(model.time_ns, black_box(r))),
        )
    });
}

/// Ticks of the built-in scene that are measured: at rest, then pulling, then holding.
const TICKS: usize = 3000;
/// The scene's host steps and publishes at 250 Hz; a model arrives one period after its step began.
const HOST_EVERY: usize = 4;
/// How often each pass is repeated.
const PASSES: usize = 3;

/// A device that keeps what passes through it.
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

/// A device that gives recorded readings again and takes every wrench.
struct Player<'a> {
    capabilities: Capabilities,
    readings: std::slice::Iter<'a, Reading>,
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

/// What a run of the scene left: readings and wrenches by device, and the models by tick of arrival.
struct Recording {
    readings: Vec<Vec<Reading>>,
    wrenches: Vec<Vec<Wrench>>,
    models: Vec<Option<LocalModel>>,
    period_ns: u64,
}

fn record() -> Recording {
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

/// Times (s) of all ticks of `tick`, with the recorded models.
fn pass<D: Device>(
    tick: &mut TickLoop<D>,
    host: &mut HostEnd,
    log: &mut LogEnd,
    run: &Recording,
) -> Vec<f64> {
    let timed = |k: usize| {
        if let Some(model) = &run.models[k] {
            let _ = host.publish(0, model);
        }
        let start = Instant::now();
        black_box(tick.tick(k as u64 * run.period_ns, 0));
        let time = start.elapsed().as_secs_f64();
        host.drain(|record| {
            black_box(record);
        });
        log.drain(|telemetry| {
            black_box(telemetry);
        });
        time
    };
    (0..TICKS).map(timed).collect()
}

fn pass_whole(run: &Recording) -> Vec<f64> {
    let Setup {
        mut tick,
        mut host,
        mut log,
        ..
    } = default_setup(1.0);
    pass(&mut tick, &mut host, &mut log, run)
}

fn pass_recorded(run: &Recording) -> Vec<f64> {
    let Setup {
        tick,
        mut host,
        mut log,
        ..
    } = default_setup(1.0);
    let players = tick
        .devices
        .iter()
        .zip(&run.readings)
        .map(|(device, readings)| Player {
            capabilities: device.capabilities(),
            readings: readings.iter(),
        });
    let mut tick = TickLoop::new(tick.controller, players.collect(), tick.end);
    pass(&mut tick, &mut host, &mut log, run)
}

fn pass_law(run: &Recording) -> Vec<f64> {
    let mut law = default_setup(1.0).tick.controller;
    let timed = |k: usize| {
        let mut readings = [const { Err(DeviceError::NoReport) }; MAX_DEVICES];
        for (reading, recorded) in readings.iter_mut().zip(&run.readings) {
            *reading = recorded[k];
        }
        let start = Instant::now();
        if let Some(model) = &run.models[k] {
            let _ = law.accept(0, model);
        }
        black_box(law.tick(k as u64 * run.period_ns, &readings));
        start.elapsed().as_secs_f64()
    };
    (0..TICKS).map(timed).collect()
}

fn pass_devices(run: &Recording) -> Vec<f64> {
    let mut devices = default_setup(1.0).tick.devices;
    let timed = |k: usize| {
        let now = k as u64 * run.period_ns;
        let start = Instant::now();
        for device in &mut devices {
            let _ = black_box(device.read(now));
        }
        for (device, wrenches) in devices.iter_mut().zip(&run.wrenches) {
            let _ = black_box(device.write(now, &wrenches[k]));
        }
        start.elapsed().as_secs_f64()
    };
    (0..TICKS).map(timed).collect()
}

fn whole_tick() {
    let run = record();
    let passes: [(&str, fn(&Recording) -> Vec<f64>); 4] = [
        ("whole tick", pass_whole),
        ("from recorded readings", pass_recorded),
        ("law alone", pass_law),
        ("two simulated devices alone", pass_devices),
    ];
    let mut times = vec![Vec::new(); passes.len()];
    for _ in 0..PASSES {
        for ((_, pass), times) in passes.iter().zip(&mut times) {
            times.extend(pass(&run));
        }
    }
    let clock = (0..TICKS).map(|_| Instant::now().elapsed().as_secs_f64());
    let clock = Spread::of(clock.collect()).times(1e9);
    println!(
        "One tick of the built-in scene: two simulated devices behind firmware reports, one sheet,"
    );
    println!(
        "scheme linear, a new model every {HOST_EVERY} ticks. {TICKS} ticks, {PASSES} times. Wall time; the clock's"
    );
    println!(
        "own {:.0} ns are inside. Median (10th to 90th percentile).\n",
        clock.median
    );
    println!("| | us | share of the whole |");
    println!("|---|---|---|");
    let spreads: Vec<Spread> = times.into_iter().map(Spread::of).collect();
    for ((name, _), spread) in passes.iter().zip(&spreads) {
        let share = 100.0 * spread.median / spreads[0].median;
        println!("| {name} | {:.2} | {share:.0} % |", spread.times(1e6));
    }
    println!();
}
