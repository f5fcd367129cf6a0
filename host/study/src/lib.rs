//! Experiments whose figures the book quotes. Each can be run again with `palpate bench` or `palpate stress`.
#![forbid(unsafe_code)]

pub mod accuracy;
pub mod elsewhere;
pub mod extrapolation;
pub mod speed;
pub mod stability;
pub mod stress;
pub mod velocity;
