//! The messages that wait for one client.
//!
//! Messages of the channels go in order. When the messages that wait exceed the limit, the oldest are dropped and
//! counted, and a status message tells the client their number. A slow client therefore sees the present, with gaps.

use super::protocol::{Channel, Level, message, status, time};
use super::session::{Incoming, Session};
use crate::door;
use std::collections::VecDeque;
use std::sync::Arc;
use tungstenite::Message as Packet;

/// Bytes of messages that wait for a client at most: several seconds of a run with large bodies.
pub(super) const QUEUE_LIMIT: usize = 16 << 20;
/// Bytes that each waiting message takes in addition to its content.
const OVERHEAD: usize = 64;

/// A message that waits.
#[derive(Debug)]
struct Item {
    /// The time at which the source was when it gave the message (ns).
    clock_ns: u64,
    /// `None` for a message that tells only the time.
    message: Option<(u32, u64, Arc<[u8]>)>,
}

impl Item {
    fn size(&self) -> usize {
        OVERHEAD + self.message.as_ref().map_or(0, |(_, _, data)| data.len())
    }
}

/// The subscriptions of a client, and the messages that wait for it.
#[derive(Debug)]
pub(super) struct Queue {
    session: Session,
    channels: Arc<[Channel]>,
    items: VecDeque<Item>,
    /// Sum of the sizes of the items.
    size: usize,
    limit: usize,
    dropped: u64,
    /// The number of dropped messages that the client knows of.
    reported: u64,
    /// The time that the client knows (ns).
    clock_ns: Option<u64>,
}

impl Queue {
    /// A queue whose messages take at most `limit` bytes. A single larger message is sent nevertheless.
    pub(super) fn new(limit: usize) -> Self {
        Self {
            session: Session::default(),
            channels: Arc::from([]),
            items: VecDeque::new(),
            size: 0,
            limit,
            dropped: 0,
            reported: 0,
            clock_ns: None,
        }
    }

    /// Takes a message of the client. Returns the answer.
    pub(super) fn receive(&mut self, incoming: Incoming<'_>) -> Option<String> {
        let answer = self.session.receive(&self.channels, incoming);
        self.cancel(&answer.cancelled);
        answer.status
    }

    /// Gives the client new channels in place of its former ones. Their subscriptions and messages end, and do not count
    /// as dropped.
    pub(super) fn replace_channels(&mut self, channels: &Arc<[Channel]>) {
        self.channels = Arc::clone(channels);
        self.session.clear();
        self.items.clear();
        self.size = 0;
    }

    /// Whether the client has a subscription to a channel.
    pub(super) fn wants(&self, channel: u32) -> bool {
        self.session.subscription(channel).is_some()
    }

    /// Adds a message of a channel if the client has a subscription to the channel.
    pub(super) fn deliver(&mut self, channel: u32, time_ns: u64, clock_ns: u64, data: &Arc<[u8]>) {
        if let Some(subscription) = self.session.subscription(channel) {
            self.push_message(subscription, time_ns, clock_ns, data);
        }
    }

    /// Adds a message of a channel for the subscription `subscription`. `time_ns` is the time of the message, and
    /// `clock_ns` the time of the source.
    fn push_message(&mut self, subscription: u32, time_ns: u64, clock_ns: u64, data: &Arc<[u8]>) {
        self.push(Item {
            clock_ns,
            message: Some((subscription, time_ns, Arc::clone(data))),
        });
    }

    /// Adds the time of the source. A message that waits already brings its own time.
    pub(super) fn push_time(&mut self, clock_ns: u64) {
        if self.items.is_empty() {
            self.push(Item {
                clock_ns,
                message: None,
            });
        }
    }

    fn push(&mut self, item: Item) {
        self.size += item.size();
        self.items.push_back(item);
        while self.size > self.limit && self.items.len() > 1 {
            if let Some(oldest) = self.items.pop_front() {
                self.size -= oldest.size();
                self.dropped += u64::from(oldest.message.is_some());
            }
        }
    }

    /// Removes the messages that wait for cancelled subscriptions.
    fn cancel(&mut self, subscriptions: &[u32]) {
        let cancelled = |item: &Item| {
            let message = item.message.as_ref();
            message.is_some_and(|(subscription, ..)| subscriptions.contains(subscription))
        };
        self.items.retain(|item| !cancelled(item));
        self.size = self.items.iter().map(Item::size).sum();
    }
}

