//! Writes the log of an hour and measures how long a player takes to open the log, and to jump to 200 moments.
//!
//! `cargo run --release -p palpate-view --example hour_log -- FOLDER [SECONDS]` writes FOLDER/hour.mcap: a thousand ticks
//! a second of two devices and a sheet of 441 vertices, sixty models and 25 frames a second. The file has about a
//! gigabyte for each twenty minutes. A file that is there already is used again.

use fuzz_rules::changed::Mutator;
use host::live::gather::Gatherer;
use host::log::overview::OverviewBuilder;
use host::log::{LogHeader, LogWriter};
use host::record::{BodyFrame, Cloud, Group, Surface};
use host::run::Clock;
use host::scene::Scene;
use host::world::World;
use rt_core::coupling::HostState;
use rt_core::{Telemetry, Vec3};
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::time::Instant;
use view::feed::{Command, Feed};
use view::playback::Player;

/// Ticks a second.
const RATE: u64 = 1000;
/// Ticks from one frame to the next.
const FRAME: u64 = 40;
/// Jumps.
const JUMPS: usize = 200;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("expected: FOLDER [SECONDS]")?;
    let seconds: u64 = arguments.next().map_or(Ok(3600), |text| text.parse())?;
    let path = Path::new(&folder).join("hour.mcap");
    if !path.exists() {
        write(&path, seconds)?;
    }
    let size = std::fs::metadata(&path)?.len() as f64 * 1e-9;
    let begun = Instant::now();
    let mut player = Player::open(&path, |_| ())?;
    while player.take()?.is_some() {}
    let opened = begun.elapsed().as_secs_f64() * 1e3;

    let mut random = Mutator::new(7);
    let mut times = Vec::new();
    let span = seconds * 1_000_000_000;
    for _ in 0..JUMPS {
        let time_ns = random.below(1 << 30) as u64 * (span >> 30);
        let begun = Instant::now();
        player.command(&Command::Seek { time_ns });
        let mut messages = 0;
        while player.take()?.is_some() {
            messages += 1;
        }
        assert!(messages >= 3, "curves, frame and playback");
        times.push(begun.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    println!("A log of {seconds} s:\n");
    println!("| size | opening | a jump, median of {JUMPS} | the longest jump |");
    println!("|---:|---:|---:|---:|");
    println!(
        "| {size:.2} GB | {opened:.0} ms | {:.0} ms | {:.0} ms |",
        times[JUMPS / 2],
        times[JUMPS - 1]
    );
    Ok(())
}

fn write(path: &Path, seconds: u64) -> Result<(), Box<dyn std::error::Error>> {
    let text = include_str!("../../scenes/stretch.toml");
    let loaded = Scene::embedded_default()?;
    let header = LogHeader {
        facts: [("clock", "real"), ("scheme", "capped"), ("seed", "1")]
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .into(),
        scene: text.to_owned(),
        files: loaded.files.clone(),
        ..LogHeader::default()
    };
    let world = World::new(&loaded)?;
    let mut surface = Surface::of_mesh(0, world.bodies[0].body.epoch(), &world.bodies[0].mesh);
    let mut overview = OverviewBuilder::new(Gatherer::new(&loaded, Clock::Real));
    let file = BufWriter::with_capacity(1 << 20, File::create(path)?);
    let mut log = LogWriter::create(file, &header)?;
    log.add(Group::Frames, 0, &loaded.scene.bodies[0].name)?;
    log.write_record(surface.stamp(0), &mut surface)?;
    let mut telemetry = Telemetry::empty();
    (telemetry.device_count, telemetry.body_count) = (2, 1);
    telemetry.bodies[0].state = HostState::Live;
    let mut cloud = Cloud {
        time_ns: 0,
        positions: surface.rest.clone(),
    };
    for tick in 0..seconds * RATE {
        let time = tick as f64 / RATE as f64;
        let time_ns = tick * (1_000_000_000 / RATE);
        if tick.is_multiple_of(FRAME) {
            let wave = (0.01 * (3.0 * time).sin()) as f32;
            cloud.time_ns = time_ns;
            for (at, rest) in cloud.positions.chunks_mut(3).zip(surface.rest.chunks(3)) {
                at[2] = rest[2] + wave * (40.0 * rest[0]).cos();
            }
            let mut frame = BodyFrame {
                body: 0,
                step: tick / 4,
                time_ns,
                epoch: surface.epoch,
            };
            let stamp = frame.stamp();
            log.write_record(stamp, &mut frame)?;
            log.write_record(stamp, &mut cloud)?;
        }
        (telemetry.tick, telemetry.time_ns) = (tick, time_ns);
        telemetry.lateness_ns = 1000 + tick * 7919 % 30_000;
        telemetry.bodies[0].sequence = 1 + tick / 16;
        telemetry.bodies[0].age_ns = 1_000_000 * (4 + tick % 16);
        for (device, side) in telemetry.devices.iter_mut().zip([-1.0, 1.0]) {
            let pull = 0.01 * (1.0 - (2.0 * time).cos());
            device.pose.position = Vec3::new(side * (0.05 + pull), 0.0, 0.0);
            device.wrench.force = Vec3::new(-side * 150.0 * pull, 0.2 * (3.0 * time).sin(), 0.0);
        }
        log.write(&telemetry)?;
        overview.take(&(&telemetry).into());
        if tick % (RATE / 2) == RATE / 2 - 1 {
            log.flush()?;
        }
    }
    log.write_overview(&overview.finish())?;
    log.finish()?;
    Ok(())
}
