use super::*;
use host::engine::faults::{FaultKind, HostFault};
use host::live::frame::sites;
use host::live::{ContactArrow, EventKind, Folded};
use host::log::{Log, LogHeader, LogWriter};
use host::record::PatchRow;
use host::run::{Clock, RunOptions, run};
use host::scene::Scene;
use host::world::World;
use proptest::prelude::*;
use std::io::Cursor;
use std::sync::OnceLock;

type InMemory = Player<Cursor<Vec<u8>>>;

/// The log of a run of the built-in scene: 1.2 s with frames at 50 Hz. The host stalls from 0.2 s to 1.1 s.
fn logged() -> &'static (Vec<u8>, Log, host::run::summary::RunSummary) {
    static LOGGED: OnceLock<(Vec<u8>, Log, host::run::summary::RunSummary)> = OnceLock::new();
    LOGGED.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.mcap");
        let mut options = RunOptions::new(Clock::Virtual);
        options.duration = Some(1.2);
        options.log = Some(path.clone());
        options.log_frames = Some(50.0);
        options.faults = vec![HostFault {
            kind: FaultKind::Stall,
            at: 0.2,
            duration: 0.9,
        }];
        // A model is soon too old, and the device's force is soon at its limit.
        let text = include_str!("../../../scenes/stretch.toml");
        let text = text.replace("age_limit = 2.0", "age_limit = 0.3");
        let text = text.replace("max_force = 8.0", "max_force = 0.5");
        let scene = Scene::load_texts("stretch.toml", &text, &std::collections::BTreeMap::new());
        let scene = scene.expect("the scene is sound");
        let summary = run(&World::new(&scene).unwrap(), &options, &mut |_| ()).expect("a run");
        let bytes = std::fs::read(&path).expect("the log");
        let log = Log::parse(&bytes).expect("a log");
        (bytes, log, summary)
    })
}

fn player(bytes: &[u8]) -> InMemory {
    match Player::of(Cursor::new(bytes.to_vec()), "run.mcap", |_| ()) {
        Ok(player) => player,
        Err(error) => panic!("{error}"),
    }
}

fn take_all(player: &mut InMemory) -> Vec<Message> {
    let mut messages = Vec::new();
    while let Some(message) = player.take().expect("the log is sound") {
        messages.push(message);
    }
    messages
}

fn frames(messages: &[Message]) -> Vec<&Frame> {
    let frames = messages.iter().filter_map(|message| match message {
        Message::Frame(frame) => Some(&**frame),
        _ => None,
    });
    frames.collect()
}

fn kinds(messages: &[Message]) -> Vec<u8> {
    messages.iter().map(Message::kind).collect()
}

/// What a person sees of a moment, wherever the moment was reached from.
fn seen(frame: &Frame) -> Frame {
    Frame {
        number: 0,
        folded: Folded::default(),
        events: Vec::new(),
        ..frame.clone()
    }
}

#[test]
fn a_moment_has_the_obstacles_and_the_contacts_of_its_step() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../scenes/sheet_on_sphere.toml"
    );
    let scene = Scene::load(path.as_ref()).expect("a scene");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(0.15),
        log: Some(path.clone()),
        ..RunOptions::new(Clock::Virtual)
    };
    run(&World::new(&scene).unwrap(), &options, &mut |_| ()).expect("a run");
    let bytes = std::fs::read(&path).expect("the log");
    let log = Log::parse(&bytes).expect("a log");
    let mut player = player(&bytes);
    for time_ns in [4_000_000, 60_000_000, 149_000_000] {
        player.command(&Command::Seek { time_ns });
        take_all(&mut player);
        let frame = player.frame();
        assert_eq!(frame.time_ns, time_ns);
        assert_eq!(frame.obstacles[0].pose, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        let mut before = log.contacts.iter().filter(|step| step.time_ns <= time_ns);
        let step = before.next_back().expect("a step");
        let points = step.points.iter().map(ContactArrow::from);
        assert_eq!(frame.contacts, points.collect::<Vec<_>>());
    }
    assert!(!player.frame().contacts.is_empty());
}

