//! The thread that ticks, and what it needs from the operating system.
//!
//! `rt_core` is the law of a tick; this crate runs it once a millisecond. Principles:
//!
//! - The loop sleeps to **absolute deadlines**, measures how late it woke, and skips and counts the
//!   deadlines it missed ([`pace`], [`clock`]).
//! - It **never waits** for anybody: everything enters and leaves through wait-free rings ([`mod@link`]), and
//!   a device that writes slowly is written by a thread of its own (`devices::hid`).
//! - It allocates, locks and formats **nothing**; its memory is touched and locked before the first tick
//!   ([`memory`], [`ring`]), its histograms have fixed bounds ([`latency`]).
//! - What the system does not give (a core, a priority, locked memory) is **named with its cost**, and the
//!   run goes on ([`schedule`], [`degradation`]), unless it is told to insist.
//! - It takes an isolated core where there is one ([`cores`]); other threads of the process **keep off** its core
//!   ([`reserve`]).
//! - Its **system calls** are few and named; the kernel can be asked to trap any other ([`seccomp`]).
//! - [`tick_loop::TickLoop`] is one tick with its rings and histograms, without clock or thread: virtual
//!   time runs exactly what [`thread`] runs.
//!
//! Read [`thread`] first.

pub mod clock;
pub mod cores;
pub mod degradation;
pub mod latency;
pub mod link;
pub mod memory;
#[cfg(feature = "mutations")]
mod mutation;
pub mod pace;
pub mod reserve;
pub mod ring;
pub mod schedule;
pub mod seccomp;
mod setup;
pub mod thread;
pub mod tick_loop;
mod trap;

pub use cores::{CoreChoice, Cores};
pub use degradation::Degradation;
pub use latency::{Latencies, LatencyHistogram, Summary};
pub use link::{HostEnd, LinkConfig, LogEnd, TickEnd, link};
pub use reserve::Reserved;
pub use seccomp::{CallPolicy, ForbiddenCall};
pub use thread::{RunnerConfig, Stop, TickReport, TickThread, spawn};
pub use tick_loop::{AnyDevice, TickLoop};
