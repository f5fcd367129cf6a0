//! A socket that accepts viewers.

use super::address;
use rustix::io::Errno;
use rustix::net::{
    AddressFamily, SocketAddrUnix, SocketFlags, SocketType, bind, connect, listen, socket_with,
};
use std::fs;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

/// Connections that may wait to be accepted.
const BACKLOG: i32 = 128;

/// Why a run cannot be watched.
#[derive(Debug, thiserror::Error)]
pub enum SocketError {
    /// The folder of the socket cannot be made or read.
    #[error("cannot use the folder {} for the socket of viewers: {source}", .folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The folder of the socket is not safe.
    #[error(
        "cannot use the folder {} for the socket of viewers: found owner {owner} and mode {mode:03o}, allowed: a folder \
         of this user that nobody else can write; give another path with --view=SOCKET", .folder.display()
    )]
    NotOurs {
        /// The folder.
        folder: PathBuf,
        /// The user to whom it belongs.
        owner: u32,
        /// Its mode.
        mode: u32,
    },
    /// Another run has the socket.
    #[error(
        "the socket {} belongs to another run that goes on; give this run another path with --view=SOCKET", .path.display()
    )]
    Live {
        /// The path.
        path: PathBuf,
    },
    /// There is a file that is no socket.
    #[error(
        "the file {} is no socket and is not replaced; give another path with --view=SOCKET", .path.display()
    )]
    NoSocket {
        /// The path.
        path: PathBuf,
    },
    /// The socket cannot be made.
    #[error("cannot make the socket {} for viewers: {source}", .path.display())]
    Bind {
        /// The path.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The thread of the server cannot start.
    #[error("the system gave no thread for viewers: {0}")]
    Thread(io::Error),
}

/// A socket that accepts viewers: those of the owner and of the group of this process. Removes its file when it is dropped.
#[derive(Debug)]
pub struct Listener {
    inner: UnixListener,
    path: PathBuf,
    /// Device and number of the file, so that only this listener's own file is removed.
    file: (u64, u64),
}

impl Listener {
    /// Listens at `path`, or at this process's own path if none is given. The socket of a process that has ended is
    /// replaced.
    ///
    /// # Errors
    /// [`SocketError`], also if another process listens at `path`.
    pub fn bind(path: Option<&Path>) -> Result<Self, SocketError> {
        let path = if let Some(path) = path {
            path.to_owned()
        } else {
            let path = address::of_this_process();
            if let Some(folder) = path.parent() {
                address::prepare(folder)?;
            }
            path
        };
        make_room(&path)?;
        match make(&path) {
            Ok((inner, file)) => Ok(Self { inner, path, file }),
            Err(source) => Err(SocketError::Bind { path, source }),
        }
    }

    /// The path of the socket.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Accepts a viewer; `None` if none waits. Nothing can be read from the viewer, and writing to it never blocks.
    ///
    /// # Errors
    /// The system's error, such as too many open files.
    pub(super) fn accept(&self) -> io::Result<Option<UnixStream>> {
        match self.inner.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(true)?;
                // Fails if the viewer has already gone, and then the first write fails, too.
                let _ = stream.shutdown(std::net::Shutdown::Read);
                Ok(Some(stream))
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(None),
            Err(error) => Err(error),
        }
    }
}

impl AsFd for Listener {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.inner.as_fd()
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        let data = fs::symlink_metadata(&self.path);
        if data.is_ok_and(|data| (data.dev(), data.ino()) == self.file) {
            // Nobody can be told.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Mode of the socket: connecting needs the right to write.
const MODE: u32 = 0o660;

/// A socket, and device and number of its file. Nobody can connect before the mode is set.
fn make(path: &Path) -> io::Result<(UnixListener, (u64, u64))> {
    let socket = socket()?;
    bind(&socket, &SocketAddrUnix::new(path)?)?;
    fs::set_permissions(path, fs::Permissions::from_mode(MODE))?;
    let data = fs::symlink_metadata(path)?;
    listen(&socket, BACKLOG)?;
    Ok((socket.into(), (data.dev(), data.ino())))
}

fn socket() -> Result<OwnedFd, Errno> {
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)
}

/// Removes the socket of a process that has ended.
fn make_room(path: &Path) -> Result<(), SocketError> {
    let Ok(data) = fs::symlink_metadata(path) else {
        return Ok(());
    };
    if !data.file_type().is_socket() {
        return Err(SocketError::NoSocket {
            path: path.to_owned(),
        });
    }
    // A socket that does not wait: a stopped process accepts nobody, and its backlog may be full.
    match SocketAddrUnix::new(path).and_then(|address| connect(socket()?, &address)) {
        Err(Errno::CONNREFUSED) => {
            // Another run may have removed the file at the same time.
            let _ = fs::remove_file(path);
            Ok(())
        }
        Err(Errno::NOENT) => Ok(()),
        _ => Err(SocketError::Live {
            path: path.to_owned(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::error::Error;

    #[test]
    fn only_the_socket_of_a_dead_process_is_replaced() -> Result<(), Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("run.sock");
        let first = Listener::bind(Some(&path))?;
        assert_eq!(path.metadata()?.mode() & 0o777, 0o660);
        let second = Listener::bind(Some(&path));
        assert!(
            matches!(second, Err(SocketError::Live { .. })),
            "{second:?}"
        );
        drop(first);
        assert!(!path.exists());

        // A process that is killed leaves its file.
        drop(UnixListener::bind(&path)?);
        assert!(path.exists());
        let listener = Listener::bind(Some(&path))?;
        assert!(listener.accept()?.is_none());

        // The file of another listener stays.
        fs::remove_file(&path)?;
        let other = UnixListener::bind(&path)?;
        drop(listener);
        assert!(path.exists());
        drop(other);

        fs::remove_file(&path)?;
        fs::write(&path, "text")?;
        let refused = Listener::bind(Some(&path));
        assert!(
            matches!(refused, Err(SocketError::NoSocket { .. })),
            "{refused:?}"
        );
        assert_eq!(fs::read_to_string(&path)?, "text");

        let long = folder.path().join("x".repeat(108));
        let refused = Listener::bind(Some(&long));
        assert!(
            matches!(refused, Err(SocketError::Bind { .. })),
            "{refused:?}"
        );
        Ok(())
    }
}
