//! A sheet that tears is shown and stored as it is: in frames for ParaView, in the frames of a log, and to viewers.

use host::live::EventKind;
use host::log::Log;
use host::log::index::LogIndex;
use host::run::frames::FrameOptions;
use host::run::prepare::{Options, Prepared};
use host::run::replay::{replay, scene_of};
use host::run::session::Session;
use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::snapshot::{Subscriber, Watchers};
use host::world::World;
use physics::Vec3;
use std::collections::BTreeMap;
use std::error::Error;
use std::fs::{self, File};
use std::io::{BufReader, Cursor};
use std::path::Path;
use std::time::{Duration, Instant};

type Outcome = Result<(), Box<dyn Error>>;

/// A sheet that two hands tear within half a second.
const SCENE: &str = include_str!("../scenes/small_tear.toml");
const DURATION: f64 = 0.6;

fn scene() -> Result<LoadedScene, Box<dyn Error>> {
    Ok(Scene::load_texts(
        "small_tear.toml",
        SCENE,
        &BTreeMap::new(),
    )?)
}

/// Runs the scene with frames in `folder/frames` and a log `folder/run.mcap`.
fn torn(folder: &Path, frames: bool) -> Result<RunSummary, Box<dyn Error>> {
    let options = RunOptions {
        duration: Some(DURATION),
        log: Some(folder.join("run.mcap")),
        log_frames: frames.then_some(50.0),
        frames: frames.then(|| FrameOptions {
            folder: folder.join("frames"),
            rate: 50.0,
        }),
        ..RunOptions::new(Clock::Virtual)
    };
    let summary = run(&World::new(&scene()?).unwrap(), &options, &mut |_| {})?;
    assert_eq!(summary.failures, Vec::<String>::new());
    assert_eq!(summary.degradations, Vec::<String>::new());
    assert!(summary.tears[0].edges > 5, "{:?}", summary.tears);
    Ok(summary)
}

#[test]
fn frames_for_other_programs_show_the_triangles_of_the_torn_sheet() -> Outcome {
    let folder = tempfile::tempdir()?;
    let summary = torn(folder.path(), true)?;
    let mut before: Option<(usize, usize)> = None;
    let mut grown = 0;
    for number in 0..30 {
        let name = format!("sheet_{number:04}.vtu");
        let text = fs::read_to_string(folder.path().join("frames").join(&name))?;
        // A tear has vertices at one place, which the readers of meshes refuse.
        let count = |field: &str| -> Result<usize, Box<dyn Error>> {
            let (_, rest) = text.split_once(field).ok_or("no such field")?;
            let number = rest.split('"').nth(1).ok_or("no number")?;
            Ok(number.parse()?)
        };
        let counts = (count("NumberOfPoints=")?, count("NumberOfCells=")?);
        let (vertices, triangles) = before.unwrap_or(counts);
        assert!(counts.0 >= vertices && counts.1 >= triangles);
        grown += usize::from(counts.0 > vertices);
        before = Some(counts);
        // Every triangle has a stress, and the numbers are numbers.
        for field in ["von_mises", "young", "poisson", "displacement"] {
            assert!(text.contains(&format!("Name=\"{field}\"")), "{field}");
        }
        assert!(!text.contains("NaN") && !text.contains("inf"), "{name}");
    }
    assert!(grown > 2, "the sheet grows in {grown} frames");
    let added = before.ok_or("no frame")?.0 as u64;
    let at_first = 13 * 11 + 2;
    assert!(added > at_first && added <= at_first + 2 * summary.tears[0].edges);
    Ok(())
}

/// The positions of the body after each step that a tick follows, by number of the step: bits of `f32`. And the triangles.
type Steps = BTreeMap<u64, (Vec<u32>, Vec<u32>)>;

