//! The Novint Falcon.

pub mod geometry;
