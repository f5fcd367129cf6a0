//! A frame shows the truth: its totals are those of the summary, and no spike of a single tick is lost.

use host::engine::faults::{FaultKind, HostFault};
use host::live::frame::{EventKind, Frame};
use host::live::gather::{Gatherer, TickView};
use host::log::read_log;
use host::record::TickRow;
use host::run::observer::{Observed, Observer, Observers};
use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, run_watched};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::{Telemetry, Vec3};
use runner::link::LogRecord;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

type Outcome = Result<(), Box<dyn Error>>;

/// Ticks a frame.
const TICKS: u64 = 17;

/// An observer that makes a frame of every few ticks. It may change a tick before the gatherer takes it.
struct Frames {
    gatherer: Gatherer,
    made: Arc<Mutex<Vec<Frame>>>,
    plant: fn(&mut Telemetry),
}

impl Observer for Frames {
    fn take(&mut self, record: LogRecord<'_>) {
        if let LogRecord::Tick(telemetry) = record {
            let mut telemetry = *telemetry;
            (self.plant)(&mut telemetry);
            self.gatherer.take(&(&telemetry).into());
            if (telemetry.tick + 1).is_multiple_of(TICKS) {
                let frame = self.gatherer.frame();
                self.made.lock().expect("nothing panics").push(frame);
            }
        }
    }

    fn finish(mut self: Box<Self>, _: &mut Observed) {
        let frame = self.gatherer.last_frame();
        self.made.lock().expect("nothing panics").push(frame);
    }
}

fn scene(name: &str) -> Result<LoadedScene, Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    Ok(Scene::load(&folder.join(name))?)
}

/// The frames and the summary of a run under virtual time.
fn frames_of(
    loaded: &LoadedScene,
    options: &RunOptions,
    plant: fn(&mut Telemetry),
) -> Result<(Vec<Frame>, RunSummary), Box<dyn Error>> {
    let frames = Arc::<Mutex<Vec<Frame>>>::default();
    let observer = Frames {
        gatherer: Gatherer::new(loaded, options.clock),
        made: Arc::clone(&frames),
        plant,
    };
    let summary = run_watched(
        &World::new(loaded).unwrap(),
        options,
        Observers::new().with(observer),
        &mut |_| {},
    )?;
    let frames = std::mem::take(&mut *frames.lock().expect("nothing panics"));
    Ok((frames, summary))
}

fn options(duration: f64, log: Option<PathBuf>) -> RunOptions {
    RunOptions {
        duration: Some(duration),
        log,
        ..RunOptions::new(Clock::Virtual)
    }
}

/// Whether the totals of a frame are those of the summary, to the last bit.
fn agrees(frame: &Frame, summary: &RunSummary) {
    let totals = &frame.totals;
    assert_eq!(totals.ticks, summary.tick.count);
    assert_eq!(totals.missed, summary.tick.missed_deadlines);
    assert_eq!(totals.longest_miss, summary.tick.longest_miss);
    assert_eq!(totals.lost, summary.dropped.telemetry);
    assert_eq!(totals.lateness, summary.tick.lateness);
    assert_eq!(totals.duration, summary.tick.duration);
    assert_eq!(totals.model_age, summary.tick.model_age);
    assert_eq!(totals.stale, summary.tick.faded);
    assert_eq!(frame.hands.len(), summary.devices.len());
    for (hand, device) in frame.hands.iter().zip(&summary.devices) {
        assert_eq!(
            (hand.peak_force, hand.work, hand.reach),
            (device.peak_force, device.work, device.reach)
        );
        assert!(hand.peak_force > 0.0 && hand.reach > 0.0);
    }
    assert_eq!(frame.bodies.len(), summary.energy.len());
    for (body, energy) in frame.bodies.iter().zip(&summary.energy) {
        assert_eq!(body.energy["supplied"], energy.supplied);
        assert_eq!(body.energy["initial"], energy.initial);
        assert_eq!(body.energy["raised"], energy.raised);
        assert_eq!(body.energy["credited"], energy.credited);
        assert_eq!(Some(body.energy["stored"]), energy.stored);
        assert_eq!(body.capped_ticks, energy.capped_ticks);
    }
}

#[test]
fn the_totals_of_the_last_frame_are_those_of_the_summary() -> Outcome {
    for name in ["stretch.toml", "press.toml"] {
        let mut options = options(1.2, None);
        // A stall in which the model becomes too old, so that there is an event.
        options.faults = vec![HostFault {
            kind: FaultKind::Stall,
            at: 0.6,
            duration: 0.5,
        }];
        let mut loaded = scene(name)?;
        loaded.scene.realtime.age_limit = Some(0.1);
        let (frames, summary) = frames_of(&loaded, &options, |_| {})?;
        let last = frames.last().ok_or("no frame")?;
        assert!(last.last);
        agrees(last, &summary);
        assert!(summary.tick.faded > 0, "{name}: the stall has no effect");
        let events = frames.iter().flat_map(|frame| &frame.events);
        let stale = events.filter(|event| event.kind == EventKind::StaleModel);
        assert_eq!(stale.count() as u64, summary.tick.faded);
        // Every tick is in one frame, and the greatest force is in a curve.
        let ticks: u64 = frames.iter().map(|frame| frame.folded.ticks).sum();
        assert_eq!(ticks, summary.tick.count);
        for (index, device) in summary.devices.iter().enumerate() {
            let most = frames
                .iter()
                .filter_map(|frame| frame.folded.hands.get(index))
                .fold(0.0, |most: f64, hand| most.max(hand.force_norm.most));
            assert_eq!(most, device.peak_force);
        }
    }
    Ok(())
}

#[test]
fn a_spike_of_one_tick_is_in_the_curves_of_one_frame() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let (frames, _) = frames_of(&loaded, &options(0.4, None), |telemetry| {
        if telemetry.tick == 123 {
            telemetry.devices[1].wrench.force = Vec3::new(0.0, -47.0, 0.0);
        }
    })?;
    let spiked = |frame: &&Frame| frame.folded.hands[1].force_norm.most == 47.0;
    let found: Vec<_> = frames.iter().filter(spiked).collect();
    assert_eq!(found.len(), 1);
    let folded = &found[0].folded;
    assert!((folded.first..=folded.last).contains(&123));
    assert_eq!(folded.hands[1].force[1].least, -47.0);
    assert!(folded.hands[0].force_norm.most < 47.0);
    // The frame shows its last tick, which is another one; the peak stays in the totals.
    assert!(found[0].hands[1].force[1] > -47.0);
    assert!(found[0].hands[1].peak_force == 47.0);
    Ok(())
}

#[test]
fn a_log_gives_the_frames_of_its_run() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let (frames, _) = frames_of(&loaded, &options(0.4, Some(path.clone())), |_| {})?;
    let mut gatherer = Gatherer::new(&loaded, Clock::Virtual);
    let mut played = Vec::new();
    let rows: Vec<TickRow> = read_log(&std::fs::read(&path)?)?;
    for row in &rows {
        gatherer.take(&TickView::from(row));
        if (row.tick + 1).is_multiple_of(TICKS) {
            played.push(gatherer.frame());
        }
    }
    played.push(gatherer.last_frame());
    assert_eq!(played, frames);
    Ok(())
}
