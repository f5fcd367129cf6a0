//! The subscriptions of one client, and the answers to the messages of the client.
//!
//! A client may subscribe to channels and cancel subscriptions. Everything else that a client sends has no effect, and
//! the answer says so. The functions here are pure: no message reaches the source.

use super::protocol::{Channel, Level, status};
use serde::Deserialize;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Most characters of a client's text that an answer repeats.
const QUOTED: usize = 40;

/// A message of a client.
#[derive(Clone, Copy, Debug)]
pub(super) enum Incoming<'a> {
    /// A text message.
    Text(&'a str),
    /// A binary message.
    Binary(&'a [u8]),
}

/// The effect of a message of a client.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Answer {
    /// The answer: a status message. `None` if everything is in order.
    pub(super) status: Option<String>,
    /// The subscriptions that the client cancelled.
    pub(super) cancelled: Vec<u32>,
}

/// The subscriptions of a client.
#[derive(Debug, Default)]
pub(super) struct Session {
    /// The channel of each subscription, by the number that the client gave.
    subscriptions: BTreeMap<u32, u32>,
}

#[derive(Deserialize)]
struct Op<'a> {
    #[serde(borrow)]
    op: Cow<'a, str>,
}

#[derive(Deserialize)]
struct Subscribe {
    subscriptions: Vec<Subscription>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    channel_id: u32,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Unsubscribe {
    subscription_ids: Vec<u32>,
}

impl Session {
    /// The subscription to a channel.
    pub(super) fn subscription(&self, channel: u32) -> Option<u32> {
        let mut all = self.subscriptions.iter();
        all.find(|(_, subscribed)| **subscribed == channel)
            .map(|(id, _)| *id)
    }

    /// Number of subscriptions.
    #[cfg(test)]
    pub(super) fn count(&self) -> usize {
        self.subscriptions.len()
    }

    /// Forgets all subscriptions.
    pub(super) fn clear(&mut self) {
        self.subscriptions.clear();
    }

    /// Takes a message of the client. `channels` are the channels that the client was told of.
    pub(super) fn receive(&mut self, channels: &[Channel], incoming: Incoming<'_>) -> Answer {
        let error = |text: &str| Answer {
            status: Some(status(Level::Error, text)),
            cancelled: Vec::new(),
        };
        let text = match incoming {
            Incoming::Text(text) => text,
            Incoming::Binary(bytes) => {
                return error(&match bytes.first() {
                    None => "an empty binary message was ignored".to_owned(),
                    Some(kind) => format!(
                        "a binary message of kind {kind} was ignored: this server takes no data and offers no services"
                    ),
                });
            }
        };
        let op = match serde_json::from_str::<Op<'_>>(text) {
            Ok(Op { op }) => op,
            Err(why) => return error(&format!("a message was ignored: it cannot be read: {why}")),
        };
        match op.as_ref() {
            "subscribe" => match serde_json::from_str::<Subscribe>(text) {
                Ok(wanted) => Answer {
                    status: self.subscribe(channels, &wanted.subscriptions),
                    cancelled: Vec::new(),
                },
                Err(why) => error(&format!("\"subscribe\" cannot be read: {why}")),
            },
            "unsubscribe" => match serde_json::from_str::<Unsubscribe>(text) {
                // A client that cancels a subscription twice, or one that ended with its channel, loses nothing.
                Ok(Unsubscribe { subscription_ids }) => Answer {
                    status: None,
                    cancelled: subscription_ids
                        .into_iter()
                        .filter(|id| self.subscriptions.remove(id).is_some())
                        .collect(),
                },
                Err(why) => error(&format!("\"unsubscribe\" cannot be read: {why}")),
            },
            other => Answer {
                status: Some(status(
                    Level::Warning,
                    &format!(
                        "{:?} was ignored: this server has channels to subscribe to, and nothing else",
                        other.chars().take(QUOTED).collect::<String>()
                    ),
                )),
                cancelled: Vec::new(),
            },
        }
    }

