//! The latency of the whole loop.

pub mod percentile;
