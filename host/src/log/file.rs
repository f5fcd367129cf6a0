//! The file of a log. It has one writer at a time, and an older log lives until the new one begins.
//!
//! The writer holds an advisory lock on the file itself. The system releases the lock when the process ends in any way,
//! so that the log of a killed process blocks nobody.

use super::LogError;
use plot::atomic_file::is_at;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

/// An open and locked file. Until [`LogFile::begin`] its content is that of the older log. A file that did not exist is
/// removed again if the log does not begin.
pub(crate) struct LogFile {
    // The fields are dropped in this order: the file is removed while it is locked.
    unused: Unused,
    file: File,
    name: String,
}

impl LogFile {
    /// Opens and locks the file at `path`.
    ///
    /// # Errors
    /// If the file cannot be opened, or another program writes to it.
    pub(crate) fn open(path: &Path) -> Result<Self, LogError> {
        let name = path.display().to_string();
        let failed = |source| LogError::Create {
            log: name.clone(),
            source,
        };
        loop {
            let new =
                fs::metadata(path).is_err_and(|error| error.kind() == io::ErrorKind::NotFound);
            let mut options = OpenOptions::new();
            let file = options.write(true).create(true).truncate(false).open(path);
            let file = file.map_err(failed)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Err(LogError::Busy { log: name }),
                // Some network file systems have no locks.
                Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {}
                Err(TryLockError::Error(error)) => return Err(failed(error)),
            }
            // Between opening and locking, the previous writer may have removed the file.
            if !file.metadata().is_ok_and(|open| is_at(&open, path)) {
                continue;
            }
            let unused = Unused(if new {
                fs::canonicalize(path).ok()
            } else {
                None
            });
            return Ok(Self { unused, file, name });
        }
    }

    /// Empties the file. Returns the file and its name in messages; the lock lasts as long as the file is open.
    ///
    /// # Errors
    /// If the file cannot be emptied.
    pub(super) fn begin(mut self) -> Result<(File, String), LogError> {
        self.unused.0 = None;
        // A device has no length.
        let regular = self.file.metadata().is_ok_and(|there| there.is_file());
        let emptied = if regular {
            self.file.set_len(0)
        } else {
            Ok(())
        };
        match emptied {
            Ok(()) => Ok((self.file, self.name)),
            Err(source) => Err(LogError::Create {
                log: self.name,
                source,
            }),
        }
    }
}

/// A new file that holds nothing yet. It is removed on drop.
struct Unused(Option<PathBuf>);

impl Drop for Unused {
    fn drop(&mut self) {
        if let Some(path) = &self.0 {
            // An empty file that stays does no harm.
            let _ = fs::remove_file(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_writer_is_refused_and_the_older_log_lives_until_the_new_one_begins() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.mcap");
        fs::write(&path, b"the older log").expect("written");
        let first = LogFile::open(&path).expect("a file");
        let second = LogFile::open(&path).err().expect("one writer");
        let expected = format!(
            "cannot write the log {}: another program is writing to this log; give each run a log of its own",
            path.display()
        );
        assert_eq!(second.to_string(), expected);
        assert_eq!(fs::read(&path).expect("the file"), b"the older log");
        let (open, _) = first.begin().expect("a file");
        assert_eq!(fs::read(&path).expect("the file"), b"");
        assert!(matches!(LogFile::open(&path), Err(LogError::Busy { .. })));
        drop(open);
        assert!(LogFile::open(&path).is_ok());
    }

    #[test]
    fn a_log_that_does_not_begin_leaves_no_new_file_and_keeps_an_old_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let [new, old] = ["new.mcap", "old.mcap"].map(|name| folder.path().join(name));
        fs::write(&old, b"the older log").expect("written");
        for path in [&new, &old] {
            drop(LogFile::open(path).expect("a file"));
        }
        assert!(!new.exists());
        assert_eq!(fs::read(&old).expect("the file"), b"the older log");
    }
}
