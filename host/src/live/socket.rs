//! The Unix socket through which viewers watch a run.
//!
//! A thread of its own serves up to eight viewers. The run gives this thread frames over a bounded channel and never
//! waits for it. The thread sends to each viewer as fast as the viewer takes; the frames that a viewer does not take are
//! merged into one. Nothing is read from a viewer.
//!
//! - [`address`]: where the sockets are, and who may connect;
//! - [`listener`]: a socket that accepts viewers, and the file that belongs to it;
//! - [`server`]: the thread;
//! - `viewer`: the messages that one viewer has received, and the next message.

pub mod address;
pub mod listener;
pub mod server;
mod station;
mod viewer;

pub use listener::{Listener, SocketError};
pub use server::{Server, Update, UpdateSender};
