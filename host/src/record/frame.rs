//! A frame of a body: its facts in addition to its point cloud ([`super::cloud`]).

use super::field::{Record, Visitor, fields, record};
use super::kind::{Stamp, kind};

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

impl BodyFrame {
    /// The stamp of its message, and of the cloud of the same step.
    pub fn stamp(&self) -> Stamp {
        Stamp {
            body: self.body as usize,
            number: Some(self.step as u32),
            time_ns: self.time_ns,
        }
    }
}

kind! { BodyFrame: "palpate_msgs/msg/BodyFrame", Frames, |body| format!("/bodies/{body}/frame"); }

record! { BodyFrame: Self::default();
    "# A frame of a body. The positions are in the point cloud of the same time on the channel /bodies/NAME.";
    "uint64 step      # number of the host step, from one; zero for the state before the first step" step;
    "uint64 time_ns   # the time at which the step was due" time_ns;
    "uint32 epoch     # topology epoch" epoch;
    "uint32 body      # index in a tick's bodies" body;
}
