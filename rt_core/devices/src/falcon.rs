//! The Novint Falcon.

pub mod geometry;
pub mod packet;
