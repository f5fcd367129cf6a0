//! A frame of a body: its facts in addition to its point cloud ([`super::cloud`]).

use super::field::{Record, Visitor, definition, fields, record};
use super::kind::Kind;

/// The facts of a frame of a body in addition to the positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BodyFrame {
    /// Index of the body.
    pub body: u32,
    /// Number of the host step, from one; zero for the state before the first step.
    pub step: u64,
    /// Time at which the step was due (ns).
    pub time_ns: u64,
    /// Topology epoch.
    pub epoch: u32,
}

impl Kind for BodyFrame {
    const SCHEMA_NAME: &'static str = "palpate_msgs/msg/BodyFrame";

    fn topic(body: &str) -> String {
        format!("/bodies/{body}/frame")
    }

    fn definition() -> String {
        definition::<Self>()
    }
}

record! { BodyFrame: Self::default();
    "# A frame of a body. The positions are in the point cloud of the same time on the channel /bodies/NAME.";
    "uint64 step      # number of the host step, from one; zero for the state before the first step" step;
    "uint64 time_ns   # the time at which the step was due" time_ns;
    "uint32 epoch     # topology epoch" epoch;
    "uint32 body      # index in a tick's bodies" body;
}
