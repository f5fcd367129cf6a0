//! The taps of a run: each may copy the state of the bodies after a host step.
//!
//! No tap changes the state of the run.

use super::frames::FrameTap;
use super::log_frames::LogTap;
use super::tears::TearTap;
use crate::engine::Engine;
use crate::run::view::HostView;

/// The taps of a run. By default there are none.
#[derive(Default)]
pub struct Taps {
    /// Takes frames of the bodies as meshes.
    pub frames: Option<FrameTap>,
    /// Takes frames of the bodies for the log.
    pub log_frames: Option<LogTap>,
    /// Passes on the edits of tears; `None` if no body tears.
    pub tears: Option<TearTap>,
    /// Shows the bodies to viewers.
    pub view: Option<HostView>,
}

impl Taps {
    /// Gives every tap the state of `engine` after the step that was due at `time_ns`. `skipped` is the number of steps
    /// that the host left out so far.
    pub(super) fn after_step(&mut self, time_ns: u64, skipped: u64, engine: &Engine) {
        if let Some(frames) = &mut self.frames {
            frames.after_step(time_ns, engine.bodies());
        }
        if let Some(frames) = &mut self.log_frames {
            frames.after_step(time_ns, engine.stats().steps, engine.bodies());
        }
        if let Some(tears) = &mut self.tears {
            tears.after_step(time_ns, engine.stats().steps, engine.bodies());
        }
        if let Some(view) = &mut self.view {
            view.slot.after_step(time_ns, skipped, engine);
        }
    }
}