#[test]
fn a_moment_has_the_tools_and_the_sites_of_the_patches_in_use() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/lift.toml");
    let scene = Scene::load(path.as_ref()).expect("a scene");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(0.7),
        log: Some(path.clone()),
        ..RunOptions::new(Clock::Virtual)
    };
    run(&World::new(&scene).unwrap(), &options, &mut |_| ()).expect("a run");
    let bytes = std::fs::read(&path).expect("the log");
    let log = Log::parse(&bytes).expect("a log");
    let mut player = player(&bytes);
    for time_ns in [0, 60_000_000, 500_000_000, 699_000_000] {
        player.command(&Command::Seek { time_ns });
        take_all(&mut player);
        let frame = player.frame();
        assert_eq!((frame.time_ns, frame.tools.len()), (time_ns, 2));
        let row = log.rows.iter().find(|row| row.time_ns == time_ns).unwrap();
        for tool in &frame.tools {
            let device = tool.device as usize;
            assert_eq!(tool.patch, row.patches[device]);
            // The device leads a ball to where the hand is, and does not turn it.
            let [x, y, z] = frame.hands[device].position;
            assert_eq!(tool.led, [x, y, z, 0.0, 0.0, 0.0, 1.0]);
            let used = |patch: &&PatchRow| {
                usize::from(patch.device) == device && patch.sequence == tool.patch
            };
            let used = log.patches.iter().find(used);
            let expected = used.map(|patch| sites(patch.sites())).unwrap_or_default();
            assert_eq!(tool.sites, expected);
        }
    }
    // Both balls press the cube from their sides, and are held back from where their hands are.
    let frame = player.frame();
    let [left, right] = &frame.tools[..] else {
        panic!("two tools");
    };
    assert!(left.force[0] < -0.5 && right.force[0] > 0.5, "{frame:?}");
    assert!(left.led[0] > frame.obstacles[1].pose[0] + 1e-4);
    assert!(right.led[0] < frame.obstacles[2].pose[0] - 1e-4);
    for (tool, sign) in [(left, -1.0), (right, 1.0)] {
        assert!(tool.contacts > 0 && tool.sites.len() > 2);
        assert!(tool.sites.iter().any(|site| sign * site[0] > 0.01));
    }
}

#[test]
fn the_first_messages_describe_the_log() {
    let (bytes, log, _) = logged();
    let mut player = player(bytes);
    let messages = take_all(&mut player);
    // Hello, the curves, the surface, the frame, the playback.
    assert_eq!(kinds(&messages), [1, 4, 2, 3, 5]);
    let [
        Message::Hello(hello),
        _,
        Message::Surface(surface),
        Message::Frame(frame),
        Message::Playback(playback),
    ] = messages.as_slice()
    else {
        panic!("{messages:?}");
    };
    assert_eq!(
        (hello.source, hello.file.as_str()),
        (host::live::Source::Log, "run.mcap")
    );
    assert_eq!(hello.facts, log.facts);
    let vertices = frame.bodies[0].vertices.as_ref().expect("the first frame");
    assert_eq!((vertices.step, vertices.count), (0, surface.vertices));
    assert!(playback.complete && playback.has_frames && playback.playing);
    assert_eq!(playback.notes, Vec::<String>::new());
    assert_eq!(
        (playback.tick, playback.from_ns, playback.to_ns),
        (0, 0, 1_199_000_000)
    );
    assert_eq!(playback.overview.iter().map(|p| p.ticks).sum::<u64>(), 1200);
    // Later messages do not repeat the overview.
    player.advance(Duration::from_millis(40));
    let later = take_all(&mut player);
    let Some(Message::Playback(playback)) = later.last() else {
        panic!("{later:?}");
    };
    assert!(playback.overview.is_empty() && playback.events.is_empty());
    // A viewer that joins later is told everything.
    assert_eq!(kinds(&player.present()), [1, 2, 4, 3, 5]);
}

