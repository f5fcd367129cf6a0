//! What reads bytes from outside, for the fuzzers: any bytes, no panic.

use crate::feed::{Command, Feed};
use crate::playback::Player;
use host::live::Message;
use std::io::Cursor;
use std::time::Duration;

/// Reads a message of a stream, and writes it again. Returns whether the bytes are a message.
pub fn message(bytes: &[u8]) -> bool {
    let Ok(message) = Message::decode(bytes) else {
        return false;
    };
    let mut again = Vec::new();
    message.encode(&mut again);
    true
}

/// Opens a log and plays it with every kind of command. Returns whether the log could be opened.
pub fn log(bytes: &[u8]) -> bool {
    let Ok(mut player) = Player::of(Cursor::new(bytes), "run.mcap", |_| ()) else {
        return false;
    };
    let commands = [
        Command::Speed { factor: 3.0 },
        Command::Seek { time_ns: 2_000_000 },
        Command::Play,
        Command::Next,
        Command::Previous,
        Command::Step { ticks: 1 },
        Command::Step { ticks: -1 },
        Command::Step { ticks: 1 << 40 },
        Command::Seek { time_ns: u64::MAX },
        Command::Play,
    ];
    for command in &commands {
        player.command(command);
        player.advance(Duration::from_millis(20));
        let _ = player.present();
        // After an error the player has no further messages.
        while let Ok(Some(_)) = player.take() {}
    }
    true
}

/// Changes bytes at random, from a seed: the same seed makes the same inputs on every machine.
#[derive(Clone, Debug)]
pub struct Mutator(u64);

/// Numbers at which sizes and counts go wrong.
const EDGES: [u64; 8] = [0, 1, 0x7f, 0xff, 0xffff, u32::MAX as u64, 1 << 40, u64::MAX];

impl Mutator {
    /// A mutator with this seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(2).wrapping_add(1))
    }

    /// A number below `most`, which is above zero (xorshift*, Vigna 2016).
    pub fn below(&mut self, most: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let number = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 32;
        number as usize % most.max(1)
    }

    /// Makes one to four changes to `bytes`, none of which begins in the range `keep`.
    pub fn change(&mut self, bytes: &mut Vec<u8>, keep: &std::ops::Range<usize>) {
        for _ in 0..=self.below(4) {
            let at = self.below(bytes.len());
            if keep.contains(&at) {
                continue;
            }
            self.change_at(at, bytes);
        }
    }

    fn change_at(&mut self, at: usize, bytes: &mut Vec<u8>) {
        let kind = self.below(8);
        let (bit, value) = (self.below(8), self.below(256) as u8);
        let length = (1 + self.below(16)).min(bytes.len().saturating_sub(at));
        match kind {
            0 | 1 => {
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= 1 << bit;
                }
            }
            2 => {
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = value;
                }
            }
            3 | 4 => {
                let edge = EDGES.get(self.below(EDGES.len())).copied().unwrap_or(0);
                let width = [1, 2, 4, 8].get(self.below(4)).copied().unwrap_or(8);
                let places = bytes.iter_mut().skip(at).take(width);
                for (place, byte) in places.zip(edge.to_le_bytes()) {
                    *place = byte;
                }
            }
            5 => {
                let from = self.below(bytes.len());
                let copy: Vec<u8> = bytes.iter().skip(from).take(length).copied().collect();
                for (place, byte) in bytes.iter_mut().skip(at).zip(copy) {
                    *place = byte;
                }
            }
            6 => {
                bytes.drain(at..at + length);
            }
            _ => bytes.truncate(at),
        }
    }
}

/// The bytes of a log that a change should leave alone: the text of its scene, which has a fuzzer of its own.
pub fn scene_of(log: &[u8]) -> std::ops::Range<usize> {
    let (begin, end) = (b"# scene begins", b"# scene ends");
    let find = |text: &[u8]| log.windows(text.len()).position(|window| window == text);
    match (find(begin), find(end)) {
        (Some(from), Some(to)) => from..to + end.len(),
        _ => 0..0,
    }
}

