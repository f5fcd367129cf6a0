//! A kind of record that a log keeps: its channels, and its messages.
//!
//! [`KINDS`] lists all kinds. The log writes and reads the kinds of this list, and the index of a log keeps the records of
//! each kind by its type. A new kind is one file with its [`Kind`], and one entry of the list.

use super::{BodyFrame, Cloud, ContactStep, ModelRow, PatchRow, Surface, TearEvent, TickRow};
use std::any::Any;
use std::fmt;

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

/// Kinds whose channels a log has together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// One channel of the run, in every log.
    Run,
    /// A channel of each body, in a log with frames of the bodies.
    Frames,
    /// A channel of each body that tears.
    Tears,
    /// One channel, in the log of a scene with contact.
    Contacts,
    /// One channel, in the log of a scene with tools.
    Tools,
}

impl Group {
    /// The channels of its kinds, for the body of this name.
    pub fn channels(self, body: &str) -> impl Iterator<Item = ChannelInfo> {
        let kinds = KINDS.iter().filter(move |kind| kind.group == self);
        kinds.map(move |kind| (kind.channel)(body))
    }
}

/// The number and the time of a message, and the body whose channel it is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Index of the body; zero for a channel of the run.
    pub body: usize,
    /// The number of the message; `None` for its number among the messages of its channel, from zero.
    pub number: Option<u32>,
    /// Its time (ns).
    pub time_ns: u64,
}

/// A kind of record that a log keeps.
pub trait Kind: Clone + fmt::Debug + Send + Sync + 'static {
    /// Name of the type of its messages.
    const SCHEMA_NAME: &'static str;
    /// The kinds together with which a log has its channels.
    const GROUP: Group;

    /// The name of its channel. A channel of the run does not depend on the name of a body.
    fn topic(body: &str) -> String;

    /// The definition of its messages. A log whose fields differ from those of this text is refused, so any change of a
    /// field makes older logs unreadable.
    fn definition() -> String;

    /// Writes its message in place of the content of `message`.
    fn encode(&mut self, message: &mut Vec<u8>);

    /// Reads the message of this time (ns) back; `None` if the message does not match the definition.
    fn decode(time_ns: u64, message: &[u8]) -> Option<Self>;

    /// Whether a message of this time (ns) may follow the record `before`, the last one of its kind in a chunk.
    fn follows(&self, _time_ns: u64, _before: Option<&Self>) -> bool {
        true
    }

    /// About its size in memory (bytes), in addition to the size of its message.
    fn size(&self) -> usize {
        0
    }

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

    /// Its message.
    fn message(mut self) -> Vec<u8> {
        let mut message = Vec::new();
        self.encode(&mut message);
        message
    }
}

/// Implements [`Kind`] for a record with a list of fields ([`super::field::record`]), by the name of its type, its group
/// and its topic, and any methods that it has of its own.
macro_rules! kind {
    ($type:ty: $name:literal, $group:ident, $topic:expr; $($own:item)*) => {
        impl $crate::record::Kind for $type {
            const SCHEMA_NAME: &'static str = $name;
            const GROUP: $crate::record::Group = $crate::record::Group::$group;

            fn topic(body: &str) -> String {
                let topic: fn(&str) -> String = $topic;
                topic(body)
            }

            fn definition() -> String {
                $crate::record::field::definition::<Self>()
            }

            fn encode(&mut self, message: &mut Vec<u8>) {
                $crate::record::cdr::encode(self, message);
            }

            fn decode(_: u64, message: &[u8]) -> Option<Self> {
                $crate::record::cdr::decode(message)
            }

            $($own)*
        }
    };
}
pub(super) use kind;

/// The records of one kind in a part of a log, in the order of the file.
#[derive(Clone, Debug)]
pub(crate) struct Records<K> {
    /// The number of the channel and the time (ns) of each record.
    pub places: Vec<(u16, u64)>,
    /// The records.
    pub records: Vec<K>,
}

/// The records of any kind.
pub(crate) trait List: Any + fmt::Debug + Send + Sync {
    /// Reads a message of this channel and time (ns); `None` if the message is damaged.
    fn take(&mut self, channel: u16, time_ns: u64, message: &[u8]) -> Option<()>;

    /// About the size in memory (bytes), in addition to the size of the messages.
    fn size(&self) -> usize;
}

impl<K: Kind> List for Records<K> {
    fn take(&mut self, channel: u16, time_ns: u64, message: &[u8]) -> Option<()> {
        let record = K::decode(time_ns, message)?;
        record.follows(time_ns, self.records.last()).then(|| {
            self.places.push((channel, time_ns));
            self.records.push(record);
        })
    }

    fn size(&self) -> usize {
        let own = self.records.iter().map(Kind::size).sum::<usize>();
        own + size_of_val(&*self.records) + size_of_val(&*self.places)
    }
}

/// A kind, as the list of all kinds has it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KindInfo {
    /// See [`Kind::SCHEMA_NAME`].
    pub schema_name: &'static str,
    /// See [`Kind::GROUP`].
    pub group: Group,
    /// See [`Kind::definition`].
    pub definition: fn() -> String,
    /// See [`Kind::channel`].
    pub channel: fn(&str) -> ChannelInfo,
    /// An empty list of its records.
    pub list: fn() -> Box<dyn List>,
}

impl KindInfo {
    const fn of<K: Kind>() -> Self {
        Self {
            schema_name: K::SCHEMA_NAME,
            group: K::GROUP,
            definition: K::definition,
            channel: K::channel,
            list: || {
                Box::new(Records::<K> {
                    places: Vec::new(),
                    records: Vec::new(),
                })
            },
        }
    }
}

/// All kinds, in the order in which a log has their channels.
pub(crate) static KINDS: [KindInfo; 8] = [
    KindInfo::of::<TickRow>(),
    KindInfo::of::<ModelRow>(),
    KindInfo::of::<Cloud>(),
    KindInfo::of::<BodyFrame>(),
    KindInfo::of::<Surface>(),
    KindInfo::of::<TearEvent>(),
    KindInfo::of::<ContactStep>(),
    KindInfo::of::<PatchRow>(),
];
