//! The latency of the whole loop: how late, how often, and where from.
//!
//! A run under the real clock stamps every stage of its ticks. An observer ([`gather`]) collects the stamps by deadline
//! ([`deadlines`]), states percentiles with intervals ([`percentile`]), and keeps the worst ticks with what the kernel counted
//! around them ([`worst`]).

pub mod deadlines;
pub mod edges;
pub mod gather;
pub mod percentile;
pub mod stages;
pub mod worst;
