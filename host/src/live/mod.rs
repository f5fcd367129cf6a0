//! A run as viewers see it while it is under way: frames, and the messages that carry the frames to viewers.
//!
//! A **frame** ([`Frame`]) is the state of a run at one moment: the hands, the states of bodies and host, the deformed
//! vertices, and the least and the greatest value of each curve over the ticks since the frame before, so that no spike
//! is lost. The same type describes a moment of a log that is played back. [`message`] is the encoding, which is the
//! same from the run to the viewer, over a Unix socket, and from the viewer to a page in a browser, over a WebSocket.

mod clusters;
pub mod frame;
pub mod gather;
pub mod hello;
pub mod merge;
pub mod message;
pub mod obstacle;
pub mod range;
pub mod socket;

pub use frame::{
    Bins, BodyInfo, BodyState, ContactArrow, DeviceInfo, Event, EventKind, Folded, Frame,
    HandState, HandleInfo, Hello, LogMessage, Playback, Source, ToolInfo, ToolState, Totals,
    Vertices,
};
pub use message::{Message, MessageError};
pub use obstacle::{ObstacleInfo, ObstacleState};
pub use range::Range;
