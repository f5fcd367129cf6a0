//! Tools that go farther than their patches have the surface: a run, its log and its viewers tell.

use host::engine::faults::{FaultKind, HostFault};
use host::live::EventKind;
use host::live::gather::Gatherer;
use host::log::Log;
use host::run::prepare::{Options, Prepared};
use host::run::session::Session;
use host::run::summary::EventSummary;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::Telemetry;
use runner::AnyDevice;
use sim::{Fault, Faulty};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// How far a patch has the surface beyond a tool at rest (m): twice the way at 0.5 m/s until the next one, which comes after a period of
/// 1/60 s and 4 ms.
const REACH: f64 = 2.0 * 0.5 * (1.0 / 60.0 + 0.004);

/// Two balls above a block. The hand of the first one moves it by `way` (m) along y from 1.0 to 1.4 s; the other one rests.
fn two_balls(way: f64) -> LoadedScene {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let text = fs::read_to_string(scenes.join("touch.toml")).unwrap();
    let text = text.replace("[12, 12, 6]", "[4, 4, 2]");
    let (block, ball) = text.split_at(text.find("[[tool]]").unwrap());
    let ball = ball.split_at(ball.find("waypoints").unwrap()).0;
    let other = ball
        .replace("\"ball\"", "\"other\"")
        .replace("\"omega\"", "\"second\"")
        .replace("[0.0, 0.0, 0.045]", "[-0.04, 0.0, 0.045]");
    let text =
        format!("{block}{ball}waypoints = [[1.0, 0, 0, 0], [1.4, 0, {way:?}, 0]]\n\n{other}");
    Scene::load_texts("two.toml", &text, &BTreeMap::new()).unwrap()
}

/// The events of a run of 2 s that tell of a tool beyond its patch, and the log of the run.
fn told(loaded: &LoadedScene, fault: Option<(FaultKind, f64)>) -> (Vec<EventSummary>, Log) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let fault = fault.map(|(kind, duration)| HostFault {
        kind,
        at: 0.9,
        duration,
    });
    let options = RunOptions {
        duration: Some(2.0),
        log: Some(path.clone()),
        faults: fault.into_iter().collect(),
        ..RunOptions::new(Clock::Virtual)
    };
    let summary = run(&World::new(loaded).unwrap(), &options, &mut |_| {}).unwrap();
    let events = summary.events.into_iter();
    let events = events.filter(|event| event.description.contains("beyond the surface"));
    (
        events.collect(),
        Log::parse(&fs::read(path).unwrap()).unwrap(),
    )
}

/// The host stands still, or its patches are spoilt, while the first ball moves by twice the reach. The ticks of the log tell when it left
/// the surface that it knew: the ball had rested before, so the way is that from its place at 0.9 s.
#[test]
fn a_tool_that_leaves_the_patch_of_a_host_that_fails_is_told() {
    let loaded = two_balls(2.0 * REACH);
    for kind in [FaultKind::Stall, FaultKind::NotANumber] {
        let (events, log) = told(&loaded, Some((kind, 0.6)));
        let [event] = &events[..] else {
            panic!("{kind:?}: {events:?}");
        };
        let place = |tick: usize| log.rows[tick].tools()[0].unwrap().pose.position;
        let way = |tick: &usize| (place(*tick) - place(900)).norm();
        let left = (900..2000).find(|tick| way(tick) > REACH).unwrap();
        // The tremor of a count before the stall.
        assert!(
            (event.from - 1e-3 * left as f64).abs() < 1.1e-3,
            "{event:?} {left}"
        );
        // The first patch after 1.5 s, which is there 4 ms after a step at 60 Hz.
        assert!((1.499..1.53).contains(&event.to), "{kind:?}: {event:?}");
        let farthest = 1e3 * (900..1500).map(|tick| way(&tick)).fold(0.0, f64::max);
        let said = format!("ball: beyond the surface that the host told: {farthest:.1} mm");
        assert!(event.description.starts_with(&said), "{said}: {event:?}");
        assert!(
            event.description.contains("which reaches 20.7 mm"),
            "{event:?}"
        );

        // A viewer of the log tells of it at its first tick.
        let mut gatherer = Gatherer::new(&loaded, Clock::Virtual);
        for row in &log.rows {
            gatherer.take(&row.into());
        }
        let (live, _) = gatherer.events();
        let mut live = live.iter().filter(|event| event.kind == EventKind::Beyond);
        let (first, second) = (live.next().unwrap(), live.next());
        assert_eq!(first.time_ns as f64 * 1e-9, event.from);
        assert!(
            first.text.starts_with("ball: beyond") && second.is_none(),
            "{first:?}"
        );
    }
}

#[test]
fn no_other_tool_is_told() {
    // A host that does not fail follows the ball, and a ball that rests does not leave its patch.
    assert_eq!(told(&two_balls(2.0 * REACH), None).0.len(), 0);
    let (events, log) = told(&two_balls(0.0), Some((FaultKind::Stall, 0.6)));
    assert_eq!(events.len(), 0);
    // A log of an earlier version does not know how far its patches reach.
    let mut row = log.rows[1000].clone();
    assert_eq!(row.way.len(), 4);
    row.way.clear();
    assert!(
        row.tools()[..2]
            .iter()
            .flatten()
            .all(|tool| !tool.is_beyond())
    );
}

/// The device of the first ball is silent, or gone, while its hand moves on: the ball stays, and is led after it when the device is back.
#[test]
fn a_tool_whose_device_is_lost_does_not_leave_its_patch() {
    let loaded = two_balls(2.0 * REACH);
    let world = World::new(&loaded).unwrap();
    for fault in [Fault::Silent, Fault::Gone] {
        let mut prepared = Prepared::new(&world, &Options::new(2.0, 1)).unwrap();
        let mut faults = Some((1_050_000_000..1_450_000_000, fault));
        let devices = prepared.tick.devices.into_iter();
        prepared.tick.devices = devices
            .map(|device| {
                Box::new(Faulty::new(device, faults.take().into_iter().collect())) as AnyDevice
            })
            .collect();
        let mut session = Session::of(prepared);
        let run: Vec<Telemetry> = std::iter::from_fn(|| session.tick()).collect();
        let tools: Vec<_> = run.iter().flat_map(Telemetry::tools).collect();
        assert!(tools.iter().any(|tool| tool.way > 1e-3), "{fault:?}");
        for tool in tools {
            assert!(tool.way <= tool.reach, "{fault:?}: {tool:?}");
        }
    }
}
