//! The errors of playing a log.

use host::log::index::IndexError;
use host::scene::SceneError;
use std::io;

/// Why a log cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum PlayerError {
    /// The file cannot be opened.
    #[error("cannot open the log {log}: {source}")]
    Open {
        /// The log, as messages name it.
        log: String,
        /// The system's error.
        source: io::Error,
    },
    /// The file is no log, or is damaged.
    #[error("cannot play the log {log}: {source}")]
    Read {
        /// The log, as messages name it.
        log: String,
        /// What is wrong, with its place.
        source: IndexError,
    },
    /// This version does not take the scene of the log.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The log has no ticks.
    #[error(
        "cannot play the log {log}: it has no ticks; the run ended before its log was first written"
    )]
    Empty {
        /// The log, as messages name it.
        log: String,
    },
    /// The log cannot be read further.
    #[error(transparent)]
    Further(#[from] IndexError),
}
