//! A run of every kind of device replays bit for bit: simulated devices, and those behind the drivers of the firmware
//! protocol, WoodenHaptics and the Falcon; with two devices, a limit that a driver states below its profile and that acts,
//! the loss of a device, and a pause of the loop.

use host::log::{Log, LogHeader, LogWriter};
use host::record::ModelRow;
use host::run::prepare::{self, Options, Prepared};
use host::run::replay::{ReplayReport, replay, scene_of};
use host::run::session::Session;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Override, Scene};
use host::world::World;
use rt_core::safety::SafetyState;
use rt_core::{Axes, Controller, Freedom, LocalModel, TickTime};
use runner::link::LogRecord;
use runner::{AnyDevice, TickLoop};
use sim::{Fault, Faulty};
use std::collections::BTreeMap;
use std::error::Error;
use std::io::Cursor;
use std::ops::Range;

type Outcome = Result<(), Box<dyn Error>>;

const STRETCH: &str = include_str!("../../scenes/stretch.toml");
/// Length of a run (ticks of 1 ms).
const TICKS: u64 = 2600;
/// The left device is lost (ms).
const LOST: Range<u64> = 1500..1600;
/// The loop stands still (ms).
const PAUSE: Range<u64> = 2000..2300;
/// What the driver of the left device states (N). Every profile has more, and the run asks for more.
const STATED: f64 = 0.4;

/// A kind of device.
struct Case {
    model: &'static str,
    connect: &'static str,
    /// What the left device states that it actuates; `None` for what its driver states.
    actuates: Option<Freedom>,
}

const fn case(model: &'static str, connect: &'static str) -> Case {
    Case {
        model,
        connect,
        actuates: None,
    }
}

/// The built-in scene with two devices of a kind.
fn scene(case: &Case) -> Result<LoadedScene, Box<dyn Error>> {
    let model = format!("model = \"{}\"", case.model);
    let text = STRETCH.replace("model = \"falcon\"", &model);
    let scene = Scene::load_texts("x.toml", &text, &BTreeMap::new())?;
    let both = ["left", "right"].map(|name| Override::connection(name, case.connect));
    Ok(scene.overridden(&both)?)
}

/// The models that the host publishes in a run without faults, in order.
fn models(scene: &LoadedScene) -> Result<Vec<(usize, LocalModel)>, Box<dyn Error>> {
    let built = Prepared::new(
        &World::new(scene).unwrap(),
        &Options::new(TICKS as f64 * 1e-3, 1),
    )?;
    let mut models = Vec::new();
    let sink = |record: LogRecord<'_>| {
        if let LogRecord::Model(body, model) = record {
            models.push((usize::from(body), *model));
        }
    };
    Session::of(built).run(sink);
    Ok(models)
}

/// The log of a run with the limit, the loss and the pause. The host of this run publishes the models of a run without
/// them.
fn logged(case: &Case) -> Result<Log, Box<dyn Error>> {
    let scene = scene(case)?;
    let models = models(&scene)?;
    let built = Prepared::new(
        &World::new(&scene).unwrap(),
        &Options::new(TICKS as f64 * 1e-3, 1),
    )?;
    // The limits as the drivers state them. The left device is a plug-in that states less.
    let devices = built.tick.devices;
    let mut limits: Vec<_> = devices.iter().map(|device| device.capabilities()).collect();
    let (mut config, _) = prepare::controls(&World::new(&scene).unwrap(), 1)?;
    limits[0].max_force = STATED;
    config.devices[0].safety.max_force = STATED;
    if let Some(actuates) = case.actuates {
        limits[0].actuated = actuates;
        config.devices[0].safety.actuated = actuates;
    }
    let ns = |span: Range<u64>| span.start * 1_000_000..span.end * 1_000_000;
    let devices = devices.into_iter().enumerate().map(|(index, device)| {
        let lost = [(ns(LOST), Fault::Gone)];
        let faults = if index == 0 { &lost[..] } else { &[] };
        Box::new(Faulty::new(device, faults.to_vec())) as AnyDevice
    });
    let controller = Controller::new(&config);
    let mut tick = TickLoop::new(controller, devices.collect(), built.tick.end);
    let (mut host, mut log) = (built.host, built.log);

    let header = LogHeader {
        limits,
        scene: scene.source.text.clone(),
        ..LogHeader::default()
    };
    let mut writer = LogWriter::create(Cursor::new(Vec::new()), &header)?;
    let mut models = models.into_iter().peekable();
    for k in (0..TICKS).filter(|k| !PAUSE.contains(k)) {
        let now_ns = k * 1_000_000;
        // The host goes on while the loop stands still; its models wait in the ring.
        while let Some((body, model)) = models.next_if(|(_, model)| model.head.time_ns <= now_ns) {
            host.publish(body, &model)?;
        }
        let late = if k == PAUSE.end {
            299_123_456
        } else {
            k * 7919 % 50_000
        };
        // Now and then the thread of the tick is kept from its processor before it commands.
        let took = if k % 701 == 700 {
            9_876_543
        } else {
            k * 104_729 % 30_000
        };
        let time = TickTime {
            now_ns,
            lateness_ns: late,
        };
        tick.timed(time, || took);
        host.drain(|_| {});
        let mut written = Ok(());
        log.records(|record| {
            let result = match record {
                LogRecord::Tick(telemetry) => writer.write(telemetry),
                LogRecord::Patch(..) => Ok(()),
                LogRecord::Model(body, model) => {
                    let mut row = ModelRow::new(body, model);
                    writer.write_record(row.stamp(), &mut row)
                }
            };
            if written.is_ok() {
                written = result;
            }
        });
        written?;
    }
    Ok(Log::parse(&writer.finish()?.into_inner())?)
}

