//! Frames of a run: the deformed bodies as files for ParaView, at a rate of the run's own time.
//!
//! After a step, the host copies positions and velocities into one of a few buffers; a thread of its own computes
//! stresses and writes the files. Under the real clock the host never waits: it leaves out a frame that finds no free
//! buffer, and the summary reports how many. Under virtual time the host waits, and every frame is there.

use super::Clock;
use super::RunError;
use super::parts::Parts;
use crate::atomic_file::AtomicFileError;
use crate::engine::body::HostBody;
use crate::engine::tears;
use crate::live::torn::vertex_room;
use crate::run::panics;
use crate::scene::Scene;
use crate::solve::frames::FrameFolder;
use crate::solve::{Frame, snapshot};
use crate::world::{Built, World};
use physics::topology::Edit;
use physics::{BodyError, TearingError, Vec3};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Frames that may wait for the writer.
const WAITING: usize = 8;

/// Which frames of a run are written, and where.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameOptions {
    /// The folder; it may be new.
    pub folder: PathBuf,
    /// Frames a second of the run's own time (Hz).
    pub rate: f64,
}

/// A rate of frames that a run cannot have.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "{option}: found {found}, allowed: a number above 0 and up to host.step_rate, which is {most} (Hz)"
)]
pub struct FrameRateError {
    /// The option that gives the rate.
    pub option: &'static str,
    /// The rate found (Hz).
    pub found: f64,
    /// The largest rate (Hz): that of the host's steps.
    pub most: f64,
}

impl FrameOptions {
    /// The path of the list, the file to open in ParaView.
    pub fn list_file(&self) -> PathBuf {
        FrameFolder::list_in(&self.folder)
    }

    /// Checks the rate.
    ///
    /// # Errors
    /// [`FrameRateError`] for a rate that is not above zero, or above the rate of the scene's host steps.
    pub fn check(&self, scene: &Scene) -> Result<(), FrameRateError> {
        FrameRateError::check("--frames", self.rate, scene)
    }
}

impl FrameRateError {
    /// Checks the rate that `option` gives.
    pub(super) fn check(option: &'static str, found: f64, scene: &Scene) -> Result<(), Self> {
        let most = scene.host.step_rate;
        if found > 0.0 && found <= most {
            Ok(())
        } else {
            Err(Self {
                option,
                found,
                most,
            })
        }
    }
}

/// The state of all bodies at one time.
#[derive(Default)]
struct Moment {
    number: usize,
    time_ns: u64,
    /// By body.
    bodies: Vec<BodyMoment>,
}

/// The state of one body at one time.
#[derive(Default)]
struct BodyMoment {
    /// Positions (m).
    positions: Vec<Vec3>,
    /// Velocities (m/s).
    velocities: Vec<Vec3>,
    /// The edits by which the body has torn since the frame before.
    edits: Vec<Edit>,
}

impl Moment {
    /// A moment with room for `bodies`.
    fn with_room(bodies: &[HostBody]) -> Self {
        let bodies = bodies.iter().map(|body| {
            let room = vertex_room(body.body());
            BodyMoment {
                positions: Vec::with_capacity(room),
                velocities: Vec::with_capacity(room),
                // Every edit adds a vertex.
                edits: Vec::with_capacity(room - body.body().vertex_count()),
            }
        });
        Self {
            bodies: bodies.collect(),
            ..Self::default()
        }
    }
}

/// Frames that are missing, by reason.
#[derive(Default)]
pub(super) struct Missing {
    /// The writer had not written the frames before.
    pub(super) unwritten: AtomicU64,
    /// The host made no step in their time.
    pub(super) skipped: AtomicU64,
}

impl Missing {
    /// Counts a frame that found no free buffer.
    pub(super) fn count_unwritten(&self) {
        // Relaxed: the counts are read after the host's thread has ended.
        self.unwritten.fetch_add(1, Ordering::Relaxed);
    }
}

