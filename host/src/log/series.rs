//! A series of logs in a folder, for a run without an end: a new file begins when a file has its size or its age, and the oldest
//! files are deleted before all of them together take more than they may.
//!
//! A file is called `palpate-RUN-PART.mcap`, with the number of its run in the folder and the number of the part within the run. No
//! clock enters the names, so their order is the order in time, even if somebody sets the clock back.

use plot::atomic_file::is_at;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// Where the logs of a run without an end go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SeriesOptions {
    /// The folder.
    pub folder: PathBuf,
    /// Size at which a file is finished (bytes).
    pub file_bytes: u64,
    /// Age at which a file is finished (s of the run's own time).
    pub file_seconds: u64,
    /// Size of all files together (bytes).
    pub total_bytes: u64,
}

/// The series of one run.
#[derive(Debug)]
pub(crate) struct Series {
    options: SeriesOptions,
    run: u32,
    part: u32,
}

/// The number of the run and of the part in the name of a file of a series.
fn numbers(path: &Path) -> Option<(u32, u32)> {
    let name = path.file_name()?.to_str()?;
    let (run, part) = name
        .strip_prefix("palpate-")?
        .strip_suffix(".mcap")?
        .split_once('-')?;
    let number = |text: &str, digits: usize| {
        let is_number = text.len() >= digits && text.bytes().all(|byte| byte.is_ascii_digit());
        text.parse().ok().filter(|_| is_number)
    };
    Some((number(run, 6)?, number(part, 4)?))
}

fn path(folder: &Path, run: u32, part: u32) -> PathBuf {
    folder.join(format!("palpate-{run:06}-{part:04}.mcap"))
}

/// The files of all series in a folder, the oldest first.
fn files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files: Vec<_> = fs::read_dir(folder)?
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| numbers(path).is_some())
        .collect();
    files.sort_by_key(|path| numbers(path));
    Ok(files)
}

/// The last file of all series in a folder; `None` if there is none.
///
/// # Errors
/// The folder cannot be read.
pub fn last(folder: &Path) -> io::Result<Option<PathBuf>> {
    Ok(files(folder)?.pop())
}

/// The file at `file` and the parts of its run that follow it without a gap. A file of another name stands alone.
pub fn with_successors(file: &Path) -> Vec<PathBuf> {
    let mut all = vec![file.to_owned()];
    if let Some((run, first)) = numbers(file) {
        let folder = file.parent().unwrap_or(Path::new(""));
        let later = (first.saturating_add(1)..).map(|part| path(folder, run, part));
        all.extend(later.take_while(|path| path.exists()));
    }
    all
}

impl Series {
    /// The series of the next run in the folder, before its first file.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub(crate) fn new(options: &SeriesOptions) -> io::Result<Self> {
        let last = last(&options.folder)?.as_deref().and_then(numbers);
        Ok(Self {
            options: options.clone(),
            run: last.map_or(1, |(run, _)| run.saturating_add(1)),
            part: 0,
        })
    }

    /// Makes room for the next file, and returns its path.
    pub(crate) fn next(&mut self) -> PathBuf {
        self.make_room();
        self.part += 1;
        path(&self.options.folder, self.run, self.part)
    }

    /// Deletes the file that [`Self::next`] named last, because it could not be begun. Its number is used again.
    pub(crate) fn give_up(&mut self) {
        // A file that stays is overwritten by the next attempt.
        let _ = fs::remove_file(path(&self.options.folder, self.run, self.part));
        self.part = self.part.saturating_sub(1);
    }

    /// Whether the present file, which has lasted for `seconds`, is to be finished.
    pub(crate) fn is_over(&self, seconds: u64) -> bool {
        let size = fs::metadata(path(&self.options.folder, self.run, self.part));
        seconds >= self.options.file_seconds
            || size.is_ok_and(|file| file.len() >= self.options.file_bytes)
    }

    /// Deletes the oldest files until a whole new one fits. A file that a program writes stays.
    fn make_room(&self) {
        let Ok(files) = files(&self.options.folder) else {
            return;
        };
        let size = |path: &PathBuf| fs::metadata(path).map_or(0, |file| file.len());
        let mut all: u64 = files.iter().map(size).sum();
        let most = self
            .options
            .total_bytes
            .saturating_sub(self.options.file_bytes);
        for file in &files {
            if all <= most {
                return;
            }
            let bytes = size(file);
            if delete(file).is_ok() {
                all = all.saturating_sub(bytes);
            }
        }
    }
}

/// Deletes a log that no program writes.
fn delete(path: &Path) -> io::Result<()> {
    let file = File::open(path)?;
    file.try_lock()?;
    if is_at(&file.metadata()?, path) {
        fs::remove_file(path)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(folder: &Path) -> SeriesOptions {
        SeriesOptions {
            folder: folder.to_owned(),
            file_bytes: 100,
            file_seconds: 60,
            total_bytes: 350,
        }
    }

    fn names(folder: &Path) -> Vec<String> {
        let files = files(folder).expect("a folder");
        let name = |path: &PathBuf| {
            path.file_name()
                .map(|name| name.to_string_lossy().into_owned())
        };
        files.iter().filter_map(name).collect()
    }

    #[test]
    fn files_follow_each_other_by_number_and_the_oldest_make_room() {
        let folder = tempfile::tempdir().expect("a folder");
        // Neither a file of a person nor another name is deleted.
        for name in ["notes.txt", "palpate-1-1.mcap", "palpate-000001.mcap"] {
            fs::write(folder.path().join(name), [0; 500]).expect("written");
        }
        for run in 1..=2_u32 {
            let mut series = Series::new(&options(folder.path())).expect("a folder");
            for _ in 0..3 {
                let path = series.next();
                assert!(!series.is_over(59) && series.is_over(60));
                fs::write(&path, [0; 100]).expect("written");
                assert!(series.is_over(0), "the file has its size");
            }
            assert_eq!(series.run, run);
        }
        // Two older files and the new one have at most 350 bytes.
        let expected = [
            "palpate-000002-0001.mcap",
            "palpate-000002-0002.mcap",
            "palpate-000002-0003.mcap",
        ];
        assert_eq!(names(folder.path()), expected);
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 6);
        let first = folder.path().join(expected[0]);
        assert_eq!(with_successors(&first).len(), 3);
        assert_eq!(with_successors(&folder.path().join("notes.txt")).len(), 1);
        fs::remove_file(folder.path().join(expected[1])).expect("removed");
        assert_eq!(with_successors(&first), [first]);
    }

    #[test]
    fn a_file_that_another_program_writes_is_not_deleted() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut series = Series::new(&options(folder.path())).expect("a folder");
        let first = series.next();
        fs::write(&first, [0; 1000]).expect("written");
        let held = File::open(&first).expect("a file");
        held.try_lock().expect("nobody else has it");
        let second = series.next();
        assert!(first.exists());
        fs::write(&second, [0; 10]).expect("written");
        series.give_up();
        assert!(!second.exists());
        drop(held);
        assert_eq!(series.next(), second, "the number is used again");
        assert!(!first.exists());
    }
}
