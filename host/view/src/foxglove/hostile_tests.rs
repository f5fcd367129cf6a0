//! Hostile clients: random and mutated messages.
//!
//! A million inputs of each kind:
//! `cargo test --release -p palpate-view --lib foxglove::hostile_tests -- --ignored`

use super::protocol::Channel;
use super::session::{Incoming, Session};
use std::io::{self, Cursor, Read, Write};
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

/// Random numbers (xorshift64*).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() >> 33) as usize % limit.max(1)
    }

    /// One of the seeds with a few bytes changed, inserted, removed or repeated; now and then random bytes.
    fn mutate(&mut self, seeds: &[Vec<u8>]) -> Vec<u8> {
        if self.below(20) == 0 {
            let length = self.below(200);
            return (0..length).map(|_| self.next() as u8).collect();
        }
        let mut bytes = seeds[self.below(seeds.len())].clone();
        for _ in 0..self.below(6) {
            let at = self.below(bytes.len());
            match self.below(5) {
                0 if !bytes.is_empty() => bytes[at] = self.next() as u8,
                1 => bytes.insert(at, b"{}[]\":,-019eop\r\n /"[self.below(18)]),
                2 if !bytes.is_empty() => drop(bytes.remove(at)),
                3 => bytes.truncate(at),
                _ => {
                    let to = at + self.below(bytes.len() - at + 1);
                    let piece = bytes[at..to].to_vec();
                    bytes.splice(at..at, piece);
                }
            }
        }
        bytes
    }
}

fn channels() -> Vec<Channel> {
    let channel = |id| Channel {
        id,
        topic: format!("/{id}"),
        encoding: "cdr",
        schema_name: "a",
        schema: String::new(),
        schema_encoding: "ros2msg",
    };
    (1..4).map(channel).collect()
}

const TEXTS: [&str; 8] = [
    r#"{"op":"subscribe","subscriptions":[{"id":0,"channelId":1},{"id":1,"channelId":2}]}"#,
    r#"{"op":"unsubscribe","subscriptionIds":[0,1]}"#,
    r#"{"op":"advertise","channels":[{"id":1,"topic":"/a","encoding":"json","schemaName":"b"}]}"#,
    r#"{"op":"setParameters","parameters":[{"name":"/int_param","value":3}],"id":"request-456"}"#,
    r#"{"op":"getParameters","parameterNames":[]}"#,
    r#"{"op":"subscribeConnectionGraph"}"#,
    r#"{"op":"fetchAsset","uri":"package://a/b.urdf","requestId":123}"#,
    r#"{"op":"unadvertise","channelIds":[1,2]}"#,
];

/// Gives mutated messages to sessions. Returns how many messages had an effect and how many were answered.
fn messages(count: usize) -> (usize, usize) {
    let mut seeds: Vec<Vec<u8>> = TEXTS.iter().map(|text| text.as_bytes().to_vec()).collect();
    seeds.push(vec![1, 0, 0, 0, 0, 1, 2, 3]);
    let channels = channels();
    let mut random = Random(1);
    let mut session = Session::default();
    let (mut effects, mut answers) = (0, 0);
    for number in 0..count {
        if number % 8 == 0 {
            session.clear();
        }
        let bytes = random.mutate(&seeds);
        let before = session.count();
        let answer = match std::str::from_utf8(&bytes) {
            Ok(text) => session.receive(&channels, Incoming::Text(text)),
            Err(_) => session.receive(&channels, Incoming::Binary(&bytes)),
        };
        if let Some(status) = &answer.status {
            answers += 1;
            assert!(status.len() < 1000, "{status}");
            let status: serde_json::Value = serde_json::from_str(status).expect("JSON");
            assert_eq!(status["op"], "status");
        }
        assert!(session.count() <= channels.len());
        effects += usize::from(session.count() != before);
    }
    (effects, answers)
}

/// A connection that gives some bytes and then ends.
struct Given(Cursor<Vec<u8>>);

impl Read for Given {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read(buffer)
    }
}

impl Write for Given {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Gives mutated frames of a WebSocket to sessions. Returns how many frames were decoded.
fn frames(count: usize) -> usize {
    let mut seeds = vec![
        vec![0x89, 0x82, 0, 0, 0, 0, b'h', b'i'],
        vec![0x88, 0x82, 0, 0, 0, 0, 3, 0xe8],
        vec![0x82, 0xff, 0, 0, 0, 0, 0x7f, 0xff, 0xff, 0xff, 0, 0, 0, 0],
        vec![0x82, 0x83, 1, 2, 3, 4, 5, 6, 7],
    ];
    for text in TEXTS {
        let mut frame = vec![0x81];
        match text.len() {
            short @ 0..126 => frame.push(0x80 | short as u8),
            long => {
                frame.push(0xfe);
                frame.extend((long as u16).to_be_bytes());
            }
        }
        frame.extend([0; 4]);
        frame.extend(text.as_bytes());
        seeds.push(frame);
    }
    let channels = channels();
    let mut random = Random(3);
    let mut decoded = 0;
    for _ in 0..count {
        let bytes = [random.mutate(&seeds), random.mutate(&seeds)].concat();
        let config = WebSocketConfig::default()
            .read_buffer_size(256)
            .max_message_size(Some(1 << 16))
            .max_frame_size(Some(1 << 16));
        let mut socket =
            WebSocket::from_raw_socket(Given(Cursor::new(bytes)), Role::Server, Some(config));
        let mut session = Session::default();
        while let Ok(message) = socket.read() {
            decoded += 1;
            match message {
                Message::Text(text) => {
                    session.receive(&channels, Incoming::Text(text.as_str()));
                }
                Message::Binary(bytes) => {
                    session.receive(&channels, Incoming::Binary(&bytes));
                }
                _ => {}
            }
        }
    }
    decoded
}

#[test]
fn no_input_of_a_client_does_harm() {
    let (effects, answers) = messages(5000);
    assert!(effects > 100 && answers > 1000, "{effects}, {answers}");
    assert!(frames(5000) > 1000);
}

#[test]
#[ignore = "a million inputs of each kind: see the head of the file"]
fn no_input_of_a_million_does_harm() {
    let (effects, answers) = messages(1_000_000);
    let decoded = frames(1_000_000);
    println!("messages: {effects} with effect, {answers} answered; frames: {decoded} decoded");
    assert!(effects > 10_000 && decoded > 100_000);
}
