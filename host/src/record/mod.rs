//! Records: the output of a run, as plain data.
//!
//! The host makes them; the log, the viewers, the tables and the summary take them. This room stands at the ground of the host:
//! it imports no other of its rooms.
//!
//! A kind of record is one file: its fields, its channel and the definition of its messages ([`Kind`], [`field::Record`]),
//! and its columns in a table. `kind.rs` lists all kinds. Code that writes, reads, compares or shows records follows these
//! lists.

pub(crate) mod cdr;
pub(crate) mod cloud;
pub mod contact;
pub mod field;
mod frame;
mod kind;
mod model;
mod patch;
mod surface;
pub mod tear;
pub mod tick;
mod times;
pub mod totals;

pub use cloud::Cloud;
pub use contact::ContactStep;
pub use frame::BodyFrame;
pub use kind::{ChannelInfo, Group, Kind, Stamp};
pub(crate) use kind::{KINDS, List, Records};
pub use model::ModelRow;
pub use patch::PatchRow;
pub use surface::Surface;
pub use tear::TearEvent;
pub use tick::{LoggedReading, ReadFault, TOUCH, TickRow, Touch, energy_sums};
pub use times::Distribution;

/// Which clock a run follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Virtual time: exact, repeatable, and as fast as the machine computes.
    Virtual,
    /// The machine's monotonic clock.
    Real,
}

impl Clock {
    /// Its name in logs and summaries.
    pub fn name(self) -> &'static str {
        match self {
            Self::Virtual => "virtual",
            Self::Real => "real",
        }
    }
}
