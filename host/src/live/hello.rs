//! The facts of a run.

use super::frame::{BodyInfo, Hello, PROTOCOL};
use crate::log::LogHeader;
use crate::run::RunOptions;
use crate::scene::LoadedScene;

/// The facts of a run.
pub(super) fn of_run(loaded: &LoadedScene, header: &LogHeader, options: &RunOptions) -> Hello {
    Hello {
        protocol: PROTOCOL.into(),
        scene: loaded.scene.name.clone(),
        facts: header.facts.clone(),
        run: u64::from(std::process::id()),
        duration: options.duration.unwrap_or(loaded.scene.duration),
        scene_text: header.scene.clone(),
        bodies: loaded
            .scene
            .bodies
            .iter()
            .map(|body| BodyInfo {
                name: body.name.clone(),
                ..BodyInfo::default()
            })
            .collect(),
        files: header.files.clone(),
        ..Hello::default()
    }
}
