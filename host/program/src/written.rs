//! The files that a command writes at its end, after it has printed its result.

use super::CommandError;
use host::atomic_file::AtomicFileError;
use std::path::{Path, PathBuf};

/// Writes every file that can be written: one failure does not lose the other results.
#[derive(Default)]
pub(super) struct Written {
    failures: Vec<CommandError>,
}

impl Written {
    /// Writes the file, if it is requested. Returns whether it was written.
    pub(super) fn write(
        &mut self,
        path: Option<&PathBuf>,
        write: impl FnOnce(&Path) -> Result<(), AtomicFileError>,
    ) -> bool {
        match path.map(|path| write(path)) {
            None => false,
            Some(Ok(())) => true,
            Some(Err(failure)) => {
                self.failures.push(failure.into());
                false
            }
        }
    }

    /// Adds the failure of a file that was written during the work, if it failed.
    pub(super) fn and(mut self, failure: Option<impl Into<CommandError>>) -> Self {
        self.failures.extend(failure.map(Into::into));
        self
    }

    /// Reports the failures.
    ///
    /// # Errors
    /// The last failure. The others have been printed.
    pub(super) fn end(mut self) -> Result<(), CommandError> {
        let last = self.failures.pop();
        for failure in self.failures {
            errln!("{failure}");
        }
        last.map_or(Ok(()), Err)
    }

    /// Reports the failures of a command whose work has this `outcome`.
    ///
    /// # Errors
    /// The outcome, if it is an error: the failures have been printed then. Otherwise the last failure.
    pub(super) fn end_with(self, outcome: Result<(), CommandError>) -> Result<(), CommandError> {
        let written = self.end();
        if let (Err(_), Err(failure)) = (&outcome, &written) {
            errln!("{failure}");
        }
        outcome.and(written)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::atomic_file::write_atomically;

    #[test]
    fn a_failed_command_keeps_its_error_and_a_failed_file_is_one() {
        let failed = || {
            let mut written = Written::default();
            let path = PathBuf::from("no such folder/x.svg");
            assert!(!written.write(Some(&path), |path| write_atomically(path, b"x")));
            written
        };
        let end = failed().end_with(Err(CommandError::Incomplete));
        assert!(matches!(end, Err(CommandError::Incomplete)));
        assert!(matches!(
            failed().end_with(Ok(())),
            Err(CommandError::File(_))
        ));
        let all_well = Written::default().end_with(Err(CommandError::Incomplete));
        assert!(matches!(all_well, Err(CommandError::Incomplete)));
    }
}
