//! What it costs a run to be watched: `cargo run --release -p palpate-tests --example view_cost [-- --quick]`.
//!
//! - **The tick**: runs of the built-in scene under the real clock, in pairs: one with four viewers, of which one is
//!   stopped, and one without. The order within a pair is random. The table has the 99th percentiles of lateness and of
//!   the computing time of a tick: the median over all pairs of the ratio "watched by unwatched", with the 95 % interval
//!   of a bootstrap over the pairs.
//! - **The host step**: blocks of steps of a sheet of 11,088 vertices, by turns with and without a viewer. The table has
//!   the ratio of the mean time of a step, computed in the same way over pairs of blocks.
//!
//! `--quick` makes short runs, which show that the program works.

use host::engine::Engine;
use host::engine::build::{BuildOptions, bodies};
use host::engine::pacer::Due;
use host::engine::stats::WallStopwatch;
use host::record::Distribution;
use host::run::summary::RunSummary;
use host::run::view::ViewOptions;
use host::run::{Clock, RunOptions, run};
use host::scene::Scene;
use host::scene::spec::MeshSource;
use host::snapshot::{Subscriber, Watchers};
use host::world::World;
use rt_core::TickRecord;
use rustix::process::{Pid, Signal, kill_process};
use std::error::Error;
use std::hint::black_box;
use std::io::Read;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// The argument with which this program is a viewer.
const VIEWER: &str = "--viewer";
/// Cells of the sheet of the host steps: 132 x 84 vertices.
const CELLS: [u32; 2] = [131, 83];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [argument, socket] = arguments.as_slice()
        && argument == VIEWER
    {
        return view(Path::new(socket));
    }
    let quick = arguments.iter().any(|argument| argument == "--quick");
    let mut random = Random(0x2545_F491_4F6C_DD1D);
    ticks(quick, &mut random)?;
    steps(quick, &mut random)
}

/// A viewer: takes everything until the run ends.
fn view(socket: &Path) -> Result<(), Box<dyn Error>> {
    let mut stream = loop {
        match UnixStream::connect(socket) {
            Ok(stream) => break stream,
            Err(_) => std::thread::sleep(Duration::from_millis(10)),
        }
    };
    let mut bytes = vec![0; 1 << 16];
    while stream.read(&mut bytes)? > 0 {}
    Ok(())
}

/// The runs under the real clock.
fn ticks(quick: bool, random: &mut Random) -> Result<(), Box<dyn Error>> {
    let (pairs, seconds) = if quick { (2, 1.0) } else { (12, 5.0) };
    let (mut lateness, mut duration) = (Vec::new(), Vec::new());
    for _ in 0..pairs {
        let watched_first = random.below(2) == 0;
        let mut summaries = Vec::new();
        for watched in [watched_first, !watched_first] {
            summaries.push((watched, slice(seconds, watched)?));
        }
        summaries.sort_by_key(|(watched, _)| *watched);
        let [(_, without), (_, with)] = &summaries[..] else {
            return Err("a pair has two runs".into());
        };
        let p99 = |of: &dyn Fn(&RunSummary) -> Option<Distribution>| {
            let each = [with, without].map(|summary| of(summary).map(|times| times.p99));
            each[0].zip(each[1]).ok_or("a run without times")
        };
        lateness.push(p99(&|summary| summary.tick.lateness)?);
        duration.push(p99(&|summary| summary.tick.duration)?);
    }
    println!(
        "{pairs} pairs of runs of {seconds} s under the real clock, with and without four viewers, one stopped:\n"
    );
    println!("| 99th percentile | watched (µs) | unwatched (µs) | ratio | 95 % interval |");
    println!("|---|---:|---:|---:|---:|");
    for (name, pairs) in [
        ("lateness", &lateness),
        ("computing time of a tick", &duration),
    ] {
        row(name, pairs, random);
    }
    Ok(())
}

/// One run, with four viewers or without.
fn slice(seconds: f64, watched: bool) -> Result<RunSummary, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let socket = folder.path().join("run.sock");
    let mut options = RunOptions::new(Clock::Real);
    options.duration = Some(seconds);
    let mut viewers = Vec::new();
    if watched {
        options.view = Some(ViewOptions {
            socket: Some(socket.clone()),
            pace: 0.0,
        });
        for _ in 0..4 {
            viewers.push(Viewer::start(&socket)?);
        }
    }
    let mut stopped = false;
    let summary = run(
        &World::new(&Scene::embedded_default()?).unwrap(),
        &options,
        &mut |progress| {
            // All viewers are connected by then.
            if progress.fraction() > 0.1 && !stopped {
                stopped = true;
                viewers.iter().take(1).for_each(Viewer::stop);
            }
        },
    );
    drop(viewers);
    Ok(summary?)
}

