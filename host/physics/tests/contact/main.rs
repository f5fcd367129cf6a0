//! Contact: detection of pairs that may touch.

mod lists;
mod motions;
mod throws;
