//! Sound logs and messages of each kind: the seeds of their fuzz targets, and what tests change.

use crate::synthetic::Synthetic;
use host::live::Message;
use std::io::Cursor;

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
    use host::live::gather::Gatherer;
    use host::log::overview::OverviewBuilder;
    use host::log::{LogHeader, LogWriter};
    use host::record::{BodyFrame, Cloud, Group, Surface};
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
    writer.add(Group::Frames, 0, "thread")?;
    for tick in 0..7_u64 {
        let time_ns = tick * 1_000_000;
        if tick.is_multiple_of(2) {
            let epoch = u32::from(tick >= 4);
            let mut frame = BodyFrame {
                body: 0,
                step: tick,
                time_ns,
                epoch,
            };
            if tick.is_multiple_of(4) {
                let mut surface = Surface {
                    epoch,
                    vertices: 3,
                    line_count: 2,
                    rest: vec![0.5; 9],
                    lines: vec![0, 1, 1, 2],
                    ..Surface::default()
                };
                writer.write_record(surface.stamp(time_ns), &mut surface)?;
            }
            let mut cloud = Cloud {
                time_ns,
                positions: vec![0.25; 9],
            };
            writer.write_record(frame.stamp(), &mut frame)?;
            writer.write_record(frame.stamp(), &mut cloud)?;
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
    // A hello, a surface, a frame and an end.
    let mut messages: Vec<Message> = Synthetic::new(1).messages().take(4).collect();
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
