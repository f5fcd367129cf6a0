//! A log of the built-in scene in the page: what the page shows at a moment is what the log holds there.
//!
//! The test needs `node`, `chromium`, and a folder with the npm package `playwright-core`, which the environment variable
//! `PALPATE_NODE_MODULES` names. Without these tools the test is skipped with a line.

mod browser;

use host::engine::faults::{FaultKind, HostFault};
use host::log::Log;
use host::log::index::LogIndex;
use host::log::read_log;
use host::record::TickRow;
use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, run};
use host::scene::Scene;
use host::world::World;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use view::playback::Player;
use view::terminal::model::Model;
use view::web::{Draw, Picture};

/// Writes a log of the built-in scene, 1.2 s with 50 frames a second. The host stalls from 0.2 s to 1.1 s, and the force of
/// the devices is limited early, so that the log has events.
fn write_log(path: &Path) -> RunSummary {
    let mut options = RunOptions::new(Clock::Virtual);
    options.duration = Some(1.2);
    options.log = Some(path.to_owned());
    options.log_frames = Some(50.0);
    options.faults = vec![HostFault {
        kind: FaultKind::Stall,
        at: 0.2,
        duration: 0.9,
    }];
    let text = include_str!("../../scenes/stretch.toml");
    let text = text.replace("age_limit = 2.0", "age_limit = 0.3");
    let text = text.replace("max_force = 8.0", "max_force = 0.5");
    let scene = Scene::load_texts("stretch.toml", &text, &BTreeMap::new()).unwrap();
    run(&World::new(&scene).unwrap(), &options, &mut |_| ()).unwrap()
}

/// What the page shows at a moment.
#[derive(Deserialize)]
struct Shown {
    /// What was done before.
    after: String,
    /// The tick beside the timeline.
    tick: u64,
    /// The time beside the timeline (s).
    at: String,
    /// The host step of the vertices that are drawn.
    step: u64,
    /// Their bits.
    bits: Vec<u32>,
    /// Position and force of the hands.
    hands: Vec<([f64; 3], [f64; 3])>,
}

/// The numbers of the panel.
#[derive(Deserialize)]
struct Numbers {
    ticks: u64,
    missed: u64,
    peaks: Vec<f64>,
    age: [f64; 3],
}

/// The stresses that the page draws.
#[derive(Deserialize)]
struct Stresses {
    bits: Vec<u32>,
    step: u64,
    most: f64,
    range: f64,
    bar: String,
}

