//! Frames of the bodies in a log: they are the positions of the steps that they name, and nothing else changes.

use host::log::Log;
use host::log::index::LogIndex;
use host::run::prepare::{Options, Prepared};
use host::run::replay::{replay, scene_of};
use host::run::session::Session;
use host::run::{Clock, RunOptions, log_frames, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::io::Cursor;
use std::path::Path;

type Outcome = Result<(), Box<dyn Error>>;

const DURATION: f64 = 0.6;

fn scene(name: &str) -> Result<LoadedScene, Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    Ok(Scene::load(&folder.join(name))?)
}

/// The log of a run with frames at `rate` (Hz), as bytes, and what the summary says it lacks.
fn logged(
    loaded: &LoadedScene,
    clock: Clock,
    rate: Option<f64>,
) -> Result<(Vec<u8>, Vec<String>), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(DURATION),
        log: Some(path.clone()),
        log_frames: rate,
        ..RunOptions::new(clock)
    };
    let summary = run(&World::new(loaded).unwrap(), &options, &mut |_| {})?;
    assert_eq!(summary.failures, Vec::<String>::new());
    Ok((fs::read(path)?, summary.degradations))
}

/// By number of the step and by body: positions as bits of `f32`.
type Steps = BTreeMap<u64, Vec<Vec<u32>>>;

/// The positions of the bodies after each step of a run that a tick follows, as bits of `f32`, by number of the step.
fn positions(loaded: &LoadedScene) -> Result<Steps, Box<dyn Error>> {
    let mut steps = BTreeMap::new();
    let setup = Prepared::new(
        &World::new(loaded).unwrap(),
        &Options::new(DURATION, loaded.scene.seed),
    )?;
    let mut session = Session::of(setup);
    while session.tick().is_some() {
        let engine = session.engine().ok_or("the host panicked")?;
        steps.entry(engine.stats().steps).or_insert_with(|| {
            let bodies = engine.bodies().iter().map(|body| {
                let positions = body.body().positions();
                let numbers = positions.flat_map(|p| [p.x as f32, p.y as f32, p.z as f32]);
                numbers.map(f32::to_bits).collect()
            });
            bodies.collect()
        });
    }
    Ok(steps)
}

#[test]
fn a_frame_has_the_positions_of_the_step_that_it_names() -> Outcome {
    for name in ["stretch.toml", "press.toml", "thread.toml"] {
        let loaded = scene(name)?;
        let steps = positions(&loaded)?;
        let (bytes, lacks) = logged(&loaded, Clock::Virtual, Some(50.0))?;
        assert_eq!(lacks, Vec::<String>::new());
        let mut log = LogIndex::open(Cursor::new(bytes))?;
        for (index, body) in loaded.scene.bodies.iter().enumerate() {
            let mut compared = 0;
            for number in 0..30_u64 {
                let at = number * 20_000_000 + 19_999_999;
                let found = log.frame_at(&body.name, at)?.ok_or("no frame")?;
                // The first step at or after the time of the frame.
                assert!((number * 20_000_000..=at).contains(&found.frame.time_ns));
                if let Some(expected) = steps.get(&found.frame.step) {
                    let bits: Vec<_> = found.positions.iter().map(|x| x.to_bits()).collect();
                    assert!(bits == expected[index], "{name}, frame {number}");
                    compared += 1;
                }
                let surface = log.surface_at(&body.name, at)?.ok_or("no surface")?;
                assert_eq!(surface.epoch, found.frame.epoch);
                assert_eq!(3 * surface.vertices as usize, found.positions.len());
                assert!(!(surface.triangles.is_empty() && surface.lines.is_empty()));
            }
            // If two steps fall between two ticks, the first of them is not seen here.
            assert!(compared >= 10, "{name}: {compared}");
        }
    }
    Ok(())
}

#[test]
fn frames_change_nothing_else_and_two_runs_give_the_same_bytes() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let (with, _) = logged(&loaded, Clock::Virtual, Some(60.0))?;
    let (again, _) = logged(&loaded, Clock::Virtual, Some(60.0))?;
    assert!(with == again, "two runs");
    let (without, _) = logged(&loaded, Clock::Virtual, None)?;
    let (with, without) = (Log::parse(&with)?, Log::parse(&without)?);
    assert!(with == without, "ticks, models, scene and files");
    let report = replay(&with, &scene_of(&with, "a log")?, &mut |_| {})?;
    assert!(report.is_exact());
    Ok(())
}

#[test]
fn under_the_real_clock_the_frames_are_counted() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let (bytes, lacks) = logged(&loaded, Clock::Real, Some(50.0))?;
    let mut log = LogIndex::open(Cursor::new(bytes))?;
    let name = &loaded.scene.bodies[0].name;
    let mut times = Vec::new();
    for number in 0..30_u64 {
        let at = number * 20_000_000 + 19_999_999;
        times.extend(log.frame_at(name, at)?.map(|found| found.frame.time_ns));
    }
    times.dedup();
    // A frame is in the log, or the summary says that frames are missing.
    let told = lacks
        .iter()
        .any(|lack| lack.contains("frames of the bodies"));
    assert!(
        times.len() >= 29 || told,
        "{} frames, {lacks:?}",
        times.len()
    );
    assert!(!times.is_empty());
    Ok(())
}

#[test]
fn a_rate_that_is_not_allowed_is_refused() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let most = loaded.scene.host.step_rate;
    for rate in [0.0, -1.0, f64::NAN, 2.0 * most] {
        let error = log_frames::check_rate(rate, &loaded.scene).expect_err("refused");
        let text = error.to_string();
        assert!(text.starts_with("--log-frames: found "), "{text}");
    }
    assert!(log_frames::check_rate(most, &loaded.scene).is_ok());
    Ok(())
}
