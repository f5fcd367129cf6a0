//! Experiments whose figures the book quotes. `palpate bench`, `palpate stress` or `palpate compare` repeats each of them.
#![forbid(unsafe_code)]

pub mod accuracy;
pub mod adversary;
pub mod compare;
pub mod elsewhere;
mod error;
pub mod extrapolation;
mod level;
pub mod probe;
pub mod speed;
pub mod stability;
pub mod stress;
pub mod sweep;
pub mod tearing;
pub mod velocity;
mod workers;

pub use error::StudyError;
pub use level::Level;
