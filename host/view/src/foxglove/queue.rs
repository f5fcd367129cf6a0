//! What waits to be sent to one client.
//!
//! Texts and answers go first, and none is dropped. Messages of the channels go in order. When the messages that wait
//! exceed the limit, the oldest are dropped and counted, and a status message tells the client their number. A slow
//! client therefore sees the present, with gaps.

use super::protocol::{Level, put_message, put_text, put_time, status};
use std::collections::VecDeque;
use std::sync::Arc;

/// Bytes that each waiting message takes beside its content.
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

/// The queue of a client.
#[derive(Debug)]
pub(super) struct Queue {
    /// Frames of a WebSocket.
    first: VecDeque<Vec<u8>>,
    items: VecDeque<Item>,
    /// Sum of the sizes of the items.
    size: usize,
    limit: usize,
    dropped: u64,
    /// The number of dropped messages of which the client knows.
    reported: u64,
    /// The time that the client knows (ns).
    clock_ns: Option<u64>,
}

impl Queue {
    /// A queue whose messages take at most `limit` bytes. A single larger message is sent nevertheless.
    pub(super) fn new(limit: usize) -> Self {
        Self {
            first: VecDeque::new(),
            items: VecDeque::new(),
            size: 0,
            limit,
            dropped: 0,
            reported: 0,
            clock_ns: None,
        }
    }

    /// Adds a text message.
    pub(super) fn push_text(&mut self, text: &str) {
        let mut frame = Vec::with_capacity(text.len() + 10);
        put_text(text, &mut frame);
        self.first.push_back(frame);
    }

    /// Adds whole frames of a WebSocket, such as the answer to a ping.
    pub(super) fn push_frame(&mut self, frame: &[u8]) {
        self.first.push_back(frame.to_vec());
    }

    /// Number of texts and answers that wait.
    pub(super) fn answers(&self) -> usize {
        self.first.len()
    }

    /// Adds a message of a channel for the subscription `subscription`. `time_ns` is the time of the message, and
    /// `clock_ns` the time of the source.
    pub(super) fn push_message(
        &mut self,
        subscription: u32,
        time_ns: u64,
        clock_ns: u64,
        data: &Arc<[u8]>,
    ) {
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
    pub(super) fn cancel(&mut self, subscriptions: &[u32]) {
        let cancelled = |item: &Item| {
            let message = item.message.as_ref();
            message.is_some_and(|(subscription, ..)| subscriptions.contains(subscription))
        };
        self.items.retain(|item| !cancelled(item));
        self.size = self.items.iter().map(Item::size).sum();
    }

    /// Removes all messages that wait. They do not count as dropped.
    pub(super) fn clear(&mut self) {
        self.items.clear();
        self.size = 0;
    }

    /// Appends what is to be sent next, as frames of a WebSocket. Returns whether there was anything.
    pub(super) fn pop(&mut self, out: &mut Vec<u8>) -> bool {
        if let Some(frame) = self.first.pop_front() {
            out.extend_from_slice(&frame);
            return true;
        }
        let Some(item) = self.items.pop_front() else {
            return false;
        };
        self.size -= item.size();
        // A client that stays slow gets a report whenever the number has doubled, and one when it has caught up.
        let caught_up = self.items.is_empty();
        if self.dropped > self.reported && (caught_up || self.dropped >= 2 * self.reported) {
            self.reported = self.dropped;
            let text = format!(
                "{} messages were dropped so far because this client reads too slowly",
                self.dropped
            );
            put_text(&status(Level::Warning, &text), out);
        }
        if self.clock_ns.replace(item.clock_ns) != Some(item.clock_ns) {
            put_time(item.clock_ns, out);
        }
        if let Some((subscription, time_ns, data)) = item.message {
            put_message(subscription, time_ns, &data, out);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data(length: usize, value: u8) -> Arc<[u8]> {
        vec![value; length].into()
    }

    /// The frames in the queue, in order: texts as they are, other frames as their bytes after the header.
    fn frames(queue: &mut Queue) -> Vec<String> {
        let mut out = Vec::new();
        while queue.pop(&mut out) {}
        let mut rest = out.as_slice();
        let mut frames = Vec::new();
        while let [kind, length, after @ ..] = rest {
            assert!(*length < 126, "the tests have short frames");
            let (payload, next) = after.split_at(usize::from(*length));
            frames.push(match kind & 15 {
                1 => String::from_utf8(payload.to_vec()).expect("text"),
                _ if payload[0] == 2 => format!("time {}", payload[1]),
                _ => format!("{} to {} at {}", payload[13], payload[1], payload[5]),
            });
            rest = next;
        }
        frames
    }

    #[test]
    fn texts_go_first_and_messages_in_order_with_the_time() {
        let mut queue = Queue::new(1000);
        queue.push_message(3, 4, 5, &data(1, 10));
        queue.push_message(4, 5, 5, &data(1, 11));
        queue.push_message(3, 6, 6, &data(1, 12));
        queue.push_text("first");
        let expected = [
            "first",
            "time 5",
            "10 to 3 at 4",
            "11 to 4 at 5",
            "time 6",
            "12 to 3 at 6",
        ];
        assert_eq!(frames(&mut queue), expected);
        queue.push_time(6);
        queue.push_time(7);
        assert_eq!(frames(&mut queue), Vec::<String>::new());
        queue.push_time(7);
        assert_eq!(frames(&mut queue), ["time 7"]);
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
        assert_eq!(frames(&mut queue), expected);
        queue.push_message(1, 0, 0, &data(10, 10));
        assert_eq!(frames(&mut queue), ["10 to 1 at 0"]);
        assert_eq!(queue.size, 0);
    }

    #[test]
    fn a_message_above_the_limit_is_sent() {
        let mut queue = Queue::new(100);
        queue.push_message(1, 0, 0, &data(1, 1));
        queue.push_message(1, 0, 0, &data(110, 2));
        assert_eq!(
            frames(&mut queue).last().map(String::as_str),
            Some("2 to 1 at 0")
        );
        assert_eq!(queue.dropped, 1);
    }

    #[test]
    fn a_client_that_stays_slow_gets_few_reports() {
        let mut queue = Queue::new(4 * (OVERHEAD + 1));
        let mut out = Vec::new();
        for _ in 0..1000 {
            (0..3).for_each(|_| queue.push_message(1, 0, 0, &data(1, 0)));
            queue.pop(&mut out);
        }
        let text = String::from_utf8_lossy(&out);
        let reports = text.matches("dropped").count();
        assert!((5..15).contains(&reports), "{reports}");
    }

    #[test]
    fn messages_of_a_cancelled_subscription_are_not_sent() {
        let mut queue = Queue::new(1000);
        queue.push_message(1, 0, 0, &data(1, 10));
        queue.push_message(2, 0, 0, &data(1, 11));
        queue.cancel(&[1]);
        assert_eq!(frames(&mut queue), ["time 0", "11 to 2 at 0"]);
        assert_eq!((queue.dropped, queue.size), (0, 0));
    }
}