    /// Adds subscriptions. Returns a status message if some were refused: the reason of the first, and their number.
    fn subscribe(&mut self, channels: &[Channel], wanted: &[Subscription]) -> Option<String> {
        let mut first = None;
        let mut refused = 0;
        for Subscription { id, channel_id } in wanted {
            let topic = channels.iter().find(|channel| channel.id == *channel_id);
            let reason = match topic {
                None => format!("channel {channel_id} does not exist"),
                Some(_) if self.subscriptions.contains_key(id) => {
                    format!("the number {id} belongs to another subscription")
                }
                Some(channel) if self.subscription(*channel_id).is_some() => {
                    format!("this client has a subscription to {}", channel.topic)
                }
                Some(_) => {
                    self.subscriptions.insert(*id, *channel_id);
                    continue;
                }
            };
            first.get_or_insert(reason);
            refused += 1;
        }
        first.map(|reason| {
            let of = wanted.len();
            let text = format!("{refused} of {of} subscriptions refused: {reason}");
            status(Level::Error, &text)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channels() -> Vec<Channel> {
        ["/tick", "/model"]
            .iter()
            .zip(1..)
            .map(|(topic, id)| Channel {
                id,
                topic: (*topic).to_owned(),
                encoding: "cdr",
                schema_name: "a",
                schema: String::new(),
                schema_encoding: "ros2msg",
            })
            .collect()
    }

    fn receive(session: &mut Session, text: &str) -> Answer {
        session.receive(&channels(), Incoming::Text(text))
    }

    /// The message of the status that a text message causes.
    fn refusal(session: &mut Session, text: &str) -> String {
        let status = receive(session, text).status.expect("a status");
        let status: serde_json::Value = serde_json::from_str(&status).expect("JSON");
        assert_eq!(status["op"], "status");
        status["message"].as_str().expect("a message").to_owned()
    }

    #[test]
    fn a_client_subscribes_and_cancels() {
        let mut session = Session::default();
        let both =
            r#"{"op":"subscribe","subscriptions":[{"id":7,"channelId":1},{"id":0,"channelId":2}]}"#;
        assert_eq!(receive(&mut session, both), Answer::default());
        assert_eq!(session.subscription(1), Some(7));
        assert_eq!(session.subscription(2), Some(0));
        let cancel = r#"{"op":"unsubscribe","subscriptionIds":[7,8,7]}"#;
        assert_eq!(receive(&mut session, cancel).cancelled, [7]);
        assert_eq!(session.subscription(1), None);
        assert_eq!(session.subscription(2), Some(0));
        let again = r#"{"op":"subscribe","subscriptions":[{"id":7,"channelId":1}]}"#;
        assert_eq!(receive(&mut session, again), Answer::default());
        assert_eq!(session.subscription(1), Some(7));
    }

    #[test]
    fn a_wrong_subscription_is_refused_and_changes_nothing() {
        let mut session = Session::default();
        let wanted = r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":1},{"id":1,"channelId":2},
            {"id":2,"channelId":1},{"id":3,"channelId":9}]}"#;
        assert_eq!(
            refusal(&mut session, wanted),
            "3 of 4 subscriptions refused: the number 1 belongs to another subscription"
        );
        assert_eq!(session.subscription(1), Some(1));
        assert_eq!(session.subscription(2), None);
        let twice = r#"{"op":"subscribe","subscriptions":[{"id":2,"channelId":1}]}"#;
        assert_eq!(
            refusal(&mut session, twice),
            "1 of 1 subscriptions refused: this client has a subscription to /tick"
        );
        let none = r#"{"op":"subscribe","subscriptions":[{"id":2,"channelId":3}]}"#;
        assert_eq!(
            refusal(&mut session, none),
            "1 of 1 subscriptions refused: channel 3 does not exist"
        );
    }

    #[test]
    fn everything_else_is_answered_and_has_no_effect() {
        let mut session = Session::default();
        for text in [
            "",
            "{",
            "[]",
            "null",
            r#"{"op":3}"#,
            r#"{"op":"subscribe"}"#,
            r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}"#,
            r#"{"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":1}]}"#,
            r#"{"op":"subscribe","subscriptions":[{"id":1.5,"channelId":1}]}"#,
            r#"{"op":"unsubscribe","subscriptionIds":"all"}"#,
            &"[".repeat(50_000),
        ] {
            let message = refusal(&mut session, text);
            assert!(message.contains("cannot be read"), "{text}: {message}");
        }
        let other = format!(r#"{{"op":"{}"}}"#, "x".repeat(1000));
        let message = refusal(&mut session, &other);
        assert!(
            message.starts_with("\"xxxx") && message.len() < 150,
            "{message}"
        );
        for op in [
            "advertise",
            "setParameters",
            "fetchAsset",
            "subscribeConnectionGraph",
        ] {
            let message = refusal(&mut session, &format!(r#"{{"op":"{op}"}}"#));
            assert!(message.contains(op), "{message}");
        }
        for bytes in [&[][..], &[1, 0, 0, 0, 0, 5], &[2], &[255; 100]] {
            let answer = session.receive(&channels(), Incoming::Binary(bytes));
            assert!(
                answer
                    .status
                    .is_some_and(|status| status.contains("ignored"))
            );
        }
        assert!(session.subscriptions.is_empty());
    }
}
