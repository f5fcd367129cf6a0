//! Frames of a solve as files for ParaView: one VTU file per body and frame, and a PVD file that lists them.

use super::Frame;
use crate::atomic_file::{AtomicFileError, write_atomically};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// A folder of frames. The list is written again with each frame, so that it is complete whenever the solve ends.
#[derive(Debug)]
pub struct FrameFolder {
    folder: PathBuf,
    list: String,
}

impl FrameFolder {
    /// Creates the folder, if it does not exist.
    ///
    /// # Errors
    /// If the folder cannot be created.
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

    /// Writes one frame and the list.
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

    /// The path of the list, the file to open in ParaView.
    pub fn list_file(&self) -> PathBuf {
        self.folder.join("frames.pvd")
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