impl door::Queue for Queue {
    type Item = Packet;

    fn pop(&mut self, _closing: bool) -> Option<Packet> {
        loop {
            let clock_ns = self.items.front()?.clock_ns;
            // A client that stays slow gets a report whenever the number has doubled, and one when it has caught up.
            let caught_up = self.items.len() == 1;
            if self.dropped > self.reported && (caught_up || self.dropped >= 2 * self.reported) {
                self.reported = self.dropped;
                let text = format!(
                    "{} messages were dropped so far because this client reads too slowly",
                    self.dropped
                );
                return Some(Packet::text(status(Level::Warning, &text)));
            }
            if self.clock_ns.replace(clock_ns) != Some(clock_ns) {
                return Some(time(clock_ns));
            }
            let item = self.items.pop_front()?;
            self.size -= item.size();
            if let Some((subscription, time_ns, data)) = item.message {
                return Some(message(subscription, time_ns, &data));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data(length: usize, value: u8) -> Arc<[u8]> {
        vec![value; length].into()
    }

    /// The packets in the queue, in order.
    fn packets(queue: &mut Queue) -> Vec<String> {
        let pop = || door::Queue::pop(queue, false);
        let packets = std::iter::from_fn(pop).map(|packet| match packet {
            Packet::Text(text) => text.as_str().to_owned(),
            other => match &other.into_data()[..] {
                [2, time, ..] => format!("time {time}"),
                bytes => format!("{} to {} at {}", bytes[13], bytes[1], bytes[5]),
            },
        });
        packets.collect()
    }

    #[test]
    fn messages_go_in_order_with_the_time() {
        let mut queue = Queue::new(1000);
        queue.push_message(3, 4, 5, &data(1, 10));
        queue.push_message(4, 5, 5, &data(1, 11));
        queue.push_message(3, 6, 6, &data(1, 12));
        let expected = [
            "time 5",
            "10 to 3 at 4",
            "11 to 4 at 5",
            "time 6",
            "12 to 3 at 6",
        ];
        assert_eq!(packets(&mut queue), expected);
        queue.push_time(6);
        queue.push_time(7);
        assert_eq!(packets(&mut queue), Vec::<String>::new());
        queue.push_time(7);
        assert_eq!(packets(&mut queue), ["time 7"]);
    }

    #[test]
    fn the_oldest_messages_are_dropped_and_the_client_is_told() {
        let mut queue = Queue::new(3 * (OVERHEAD + 10));
        for value in 0..10 {
            queue.push_message(1, 0, 0, &data(10, value));
        }
        let expected = [
            r#"{"op":"status","level":1,"message":"7 messages were dropped so far because this client reads too slowly"}"#,
            "time 0",
            "7 to 1 at 0",
            "8 to 1 at 0",
            "9 to 1 at 0",
        ];
        assert_eq!(packets(&mut queue), expected);
        queue.push_message(1, 0, 0, &data(10, 10));
        assert_eq!(packets(&mut queue), ["10 to 1 at 0"]);
        assert_eq!(queue.size, 0);
    }

    #[test]
    fn a_message_above_the_limit_is_sent() {
        let mut queue = Queue::new(100);
        queue.push_message(1, 0, 0, &data(1, 1));
        queue.push_message(1, 0, 0, &data(110, 2));
        assert_eq!(
            packets(&mut queue).last().map(String::as_str),
            Some("2 to 1 at 0")
        );
        assert_eq!(queue.dropped, 1);
    }

    #[test]
    fn a_client_that_stays_slow_gets_few_reports() {
        let mut queue = Queue::new(4 * (OVERHEAD + 1));
        let mut reports = 0;
        for _ in 0..1000 {
            (0..3).for_each(|_| queue.push_message(1, 0, 0, &data(1, 0)));
            let packet = door::Queue::pop(&mut queue, false);
            reports += u32::from(packet.is_some_and(|packet| packet.is_text()));
        }
        assert!((5..15).contains(&reports), "{reports}");
    }

    #[test]
    fn messages_of_a_cancelled_subscription_are_not_sent() {
        let mut queue = Queue::new(1000);
        queue.push_message(1, 0, 0, &data(1, 10));
        queue.push_message(2, 0, 0, &data(1, 11));
        queue.cancel(&[1]);
        assert_eq!(packets(&mut queue), ["time 0", "11 to 2 at 0"]);
        assert_eq!((queue.dropped, queue.size), (0, 0));
    }
}
