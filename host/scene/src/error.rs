//! The errors of a scene. Each is one line: file, line, field, the value found, the allowed values.

use super::advice;
use super::source::{Source, cut};
use meshio::MeshFileError;
use sim::models::{ModelError, ModelProblem};
use std::{fmt, io, path::PathBuf};
use thiserror::Error;

/// Longest message of the TOML parser that an error quotes, in characters.
const LONGEST: usize = 400;

/// The reason why a scene cannot be used.
#[derive(Debug, Error)]
pub enum SceneError {
    /// The scene file itself cannot be read.
    #[error("{file}: cannot read this scene: {source}")]
    Read {
        /// The file.
        file: String,
        /// The system's error.
        source: io::Error,
    },
    /// A device file that no scene names cannot be read.
    #[error("{}: cannot read this device file: {source}", path.display())]
    DeviceFile {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The file of the machine's settings cannot be read.
    #[error("{file}: cannot read these settings: {source}")]
    Settings {
        /// The file.
        file: String,
        /// The system's error.
        source: io::Error,
    },
    /// There is no device of this name.
    #[error("found {found:?}, allowed: a device file (.toml), or a built-in device: {known}")]
    NoDevice {
        /// The name that was given.
        found: String,
        /// The built-in devices.
        known: String,
    },
    /// The text is not TOML, or has a fault that no other case describes.
    #[error("{location}: {problem}")]
    Malformed {
        /// Location of the fault.
        location: SourceLocation,
        /// The parser's message.
        problem: String,
    },
    /// A required field is missing.
    #[error("{location}: missing field {name}")]
    Missing {
        /// The table that should hold the field.
        location: SourceLocation,
        /// The name of the field.
        name: String,
    },
    /// A field of this name does not exist.
    #[error("{location}: unknown field, allowed: {allowed}")]
    Unknown {
        /// Location of the field.
        location: SourceLocation,
        /// The fields that exist in this table.
        allowed: String,
    },
    /// A value is of the wrong type, out of its range, or in contradiction to another field.
    #[error("{location}: found {found}, allowed: {allowed}")]
    Value {
        /// Location of the value.
        location: SourceLocation,
        /// The value in the file.
        found: String,
        /// The allowed values.
        allowed: String,
    },
    /// A mesh file that the scene names holds no valid mesh.
    #[error("{location}: cannot use {}: {source}", path.display())]
    Mesh {
        /// The field that names the file.
        location: SourceLocation,
        /// The file.
        path: PathBuf,
        /// The fault and its location in the file.
        source: Box<MeshFileError>,
    },
    /// A file that the scene names cannot be read.
    #[error("{location}: cannot read {}: {source}", path.display())]
    File {
        /// The field that names the file.
        location: SourceLocation,
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

/// A location in the text of a scene or of a file that it names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceLocation {
    /// The name of the file, as the user gave it.
    pub file: String,
    /// Line, counted from 1.
    pub line: usize,
    /// Column in characters, counted from 1; `None` in a file whose messages name lines only.
    pub column: Option<usize>,
    /// The field, such as `body[0].material.young`; empty if the error concerns no field.
    pub field: String,
}

impl fmt::Display for SourceLocation {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(to, "{}:{}", self.file, self.line)?;
        if let Some(column) = self.column {
            write!(to, ":{column}")?;
        }
        if self.field.is_empty() {
            Ok(())
        } else {
            write!(to, ": {}", self.field)
        }
    }
}

impl SceneError {
    /// The location in the text of the scene; `None` if no text was read.
    pub(super) fn location_mut(&mut self) -> Option<&mut SourceLocation> {
        match self {
            Self::Read { .. }
            | Self::Settings { .. }
            | Self::DeviceFile { .. }
            | Self::NoDevice { .. } => None,
            Self::Malformed { location, .. }
            | Self::Missing { location, .. }
            | Self::Unknown { location, .. }
            | Self::Value { location, .. }
            | Self::Mesh { location, .. }
            | Self::File { location, .. } => Some(location),
        }
    }

    /// The error for a text that is not TOML.
    pub(super) fn syntax(source: &Source, error: &toml::de::Error) -> Self {
        let start = error.span().map_or(0, |span| span.start);
        let problem = if is_mesh(&source.text) {
            "found a mesh, allowed: a scene (TOML), which names the mesh in `mesh.file`".to_owned()
        } else {
            let message = cut(error.message(), LONGEST);
            format!("not valid TOML: {message}; found {}", source.line_at(start))
        };
        Self::Malformed {
            location: source.location_at("", start),
            problem,
        }
    }

    /// The error for a faulty device file, in the form of the scene's own errors: with the line and the field of the
    /// device file.
    pub(super) fn model(file: String, error: ModelError) -> Self {
        let ModelError {
            line,
            field,
            problem,
        } = error;
        let location = SourceLocation {
            file,
            line,
            column: None,
            field,
        };
        match problem {
            ModelProblem::Syntax(problem) => Self::Malformed {
                location,
                problem: format!("not valid TOML: {problem}"),
            },
            ModelProblem::Missing(name) => Self::Missing {
                location,
                name: format!("`{name}`"),
            },
            ModelProblem::Unknown { allowed } => Self::Unknown { location, allowed },
            ModelProblem::Value { found, allowed } => Self::Value {
                location,
                found,
                allowed,
            },
        }
    }

    /// The error for a value at `field` that serde refused. The function splits serde's message into its parts, so
    /// that all errors have the same form and quote the text of the file.
    pub(super) fn refused(
        source: &Source,
        field: &str,
        error: &toml::de::Error,
        format: advice::Format,
    ) -> Self {
        let field = if field == "." { "" } else { field };
        let span = error.span();
        let location = match &span {
            Some(span) => source.location_at(field, span.start),
            None => source.location(field),
        };
        let message = error.message();
        let (before, allowed) = message.rsplit_once(", expected ").unwrap_or((message, ""));
        let allowed = plain(allowed);
        if let Some(name) = before.strip_prefix("missing field ") {
            return Self::Missing {
                location,
                name: name.to_owned(),
            };
        }
        if before.starts_with("unknown field ") {
            let allowed = format!("{allowed}{}", advice::of_field(field, &allowed, format));
            return Self::Unknown { location, allowed };
        }
        let allowed = if before.ends_with("overflowed") {
            "a number below 1.8e308".to_owned()
        } else if before.starts_with("invalid ") || before.starts_with("unknown variant ") {
            allowed
        } else {
            let problem = cut(message, LONGEST);
            return Self::Malformed { location, problem };
        };
        let found = span.map_or_else(|| cut(before, LONGEST), |span| source.quote(span));
        let advice = advice::meant(&found, &allowed) + &advice::example(field, &allowed);
        let allowed = allowed + &advice;
        Self::Value {
            location,
            found,
            allowed,
        }
    }
}

/// Whether a text begins as the mesh files do that this program reads.
fn is_mesh(text: &str) -> bool {
    let beginnings = ["$MeshFormat", "# vtk", "<?xml", "<VTKFile", "v "];
    beginnings
        .iter()
        .any(|beginning| text.starts_with(beginning))
}

/// Serde's description of an expected value, with words in place of the names of Rust types.
fn plain(expected: &str) -> String {
    let expected = expected.strip_prefix("one of ").unwrap_or(expected);
    match expected {
        "u64" => "a whole number, 0 or above",
        "a boolean" => "true or false",
        "a sequence" => "a list",
        text => text,
    }
    .to_owned()
}
