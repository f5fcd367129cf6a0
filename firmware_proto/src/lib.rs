//! What travels between a haptic device's microcontroller and this machine.
//!
//! Both ends compile this crate: it needs no operating system, allocates nothing and has no `unsafe`. Nothing
//! that arrives is trusted: bytes are checked once, whole, and only then read, and nothing here panics.
//!
//! A device's own units end here. What is sent is integers in units that suit the device; what the rest of
//! the program sees is SI (see [`report::StateSi`] and [`report::WrenchSi`]).
//!
//! - [`report`]: the 64-byte reports that are exchanged every tick.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod report;