#[test]
fn playing_shows_every_tick_once() {
    let (bytes, log, _) = logged();
    for speed in [0.1, 1.0, 7.3, 100.0] {
        let mut player = player(bytes);
        player.command(&Command::Speed { factor: speed });
        let mut next = 0;
        let mut most: f64 = 0.0;
        let mut last = Frame::default();
        for step in 0..100_000 {
            // Times that fit no grid.
            player.advance(Duration::from_micros(3000 + 7919 * (step % 5)));
            for frame in frames(&take_all(&mut player)) {
                assert_eq!(frame.folded.first, next, "at {speed}");
                assert_eq!(
                    frame.folded.ticks,
                    frame.folded.last + 1 - frame.folded.first
                );
                next = frame.folded.last + 1;
                most = most.max(frame.folded.hands[0].force_norm.most);
                last = frame.clone();
            }
            if next == 1200 {
                break;
            }
        }
        assert_eq!(next, 1200, "at {speed}");
        assert!(!player.playing, "the log ended");
        let forces = log
            .rows
            .iter()
            .map(|row| row.devices[0].wrench.force.norm());
        assert_eq!(most, forces.fold(0.0, f64::max), "no spike is lost");
        assert_eq!((last.totals.ticks, last.totals.lost), (1200, 0));
    }
}

#[test]
fn a_slow_speed_shows_single_ticks_and_a_pause_shows_none() {
    let (bytes, ..) = logged();
    let mut player = player(bytes);
    take_all(&mut player);
    player.command(&Command::Speed { factor: 0.01 });
    let mut shown = Vec::new();
    for _ in 0..600 {
        player.advance(Duration::from_millis(17));
        shown.extend(
            frames(&take_all(&mut player))
                .iter()
                .map(|f| f.folded.ticks),
        );
    }
    assert_eq!(shown.len(), 102);
    assert!(shown.iter().all(|ticks| *ticks == 1));
    player.command(&Command::Pause);
    take_all(&mut player);
    player.advance(Duration::from_secs(5));
    assert_eq!(take_all(&mut player), []);
}

#[test]
fn stepping_shows_the_rows_of_the_log() {
    let (bytes, log, _) = logged();
    let mut player = player(bytes);
    take_all(&mut player);
    let steps = [
        1,
        1,
        1,
        5,
        -3,
        400,
        -1,
        -1,
        700,
        -2000,
        1_000_000,
        -5,
        i64::MAX,
        i64::MIN,
    ];
    let mut at: i64 = 0;
    for ticks in steps {
        player.command(&Command::Step { ticks });
        at = at.saturating_add(ticks).clamp(0, 1199);
        let messages = take_all(&mut player);
        let frame = *frames(&messages).last().expect("a frame");
        let row = &log.rows[at as usize];
        assert_eq!(
            (player.tick, frame.time_ns),
            (row.tick, row.time_ns),
            "{ticks}"
        );
        for (hand, device) in frame.hands.iter().zip(&row.devices) {
            let bits = |v: [f64; 3]| v.map(f64::to_bits);
            assert_eq!(bits(hand.force), bits(device.wrench.force.into()));
            assert_eq!(bits(hand.position), bits(device.pose.position.into()));
        }
        assert_eq!(frame.bodies[0].sequence, row.bodies[0].sequence);
        assert!(!player.playing);
    }
}

/// The frames of a log played tick by tick.
fn played() -> &'static Vec<Frame> {
    static PLAYED: OnceLock<Vec<Frame>> = OnceLock::new();
    PLAYED.get_or_init(|| {
        let mut player = player(&logged().0);
        let mut played = vec![seen(player.frame())];
        for _ in 1..1200 {
            player.command(&Command::Step { ticks: 1 });
            take_all(&mut player);
            played.push(seen(player.frame()));
        }
        played
    })
}

