//! The protocol between a haptic device's microcontroller and this machine.
//!
//! Both ends compile this crate: it needs no operating system, allocates nothing and has no `unsafe`. The crate trusts
//! no received bytes. It checks them once, as a whole, before it reads them, and never panics.
//!
//! A device's own units end here. Reports hold integers in units that suit the device. The rest of the program sees SI
//! (see [`report::StateSi`] and [`report::WrenchSi`]).
//!
//! - [`report`]: the 64-byte reports that are exchanged every tick.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod report;