/// The value of the line that begins with `name`.
fn found<T: serde::de::DeserializeOwned>(text: &str, name: &str) -> Vec<T> {
    let lines = text.lines().filter_map(|line| line.strip_prefix(name));
    lines
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

/// Compares a moment with the ticks and the frames of the log.
fn compare(shown: &Shown, rows: &[TickRow], index: &mut LogIndex<File>) {
    let row = rows.iter().find(|row| row.tick == shown.tick).unwrap();
    let after = &shown.after;
    assert_eq!(
        shown.at,
        format!("{:.3}", row.time_ns as f64 * 1e-9),
        "{after}"
    );
    let frame = index.frame_at("sheet", row.time_ns).unwrap().unwrap();
    assert_eq!(shown.step, frame.frame.step, "{after}");
    let bits: Vec<u32> = frame.positions.iter().map(|x| x.to_bits()).collect();
    assert!(shown.bits == bits, "{after}: the page draws other vertices");
    let hands = row.devices.iter().map(|device| {
        let (position, force) = (device.pose.position, device.wrench.force);
        (position.into(), force.into())
    });
    assert_eq!(shown.hands, hands.collect::<Vec<_>>(), "{after}");
}

/// What a script prints that looks at the log of a scene's first `duration` (s), and the log; `None` if a tool is missing.
fn looked_at(script: &str, scene: &str, duration: f64) -> Option<(String, Log)> {
    let mut script = browser::script(script)?;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let scene = format!("{}/../scenes/{scene}", env!("CARGO_MANIFEST_DIR"));
    let scene = Scene::load(scene.as_ref()).unwrap();
    let options = RunOptions {
        duration: Some(duration),
        log: Some(path.clone()),
        log_frames: Some(50.0),
        ..RunOptions::new(Clock::Virtual)
    };
    run(&World::new(&scene).unwrap(), &options, &mut |_| ()).unwrap();
    let player = Player::open(&path, |_| ()).unwrap();
    let stop = Arc::new(AtomicBool::new(false));
    let draw: Arc<Draw> = Arc::new(|_, _| Err("the test saves no still".to_owned()));
    let (server, address) = browser::server(Box::new(player), draw, &stop);
    script.arg(&address);
    let text = browser::lines(script);
    stop.store(true, Ordering::Release);
    server.join().unwrap();
    Some((text, Log::parse(&std::fs::read(&path).unwrap()).unwrap()))
}

#[test]
fn the_page_draws_tools_with_their_ghosts_their_forces_and_what_they_may_touch() {
    let Some((text, log)) = looked_at("tools.cjs", "lift.toml", 0.7) else {
        return;
    };
    // The sites of the patches that the last tick uses.
    let used = (0..).zip(&log.rows.last().unwrap().patches);
    let patches = used.filter_map(|(device, sequence)| {
        let mut patches = log.patches.iter();
        patches.find(|patch| (patch.device, patch.sequence) == (device, *sequence))
    });
    let sites: usize = patches.map(|patch| patch.sites().len()).sum();
    assert!(sites > 6);
    assert_eq!(found::<usize>(&text, "SITES "), [sites]);
}

#[test]
fn the_page_draws_obstacles_and_on_a_key_the_forces_of_contacts() {
    let Some((text, log)) = looked_at("contact.cjs", "sheet_on_sphere.toml", 0.15) else {
        return;
    };
    let last = log.contacts.last().unwrap();
    assert!(!last.points.is_empty());
    assert_eq!(found::<usize>(&text, "CONTACTS "), [last.points.len()]);
}

#[test]
fn the_page_shows_the_moments_of_a_log() {
    let Some(mut script) = browser::script("log.cjs") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let summary = write_log(&path);
    let draw: Arc<Draw> = Arc::new(|messages, picture| {
        let mut model = Model::default();
        for message in messages {
            model.take(message.clone(), Instant::now());
        }
        let shown = model.shown().ok_or("there is no frame yet")?;
        let still = shown.still();
        match picture {
            Picture::Svg => Ok(still.picture().svg().into_bytes()),
            Picture::Png => still.picture().png().map_err(|error| error.to_string()),
            Picture::Csv => Ok(still.vertices_csv().into_bytes()),
        }
    });
    let player = Player::open(&path, |_| ()).unwrap();
    let stop = Arc::new(AtomicBool::new(false));
    let (server, address) = browser::server(Box::new(player), draw, &stop);
    let rows = read_log(&std::fs::read(&path).unwrap()).unwrap();
    let mut index = LogIndex::open(File::open(&path).unwrap()).unwrap();
    let events = &index.overview().unwrap().events;
    let mut ticks: Vec<u64> = events.iter().map(|event| event.tick).collect();
    ticks.dedup();
    ticks.retain(|tick| *tick > 0);
    assert!(ticks.len() >= 2, "{events:?}");
    ticks.truncate(4);
    script.args([&address, &ticks.len().to_string()]);
    let text = browser::lines(script);
    stop.store(true, Ordering::Release);
    server.join().unwrap();

    let moments: Vec<Shown> = found(&text, "SHOWN ");
    for shown in &moments {
        compare(shown, &rows, &mut index);
    }
    let after = |name: &str| moments.iter().find(|shown| shown.after == name).unwrap();
    let (paused, stepped) = (after("pause"), after("forth"));
    assert!(paused.tick > 0);
    assert_eq!(stepped.tick, paused.tick + 1);
    assert_eq!(after("back").tick, paused.tick);
    assert_eq!(after("start").tick, 0);
    assert_eq!(after("end").tick, rows.last().unwrap().tick);
    // The middle of the timeline, to a pixel of at least 300.
    assert!(after("scrub").tick.abs_diff(600) <= 4);
    // The button of the next event visits every tick with an event, in order.
    let visited: Vec<u64> = moments
        .iter()
        .filter(|shown| shown.after == "next")
        .map(|shown| shown.tick)
        .collect();
    assert_eq!(visited, ticks);

    // At the end of the log, the numbers of the page are those of the summary.
    let [numbers] = &found::<Numbers>(&text, "NUMBERS ")[..] else {
        panic!("{text}");
    };
    assert_eq!(numbers.ticks, summary.tick.count);
    assert_eq!(numbers.missed, summary.tick.missed_deadlines);
    let peaks = summary.devices.iter().map(|device| device.peak_force);
    assert_eq!(numbers.peaks, peaks.collect::<Vec<_>>());
    let age = summary.tick.model_age[0];
    assert_eq!(numbers.age, [age.p50, age.p99, age.max]);

    // The stresses that are drawn are those of a player of the same log, and the colour bar holds the largest.
    let [drawn] = &found::<Stresses>(&text, "STRESS ")[..] else {
        panic!("{text}");
    };
    let stress: Vec<f32> = drawn
        .bits
        .iter()
        .map(|bits| f32::from_bits(*bits))
        .collect();
    assert!(
        stress
            .iter()
            .all(|value| value.is_finite() && *value >= 0.0)
    );
    let most = stress.iter().copied().fold(0.0, f32::max);
    assert!(most > 0.0);
    assert_eq!(drawn.most, f64::from(most));
    assert!(drawn.range >= drawn.most && drawn.range <= 2.0 * drawn.most);
    assert!(drawn.bar.ends_with("Pa"), "{}", drawn.bar);
    assert!(drawn.step > 0);
}