#[test]
fn the_curves_after_a_jump_end_where_the_frame_begins() {
    let (bytes, log, _) = logged();
    let mut player = player(bytes);
    for tick in [1199_u64, 0, 1, 700] {
        take_all(&mut player);
        player.command(&Command::Seek {
            time_ns: tick * 1_000_000 + 17,
        });
        let messages = take_all(&mut player);
        let (Some(Message::History(curves)), Some(frame)) =
            (messages.first(), frames(&messages).first().copied())
        else {
            panic!("{messages:?}");
        };
        assert!(curves.len() <= 600);
        let mut next = 0;
        for piece in curves {
            assert_eq!(piece.first, next);
            next = piece.last + 1;
        }
        assert_eq!(
            (next, frame.folded.first, frame.folded.last),
            (tick, tick, tick)
        );
        let forces = log.rows[..tick as usize].iter();
        let most = forces.map(|row| row.devices[1].wrench.force.norm());
        let drawn = curves.iter().map(|piece| piece.hands[1].force_norm.most);
        assert_eq!(drawn.fold(0.0, f64::max), most.fold(0.0, f64::max));
        assert!(
            frame.bodies[0].vertices.is_some(),
            "all vertices after a jump"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn a_moment_is_the_same_wherever_it_is_reached_from(
        jumps in proptest::collection::vec((0_u64..1300, 0_u64..400), 1..12)
    ) {
        let played = played();
        let mut player = player(&logged().0);
        for (tick, on) in jumps {
            player.command(&Command::Seek { time_ns: tick * 1_000_000 });
            take_all(&mut player);
            prop_assert_eq!(&seen(player.frame()), &played[tick.min(1199) as usize]);
            player.command(&Command::Play);
            player.advance(Duration::from_millis(on));
            take_all(&mut player);
            prop_assert_eq!(&seen(player.frame()), &played[player.tick as usize]);
        }
    }
}

#[test]
fn the_last_moment_has_the_numbers_of_the_summary() {
    let (bytes, _, summary) = logged();
    let mut player = player(bytes);
    player.command(&Command::Seek { time_ns: u64::MAX });
    let frame = player.frame();
    assert_eq!(frame.totals.ticks, summary.tick.count);
    assert_eq!(frame.totals.model_age, summary.tick.model_age);
    for (hand, device) in frame.hands.iter().zip(&summary.devices) {
        assert_eq!(
            (hand.peak_force, hand.work, hand.reach),
            (device.peak_force, device.work, device.reach)
        );
    }
}

#[test]
fn events_are_reached_at_their_tick_and_are_those_of_the_summary() {
    let (bytes, log, summary) = logged();
    let mut player = player(bytes);
    let events = player.overview.events.clone();
    for kind in [EventKind::StaleModel, EventKind::Trip] {
        assert!(events.iter().any(|event| event.kind == kind), "{events:?}");
    }
    for event in &events {
        let from = (event.time_ns as f64 * 1e-9).to_bits();
        let mut told = summary.events.iter();
        let told = told.find(|told| told.description == event.text && told.from.to_bits() == from);
        assert!(told.is_some(), "{event:?}");
        assert_eq!(log.rows[event.tick as usize].time_ns, event.time_ns);
    }
    // Several events may have the same tick.
    let mut ticks: Vec<_> = events.iter().map(|event| event.tick).collect();
    ticks.dedup();
    for tick in ticks {
        player.command(&Command::Next);
        let messages = take_all(&mut player);
        assert_eq!(player.tick, tick);
        let frame = *frames(&messages).last().expect("a frame");
        let here = events.iter().filter(|event| event.tick == tick).cloned();
        assert_eq!(frame.events, here.collect::<Vec<_>>());
    }
    // Beyond the last event, the moment stays.
    let last = player.tick;
    player.command(&Command::Next);
    assert_eq!(player.tick, last);
    assert_eq!(kinds(&take_all(&mut player)), [5]);
    player.command(&Command::Previous);
    assert!(player.tick < last || events.len() == 1);
}

#[test]
fn frames_of_the_log_are_shown_bit_for_bit() {
    let (bytes, ..) = logged();
    let mut player = player(bytes);
    let mut log = LogIndex::open(Cursor::new(bytes.clone())).expect("a log");
    for tick in [0_u64, 19, 20, 777, 1199] {
        player.command(&Command::Seek {
            time_ns: tick * 1_000_000,
        });
        let vertices = player.frame().bodies[0].vertices.clone().expect("vertices");
        let name = &player.facts.bodies[0];
        let found = log
            .frame_at(name, tick * 1_000_000)
            .expect("sound")
            .expect("a frame");
        assert!(vertices.time_ns <= tick * 1_000_000);
        assert_eq!(
            (vertices.step, vertices.time_ns),
            (found.frame.step, found.frame.time_ns)
        );
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&vertices.positions), bits(&found.positions));
    }
}

