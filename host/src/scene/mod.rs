//! Scenes: what a run is made of, read from a TOML file.
//!
//! [`spec`] is the format, field by field. [`Scene::load`] reads a file: `check` refuses single values
//! out of their range while they are read, `consistency` what does not fit together. Every
//! [`SceneError`] is one line with the file, the line, the field, what was found and what is allowed.

mod check;
mod consistency;
mod error;
mod load;
pub mod recording;
pub(crate) mod source;
pub mod spec;

pub use error::{Place, SceneError};
pub use load::{LoadedScene, MeshFile};
pub use source::Source;
pub use spec::Scene;
