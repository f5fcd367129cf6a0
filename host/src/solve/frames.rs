//! Frames of a solve as files for ParaView: one VTU a body and frame, and a PVD file that lists them.

use super::Frame;
use crate::atomic_file::{AtomicFileError, write_atomically};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// A folder of frames. The list is written anew with each frame, so that it holds what is there whenever
/// the solve ends.
#[derive(Debug)]
pub struct FrameFolder {
    folder: PathBuf,
    list: String,
}

impl FrameFolder {
    /// Makes the folder, if there is none.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn create(folder: &Path) -> Result<Self, AtomicFileError> {
        fs::create_dir_all(folder).map_err(|source| AtomicFileError {
            path: folder.to_owned(),
            source,
        })?;
        Ok(Self {
            folder: folder.to_owned(),
            list: String::new(),
        })
    }

    /// Keeps one frame.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn keep(&mut self, frame: &Frame<'_>) -> Result<(), AtomicFileError> {
        let file = format!("{}_{:04}.vtu", plain(frame.body), frame.number);
        write_atomically(&self.folder.join(&file), frame.snapshot.vtu().as_bytes())?;
        let _ = writeln!(
            self.list,
            "<DataSet timestep=\"{:?}\" part=\"0\" file=\"{file}\"/>",
            frame.at
        );
        let list = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n\
             {}</Collection>\n</VTKFile>\n",
            self.list
        );
        write_atomically(&self.list_file(), list.as_bytes())
    }

    /// The list: what to open in ParaView.
    pub fn list_file(&self) -> PathBuf {
        self.folder.join("frames.pvd")
    }
}

/// A name as part of a file's name.
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