#[test]
fn stresses_come_when_they_are_asked_for() {
    let mut player = player(&logged().0);
    player.command(&Command::Seek {
        time_ns: 1_000_000_000,
    });
    take_all(&mut player);
    player.command(&Command::Stress { on: true });
    let messages = take_all(&mut player);
    let frame = frames(&messages)[0];
    let vertices = frame.bodies[0].vertices.as_ref().expect("vertices");
    assert!(vertices.stressed && vertices.stress.len() == vertices.count as usize);
    assert!(vertices.stress.iter().any(|stress| *stress > 0.0));
    assert_eq!(
        (frame.folded.ticks, player.tick),
        (0, 1000),
        "the moment stays"
    );
    player.command(&Command::Stress { on: false });
    let messages = take_all(&mut player);
    let vertices = frames(&messages)[0].bodies[0].vertices.as_ref();
    assert!(!vertices.expect("vertices").stressed);
}

#[test]
fn a_killed_log_plays_to_where_it_ends() {
    let (bytes, log, _) = logged();
    // The end of the second flush is at half of the file, about.
    let cut = &bytes[..bytes.len() * 6 / 10];
    let whole = Log::parse(cut).expect("the beginning of a log");
    let mut heard = Vec::new();
    let player = Player::of(Cursor::new(cut.to_vec()), "killed.mcap", |done| {
        heard.push(done);
    });
    let mut player = player.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(heard.last(), Some(&1.0), "progress was told");
    assert!(player.notes[0].contains("killed"), "{:?}", player.notes);
    player.command(&Command::Seek { time_ns: u64::MAX });
    let last = whole.rows.last().expect("ticks");
    assert_eq!(player.tick, last.tick);
    assert!(last.tick < 1199 && log.rows[last.tick as usize] == *last);
    let played = &played()[last.tick as usize];
    // A frame of a late step comes after the cut.
    let without = |frame: &Frame| {
        let mut frame = seen(frame);
        frame
            .bodies
            .iter_mut()
            .for_each(|body| body.vertices = None);
        (frame.hands, frame.bodies)
    };
    assert!(without(player.frame()) == without(played));
}

/// A log of rows of the run, without an overview.
fn rewritten(keep: impl Fn(u64) -> bool) -> Vec<u8> {
    let (_, log, _) = logged();
    let header = LogHeader {
        facts: log.facts.clone(),
        scene: log.scene.clone(),
        files: log.files.clone(),
        limits: log.limits.clone(),
    };
    let mut writer = LogWriter::create(Cursor::new(Vec::new()), &header).expect("in memory");
    for row in log.rows.iter().filter(|row| keep(row.tick)) {
        let mut telemetry = rt_core::Telemetry::empty();
        (telemetry.tick, telemetry.time_ns) = (row.tick, row.time_ns);
        (telemetry.device_count, telemetry.body_count) = (2, 1);
        telemetry.devices[..2].copy_from_slice(&row.devices);
        telemetry.bodies[..1].copy_from_slice(&row.bodies);
        writer.write(&telemetry).expect("in memory");
    }
    writer.finish().expect("in memory").into_inner()
}