fn replayed(log: &Log) -> Result<ReplayReport, Box<dyn Error>> {
    Ok(replay(log, &scene_of(log, "a log")?, &mut |_| {})?)
}

/// The greatest force on each hand in these ticks (N).
fn greatest(log: &Log, ticks: Range<u64>) -> [f64; 2] {
    let rows = log.rows.iter();
    let rows = rows.filter(|row| ticks.contains(&(row.time_ns / 1_000_000)));
    rows.fold([0.0, 0.0], |most: [f64; 2], row| {
        [0, 1].map(|index| most[index].max(row.devices[index].wrench.force.norm()))
    })
}

fn check(case: &Case) -> Outcome {
    let name = format!("{} through {}", case.model, case.connect);
    let log = logged(case)?;
    // What the test is about happened: forces before and after the loss and the pause, a limit that acted.
    let limited = |index: usize| {
        let rows = log.rows.iter();
        rows.filter(|row| row.devices[index].safety == SafetyState::Limited)
            .count()
    };
    assert!(limited(0) > 100, "{name}: {}", limited(0));
    assert!(log.rows[1550].readings[0].0.is_err(), "{name}");
    let pause = log
        .rows
        .windows(2)
        .map(|rows| rows[1].time_ns - rows[0].time_ns);
    assert_eq!(pause.max(), Some(301_000_000), "{name}");
    for ticks in [0..LOST.start, LOST.end..PAUSE.start, PAUSE.end..TICKS] {
        let [left, right] = greatest(&log, ticks.clone());
        assert!(
            left > 0.2 && left <= STATED * (1.0 + 1e-9),
            "{name}: {left} N in {ticks:?}"
        );
        assert!(right > STATED, "{name}: {right} N in {ticks:?}");
    }
    let report = replayed(&log)?;
    assert!(report.is_exact(), "{name}: {report}");
    assert_eq!(report.ticks, TICKS - (PAUSE.end - PAUSE.start), "{name}");

    // The limits of the profiles are not those of the run.
    let mut without = log.clone();
    without.limits.clear();
    let report = replayed(&without)?;
    assert!(report.differing > 100, "{name}: {report}");
    Ok(())
}

#[test]
fn simulated_devices_replay_exactly() -> Outcome {
    check(&case("falcon", "sim"))?;
    check(&case("virtuose6d", "sim"))
}

#[test]
fn devices_of_the_firmware_protocol_replay_exactly() -> Outcome {
    check(&case("omega3", "emulated"))
}

#[test]
fn devices_of_woodenhaptics_replay_exactly() -> Outcome {
    check(&case("woodenhaptics", "emulated"))
}

#[test]
fn falcons_replay_exactly() -> Outcome {
    check(&case("falcon", "emulated"))
}

/// A plug-in may state fewer axes than its profile has.
#[test]
fn a_device_that_states_fewer_axes_than_its_profile_replays_exactly() -> Outcome {
    check(&Case {
        actuates: Axes::new([true, false, true]).map(Freedom::Along),
        ..case("omega3", "sim")
    })
}

/// The driver of the Falcon asks for 5 N at most, and the profile of the Falcon has 8 N.
#[test]
fn a_falcon_that_reaches_the_limit_of_its_driver_replays_exactly() -> Outcome {
    let text = r#"
name = "push"
duration = 1.0
[[body]]
name = "block"
mesh.box = { size = [0.1, 0.1, 0.06], cells = [4, 4, 3] }
material = { young = 1e5, poisson = 0.4, density = 1000.0 }
damping = { mass = 0.1, stiffness = 0.02 }
[[body.support]]
name = "table"
group = "bottom"
[[body.handle]]
name = "finger"
group = "top"
device = "d"
[[device]]
name = "d"
model = "falcon"
connect = "emulated"
hand = { grip = "rigid", task = "press_and_hold", direction = [0, 0, -1], depth = 0.02 }
"#;
    let loaded = Scene::load_texts("push.toml", text, &BTreeMap::new())?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("push.mcap");
    let options = RunOptions {
        log: Some(path.clone()),
        ..RunOptions::new(Clock::Virtual)
    };
    run(&World::new(&loaded).unwrap(), &options, &mut |_| {})?;
    let log = Log::parse(&std::fs::read(path)?)?;
    assert_eq!(log.limits[0].max_force, 5.0);
    let held = log
        .rows
        .iter()
        .map(|row| row.devices[0].wrench.force.norm());
    let held = held.filter(|force| (force - 5.0).abs() < 1e-9).count();
    assert!(held > 100, "{held}");
    let report = replayed(&log)?;
    assert!(report.is_exact(), "{report}");
    assert_eq!(report.ticks, 1000);
    Ok(())
}
