//! A logged run is reproduced bit for bit, and a difference is reported with its tick and field.

use host::log::{Log, LogHeader, LogWriter};
use host::run::prepare::{Options, Prepared};
use host::run::replay::{ReplayError, ReplayReport, replay, scene_of};
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::Corruption;
use runner::AnyDevice;
use runner::link::LogRecord;
use runner::tick_loop::TickLoop;
use sim::{Fault, Faulty};
use std::error::Error;
use std::fs;
use std::io::Cursor;
use std::ops::Range;
use std::path::Path;

type Outcome = Result<(), Box<dyn Error>>;

/// The log of a run, as bytes.
fn logged(loaded: &LoadedScene, clock: Clock, duration: f64) -> Result<Vec<u8>, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(duration),
        log: Some(path.clone()),
        ..RunOptions::new(clock)
    };
    run(&World::new(loaded).unwrap(), &options, &mut |_| {})?;
    Ok(fs::read(path)?)
}

fn replayed(log: &Log) -> Result<ReplayReport, Box<dyn Error>> {
    Ok(replay(log, &scene_of(log, "a log")?, &mut |_| {})?)
}

/// The first difference that the replay reports.
fn first(report: &ReplayReport) -> String {
    report
        .first
        .as_ref()
        .map_or("nothing".into(), ToString::to_string)
}

#[test]
fn a_virtual_run_replays_exactly() -> Outcome {
    let log = Log::parse(&logged(&Scene::embedded_default()?, Clock::Virtual, 2.0)?)?;
    let report = replayed(&log)?;
    assert!(report.is_exact(), "{}", first(&report));
    assert_eq!((report.ticks, report.complete), (2000, true));
    // The run used models and rendered forces.
    assert!(log.models.len() > 400);
    assert!(log.rows[1800].devices[0].wrench.force.norm() > 1.0);
    assert!(report.to_string().contains("2000 ticks reproduced exactly"));
    Ok(())
}

#[test]
fn a_run_under_the_real_clock_replays_exactly() -> Outcome {
    let log = Log::parse(&logged(&Scene::embedded_default()?, Clock::Real, 0.5)?)?;
    let report = replayed(&log)?;
    assert!(report.is_exact(), "{}", first(&report));
    assert_eq!(report.ticks, 500);
    assert!(!log.models.is_empty());
    Ok(())
}

/// The log contains the mesh and the recordings that the scene names.
#[test]
fn a_log_needs_no_other_file() -> Outcome {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let loaded = Scene::load(&scenes.join("cloth.toml"))?;
    let log = Log::parse(&logged(&loaded, Clock::Virtual, 0.3)?)?;
    assert_eq!(log.files, loaded.files);
    assert!(
        log.files
            .values()
            .any(|bytes| bytes.starts_with(b"$MeshFormat"))
    );
    let report = replayed(&log)?;
    assert!(report.is_exact(), "{}", first(&report));
    Ok(())
}

/// The device is silent, sends damaged reports and once a state that is not a number, and is gone for a moment. Times
/// are in ms.
const FAULTS: [(Range<u64>, Fault); 4] = [
    (100..130, Fault::Silent),
    (150..155, Fault::Corrupt(Corruption::Length)),
    (160..161, Fault::NotANumber),
    (170..171, Fault::Gone),
];

#[test]
fn the_failures_of_a_device_are_reproduced() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let setup = Prepared::new(&World::new(&loaded).unwrap(), &Options::new(0.4, 1))?;
    let faults = FAULTS.map(|(span, fault)| (span.start * 1_000_000..span.end * 1_000_000, fault));
    let devices = setup.tick.devices.into_iter().map(|device| {
        let device: AnyDevice = Box::new(Faulty::new(device, faults.to_vec()));
        device
    });
    let mut tick = TickLoop::new(setup.tick.controller, devices.collect(), setup.tick.end);
    let mut ends = setup.log;
    let header = LogHeader {
        scene: loaded.source.text.clone(),
        ..LogHeader::default()
    };
    let mut writer = LogWriter::create(Cursor::new(Vec::new()), &header)?;
    for k in 0..400 {
        tick.tick(k * setup.timing.period_ns);
        let mut written = Ok(());
        ends.records(|record| {
            if let LogRecord::Tick(telemetry) = record {
                written = writer.write(telemetry);
            }
        });
        written?;
    }
    let log = Log::parse(&writer.finish()?.into_inner())?;
    assert!(!log.rows[110].devices[0].fresh && log.rows[200].devices[0].fresh);
    let report = replayed(&log)?;
    assert!(report.is_exact(), "{}", first(&report));
    Ok(())
}

