//! A page in a browser, served on the loopback interface.
//!
//! ```text
//!   Feed -> hub (one thread) -> a mailbox for each browser -> WebSocket -> page/*.js
//!              ^                                                               |
//!              +------------------------- commands ----------------------------+
//! ```
//!
//! [`serve`] binds a port of 127.0.0.1 and passes the address of the page, which contains a random token, to its
//! caller. The page is complete inside the program (`page/`, embedded by [`assets`]): it loads nothing from a network,
//! and its content policy forbids this. A request without the token, with the name of another host, or from another
//! page is refused with one line (`request`, `server`).
//!
//! The thread of the hub (`hub`) pulls the feed. A browser has a mailbox (`mailbox`) with at most one frame that
//! waits. A later frame is merged into the waiting frame, so that a slow browser loses no spike and never slows the
//! feed or another browser. The page confirms each frame after it has drawn the frame, and at most two frames are
//! unconfirmed, so that no queue of old frames forms between the server and the page.
//!
//! **Extension.** The messages have a kind ([`host::live::Message::kind`]), and the modules of the page register for
//! the kinds that they show (`page/link.js`). The page sends everything through one function, as JSON with the field
//! `do`. A display of a study, and the answers of its participants, add a kind and a command in the same way.
//!
//! Loopback and token follow the practice of notebook servers. The checks of `Host` and `Origin` close the way that a
//! foreign page would take through the browser of the same person (DNS rebinding; RFC 6455, section 10.2).

use crate::feed::{Feed, FeedError};
use host::live::Message;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub mod assets;
#[cfg(test)]
mod hostile;
mod hub;
mod mailbox;
mod request;
mod server;
mod viewer;

/// Most browsers that view at the same time.
pub const VIEWERS: usize = 4;
/// Most connections at the same time, beside the WebSockets of the viewers.
pub const CONNECTIONS: usize = 32;

/// A form in which the page offers the present moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Picture {
    /// Vector graphics.
    Svg,
    /// Pixels.
    Png,
    /// A table.
    Csv,
}

/// Makes a picture or a table of the present moment from the messages of [`Feed::present`]. An error is one line for
/// the person.
pub type Moment = dyn Fn(&[Message], Picture) -> Result<Vec<u8>, String> + Send + Sync;

/// How the page is served.
pub struct Options {
    /// The port; zero for a free port.
    pub port: u16,
    /// Receives the address of the page, once, when the page can be opened.
    pub opened: Box<dyn Fn(&str) + Send + Sync>,
    /// Makes `moment.svg`, `moment.png` and `moment.csv`.
    pub moment: Arc<Moment>,
    /// The server ends soon after this becomes true.
    pub stop: Arc<AtomicBool>,
}

/// Why the page is not served, or no longer.
#[derive(Debug, thiserror::Error)]
pub enum WebError {
    /// The port could not be bound.
    #[error(
        "cannot serve a page on 127.0.0.1:{port}: {error}; give another port, or 0 for a free port"
    )]
    Bind {
        /// The port.
        port: u16,
        /// The reason.
        error: std::io::Error,
    },
    /// The system gave no random bits for the token.
    #[error("cannot read random bits from /dev/urandom: {0}")]
    Random(std::io::Error),
    /// A thread could not be started.
    #[error("cannot start a thread: {0}")]
    Thread(std::io::Error),
    /// The feed ended early.
    #[error(transparent)]
    Feed(#[from] FeedError),
}

/// Serves the page until `options.stop` becomes true or the feed fails. After the end of a run the page continues to
/// show the last state.
///
/// # Errors
/// [`WebError`] where the port cannot be bound, or where the feed ends early. The browsers receive the reason, too.
pub fn serve(feed: Box<dyn Feed>, options: &Options) -> Result<(), WebError> {
    let server = server::Server::start(options)?;
    (options.opened)(&server.address());
    let result = hub::run(feed, &server.asks(), &options.stop);
    server.stop();
    Ok(result?)
}