fn steps() -> Result<Steps, Box<dyn Error>> {
    let loaded = scene()?;
    let mut steps = BTreeMap::new();
    let setup = Prepared::new(
        &World::new(&loaded).unwrap(),
        &Options::new(DURATION, loaded.scene.seed),
    )?;
    let mut session = Session::of(setup);
    while session.tick().is_some() {
        let engine = session.engine().ok_or("the host panicked")?;
        steps.entry(engine.stats().steps).or_insert_with(|| {
            let body = engine.bodies()[0].body();
            let numbers = body
                .positions()
                .flat_map(|p| [p.x as f32, p.y as f32, p.z as f32]);
            let triangles = body.surface().map(physics::topology::Surface::triangles);
            (
                numbers.map(f32::to_bits).collect(),
                triangles.unwrap_or_default().as_flattened().to_vec(),
            )
        });
    }
    Ok(steps)
}

#[test]
fn a_log_has_the_surface_of_every_frame_of_a_torn_sheet() -> Outcome {
    let folder = tempfile::tempdir()?;
    torn(folder.path(), true)?;
    let steps = steps()?;
    let file = File::open(folder.path().join("run.mcap"))?;
    let mut log = LogIndex::open(BufReader::new(file))?;
    let (mut compared, mut epochs) = (0, Vec::new());
    for number in 0..30_u64 {
        let at = number * 20_000_000 + 19_999_999;
        let found = log.frame_at("sheet", at)?.ok_or("no frame")?;
        let surface = log.surface_at("sheet", at)?.ok_or("no surface")?;
        assert_eq!(surface.epoch, found.frame.epoch);
        assert_eq!(3 * surface.vertices as usize, found.positions.len());
        assert_eq!(surface.rest.len(), found.positions.len());
        assert_eq!(surface.triangles.len(), 3 * surface.triangle_count as usize);
        assert!(surface.triangles.iter().all(|v| *v < surface.vertices));
        if let Some((positions, triangles)) = steps.get(&found.frame.step) {
            let bits: Vec<_> = found.positions.iter().map(|x| x.to_bits()).collect();
            assert!(bits == *positions, "frame {number}");
            assert!(surface.triangles == *triangles, "frame {number}");
            compared += 1;
        }
        epochs.push(surface.epoch);
    }
    epochs.dedup();
    assert!(compared >= 20 && epochs.len() > 3, "{compared} {epochs:?}");
    Ok(())
}

/// A viewer that looks away misses surfaces, and gets the newest with the newest positions.
#[test]
fn a_viewer_gets_the_newest_surface_with_the_newest_positions() -> Outcome {
    let loaded = scene()?;
    let setup = Prepared::new(
        &World::new(&loaded).unwrap(),
        &Options::new(DURATION, loaded.scene.seed),
    )?;
    let watchers = Watchers::default();
    watchers.set(1);
    let (mut subscriber, mut reader) = Subscriber::watched(&setup.engine, watchers);
    let (mut now, mut steps) = (Instant::now(), 0);
    let (mut known, mut seen) = (None, 0);
    let mut faults = Vec::new();
    let mut session = Session::of(setup);
    while session.tick().is_some() {
        let engine = session.engine().ok_or("the host panicked")?;
        if engine.stats().steps == steps {
            continue;
        }
        steps = engine.stats().steps;
        // A copy is due after each step.
        now += Duration::from_millis(20);
        subscriber.after_step(now, 0, 0, engine);
        if !steps.is_multiple_of(7) {
            continue;
        }
        let Some(snapshot) = reader.newest() else {
            faults.push(format!("step {steps}: no snapshot"));
            continue;
        };
        let body = &snapshot.bodies[0];
        if let Some(surface) = body.torn.fresh() {
            seen += 1;
            known = Some((surface.epoch, surface.vertices));
            if surface.rest.len() != 3 * body.positions.len() {
                faults.push(format!("step {steps}: positions at rest"));
            }
        }
        let vertices = body.positions.len() as u32;
        if known.is_some_and(|known| known != (body.epoch, vertices)) {
            faults.push(format!("step {steps}: {known:?} {}", body.epoch));
        }
        reader.give_back(snapshot);
    }
    assert_eq!(faults, Vec::<String>::new());
    assert!(seen > 2, "{seen} surfaces");
    Ok(())
}

