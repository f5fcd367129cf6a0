//! Frames of a run: the deformed bodies as files for ParaView, at a rate of the run's own time.
//!
//! A thread takes the [snapshots](crate::snapshot) of the steps, computes stresses and writes the files. Under the real
//! clock the host never waits: it leaves out a frame that finds no free buffer, and the summary reports how many. Under
//! virtual time the host waits, and every frame is there.

use super::Clock;
use super::RunError;
use super::observer::Observed;
use crate::atomic_file::AtomicFileError;
use crate::engine::{Engine, tears};
use crate::run::panics;
use crate::scene::Scene;
use crate::snapshot::{Contents, Missing, Policy, Reader, Schedule, Snapshot, Subscriber, When};
use crate::solve::frames::FrameFolder;
use crate::solve::{Frame, grid};
use crate::world::{Built, World};
use physics::motion::contacts::Pressed;
use physics::{BodyError, TearingError, Vec3};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Instant;

/// Frames that may wait for the writer.
const WAITING: usize = 8;

/// The choice of the frames of a run that are written, and their folder.
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
    /// Locks the folder, begins the thread and takes the first frame, that of `engine` before the run.
    ///
    /// # Errors
    /// A rate that is not allowed, a folder that cannot be written, or no thread.
    pub(super) fn begin(
        world: &World<'_>,
        options: &FrameOptions,
        clock: Clock,
        engine: &Engine,
    ) -> Result<(Subscriber, Self), RunError> {
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
        let policy = match clock {
            Clock::Virtual => Policy::Wait,
            Clock::Real => Policy::Skip,
        };
        let when = When::Series(Schedule::new(options.rate));
        let (mut subscriber, reader) =
            Subscriber::new(engine, when, Contents::Motion, (policy, WAITING));
        let missing = Arc::clone(reader.missing());
        let names = scene.bodies.iter().map(|body| body.name.clone());
        let drawn = Drawn {
            rest: built
                .iter()
                .map(|built| built.body.positions().collect())
                .collect(),
            built,
            names: names.collect(),
            touches: !world.contacts.is_empty(),
            folder,
        };
        let thread = std::thread::Builder::new()
            .stack_size(runner::STACK)
            .name("palpate-frames".into())
            .spawn(move || drawn.write(reader))
            .map_err(RunError::Thread)?;
        subscriber.after_step(Instant::now(), 0, 0, engine);
        let writer = Self {
            thread,
            missing,
            list,
        };
        Ok((subscriber, writer))
    }

    /// Waits for the last frames, after the subscriber has ended, and adds to `observed` what went wrong.
    pub(super) fn finish(self, observed: &mut Observed) {
        let written = self.thread.join();
        let list = self.list.display();
        let frames = match written {
            Ok(Written { frames, failure }) => {
                if let Some(failure) = failure {
                    let what = format!("the frames ended early: {failure}");
                    observed.failures.push(what);
                    observed.unwritten.push(self.list.clone());
                    // The other frames are missing for this reason, not for want of time.
                    return;
                }
                frames
            }
            Err(panic) => {
                let panic = panics::text(&*panic);
                let what = format!("the thread of the frames panicked: {panic}");
                observed.failures.push(what);
                return;
            }
        };
        let [unwritten, skipped] = self.missing.counts();
        if unwritten + skipped > 0 {
            observed.degradations.push(format!(
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
    /// Whether something may touch.
    touches: bool,
    folder: FrameFolder,
}

impl Drawn {
    /// Writes frames until the subscriber ends or a frame cannot be written.
    fn write(mut self, mut reader: Reader) -> Written {
        let mut written = Written::default();
        while let Some(snapshot) = reader.wait() {
            if let Err(failure) = self.write_one(&snapshot) {
                written.failure = Some(failure);
                break;
            }
            written.frames += 1;
            reader.give_back(snapshot);
        }
        written
    }

    fn write_one(&mut self, taken: &Snapshot) -> Result<(), FrameError> {
        for (index, moved) in taken.bodies.iter().enumerate() {
            let built = &mut self.built[index];
            for edit in &moved.edits {
                built.body.edit(edit)?;
            }
            built.body.set_positions(&moved.positions)?;
            built.body.set_velocities(&moved.velocities)?;
            let pressed = self.touches.then(|| moved.pressed.iter());
            let pressure = pressed.map(|pressed| pressed.map(Pressed::pressure).collect());
            self.folder.keep(&Frame {
                body: &self.names[index],
                number: taken.number,
                at: taken.time_ns as f64 / 1e9,
                grid: grid::of_body(built, &self.rest[index], true, pressure),
            })?;
        }
        Ok(())
    }
}