#[test]
fn a_log_without_frames_or_overview_shows_the_body_at_rest_and_says_so() {
    let player = player(&rewritten(|_| true));
    assert_eq!(player.overview.events.len(), logged_events());
    assert!(player.notes[0].contains("no frames"), "{:?}", player.notes);
    let vertices = player.frame.bodies[0].vertices.as_ref().expect("vertices");
    assert_eq!(vertices.positions, player.surfaces[0].rest);
}

fn logged_events() -> usize {
    player(&logged().0).overview.events.len()
}

#[test]
fn a_log_with_a_gap_is_played_over_the_gap() {
    let mut player = player(&rewritten(|tick| !(300..310).contains(&tick)));
    assert!(
        player
            .notes
            .iter()
            .any(|note| note.contains("lacks 10 ticks")),
        "{:?}",
        player.notes
    );
    player.command(&Command::Seek {
        time_ns: 305_000_000,
    });
    assert_eq!(player.tick, 299);
    player.command(&Command::Step { ticks: 1 });
    assert_eq!(player.tick, 310);
    assert_eq!(
        (player.frame.totals.lost, player.frame.totals.ticks),
        (10, 301)
    );
    player.command(&Command::Step { ticks: -1 });
    assert_eq!(player.tick, 299);
}

fn refusal(bytes: Vec<u8>) -> String {
    let player = Player::of(Cursor::new(bytes), "run.mcap", |_| ());
    player.err().expect("refused").to_string()
}

#[test]
fn other_files_are_refused_in_words() {
    assert_eq!(
        refusal(b"time,force\n".to_vec()),
        "cannot play the log run.mcap: this file is not an MCAP file, and so is not a log of palpate"
    );
    assert_eq!(
        refusal(rewritten(|_| false)),
        "cannot play the log run.mcap: it has no ticks; the run ended before its log was first written"
    );
    let (bytes, ..) = logged();
    // Another version of the message definition, in the index and in the first chunk; its check sums are not checked
    // where they are zero, so a log of another version is imitated by a changed name of a field.
    let mut cut = bytes[..bytes.len() / 2].to_vec();
    let at = cut
        .windows(18)
        .position(|window| window == b"uint64 lateness_ns");
    cut[at.expect("the definition")] = b'U';
    assert_eq!(
        refusal(cut),
        "cannot play the log run.mcap: the messages of this log have another layout: another version of palpate wrote \
         the log"
    );
    let missing = Player::open(Path::new("no such folder/run.mcap"), |_| ());
    let error = missing.err().expect("refused").to_string();
    assert!(
        error.starts_with("cannot open the log no such folder/run.mcap: "),
        "{error}"
    );
}

#[test]
fn a_damaged_log_plays_to_the_damage_and_names_its_place() {
    let (bytes, log, _) = logged();
    let mut damaged = bytes.clone();
    let row = &log.rows[1100];
    let number = row.devices[0].pose.position.x.to_le_bytes();
    let mut places = damaged.windows(8).enumerate();
    let at = places
        .find(|(_, window)| *window == number)
        .expect("the number")
        .0;
    damaged[at] ^= 1;
    // The last tick is read at the opening, and is in the damaged chunk.
    let error = refusal(damaged);
    assert!(error.contains("the log is damaged at byte "), "{error}");
    assert!(error.contains("in a chunk"), "{error}");
    // In the middle, the damage shows when it is reached.
    let mut damaged = bytes.clone();
    let number = log.rows[600].devices[0].pose.position.x.to_le_bytes();
    let at = damaged.windows(8).position(|window| window == number);
    damaged[at.expect("the number")] ^= 1;
    let mut player = player(&damaged);
    take_all(&mut player);
    player.command(&Command::Seek {
        time_ns: 600_000_000,
    });
    let error = player.take().expect_err("the damage").to_string();
    assert!(error.contains("the log is damaged at byte "), "{error}");
}
