//! A kind of record that a log keeps: its channel and the type of its messages. A channel is one of the run, or one of each
//! body.

/// A channel of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelInfo {
    /// Name of the channel.
    pub topic: String,
    /// Name of the type of its messages.
    pub schema_name: &'static str,
    /// Definition of its messages.
    pub schema_text: String,
    /// Language of the definition.
    pub schema_encoding: &'static str,
    /// Encoding of the messages.
    pub encoding: &'static str,
}

/// A kind of record that a log keeps.
pub trait Kind {
    /// Name of the type of its messages.
    const SCHEMA_NAME: &'static str;

    /// The name of its channel. A channel of the run does not depend on the name of a body.
    fn topic(body: &str) -> String;

    /// The definition of its messages. A log whose fields differ from those of this text is refused, so any change of a
    /// field makes older logs unreadable.
    fn definition() -> String;

    /// Its channel.
    fn channel(body: &str) -> ChannelInfo {
        ChannelInfo {
            topic: Self::topic(body),
            schema_name: Self::SCHEMA_NAME,
            schema_text: Self::definition(),
            schema_encoding: "ros2msg",
            encoding: "cdr",
        }
    }
}
