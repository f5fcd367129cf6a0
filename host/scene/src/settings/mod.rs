//! Settings of the machine: where the threads of the loop run, where logs go, and what `palpate serve` runs.
//!
//! The settings belong to a machine and not to a scene, so a file of their own holds them ([`MACHINE_FILE`]). A scene that
//! needs another setting carries the same tables under `[machine]`. [`Settings::resolve`] takes each value from the first
//! that gives it: a flag of the command, the scene, the file of the machine, the default. Each value keeps its [`Origin`],
//! which `palpate settings` prints.
//!
//! The module is part of this crate, because both places are read by the same types, and refused with the same errors.

mod resolve;
mod spec;
mod visitors;

use crate::advice;
use crate::error::SceneError;
use crate::load::read;
use crate::source::Source;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

pub use resolve::{Flags, Origin, Row, Setting, Settings};
pub use spec::{CoreName, DeviceThreads, LogFolder, Machine, MachineTables, Serve, Tick};

/// The file of the machine's settings, if the command names no other.
pub const MACHINE_FILE: &str = "/etc/palpate/palpate.toml";

/// The file of the machine's settings, as it was read.
#[derive(Clone, Debug)]
pub struct MachineFile {
    /// The tables of the file.
    pub machine: Machine,
    /// The text of the file, for the lines of its fields.
    pub source: Source,
}

impl MachineFile {
    /// Reads the settings at `path`; `None`: at [`MACHINE_FILE`], and no settings if that file is absent.
    ///
    /// # Errors
    /// [`SceneError`] with the line, the column, the field, the value found and the allowed values; also if the file cannot
    /// be read.
    pub fn load(path: Option<&Path>) -> Result<Self, SceneError> {
        let file = path.unwrap_or(Path::new(MACHINE_FILE));
        let name = file.display().to_string();
        match read(file) {
            Ok(text) => Self::parse(&name, &text),
            Err(error) if path.is_none() && error.kind() == ErrorKind::NotFound => {
                Self::parse(&name, "")
            }
            Err(source) => Err(SceneError::Settings { file: name, source }),
        }
    }

    /// Reads the text of a settings file. Messages call the file `name`.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    ///
    /// ```
    /// use scene::settings::MachineFile;
    ///
    /// let error = MachineFile::parse("palpate.toml", "tick.priority = 0").expect_err("no priority");
    /// assert_eq!(
    ///     error.to_string(),
    ///     "palpate.toml:1:17: tick.priority: found 0, allowed: a whole number from 1 to 99"
    /// );
    /// ```
    pub fn parse(name: &str, text: &str) -> Result<Self, SceneError> {
        let source = Source::new(name, text).with_columns();
        let document =
            toml::Deserializer::parse(text).map_err(|error| SceneError::syntax(&source, &error))?;
        let machine: Machine = serde_path_to_error::deserialize(document).map_err(|error| {
            let field = error.path().to_string();
            SceneError::refused(&source, &field, error.inner(), advice::SETTINGS)
        })?;
        Ok(Self { machine, source })
    }

    /// The path of a file that the settings name: relative to the folder of the settings file.
    pub(crate) fn beside(&self, file: &Path) -> PathBuf {
        let folder = Path::new(&self.source.name).parent();
        folder.unwrap_or(Path::new("")).join(file)
    }
}

#[cfg(test)]
mod tests;
