//! Frames of a solve or a run as files for ParaView: one VTU file per body and frame, and a PVD file that lists them.

use super::Frame;
use crate::atomic_file::{AtomicFileError, write_atomically};
use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const LIST: &str = "frames.pvd";
/// The beginning of a list.
const HEAD: &str =
    "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n";
/// The end of a list.
const TAIL: &str = "</Collection>\n</VTKFile>\n";

/// A folder of frames. Its list grows with each frame, so that it names the frames that are there, however the program
/// ends. No other program can open the folder for its frames at the same time.
#[derive(Debug)]
pub struct FrameFolder {
    folder: PathBuf,
    /// The name of each body, and what the names of its files begin with.
    names: Vec<(String, String)>,
    list: File,
    /// Length of the list without its end (bytes).
    length: u64,
    /// The folder, open and locked.
    _lock: Option<File>,
}

impl FrameFolder {
    /// Creates the folder for frames of bodies of these names, if it does not exist, and an empty list in it.
    ///
    /// # Errors
    /// If the folder or the list cannot be created, or another program writes its frames there.
    pub fn create<'a>(
        folder: &Path,
        bodies: impl IntoIterator<Item = &'a str>,
    ) -> Result<Self, AtomicFileError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| AtomicFileError { path, source }
        };
        let locked = fs::create_dir_all(folder).and_then(|()| lock(folder));
        let lock = locked.map_err(failed(folder))?;
        let path = Self::list_in(folder);
        write_atomically(&path, format!("{HEAD}{TAIL}").as_bytes())?;
        let list = OpenOptions::new().write(true).open(&path);
        Ok(Self {
            folder: folder.to_owned(),
            names: file_names(bodies),
            list: list.map_err(failed(&path))?,
            length: HEAD.len() as u64,
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
            || frame.is_some_and(|(body, _)| file_names(bodies).iter().any(|(_, own)| own == body))
    }

    /// Writes one frame, and adds it to the list.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn keep(&mut self, frame: &Frame<'_>) -> Result<(), AtomicFileError> {
        let own = self.names.iter().find(|(body, _)| body == frame.body);
        let own = own.map_or_else(|| plain(frame.body), |(_, own)| own.clone());
        let file = format!("{own}_{:04}.vtu", frame.number);
        write_atomically(&self.folder.join(&file), frame.grid.vtu().as_bytes())?;
        let line = format!(
            "<DataSet timestep=\"{:?}\" part=\"0\" file=\"{file}\"/>\n",
            frame.at
        );
        // One call of the system writes the line and the end, so that the list is complete whenever the program ends.
        let text = format!("{line}{TAIL}");
        let start = self.list.seek(SeekFrom::Start(self.length));
        let written = start.and_then(|_| self.list.write_all(text.as_bytes()));
        written.map_err(|source| AtomicFileError {
            path: self.list_file(),
            source,
        })?;
        self.length += line.len() as u64;
        Ok(())
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

/// Locks a folder. There is no lock if the system has none for folders.
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

/// The name of each body, and what the names of its files begin with: no two bodies share a file.
fn file_names<'a>(bodies: impl IntoIterator<Item = &'a str>) -> Vec<(String, String)> {
    let bodies: Vec<_> = bodies.into_iter().collect();
    // A name that needs no change stays as it is.
    let mut taken: BTreeSet<String> = (bodies.iter())
        .filter(|name| plain(name) == **name)
        .map(|&name| name.to_owned())
        .collect();
    let names = bodies.into_iter().map(|name| {
        let first = plain(name);
        let mut own = first.clone();
        let mut number = 1;
        while own != name && !taken.insert(own.clone()) {
            number += 1;
            own = format!("{first}_{number}");
        }
        (name.to_owned(), own)
    });
    names.collect()
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
    use meshio::write_vtu::UnstructuredGrid;

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

    /// Different names of bodies may give one name of a file; the bodies then have files of their own.
    #[test]
    fn bodies_do_not_share_a_file() {
        for (bodies, expected) in [
            (["x/y", "x_y", "z"], ["x_y_2", "x_y", "z"]),
            (["x_y", "x/y", "x:y"], ["x_y", "x_y_2", "x_y_3"]),
            (["x/y", "x_y_2", "x:y"], ["x_y", "x_y_2", "x_y_3"]),
        ] {
            let names = file_names(bodies);
            assert!(names.iter().map(|(_, own)| own).eq(expected), "{names:?}");
        }
        assert!(FrameFolder::may_write("x_y_2_0000.vtu", ["x/y", "x_y"]));
        assert!(!FrameFolder::may_write("x_y_2_0000.vtu", ["x/y"]));
    }

    /// The list is whole after every frame, and a new run does not take over the list of the run before.
    #[test]
    fn the_list_names_the_frames_that_are_there() {
        let folder = tempfile::tempdir().expect("a folder");
        let list = || fs::read_to_string(folder.path().join(LIST)).expect("a list");
        for _ in 0..2 {
            let mut frames = FrameFolder::create(folder.path(), ["x/y", "x_y"]).expect("a folder");
            assert_eq!(list(), format!("{HEAD}{TAIL}"));
            let mut lines = String::new();
            for (body, file) in [("x/y", "x_y_2"), ("x_y", "x_y")] {
                let frame = Frame {
                    body,
                    number: 7,
                    at: 0.5,
                    grid: UnstructuredGrid::default(),
                };
                frames.keep(&frame).expect("a frame");
                let line = [
                    "<DataSet timestep=\"0.5\" part=\"0\" file=\"",
                    file,
                    "_0007.vtu\"/>\n",
                ];
                lines.extend(line);
                assert_eq!(list(), format!("{HEAD}{lines}{TAIL}"));
                assert!(folder.path().join(format!("{file}_0007.vtu")).is_file());
            }
        }
    }

    #[test]
    fn a_folder_has_one_writer() {
        let folder = tempfile::tempdir().expect("a folder");
        let held = FrameFolder::create(folder.path(), ["cube"]).expect("a folder");
        let second = FrameFolder::create(folder.path(), ["cube"]).expect_err("one writer");
        let said = second.to_string();
        assert!(
            said.contains("another program is writing its frames there"),
            "{said}"
        );
        drop(held);
        assert!(FrameFolder::create(folder.path(), ["cube"]).is_ok());
    }
}