#[test]
fn a_flipped_bit_of_a_force_is_named_with_its_tick_and_field() -> Outcome {
    let bytes = logged(&Scene::embedded_default()?, Clock::Virtual, 0.5)?;
    let mut log = Log::parse(&bytes)?;
    let force = &mut log.rows[321].devices[1].wrench.force.y;
    let now = *force;
    *force = f64::from_bits(now.to_bits() ^ 1);
    let planted = *force;
    let report = replayed(&log)?;
    assert_eq!(report.differing, 1);
    assert_eq!(
        first(&report),
        format!("tick 321 (0.321 s): device 1 force.y: log {planted:?}, now {now:?}")
    );
    Ok(())
}

#[test]
fn a_changed_input_or_model_changes_the_replay() -> Outcome {
    let bytes = logged(&Scene::embedded_default()?, Clock::Virtual, 0.5)?;
    let whole = Log::parse(&bytes)?;

    let mut log = whole.clone();
    let reading = &mut log.rows[200].readings[0].0;
    if let Ok(state) = reading {
        state.pose.position.x += 1e-12;
    }
    let report = replayed(&log)?;
    let found = first(&report);
    assert!(
        found.starts_with("tick 200 (0.200 s): device 0 position.x: log "),
        "{found}"
    );

    let mut log = whole;
    log.models[20].handles[1].wrench.force.x += 1e-9;
    let sequence = log.models[20].head.sequence;
    let user = log
        .rows
        .iter()
        .find(|row| row.bodies[0].sequence == sequence);
    let user = user.ok_or("the model was used")?.tick;
    let report = replayed(&log)?;
    let tick = report.first.as_ref().map(|f| f.tick);
    // The model blends in within a few ticks, with the weight zero in its first tick.
    let expected = (user..user + 3).map(Some).collect::<Vec<_>>();
    assert!(expected.contains(&tick), "{}", first(&report));
    assert!(
        first(&report).contains(": device 1 force."),
        "{}",
        first(&report)
    );
    Ok(())
}

#[test]
fn another_parameter_of_the_controller_is_found_at_once() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let log = Log::parse(&logged(&loaded, Clock::Virtual, 0.5)?)?;
    let text = log.scene.replace("blend = 0.5 ", "blend = 1.0 ");
    assert_ne!(text, log.scene);
    let other = Scene::load_texts("another blend", &text, &log.files)?;
    let report = replay(&log, &other, &mut |_| {})?;
    assert!(report.differing > 100, "{} ticks", report.differing);
    let found = first(&report);
    assert!(
        found.contains(": device ") && found.contains(" force."),
        "{found}"
    );
    Ok(())
}

#[test]
fn a_log_without_a_tick_or_a_model_is_refused_and_the_missing_one_named() -> Outcome {
    let bytes = logged(&Scene::embedded_default()?, Clock::Virtual, 0.3)?;
    let whole = Log::parse(&bytes)?;
    let scene = scene_of(&whole, "a log")?;
    let refused = |log: &Log| replay(log, &scene, &mut |_| {}).err();

    let mut log = whole.clone();
    log.rows.remove(77);
    assert!(matches!(
        refused(&log),
        Some(ReplayError::MissingTick {
            expected: 77,
            found: 78
        })
    ));
    let mut log = whole.clone();
    let missing = log.models.remove(9);
    match refused(&log) {
        Some(ReplayError::MissingModel { body, sequence, .. }) => {
            assert_eq!((body, sequence), (0, missing.head.sequence));
        }
        other => panic!("{other:?}"),
    }
    let mut log = whole;
    log.rows.clear();
    assert!(matches!(refused(&log), Some(ReplayError::Empty)));
    Ok(())
}

#[test]
fn an_incomplete_log_replays_to_its_end() -> Outcome {
    let bytes = logged(&Scene::embedded_default()?, Clock::Virtual, 1.0)?;
    let mut ticks = Vec::new();
    for tenths in [9, 6, 3] {
        let log = Log::parse(&bytes[..bytes.len() * tenths / 10])?;
        let report = replayed(&log)?;
        assert!(report.is_exact(), "{}", first(&report));
        assert!(!report.complete);
        ticks.push(report.ticks);
    }
    assert!(ticks[0] > ticks[1] && ticks[1] > ticks[2] && ticks[2] > 0);
    Ok(())
}
