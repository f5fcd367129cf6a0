//! Experiments whose figures the book quotes. Each can be run again with `palpate bench`.

pub mod accuracy;
pub mod extrapolation;
pub mod speed;
pub mod stability;
pub mod velocity;
