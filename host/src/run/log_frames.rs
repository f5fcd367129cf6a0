//! Frames of the bodies in the log, at a rate of the run's own time.
//!
//! The log takes the [snapshots](crate::snapshot) of the steps before the next tick, and rounds the positions to `f32`.
//! Under the real clock the host never waits: it leaves out a frame that finds no free buffer, and the summary reports
//! how many. Under virtual time a further buffer is made, and every frame is in the log.

use super::Clock;
use super::frames::FrameRateError;
use crate::engine::Engine;
use crate::log::{LogError, LogWriter};
use crate::record::{BodyFrame, Cloud, Surface};
use crate::scene::Scene;
use crate::snapshot::{Contents, Policy, Reader, Schedule, Snapshot, Subscriber, When};
use crate::world::World;
use physics::mesh::Mesh;
use std::io::{Seek, Write};
use std::time::Instant;

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

/// The log's end: writes the frames.
pub(super) struct LogFrames {
    snapshots: Reader,
    /// By body: the mesh from which surfaces are made, and the topology epoch of the last surface.
    meshes: Vec<(Mesh, Option<u32>)>,
    /// The present positions as the log has them. The buffer is kept for its capacity.
    cloud: Cloud,
    written: u64,
}

/// The two ends for frames at `rate` (Hz), with the first frame, that of `engine` before the run.
pub(super) fn begin(
    world: &World<'_>,
    rate: f64,
    clock: Clock,
    engine: &Engine,
) -> (Subscriber, LogFrames) {
    let policy = match clock {
        Clock::Virtual => Policy::Grow,
        Clock::Real => Policy::Skip,
    };
    let waiting = WAITING.max((PATIENCE * rate) as usize);
    let when = When::Series(Schedule::new(rate));
    let (mut subscriber, snapshots) =
        Subscriber::new(engine, when, Contents::Surfaces, (policy, waiting));
    subscriber.after_step(Instant::now(), 0, 0, engine);
    let built = world.bodies.iter();
    let log = LogFrames {
        snapshots,
        meshes: built.map(|built| (built.mesh.clone(), None)).collect(),
        cloud: Cloud::default(),
        written: 0,
    };
    (subscriber, log)
}

impl LogFrames {
    /// Writes the frames that the host has taken since the last call. Without a log, the frames are dropped.
    pub(super) fn write<W: Write + Seek>(
        &mut self,
        mut log: Option<&mut LogWriter<W>>,
    ) -> Result<(), LogError> {
        while let Some(snapshot) = self.snapshots.try_next() {
            if let Some(log) = &mut log {
                self.write_one(&snapshot, log)?;
                self.written += 1;
            }
            self.snapshots.give_back(snapshot);
        }
        Ok(())
    }

    /// Writes a frame. The first of each topology epoch begins with the surface.
    fn write_one<W: Write + Seek>(
        &mut self,
        snapshot: &Snapshot,
        log: &mut LogWriter<W>,
    ) -> Result<(), LogError> {
        let time_ns = snapshot.time_ns;
        let bodies = snapshot.bodies.iter().zip(&mut self.meshes);
        for (index, (body, (mesh, drawn))) in bodies.enumerate() {
            if drawn.replace(body.epoch) != Some(body.epoch) {
                let mut surface = match body.torn.fresh() {
                    Some(torn) => torn.clone(),
                    None => Surface::of_mesh(index, u64::from(body.epoch), mesh),
                };
                log.write_record(surface.stamp(time_ns), &mut surface)?;
            }
            self.cloud.time_ns = time_ns;
            self.cloud.positions.clear();
            self.cloud.positions.extend(body.rounded());
            let mut frame = BodyFrame {
                body: index as u32,
                step: snapshot.step,
                time_ns,
                epoch: body.epoch,
            };
            let stamp = frame.stamp();
            log.write_record(stamp, &mut frame)?;
            log.write_record(stamp, &mut self.cloud)?;
        }
        Ok(())
    }

    /// The note about frames that the log lacks; `None` if the log has all frames.
    pub(super) fn lacks(&self) -> Option<String> {
        let [unwritten, skipped] = self.snapshots.missing().counts();
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
