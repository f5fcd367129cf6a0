//! What can be wrong with a scene, said in one line: file, line, field, what was found, what is allowed.

use super::source::{Source, cut};
use meshio::MeshFileError;
use sim::models::{ModelError, ModelProblem};
use std::{fmt, io, path::PathBuf};
use thiserror::Error;

/// Longest message of the TOML parser that is passed on, in characters.
const LONGEST: usize = 400;

/// Why a scene cannot be used.
#[derive(Debug, Error)]
pub enum SceneError {
    /// The scene file itself cannot be read.
    #[error("{file}: cannot read this scene: {source}")]
    Read {
        /// The file.
        file: String,
        /// Why.
        source: io::Error,
    },
    /// The text is not TOML, or not in a way that the other cases describe.
    #[error("{place}: {problem}")]
    Malformed {
        /// Where.
        place: Place,
        /// What the parser says.
        problem: String,
    },
    /// A field that must be there is not.
    #[error("{place}: missing field {name}")]
    Missing {
        /// The table that should hold it.
        place: Place,
        /// Its name.
        name: String,
    },
    /// A field of this name does not exist.
    #[error("{place}: unknown field, allowed: {allowed}")]
    Unknown {
        /// Where.
        place: Place,
        /// The fields that exist there.
        allowed: String,
    },
    /// A value is of the wrong type, out of its range or at odds with another field.
    #[error("{place}: found {found}, allowed: {allowed}")]
    Value {
        /// Where.
        place: Place,
        /// What the file says.
        found: String,
        /// What it may say.
        allowed: String,
    },
    /// A mesh file that the scene names is no mesh.
    #[error("{place}: cannot use {}: {source}", path.display())]
    Mesh {
        /// The field that names it.
        place: Place,
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and where.
        source: Box<MeshFileError>,
    },
    /// A file that the scene names cannot be read.
    #[error("{place}: cannot read {}: {source}", path.display())]
    File {
        /// The field that names it.
        place: Place,
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file, as the person named it.
    pub file: String,
    /// Line, counted from 1.
    pub line: usize,
    /// The field, such as `body[0].material.young`; empty where none is meant.
    pub field: String,
}

impl fmt::Display for Place {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(to, "{}:{}", self.file, self.line)?;
        if self.field.is_empty() {
            Ok(())
        } else {
            write!(to, ": {}", self.field)
        }
    }
}

impl SceneError {
    /// The text is not TOML.
    pub(super) fn syntax(source: &Source, error: &toml::de::Error) -> Self {
        let start = error.span().map_or(0, |span| span.start);
        Self::Malformed {
            place: source.place_at("", start),
            problem: format!("not valid TOML: {}", cut(error.message(), LONGEST)),
        }
    }

    /// A device's file is none: said as a scene's own mistakes are, with that file's line and field.
    pub(super) fn model(file: String, error: ModelError) -> Self {
        let ModelError {
            line,
            field,
            problem,
        } = error;
        let place = Place { file, line, field };
        match problem {
            ModelProblem::Syntax(problem) => Self::Malformed {
                place,
                problem: format!("not valid TOML: {problem}"),
            },
            ModelProblem::Missing(name) => Self::Missing {
                place,
                name: format!("`{name}`"),
            },
            ModelProblem::Unknown { allowed } => Self::Unknown { place, allowed },
            ModelProblem::Value { found, allowed } => Self::Value {
                place,
                found,
                allowed,
            },
        }
    }

    /// Serde refused the value at `field`. Its message is taken apart, so that all errors read alike and
    /// quote the file as it is written.
    pub(super) fn refused(source: &Source, field: &str, error: &toml::de::Error) -> Self {
        let field = if field == "." { "" } else { field };
        let span = error.span();
        let place = match &span {
            Some(span) => source.place_at(field, span.start),
            None => source.place(field),
        };
        let message = error.message();
        let (before, allowed) = message.rsplit_once(", expected ").unwrap_or((message, ""));
        let allowed = plain(allowed);
        if let Some(name) = before.strip_prefix("missing field ") {
            return Self::Missing {
                place,
                name: name.to_owned(),
            };
        }
        if before.starts_with("unknown field ") {
            return Self::Unknown { place, allowed };
        }
        let allowed = if before.ends_with("overflowed") {
            "a number that is not so large".to_owned()
        } else if before.starts_with("invalid ") || before.starts_with("unknown variant ") {
            allowed
        } else {
            let problem = cut(message, LONGEST);
            return Self::Malformed { place, problem };
        };
        let found = span.map_or_else(|| cut(before, LONGEST), |span| source.quote(span));
        Self::Value {
            place,
            found,
            allowed,
        }
    }
}

/// What serde calls by a Rust type, in words.
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
