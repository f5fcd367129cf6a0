//! A whole tick of the built-in scene and its parts, each run over the same recorded ticks.

use crate::common::Spread;
use crate::recording::{HOST_EVERY, Recording, TICKS, record};
use devices::ReplayDevice;
use divan::black_box;
use host::run::prepare::Prepared;
use palpate_tests::default_session;
use rt_core::MAX_DEVICES;
use rt_core::device::DeviceError;
use runner::AnyDevice;
use runner::link::{HostEnd, LogEnd};
use runner::tick_loop::TickLoop;
use std::time::Instant;

/// Times (s) of all ticks, or of one part of each.
type Pass = fn(&Recording) -> Vec<f64>;

/// Repetitions of each pass.
const PASSES: usize = 3;

/// Times (s) of all ticks of `tick`, with the recorded models.
fn pass(tick: &mut TickLoop, host: &mut HostEnd, log: &mut LogEnd, run: &Recording) -> Vec<f64> {
    let timed = |k: usize| {
        if let Some(model) = &run.models[k] {
            let _ = host.publish(0, model);
        }
        let start = Instant::now();
        black_box(tick.tick(k as u64 * run.period_ns));
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
    let Prepared {
        mut tick,
        mut host,
        mut log,
        ..
    } = default_session(1.0);
    pass(&mut tick, &mut host, &mut log, run)
}

fn pass_recorded(run: &Recording) -> Vec<f64> {
    let Prepared {
        tick,
        mut host,
        mut log,
        ..
    } = default_session(1.0);
    let players = tick
        .devices
        .iter()
        .zip(&run.readings)
        .map(|(device, readings)| {
            let player = ReplayDevice::new(device.capabilities(), readings.clone());
            let player: AnyDevice = Box::new(player);
            player
        });
    let mut tick = TickLoop::new(tick.controller, players.collect(), tick.end);
    pass(&mut tick, &mut host, &mut log, run)
}

fn pass_law(run: &Recording) -> Vec<f64> {
    let mut law = default_session(1.0).tick.controller;
    let timed = |k: usize| {
        let mut readings = [const { Err(DeviceError::NoReport) }; MAX_DEVICES];
        for (reading, recorded) in readings.iter_mut().zip(&run.readings) {
            *reading = recorded[k];
        }
        // A copy, because a ring's slot is one: the recording itself is no longer in any cache.
        let model = black_box(run.models[k]);
        let start = Instant::now();
        if let Some(model) = &model {
            let _ = law.accept(0, model);
        }
        black_box(law.tick(k as u64 * run.period_ns, &readings));
        start.elapsed().as_secs_f64()
    };
    (0..TICKS).map(timed).collect()
}

fn pass_devices(run: &Recording) -> Vec<f64> {
    let mut devices = default_session(1.0).tick.devices;
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

/// Measures and prints the table.
pub(crate) fn print() {
    let run = record();
    let passes: [(&str, Pass); 4] = [
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
        "One tick of the built-in scene: two simulated devices behind firmware reports, one sheet, scheme
capped, a new model every {HOST_EVERY} ticks, whose acceptance determines the upper percentiles.
{TICKS} ticks, {PASSES} times. Wall time, with the clock's own {:.0} ns; median (10th to 90th percentile).
",
        clock.median
    );
    println!("| | us | fraction of the whole |");
    println!("|---|---|---|");
    let spreads: Vec<Spread> = times.into_iter().map(Spread::of).collect();
    for ((name, _), spread) in passes.iter().zip(&spreads) {
        let percent = 100.0 * spread.median / spreads[0].median;
        println!("| {name} | {:.2} | {percent:.0} % |", spread.times(1e6));
    }
    println!();
}
