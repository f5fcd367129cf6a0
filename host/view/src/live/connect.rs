//! Finds the socket of a run.

use super::stream::Stream;
use host::live::socket::address::{folders, sockets_in};
use std::fmt::Write;
use std::io;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};

/// Why a run cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// This user has no run that can be watched.
    #[error(
        "no run of this user can be watched (searched {}); start a run with `palpate run --view`, or name its socket \
         with --socket", list(.folders, " and ")
    )]
    NoRun {
        /// The folders that were searched.
        folders: Vec<PathBuf>,
    },
    /// No run has this socket.
    #[error("no run has the socket {}; start a run with `palpate run --view={}`", .path.display(), .path.display())]
    NoRunAt {
        /// The socket.
        path: PathBuf,
    },
    /// Several runs can be watched.
    #[error("found {} runs; choose one of them:{}", .sockets.len(), commands(.sockets))]
    Several {
        /// Their sockets, the newest first.
        sockets: Vec<PathBuf>,
    },
    /// The run is another user's.
    #[error(
        "permission denied for the socket {}: only the user who started the run, and that user's group, may watch", .path.display()
    )]
    Permission {
        /// The socket.
        path: PathBuf,
    },
    /// The socket cannot be used.
    #[error("cannot connect to the socket {}: {source}", .path.display())]
    Connect {
        /// The socket.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

fn list(paths: &[PathBuf], between: &str) -> String {
    let paths: Vec<_> = paths
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    paths.join(between)
}

fn commands(sockets: &[PathBuf]) -> String {
    sockets.iter().fold(String::new(), |mut text, path| {
        // Writing to memory cannot fail.
        let _ = write!(text, "\n  palpate view --socket {}", path.display());
        text
    })
}

/// Connects to the run at `socket`, or to the only run of this user.
pub(super) fn connect(socket: Option<&Path>) -> Result<Stream, LiveError> {
    match socket {
        Some(path) => at(path),
        None => only_one_in(folders()),
    }
}

/// Connects to the only run that has its socket in one of `folders`.
pub(super) fn only_one_in(folders: Vec<PathBuf>) -> Result<Stream, LiveError> {
    let mut live = Vec::new();
    for folder in &folders {
        let sockets = sockets_in(folder).map_err(|source| LiveError::Connect {
            path: folder.clone(),
            source,
        })?;
        for path in sockets {
            match at(&path) {
                Ok(stream) => live.push((path, stream)),
                // A run that was killed left its socket.
                Err(LiveError::NoRunAt { .. }) => {}
                Err(error) => return Err(error),
            }
        }
    }
    match live.len() {
        0 => Err(LiveError::NoRun { folders }),
        1 => live
            .pop()
            .map(|(_, stream)| stream)
            .ok_or(LiveError::NoRun { folders }),
        _ => Err(LiveError::Several {
            sockets: live.into_iter().map(|(path, _)| path).collect(),
        }),
    }
}

fn at(path: &Path) -> Result<Stream, LiveError> {
    let connected = UnixStream::connect(path).and_then(Stream::new);
    connected.map_err(|source| {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused => {
                LiveError::NoRunAt { path }
            }
            io::ErrorKind::PermissionDenied => LiveError::Permission { path },
            _ => LiveError::Connect { path, source },
        }
    })
}
