//! The thread that ticks, and its requests to the operating system.
//!
//! `rt_core` is the law of a tick; this crate runs the law once a millisecond. Principles:
//!
//! - The loop sleeps to **absolute deadlines**, measures its lateness on waking, and skips and counts the deadlines
//!   that it missed ([`pace`], [`clock`]).
//! - The loop **never waits** for another thread. All data pass through wait-free rings ([`mod@link`]). A device that
//!   takes reports slowly has its own thread, which writes the reports (`devices::hid`).
//! - The loop allocates, locks and formats **nothing**. Its memory is touched and locked before the first tick
//!   ([`memory`], [`ring`]); its histograms have fixed bounds ([`latency`]).
//! - A resource that the system refuses (a core, a priority, locked memory) is **named with its cost**, and the run
//!   continues ([`schedule`], [`degradation`]), unless the user requires the resource.
//! - The tick takes an isolated core if there is one ([`cores`]). The other threads of the process **keep off** that
//!   core ([`reserve`]).
//! - The loop makes few, named **system calls**; the kernel can trap any other call ([`seccomp`]).
//! - [`tick_loop::TickLoop`] is one tick with its rings and histograms, without clock or thread. Virtual time runs
//!   exactly the code that [`thread`] runs.
//!
//! Read [`thread`] first.

pub mod clock;
pub mod cores;
pub mod degradation;
pub mod kernel;
pub mod latency;
pub mod link;
pub mod memory;
#[cfg(feature = "mutations")]
mod mutation;
pub mod pace;
pub mod packed_ring;
pub mod published;
pub mod reserve;
pub mod ring;
pub mod schedule;
pub mod seccomp;
pub mod setup;
pub mod signals;
pub mod thread;
pub mod tick_loop;
pub mod trap;

pub use cores::{CoreChoice, Cores};
pub use degradation::Degradation;
pub use latency::{Latencies, LatencyHistogram, LatencyReader, Summary};
pub use link::{HostEnd, LinkConfig, LogEnd, TickEnd, link};
pub use reserve::{Confined, Reserved, ThreadPlace};
pub use seccomp::CallPolicy;
pub use setup::RunnerConfig;
pub use thread::{STACK, Stop, TickReport, TickThread, spawn};
pub use tick_loop::{AnyDevice, TickLoop};
pub use trap::ForbiddenCall;
