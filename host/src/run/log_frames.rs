//! Frames of the bodies in the log, at a rate of the run's own time.
//!
//! After a step, the host copies the positions, rounded to `f32`, into a buffer, and the log takes the buffer before the
//! next tick. Under the real clock the host never waits: it leaves out a frame that finds no free buffer, and the
//! summary reports how many. Under virtual time a further buffer is made, and every frame is in the log.

use super::Clock;
use super::frames::{FrameRateError, Missing, Schedule};
use crate::engine::body::HostBody;
use crate::live::torn::{TornSurface, vertex_room};
use crate::log::{LogError, LogWriter};
use crate::record::BodyFrame;
use crate::record::Surface;
use crate::scene::Scene;
use crate::world::World;
use physics::mesh::Mesh;
use std::io::{Seek, Write};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};

/// Time that the log may take between two looks at its frames (s): ten of its periods under the real clock.
const PATIENCE: f64 = 0.2;
/// Least number of frames that may wait for the log.
const WAITING: usize = 8;

/// Checks the rate of the frames in the log (Hz).
///
/// # Errors
/// [`FrameRateError`] for a rate that is not above zero, or above the rate of the scene's host steps.
pub fn check_rate(rate: f64, scene: &Scene) -> Result<(), FrameRateError> {
    FrameRateError::check("--log-frames", rate, scene)
}

/// The state of all bodies after a step.
#[derive(Debug, Default)]
struct Moment {
    bodies: Vec<BodyMoment>,
}

/// The state of one body.
#[derive(Debug, Default)]
struct BodyMoment {
    frame: BodyFrame,
    positions: Vec<f32>,
    /// The surface, where this is the first frame of a topology epoch and no tear began it.
    surface: Option<Surface>,
    /// The surface, where a tear has grown since the frame before.
    torn: TornSurface,
}

impl Moment {
    /// A moment with room for `bodies`.
    fn with_room(bodies: &[HostBody]) -> Self {
        let bodies = bodies.iter().enumerate().map(|(index, body)| BodyMoment {
            positions: Vec::with_capacity(3 * vertex_room(body.body())),
            torn: TornSurface::new(index, body.body()),
            ..BodyMoment::default()
        });
        Self {
            bodies: bodies.collect(),
        }
    }
}

/// How the host passes a moment to the log.
enum Filled {
    Bounded(SyncSender<Moment>),
    Unbounded(Sender<Moment>),
}

/// The host's end: takes a frame after a step.
pub struct LogTap {
    schedule: Schedule,
    /// By body: the mesh, of which surfaces are made, and the topology epoch of the last surface.
    meshes: Vec<(Mesh, Option<u64>)>,
    filled: Filled,
    free: Receiver<Moment>,
    missing: Arc<Missing>,
}

/// The log's end.
pub(super) struct LogFrames {
    frames: Receiver<Moment>,
    returned: SyncSender<Moment>,
    missing: Arc<Missing>,
    written: u64,
}

/// The two ends for frames at `rate` (Hz), with the first frame, that of `bodies` before the run.
pub(super) fn begin(
    world: &World<'_>,
    rate: f64,
    clock: Clock,
    bodies: &[HostBody],
) -> (LogTap, LogFrames) {
    let built = world.bodies.iter();
    let meshes = built.map(|built| (built.mesh.clone(), None)).collect();
    let waiting = WAITING.max((PATIENCE * rate) as usize);
    let (filled, frames) = match clock {
        Clock::Virtual => {
            let (filled, frames) = channel();
            (Filled::Unbounded(filled), frames)
        }
        Clock::Real => {
            let (filled, frames) = sync_channel(waiting);
            (Filled::Bounded(filled), frames)
        }
    };
    let (returned, free) = sync_channel(waiting);
    for _ in 0..waiting {
        // The channel has as many places.
        let _ = returned.try_send(Moment::with_room(bodies));
    }
    let missing = Arc::<Missing>::default();
    let mut tap = LogTap {
        schedule: Schedule::new(rate),
        meshes,
        filled,
        free,
        missing: Arc::clone(&missing),
    };
    tap.after_step(0, 0, bodies);
    let log = LogFrames {
        frames,
        returned,
        missing,
        written: 0,
    };
    (tap, log)
}

impl LogTap {
    /// Takes a frame if one is due by `time_ns`, the due time of the step just done, which has the number `step`.
    pub(super) fn after_step(&mut self, time_ns: u64, step: u64, bodies: &[HostBody]) {
        if self.schedule.due(time_ns, &self.missing).is_none() {
            return;
        }
        let buffer = match (self.free.try_recv(), &self.filled) {
            (Ok(buffer), _) => buffer,
            (Err(_), Filled::Unbounded(_)) => Moment::default(),
            (Err(_), Filled::Bounded(_)) => {
                self.missing.count_unwritten();
                return;
            }
        };
        let mut moment = buffer;
        moment.bodies.resize_with(bodies.len(), Default::default);
        let copies = moment.bodies.iter_mut().zip(&mut self.meshes);
        for ((index, body), (copy, (mesh, drawn))) in (0..).zip(bodies).zip(copies) {
            let (body, epoch) = (body.body(), body.body().epoch());
            copy.frame = BodyFrame {
                body: index,
                step,
                time_ns,
                epoch: epoch as u32,
            };
            copy.positions.clear();
            copy.positions.extend(
                body.positions()
                    .flat_map(|p| [p.x as f32, p.y as f32, p.z as f32]),
            );
            copy.surface = None;
            copy.torn.clear();
            if *drawn != Some(epoch) {
                *drawn = Some(epoch);
                if copy.torn.copy(index as usize, body) {
                    continue;
                }
                copy.surface = Some(Surface::of_mesh(index as usize, epoch, mesh));
            }
        }
        // There are as many places as buffers, so that this never waits. It fails after the log has ended.
        match &self.filled {
            Filled::Bounded(filled) => drop(filled.try_send(moment)),
            Filled::Unbounded(filled) => drop(filled.send(moment)),
        }
    }
}

impl LogFrames {
    /// Writes the frames that the host has taken since the last call. Without a log, the frames are dropped.
    pub(super) fn write<W: Write + Seek>(
        &mut self,
        mut log: Option<&mut LogWriter<W>>,
    ) -> Result<(), LogError> {
        while let Ok(moment) = self.frames.try_recv() {
            if let Some(log) = &mut log {
                for body in &moment.bodies {
                    if let Some(surface) = body.torn.fresh().or(body.surface.as_ref()) {
                        log.write_surface(surface, body.frame.time_ns)?;
                    }
                    log.write_frame(&body.frame, &body.positions)?;
                }
                self.written += 1;
            }
            // The tap may have ended.
            let _ = self.returned.try_send(moment);
        }
        Ok(())
    }

    /// What to say of frames that the log lacks; `None` if it has them all.
    pub(super) fn lacks(&self) -> Option<String> {
        let [unwritten, skipped] = [&self.missing.unwritten, &self.missing.skipped]
            .map(|count| count.load(Ordering::Relaxed));
        (unwritten + skipped > 0).then(|| {
            format!(
                "the log has {} frames of the bodies and lacks {}: {unwritten} because the log was not written as fast \
                 as the run, {skipped} because the host left out steps",
                self.written,
                unwritten + skipped
            )
        })
    }
}
