//! What the tests of the host share.
#![allow(
    clippy::missing_panics_doc,
    clippy::missing_errors_doc,
    reason = "a test that panics has failed"
)]

pub mod rig;
pub mod solve;
pub mod watched;
