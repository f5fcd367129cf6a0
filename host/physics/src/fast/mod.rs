//! The realtime step made for speed: numbers laid out for vector instructions and for the caches.
//!
//! - [`order`], [`supernodes`], [`factor`], [`panel`] and `sweep`: a frozen sparse Cholesky factor as a
//!   preconditioner.

pub mod factor;
pub mod order;
pub mod panel;
pub mod supernodes;
mod sweep;

/// Three numbers of a node (x, y, z) and a fourth, zero, that fills a vector register.
pub type Node<T> = [T; 4];
