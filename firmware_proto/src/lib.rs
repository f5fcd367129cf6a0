//! The protocol between a haptic device's microcontroller and this machine.
//!
//! Both ends compile this crate: it needs no operating system, allocates nothing and has no `unsafe`. The crate trusts
//! no received bytes. It checks them once, as a whole, before it reads them, and never panics. `c/` contains a second
//! implementation in C99, for firmware that is not written in Rust. `vectors/` contains the transcripts that both
//! implementations reproduce byte by byte. The book describes every byte and every rule (`docs/src/protocol.md`).
//!
//! A device's own units end in this crate. Reports contain integers in units that suit the device. The rest of the
//! program sees SI (see [`report::StateSi`] and [`report::WrenchSi`]).
//!
//! - [`report`]: the 64-byte reports that the two sides exchange.
//! - [`stream`]: packets for a stream of bytes (UART, pty, TCP); HID needs none.
//! - [`device`]: the device's side: the wrench that the amplifiers apply, and its duration.
//! - [`host`]: the host's side: the greeting, motion to force, the offset between the clocks.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used,
    )
)]

#[cfg(test)]
extern crate std;

pub mod device;
pub mod host;
pub mod report;
pub mod stream;