/// A small log without check sums, so that changed bytes reach the readers behind them: seven ticks in four chunks, four
/// frames of a thread in two topology epochs, a model, and an overview.
///
/// # Errors
/// None: the scene is sound, and memory is written.
pub fn small_log() -> Result<Vec<u8>, Box<dyn std::error::Error>> {
    use host::live::Surface;
    use host::live::gather::Gatherer;
    use host::log::overview::OverviewBuilder;
    use host::log::{BodyFrame, LogHeader, LogWriter};
    use host::run::Clock;
    use host::scene::Scene;
    use rt_core::Telemetry;

    let loaded = Scene::load_texts("scene.toml", SCENE, &std::collections::BTreeMap::new())?;
    let mut limits = Vec::new();
    for model in &loaded.models {
        limits.push(model.capabilities());
    }
    let header = LogHeader {
        facts: [("clock", "real"), ("seed", "1")]
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .into(),
        scene: SCENE.to_owned(),
        files: [("note".to_owned(), b"a file".to_vec())].into(),
        limits,
    };
    let mut overview = OverviewBuilder::new(Gatherer::new(&loaded, Clock::Real));
    let mut writer = LogWriter::create(Cursor::new(Vec::new()), &header)?;
    writer.add_bodies(["thread"])?;
    for tick in 0..7_u64 {
        let time_ns = tick * 1_000_000;
        if tick.is_multiple_of(2) {
            let epoch = u32::from(tick >= 4);
            let frame = BodyFrame {
                body: 0,
                step: tick,
                time_ns,
                epoch,
            };
            if tick.is_multiple_of(4) {
                let surface = Surface {
                    epoch,
                    vertices: 3,
                    line_count: 2,
                    rest: vec![0.5; 9],
                    lines: vec![0, 1, 1, 2],
                    ..Surface::default()
                };
                writer.write_surface(&surface, time_ns)?;
            }
            writer.write_frame(&frame, &[0.25; 9])?;
        }
        let mut telemetry = Telemetry::empty();
        (telemetry.tick, telemetry.time_ns, telemetry.lateness_ns) = (tick, time_ns, 10 * tick);
        (telemetry.device_count, telemetry.body_count) = (1, 1);
        telemetry.bodies[0].sequence = tick;
        if tick == 5 {
            telemetry.devices[0].safety = rt_core::safety::SafetyState::TooFast;
        }
        writer.write(&telemetry)?;
        overview.take(&(&telemetry).into());
        if tick % 2 == 1 {
            writer.flush()?;
        }
    }
    writer.write_overview(&overview.finish())?;
    let mut bytes = writer.finish()?.into_inner();
    forget_check_sums(&mut bytes);
    Ok(bytes)
}

/// Sets the check sums of a sound log to zero, which tells readers that there is none.
fn forget_check_sums(bytes: &mut [u8]) {
    use mcap::records::op;
    let mut at = mcap::MAGIC.len();
    while let Some((&[opcode, ref length @ ..], _)) = bytes
        .get(at..)
        .and_then(|rest| rest.split_first_chunk::<9>())
    {
        let end = at + 9 + u64::from_le_bytes(*length) as usize;
        let place = match opcode {
            op::CHUNK => at + 9 + 24..at + 9 + 28,
            op::ATTACHMENT | op::DATA_END | op::FOOTER => end - 4..end,
            _ => 0..0,
        };
        if let Some(sum) = bytes.get_mut(place) {
            sum.fill(0);
        }
        at = end;
        if opcode == op::FOOTER {
            break;
        }
    }
}

/// A thread of two bars in one hand.
const SCENE: &str = r#"# scene begins
name = "small"
duration = 1.0
seed = 1

[[body]]
name = "thread"

[body.mesh.thread]
length = 0.20
segments = 2

[body.material]
young = 6.4e6
area = 3.14e-6
density = 1100.0

[body.damping]
mass = 1.0
stiffness = 0.005

[[body.handle]]
name = "end"
group = "left"
device = "left"

[[device]]
name = "left"
model = "falcon"
hand = {}
# scene ends
"#;

/// Messages of each kind.
pub fn messages() -> Vec<Vec<u8>> {
    use host::live::frame::LogMessage;
    use host::live::{Event, Folded, Playback};
    let mut messages = crate::synthetic::Synthetic::new(2).present();
    let mut feed = crate::synthetic::Synthetic::new(1);
    while let Ok(Some(message)) = feed.next(Duration::ZERO) {
        let ends = matches!(message, Message::End(_));
        messages.push(message);
        if ends {
            break;
        }
    }
    for message in &mut messages {
        match message {
            Message::Hello(hello) => {
                hello.scene_text = "name = \"small\"".into();
                hello.files = [("note".to_owned(), b"a file".to_vec())].into();
            }
            Message::Frame(frame) => frame.log.push(LogMessage {
                topic: "/tick".into(),
                time_ns: 1,
                length: 3,
                data: vec![0, 1, 2],
            }),
            _ => {}
        }
    }
    messages.push(Message::History(vec![Folded::default(); 2]));
    messages.push(Message::Playback(Box::new(Playback {
        events: vec![Event::default()],
        overview: vec![Folded::default()],
        ..Playback::default()
    })));
    messages.push(Message::Refused("four viewers are there".into()));
    let encoded = messages.iter().map(|message| {
        let mut bytes = Vec::new();
        message.encode(&mut bytes);
        bytes
    });
    encoded.collect()
}
