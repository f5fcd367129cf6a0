//! The hub: pulls the feed, and passes its messages to the mailboxes of the browsers.

use super::mailbox::Mailbox;
use crate::door::Client;
use crate::feed::{Command, Feed, FeedError};
use host::live::Message;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender};
use std::time::Duration;

/// Longest wait for a message, and so the longest time until a command acts.
const WAIT: Duration = Duration::from_millis(8);

/// A request of a connection to the hub.
pub(super) enum Ask {
    /// A browser joins.
    Join(Arc<Client<Mailbox>>),
    /// A browser left.
    Leave(u64),
    /// A browser sent a command.
    Command(u64, Command),
    /// The messages that describe the present state.
    Present(Sender<Vec<Message>>),
}

/// The browsers.
#[derive(Default)]
struct Viewers {
    clients: BTreeMap<u64, Arc<Client<Mailbox>>>,
    /// Those that show stresses.
    stressed: BTreeSet<u64>,
}

impl Viewers {
    fn tell(&self, message: &Message) {
        for client in self.clients.values() {
            client.with(|mailbox| mailbox.deliver(message));
        }
    }

    fn answer(&mut self, ask: Ask, feed: &mut dyn Feed, ended: Option<&Message>) {
        let stressed = !self.stressed.is_empty();
        match ask {
            Ask::Join(client) => {
                let present = feed.present().into_iter().map(for_a_page);
                for message in present.chain(ended.cloned()) {
                    client.with(|mailbox| mailbox.deliver(&message));
                }
                self.clients.insert(client.number, client);
            }
            Ask::Leave(viewer) => {
                self.clients.remove(&viewer);
                self.stressed.remove(&viewer);
            }
            Ask::Command(viewer, Command::Stress { on: true }) => {
                self.stressed.insert(viewer);
            }
            Ask::Command(viewer, Command::Stress { on: false }) => {
                self.stressed.remove(&viewer);
            }
            Ask::Command(_, command) => feed.command(&command),
            // A connection that has gone needs no answer.
            Ask::Present(sender) => drop(sender.send(feed.present())),
        }
        // Stresses are computed as long as one of the browsers shows them.
        let on = !self.stressed.is_empty();
        if on != stressed {
            feed.command(&Command::Stress { on });
        }
    }
}

/// Runs until `stop`, or until the feed fails. After the end of a run the hub only answers.
pub(super) fn run(
    mut feed: Box<dyn Feed>,
    asks: &Receiver<Ask>,
    stop: &AtomicBool,
) -> Result<(), FeedError> {
    let mut viewers = Viewers::default();
    let mut ended: Option<Message> = None;
    loop {
        if stop.load(Ordering::Acquire) {
            return Ok(());
        }
        while let Ok(ask) = asks.try_recv() {
            viewers.answer(ask, feed.as_mut(), ended.as_ref());
        }
        if ended.is_some() {
            if let Ok(ask) = asks.recv_timeout(WAIT) {
                viewers.answer(ask, feed.as_mut(), ended.as_ref());
            }
            continue;
        }
        match feed.next(WAIT) {
            Ok(Some(message)) => {
                let message = for_a_page(message);
                viewers.tell(&message);
                if matches!(message, Message::End(_) | Message::Refused(_)) {
                    ended = Some(message);
                }
            }
            Ok(None) => {}
            Err(error) => {
                viewers.tell(&Message::Refused(error.to_string()));
                return Err(error);
            }
        }
    }
}

/// The message without the parts that a page does not need: the scene and its files, and the messages of the log.
fn for_a_page(mut message: Message) -> Message {
    match &mut message {
        Message::Hello(hello) => {
            hello.scene_text.clear();
            hello.files.clear();
        }
        Message::Frame(frame) => {
            frame.log.clear();
            frame.more_log = 0;
        }
        _ => {}
    }
    message
}