#[test]
fn the_log_holds_every_edit_and_the_summary_says_where_the_tear_started() -> Outcome {
    let folder = tempfile::tempdir()?;
    let summary = torn(folder.path(), false)?;
    let bytes = fs::read(folder.path().join("run.mcap"))?;
    let log = Log::parse(&bytes)?;
    let tears = &summary.tears[0];
    let edges = log.tears.iter().map(|edit| edit.number);
    assert!(edges.eq(1..=tears.edges as u32));
    assert!(
        log.tears
            .is_sorted_by_key(|edit| (edit.time_ns, edit.epoch))
    );
    // The sums differ from the report's by rounding alone.
    let energy: f64 = log.tears.iter().map(|edit| edit.energy).sum();
    assert!((energy / tears.energy - 1.0).abs() < 1e-12);
    let length: f64 = log.tears.iter().map(|edit| edit.length).sum();
    assert!((5e-4 * length / tears.area - 1.0).abs() < 1e-12);
    // The tear starts at the end of the notch, and each edit goes on from the end of the edit before.
    let starts: Vec<_> = log.tears.iter().filter(|edit| edit.starts).collect();
    let [start] = starts[..] else {
        return Err(format!("{starts:?}").into());
    };
    assert!((start.at - Vec3::new(0.0, 0.03, 0.0)).norm() < 1e-9);
    for pair in log.tears.windows(2) {
        assert_eq!(pair[1].from, pair[0].tips[0]);
    }
    let told = summary.events.iter();
    let told: Vec<_> = told
        .filter(|event| event.description.contains("tear started"))
        .collect();
    let [told] = told[..] else {
        return Err(format!("{:?}", summary.events).into());
    };
    assert_eq!(
        told.description,
        "sheet: a tear started at x 0.0, y 30.0, z 0.0 mm at rest"
    );
    assert_eq!(told.from, start.time_ns as f64 * 1e-9);
    // The tear ends at the other border, and the sheet is in two pieces.
    let pieces: Vec<_> = log.tears.iter().map(|edit| edit.pieces).collect();
    assert_eq!((pieces[0], pieces.last()), (1, Some(&2)));
    // The tear ran down from the upper border: it met the lower one, and not the vertex an edge before it.
    let mut events = summary.events.iter();
    let apart = events.find(|event| event.description.contains("came apart"));
    let apart = &apart.ok_or("the sheet came apart")?.description;
    let last = log.tears.last().ok_or("an edit")?;
    assert!((last.end.y + 0.05).abs() < 1e-12, "{last:?}");
    assert!(
        apart.contains(", y -50.0, z 0.0 mm at rest: 2 pieces"),
        "{apart}"
    );
    // A player and a viewer show the same event.
    let index = LogIndex::open(Cursor::new(&bytes))?;
    let overview = index.overview().ok_or("an overview")?;
    let events = overview.events.iter();
    let shown: Vec<_> = events
        .filter(|event| event.kind == EventKind::Tear)
        .collect();
    assert_eq!(shown[0].text, told.description);
    assert!(shown[0].time_ns >= start.time_ns);
    Ok(())
}

#[test]
fn two_logs_of_a_torn_sheet_are_equal_and_a_log_can_be_replayed() -> Outcome {
    let logged = || -> Result<Vec<u8>, Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        torn(folder.path(), true)?;
        Ok(fs::read(folder.path().join("run.mcap"))?)
    };
    let bytes = logged()?;
    assert!(bytes == logged()?);
    let log = Log::parse(&bytes)?;
    assert!(replay(&log, &scene_of(&log, "a log")?, &mut |_| {})?.is_exact());
    Ok(())
}