/// A viewer's process. It is killed at the end.
struct Viewer(Child);

impl Viewer {
    fn start(socket: &Path) -> std::io::Result<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg(VIEWER).arg(socket).stdin(Stdio::null());
        command.spawn().map(Self)
    }

    fn stop(&self) {
        if let Some(pid) = Pid::from_raw(self.0.id() as i32) {
            // A viewer that has ended has nothing to stop.
            let _ = kill_process(pid, Signal::STOP);
        }
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The host steps.
fn steps(quick: bool, random: &mut Random) -> Result<(), Box<dyn Error>> {
    let (pairs, length) = if quick { (5, 0.2) } else { (60, 0.5) };
    let mut loaded = Scene::embedded_default()?;
    for body in &mut loaded.scene.bodies {
        if let MeshSource::Sheet { cells, .. } = &mut body.mesh.source {
            *cells = CELLS;
        }
    }
    // As under the real clock, factors are made in the background.
    let how = BuildOptions {
        real: true,
        ..BuildOptions::default()
    };
    let mut engine = Engine::new(bodies(&World::new(&loaded).unwrap(), how)?);
    let count: usize = engine
        .bodies()
        .iter()
        .map(|body| body.body().vertex_count())
        .sum();
    let watchers = Watchers::default();
    let (mut subscriber, mut reader) = Subscriber::watched(&engine, watchers.clone());
    let watch = WallStopwatch::start();
    let mut record = TickRecord::empty();
    let mut block = |watched: bool| {
        watchers.set(usize::from(watched));
        let (mut time, mut steps) = (Duration::ZERO, 0_u32);
        while time.as_secs_f64() < length {
            record.tick += 4;
            record.time_ns += 4_000_000;
            engine.follow(&record);
            let due = Due {
                time_ns: record.time_ns,
                publishes: record.tick.is_multiple_of(8),
            };
            let start = Instant::now();
            engine.step(due, &watch, &mut |_, model| {
                black_box(model);
            });
            subscriber.after_step(Instant::now(), due.time_ns, 0, &engine);
            time += start.elapsed();
            steps += 1;
            if let Some(snapshot) = reader.newest() {
                reader.give_back(snapshot);
            }
        }
        time.as_secs_f64() / f64::from(steps)
    };
    // The first steps find no memory in the caches.
    block(true);
    let mut times = Vec::new();
    for _ in 0..pairs {
        let first = random.below(2) == 0;
        let pair = [first, !first].map(|watched| (watched, block(watched)));
        let of = |watched| pair.iter().find(|(which, _)| *which == watched);
        if let (Some((_, with)), Some((_, without))) = (of(true), of(false)) {
            times.push((*with, *without));
        }
    }
    println!("\n{pairs} pairs of {length} s of host steps of a sheet of {count} vertices:\n");
    println!("| mean time | watched (µs) | unwatched (µs) | ratio | 95 % interval |");
    println!("|---|---:|---:|---:|---:|");
    row("host step", &times, random);
    Ok(())
}

/// Prints the medians of pairs of times (s), and the median of their ratios.
fn row(name: &str, pairs: &[(f64, f64)], random: &mut Random) {
    let each = |of: fn(&(f64, f64)) -> f64| median(pairs.iter().map(of).collect());
    let ratios: Vec<f64> = pairs.iter().map(|(with, without)| with / without).collect();
    let mut medians: Vec<f64> = (0..2000)
        .map(|_| {
            median(
                (0..ratios.len())
                    .map(|_| ratios[random.below(ratios.len())])
                    .collect(),
            )
        })
        .collect();
    medians.sort_by(f64::total_cmp);
    println!(
        "| {name} | {:.2} | {:.2} | {:.3} | {:.3} to {:.3} |",
        1e6 * each(|pair| pair.0),
        1e6 * each(|pair| pair.1),
        median(ratios),
        medians[medians.len() / 40],
        medians[medians.len() - 1 - medians.len() / 40],
    );
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() % 2 {
        0 => f64::midpoint(values[middle - 1], values[middle]),
        _ => values[middle],
    }
}

/// Random numbers: xorshift64 (Marsaglia 2003).
struct Random(u64);

impl Random {
    /// A number below `bound`.
    fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 33) % bound as u64) as usize
    }
}
