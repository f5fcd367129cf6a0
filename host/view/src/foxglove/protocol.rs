//! The messages of the server, as the specification of `foxglove.websocket.v1` defines them
//! (foxglove/ws-protocol, docs/spec.md): text messages are JSON objects with a field `op`, and binary messages begin
//! with one byte that names their kind. All numbers of a binary message are little-endian.

use host::live::Hello;
use serde::Serialize;
use std::collections::BTreeMap;
use tungstenite::Message as Packet;

/// The names under which clients ask for the protocol, in the order of preference. The two protocols are the same in
/// all parts that this server uses; newer clients offer only the second name.
pub(super) const SUBPROTOCOLS: [&str; 2] = ["foxglove.websocket.v1", "foxglove.sdk.v1"];

/// Kind of a binary message that holds a message of a channel.
const MESSAGE_DATA: u8 = 1;
/// Kind of a binary message that holds the present time.
const TIME: u8 = 2;

/// A channel as it is advertised.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Channel {
    /// Number of the channel. A number is never used for another channel.
    pub(super) id: u32,
    /// Its name, that of the log.
    pub(super) topic: String,
    /// Encoding of the messages.
    pub(super) encoding: &'static str,
    /// Name of the type of the messages.
    pub(super) schema_name: &'static str,
    /// Definition of the messages.
    pub(super) schema: String,
    /// Language of the definition.
    pub(super) schema_encoding: &'static str,
}

/// How severe a status message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Level {
    /// For information.
    Info,
    /// The client lacks something.
    Warning,
    /// The client did something wrong.
    Error,
}

/// A message of the server that is text.
#[derive(Serialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
enum Text<'a> {
    ServerInfo {
        name: String,
        capabilities: [&'a str; 1],
        metadata: BTreeMap<&'a str, &'a str>,
        session_id: &'a str,
    },
    Advertise {
        channels: &'a [Channel],
    },
    Unadvertise {
        channel_ids: &'a [u32],
    },
    Status {
        level: u8,
        message: &'a str,
    },
}

fn json(text: &Text<'_>) -> String {
    // These types have only text keys and no numbers but integers: writing to memory cannot fail.
    serde_json::to_string(text).unwrap_or_default()
}

/// The first message to a client. A client that connects again knows by `session` whether the source is the same.
///
/// The only capability is `time`: without it, clients date every message by their own clock, and the axis of a chart
/// would not be the time of the run.
pub(super) fn server_info(hello: &Hello, session: &str) -> String {
    let mut metadata: BTreeMap<&str, &str> = hello
        .facts
        .iter()
        .map(|(name, value)| (name.as_str(), value.as_str()))
        .collect();
    metadata.insert("clock", &hello.clock);
    metadata.insert("scheme", &hello.scheme);
    let name = match hello.scene.as_str() {
        "" => "palpate".to_owned(),
        scene => format!("palpate: {scene}"),
    };
    json(&Text::ServerInfo {
        name,
        capabilities: ["time"],
        metadata,
        session_id: session,
    })
}

/// Tells a client which channels there are.
pub(super) fn advertise(channels: &[Channel]) -> String {
    json(&Text::Advertise { channels })
}

/// Tells a client that channels are gone.
pub(super) fn unadvertise(channel_ids: &[u32]) -> String {
    json(&Text::Unadvertise { channel_ids })
}

/// Tells a client something that a person should read.
pub(super) fn status(level: Level, message: &str) -> String {
    let level = match level {
        Level::Info => 0,
        Level::Warning => 1,
        Level::Error => 2,
    };
    json(&Text::Status { level, message })
}

/// A message of a channel to a subscription. `time_ns` is the time of the message.
pub(super) fn message(subscription: u32, time_ns: u64, data: &[u8]) -> Packet {
    let subscription = subscription.to_le_bytes();
    let time = time_ns.to_le_bytes();
    Packet::binary([&[MESSAGE_DATA][..], &subscription, &time, data].concat())
}

/// The present time.
pub(super) fn time(time_ns: u64) -> Packet {
    Packet::binary([&[TIME][..], &time_ns.to_le_bytes()].concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_have_the_form_of_the_specification() {
        assert_eq!(
            status(Level::Warning, "a \"word\""),
            r#"{"op":"status","level":1,"message":"a \"word\""}"#
        );
        assert_eq!(
            unadvertise(&[3, 4]),
            r#"{"op":"unadvertise","channelIds":[3,4]}"#
        );
        let channel = Channel {
            id: 1,
            topic: "/tick".into(),
            encoding: "cdr",
            schema_name: "a/msg/B",
            schema: "uint8 c\n".to_owned(),
            schema_encoding: "ros2msg",
        };
        let advertised = concat!(
            r#"{"op":"advertise","channels":[{"id":1,"topic":"/tick","encoding":"cdr","schemaName":"a/msg/B","#,
            r#""schema":"uint8 c\n","schemaEncoding":"ros2msg"}]}"#
        );
        assert_eq!(advertise(&[channel]), advertised);
        let hello = Hello {
            scene: "stretch".into(),
            clock: "real".into(),
            scheme: "capped".into(),
            facts: BTreeMap::from([("seed".into(), "7".into())]),
            ..Hello::default()
        };
        let info = concat!(
            r#"{"op":"serverInfo","name":"palpate: stretch","capabilities":["time"],"#,
            r#""metadata":{"clock":"real","scheme":"capped","seed":"7"},"sessionId":"5"}"#
        );
        assert_eq!(server_info(&hello, "5"), info);

        let bytes = |packet: Packet| packet.into_data().to_vec();
        let data = bytes(message(2, 3, &[9, 8]));
        assert_eq!(data, [1, 2, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 9, 8]);
        assert_eq!(bytes(time(258)), [2, 2, 1, 0, 0, 0, 0, 0, 0]);
    }
}
