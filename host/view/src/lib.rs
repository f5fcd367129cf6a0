//! The viewer: a process of its own that shows a run or a log, in a terminal, in a browser, or to other programs.
//!
//! ```text
//!   a run, over its Unix socket  \                / terminal
//!                                  Feed: messages   web: a page in a browser
//!   a log, played back           /                \ foxglove: other people's viewers
//! ```
//!
//! A **feed** ([`feed::Feed`]) gives the messages of [`host::live`], and takes the commands of the person who looks. A
//! feed from a run ([`live`]) sends nothing to the run: its commands act on the viewer alone. The page and the server for
//! other viewers stand behind one [`door`].
#![forbid(unsafe_code)]

pub mod door;
pub mod feed;
pub mod foxglove;
pub mod history;
pub mod live;
pub mod playback;
pub mod still;
pub mod stress;
pub mod terminal;
pub mod web;
