//! The comparison of `palpate latency --cyclictest`.

use super::super::{CommandError, build, progress_bar};
use super::LatencyArguments;
use super::cyclictest::Cyclictest;
use crate::signals::Ending;
use host::atomic_file::write_json;
use host::machine::Machine;
use host::run::observer::Observers;
use host::run::{RunOptions, run_watched};
use host::scene::LoadedScene;
use runner::{CoreChoice, Cores, Stop};
use serde::Serialize;
use std::sync::Arc;
use std::sync::mpsc::{TryRecvError, channel};
use study::latency::beside::{Ratio, Slices, ratios};

/// Version of the JSON.
const SCHEMA: &str = "palpate.cyclictest/1";
/// Length of a slice (s).
const SLICE: u64 = 10;
/// Seconds of a pair beyond its slices: start and end of cyclictest.
const BETWEEN: u64 = 2;
/// The percentiles that are compared.
const PERCENTS: [f64; 4] = [50.0, 90.0, 99.0, 99.9];

/// The wake-up of the loop beside that of cyclictest.
#[derive(Debug, Serialize)]
pub(crate) struct Comparison {
    /// Version of this layout.
    schema: &'static str,
    /// The program and the machine.
    machine: Machine,
    /// The core of both.
    core: usize,
    /// The priority of both under SCHED_FIFO.
    priority: u8,
    /// Wake-ups a second (Hz).
    rate: f64,
    /// A comparison for each load.
    loads: Vec<Compared>,
}

/// The comparison under one load.
#[derive(Debug, Serialize)]
struct Compared {
    /// The load: `idle`, or the kinds of work beside the run.
    load: String,
    /// Pairs of slices of ten seconds.
    pairs: usize,
    /// The percentiles of both and their ratio. Intervals resample whole pairs.
    ratios: Vec<Ratio>,
}

pub(super) fn run(
    arguments: &LatencyArguments,
    pairs: u32,
    options: &RunOptions,
    loaded: &LoadedScene,
    ending: &Ending,
) -> Result<(), CommandError> {
    let machine = Cores::of_this_machine();
    let one_core = || {
        CommandError::Cyclictest(
            "found one core, allowed: two cores or more, of which the loop takes one".into(),
        )
    };
    let allowed = runner::schedule::mask();
    let candidates = machine.candidates(options.runner.core, &allowed);
    let core = *candidates.first().ok_or_else(one_core)?;
    if machine.online.len() < 2 {
        return Err(one_core());
    }
    let priority = options.runner.priority.unwrap_or(1);
    let rate = loaded.scene.realtime.rate;
    let bar = progress_bar();
    let world = build(loaded, &bar)?;
    let mut loads = Vec::new();
    let mut about = None;
    arguments.under_each_load(ending, |part, fraction_of| {
        let stop = Arc::new(Stop::new());
        let mut options = options.clone();
        options.duration = Some((u64::from(pairs) * 2 * (SLICE + BETWEEN)) as f64);
        options.stop = Arc::clone(&stop);
        options.runner.core = CoreChoice::Id(core);
        // Without the privileges of cyclictest the comparison means nothing.
        options.runner.require_grants = true;
        let other = Cyclictest::new(core, &machine.online, priority, rate, SLICE)?;
        let (to, found) = channel();
        let slices = Slices::new(Box::new(other), pairs as usize, SLICE * 1_000_000_000, to);
        let mut result = None;
        let observers = Observers::new().with(slices);
        let summary = run_watched(&world, &options, observers, &mut |progress| {
            if let Some(preparation) = progress.preparation {
                bar.preparing(preparation);
                return;
            }
            bar.draw_here((1000.0 * fraction_of(progress.fraction())) as u64);
            match found.try_recv() {
                Ok(sent) => result = Some(sent),
                Err(TryRecvError::Empty) if !ending.stop().is_requested() => return,
                Err(_) => {}
            }
            stop.request();
        })?;
        let (pairs, failure) = result.or_else(|| found.try_recv().ok()).unwrap_or_default();
        if let Some(failure) = failure.or_else(|| part.processes.ended()) {
            return Err(CommandError::Cyclictest(failure));
        }
        about.get_or_insert(summary.machine);
        loads.push(Compared {
            load: part.name(),
            pairs: pairs.len(),
            ratios: ratios(&pairs, &PERCENTS),
        });
        Ok(())
    })?;
    bar.finish_and_clear();
    if let Some(machine) = about {
        let comparison = Comparison {
            schema: SCHEMA,
            machine,
            core,
            priority,
            rate,
            loads,
        };
        comparison.print();
        if let Some(path) = &arguments.json {
            write_json(path, &comparison)?;
            outln!("  {:<10} {}", "json", path.display());
        }
    }
    ending.result()
}

impl Comparison {
    fn print(&self) {
        outln!(
            "wake-up of the loop beside cyclictest: core {}, SCHED_FIFO {}, {} Hz",
            self.core,
            self.priority,
            self.rate
        );
        for load in &self.loads {
            outln!(
                "\n{}: {} pairs of slices of {SLICE} s",
                load.load,
                load.pairs
            );
            outln!(
                "  {:<9}{:>12}{:>18}{:>9}   95 % interval",
                "",
                "loop (µs)",
                "cyclictest (µs)",
                "ratio"
            );
            for found in &load.ratios {
                outln!(
                    "  {:<9}{:>12.1}{:>18.1}{:>9.3}   {:.3} to {:.3}",
                    format!("{} %", found.percent),
                    1e6 * found.loop_value,
                    1e6 * found.other_value,
                    found.ratio,
                    found.low,
                    found.high
                );
            }
        }
    }
}
