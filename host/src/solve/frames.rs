//! Frames of a solve or a run as files for ParaView: one VTU file per body and frame, and a PVD file that lists them.

use super::Frame;
use crate::atomic_file::{AtomicFileError, write_atomically};
use std::fmt::Write as _;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

const LIST: &str = "frames.pvd";

/// A folder of frames. The list is written again with each frame, so that it is complete whenever the solve ends. No
/// other program can open the folder for its frames at the same time.
#[derive(Debug)]
pub struct FrameFolder {
    folder: PathBuf,
    list: String,
    /// The folder, open and locked.
    _lock: Option<File>,
}

impl FrameFolder {
    /// Creates the folder, if it does not exist.
    ///
    /// # Errors
    /// If the folder cannot be created, or another program writes its frames there.
    pub fn create(folder: &Path) -> Result<Self, AtomicFileError> {
        let locked = fs::create_dir_all(folder).and_then(|()| lock(folder));
        let lock = locked.map_err(|source| AtomicFileError {
            path: folder.to_owned(),
            source,
        })?;
        Ok(Self {
            folder: folder.to_owned(),
            list: String::new(),
            _lock: lock,
        })
    }

    /// Whether a solve of bodies of these names may write a file of the name `file`.
    pub fn may_write<'a>(file: &str, bodies: impl IntoIterator<Item = &'a str>) -> bool {
        let numbered = file.strip_suffix(".vtu").and_then(|f| f.rsplit_once('_'));
        let frame = numbered.filter(|(_, number)| {
            number.len() >= 4 && number.bytes().all(|byte| byte.is_ascii_digit())
        });
        file == LIST
            || frame.is_some_and(|(body, _)| bodies.into_iter().any(|name| plain(name) == body))
    }

    /// Writes one frame and the list.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn keep(&mut self, frame: &Frame<'_>) -> Result<(), AtomicFileError> {
        self.add(frame)?;
        self.write_list()
    }

    /// Writes one frame. The list does not name it before [`write_list`](Self::write_list).
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn add(&mut self, frame: &Frame<'_>) -> Result<(), AtomicFileError> {
        let file = format!("{}_{:04}.vtu", plain(frame.body), frame.number);
        write_atomically(&self.folder.join(&file), frame.snapshot.vtu().as_bytes())?;
        let _ = writeln!(
            self.list,
            "<DataSet timestep=\"{:?}\" part=\"0\" file=\"{file}\"/>",
            frame.at
        );
        Ok(())
    }

    /// Writes the list of the frames so far.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_list(&self) -> Result<(), AtomicFileError> {
        let list = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n\
             {}</Collection>\n</VTKFile>\n",
            self.list
        );
        write_atomically(&self.list_file(), list.as_bytes())
    }

    /// The path of the list, the file to open in ParaView.
    pub fn list_file(&self) -> PathBuf {
        Self::list_in(&self.folder)
    }

    /// The path of the list of the frames in `folder`.
    pub(crate) fn list_in(folder: &Path) -> PathBuf {
        folder.join(LIST)
    }
}

/// Locks a folder. There is no lock where the system has none for folders.
fn lock(folder: &Path) -> io::Result<Option<File>> {
    let Ok(open) = File::open(folder) else {
        return Ok(None);
    };
    match open.try_lock() {
        Ok(()) => Ok(Some(open)),
        Err(TryLockError::WouldBlock) => Err(io::Error::new(
            io::ErrorKind::ResourceBusy,
            "another program is writing its frames there; give each solve a folder of its own",
        )),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

/// The name with every character replaced that might not be allowed in the name of a file.
fn plain(name: &str) -> String {
    let keep = |c: char| {
        if c.is_alphanumeric() || c == '-' {
            c
        } else {
            '_'
        }
    };
    name.chars().map(keep).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_names_of_the_files_are_known() {
        let bodies = ["cube", "left hand"];
        for name in ["frames.pvd", "cube_0001.vtu", "left_hand_12345.vtu"] {
            assert!(FrameFolder::may_write(name, bodies), "{name}");
        }
        for name in [
            "cube.vtu",
            "cube_001.vtu",
            "cube_0001.vtk",
            "ball_0001.vtu",
            "cube_000x.vtu",
        ] {
            assert!(!FrameFolder::may_write(name, bodies), "{name}");
        }
    }

    #[test]
    fn a_folder_has_one_writer() {
        let folder = tempfile::tempdir().expect("a folder");
        let held = FrameFolder::create(folder.path()).expect("a folder");
        let second = FrameFolder::create(folder.path()).expect_err("one writer");
        let said = second.to_string();
        assert!(
            said.contains("another program is writing its frames there"),
            "{said}"
        );
        drop(held);
        assert!(FrameFolder::create(folder.path()).is_ok());
    }
}
