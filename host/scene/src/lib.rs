//! Scenes: the bodies, devices and settings of a run, read from a TOML file.
//!
//! [`spec`] is the format, field by field. [`Scene::load`] reads a file: `check` refuses each value that is
//! out of its range while the file is read, `consistency` refuses values that contradict each other. Every
//! [`SceneError`] is one line with the file, the line, the field, the value found and the allowed values.

mod advice;
mod check;
pub mod connections;
mod consistency;
mod contact;
mod csv;
mod device_file;
pub mod drivers;
mod error;
mod field;
mod load;
mod overrides;
pub mod plausible;
pub mod poses;
pub mod recording;
pub mod settings;
mod silent;
pub mod source;
pub mod spec;
mod tool;

pub use device_file::NamedDevice;
pub use drivers::real_drivers;
pub use error::{SceneError, SourceLocation};
pub use field::{Field, FieldError};
pub use load::{LoadedScene, MeshFile, ObstacleFiles, read_bytes};
pub use overrides::Override;
pub use plausible::Warning;
pub use source::{Source, printable};
pub use spec::Scene;