/// The times at which frames are due.
pub(super) struct Schedule {
    /// Frames a second (Hz).
    rate: f64,
    /// Number of the next frame.
    next: usize,
}

impl Schedule {
    /// Frames at `rate` (Hz), the first at time zero.
    pub(super) fn new(rate: f64) -> Self {
        Self { rate, next: 0 }
    }

    /// Time of a frame (ns), computed as the pacer computes the times of the steps.
    fn time_ns(&self, number: usize) -> u64 {
        (number as f64 * 1e9 / self.rate) as u64
    }

    /// The number of the frame that is due after a step at `time_ns`, if one is. Frames for which the host made no step
    /// are counted as missing.
    pub(super) fn due(&mut self, time_ns: u64, missing: &Missing) -> Option<usize> {
        if time_ns < self.time_ns(self.next) {
            return None;
        }
        // Relaxed: the counts are read after the host's thread has ended.
        while self.time_ns(self.next + 1) <= time_ns {
            self.next += 1;
            missing.skipped.fetch_add(1, Ordering::Relaxed);
        }
        let number = self.next;
        self.next += 1;
        Some(number)
    }
}

/// The host's end: takes a frame after a step.
pub struct FrameTap {
    schedule: Schedule,
    /// By body: the number of edits in the frames so far.
    edits: Vec<usize>,
    filled: SyncSender<Moment>,
    free: Receiver<Moment>,
    /// Whether the host waits for a free buffer.
    waits: bool,
    missing: Arc<Missing>,
}

impl FrameTap {
    /// Takes a frame if one is due by `time_ns`, the time of the step just done.
    pub(super) fn after_step(&mut self, time_ns: u64, bodies: &[HostBody]) {
        let Some(number) = self.schedule.due(time_ns, &self.missing) else {
            return;
        };
        let buffer = if self.waits {
            self.free.recv().ok()
        } else {
            self.free.try_recv().ok()
        };
        let Some(mut moment) = buffer else {
            self.missing.count_unwritten();
            return;
        };
        moment.number = number;
        moment.time_ns = time_ns;
        moment.bodies.resize_with(bodies.len(), Default::default);
        let copies = moment.bodies.iter_mut().zip(&mut self.edits);
        for ((copy, known), body) in copies.zip(bodies) {
            copy.positions.clear();
            copy.positions.extend(body.body().positions());
            copy.velocities.clear();
            copy.velocities.extend(body.body().velocities());
            copy.edits.clear();
            let journal = body.tears().map(|tears| tears.tearing().journal());
            let newer = journal.and_then(|journal| journal.get(*known..));
            let newer = newer.unwrap_or_default();
            copy.edits.extend(newer);
            *known += newer.len();
        }
        // There are as many places as buffers, so that this never waits. It fails after the writer has failed.
        let _ = self.filled.try_send(moment);
    }
}

/// The thread that writes frames.
pub(super) struct FrameWriter {
    thread: JoinHandle<Written>,
    missing: Arc<Missing>,
    list: PathBuf,
}

/// What the writer wrote.
#[derive(Default)]
struct Written {
    frames: u64,
    failure: Option<FrameError>,
}

