//! A page in a browser, served on the loopback interface.
//!
//! ```text
//!   Feed -> hub (one thread) -> a mailbox for each browser -> door -> page/*.js
//!              ^                                                        |
//!              +------------------------- commands ---------------------+
//! ```
//!
//! [`serve`] passes the address of the page to its caller. The door (`crate::door`) says who may connect; this service
//! admits its own page alone. The page is complete inside the program (`page/`, embedded by [`assets`]): it loads nothing
//! from a network, and its content policy forbids this.
//!
//! The thread of the hub (`hub`) pulls the feed. A browser has a mailbox (`mailbox`) with at most one frame that
//! waits. A later frame is merged into the waiting frame, so that a slow browser loses no spike and never slows the
//! feed or another browser. The page confirms each frame after it has drawn the frame, and at most two frames are
//! unconfirmed, so that no queue of old frames forms between the server and the page.
//!
//! **Extension.** The messages have a kind ([`host::live::Message::kind`]), and the modules of the page register for
//! the kinds that they show (`page/link.js`). The page sends everything through one function, as JSON with the field
//! `do`. A display of a study, and the answers of its participants, add a kind and a command in the same way.

use crate::door::{Bound, DoorError, Say};
use crate::feed::{Feed, FeedError};
use host::live::Message;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub mod assets;
#[cfg(test)]
mod hostile_tests;
mod hub;
mod mailbox;
mod service;

/// A form of a still that the page offers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Picture {
    /// Vector graphics.
    Svg,
    /// Pixels.
    Png,
    /// A table.
    Csv,
}

/// Makes a still, a picture or a table, from the messages of [`Feed::present`]. An error is one line for
/// the person.
pub type Draw = dyn Fn(&[Message], Picture) -> Result<Vec<u8>, String> + Send + Sync;

/// How the page is served.
pub struct Options {
    /// The port; zero for a free port.
    pub port: u16,
    /// Receives the address of the page, and a line about each client that is refused.
    pub say: Say,
    /// Makes `still.svg`, `still.png` and `still.csv`.
    pub draw: Arc<Draw>,
    /// The server ends soon after this becomes true.
    pub stop: Arc<AtomicBool>,
}

/// Why the page is not served, or no longer.
#[derive(Debug, thiserror::Error)]
pub enum WebError {
    /// The server could not be started.
    #[error(transparent)]
    Door(#[from] DoorError),
    /// The feed ended early.
    #[error(transparent)]
    Feed(#[from] FeedError),
}

/// Serves the page until `options.stop` becomes true or the feed fails. After the end of a run the page continues to
/// show the last state.
///
/// # Errors
/// [`WebError`] if the port cannot be bound, or if the feed ends early. The browsers receive the reason, too.
pub fn serve(feed: Box<dyn Feed>, options: &Options) -> Result<(), WebError> {
    let bound = Bound::new(options.port)?;
    (options.say)(&format!("http://{}/", bound.address()));
    let (page, asks) = service::Page::new(Arc::clone(&options.draw));
    let door = bound.open(page, Arc::clone(&options.say))?;
    let result = hub::run(feed, &asks, &options.stop);
    // Whoever still asks is told that the server ends.
    drop(asks);
    door.close("The server ends.");
    Ok(result?)
}