#[derive(Debug, thiserror::Error)]
enum FrameError {
    #[error(transparent)]
    File(#[from] AtomicFileError),
    #[error("a frame cannot be drawn: {0}")]
    Body(#[from] BodyError),
    #[error("a frame cannot be drawn: {0}")]
    Tear(#[from] TearingError),
}

impl FrameWriter {
    /// Locks the folder, begins the thread and takes the first frame, that of `bodies` before the run.
    ///
    /// # Errors
    /// A rate that is not allowed, a folder that cannot be written, or no thread.
    pub(super) fn begin(
        world: &World<'_>,
        options: &FrameOptions,
        clock: Clock,
        bodies: &[HostBody],
    ) -> Result<(FrameTap, Self), RunError> {
        let scene = &world.loaded.scene;
        options.check(scene)?;
        // The writer has bodies of its own, in whose elements it computes stresses.
        let mut built = world.bodies.clone();
        for (index, built) in built.iter_mut().enumerate() {
            tears::make_tearable(world, index, &mut built.body)?;
        }
        let names = scene.bodies.iter().map(|body| body.name.as_str());
        let folder = FrameFolder::create(&options.folder, names)?;
        let list = folder.list_file();
        let (filled, frames) = sync_channel(WAITING);
        let (returned, free) = sync_channel(WAITING);
        for _ in 0..WAITING {
            // The channel has as many places.
            let _ = returned.try_send(Moment::with_room(bodies));
        }
        let names = scene.bodies.iter().map(|body| body.name.clone());
        let drawn = Drawn {
            rest: built
                .iter()
                .map(|built| built.body.positions().collect())
                .collect(),
            built,
            names: names.collect(),
            folder,
        };
        let thread = std::thread::Builder::new()
            .stack_size(runner::STACK)
            .name("palpate-frames".into())
            .spawn(move || drawn.write(&frames, &returned))
            .map_err(RunError::Thread)?;
        let missing = Arc::<Missing>::default();
        let mut tap = FrameTap {
            schedule: Schedule::new(options.rate),
            edits: vec![0; bodies.len()],
            filled,
            free,
            waits: clock == Clock::Virtual,
            missing: Arc::clone(&missing),
        };
        tap.after_step(0, bodies);
        Ok((
            tap,
            Self {
                thread,
                missing,
                list,
            },
        ))
    }

    /// Waits for the last frames, after the tap has ended, and adds to `parts` what went wrong.
    pub(super) fn finish(self, parts: &mut Parts) {
        let written = self.thread.join();
        let list = self.list.display();
        let frames = match written {
            Ok(Written { frames, failure }) => {
                if let Some(failure) = failure {
                    let what = format!("the frames ended early: {failure}");
                    parts.failures.push(what);
                    parts.unwritten.push(self.list.clone());
                    // The other frames are missing for this reason, not for want of time.
                    return;
                }
                frames
            }
            Err(panic) => {
                let panic = panics::text(&*panic);
                let what = format!("the thread of the frames panicked: {panic}");
                parts.failures.push(what);
                return;
            }
        };
        let [unwritten, skipped] = [&self.missing.unwritten, &self.missing.skipped]
            .map(|count| count.load(Ordering::Relaxed));
        if unwritten + skipped > 0 {
            parts.degradations.push(format!(
                "{list} has {frames} frames and lacks {}: {unwritten} because the writing took longer than the run, \
                 {skipped} because the host left out steps",
                unwritten + skipped
            ));
        }
    }
}

/// The writer's own bodies, which take the state of each frame.
struct Drawn {
    built: Vec<Built>,
    /// By body: the positions at rest (m).
    rest: Vec<Vec<Vec3>>,
    names: Vec<String>,
    folder: FrameFolder,
}

impl Drawn {
    /// Writes frames until the tap ends or a frame cannot be written.
    fn write(mut self, frames: &Receiver<Moment>, returned: &SyncSender<Moment>) -> Written {
        let mut written = Written::default();
        let mut done = Ok(());
        while let Ok(moment) = frames.recv() {
            done = self.write_one(&moment);
            if done.is_err() {
                break;
            }
            written.frames += 1;
            // The tap may have ended.
            let _ = returned.try_send(moment);
        }
        written.failure = done.err();
        written
    }

    fn write_one(&mut self, moment: &Moment) -> Result<(), FrameError> {
        for (index, moved) in moment.bodies.iter().enumerate() {
            let built = &mut self.built[index];
            for edit in &moved.edits {
                built.body.edit(edit)?;
            }
            built.body.set_positions(&moved.positions)?;
            built.body.set_velocities(&moved.velocities)?;
            self.folder.keep(&Frame {
                body: &self.names[index],
                number: moment.number,
                at: moment.time_ns as f64 / 1e9,
                snapshot: snapshot::of_body(built, &self.rest[index], true),
            })?;
        }
        Ok(())
    }
}
