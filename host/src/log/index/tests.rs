use super::{IndexError, LogIndex, TickAt};
use crate::live::gather::Gatherer;
use crate::log::overview::{MOST_EVENTS, Overview, OverviewBuilder};
use crate::log::tests::{header, log, telemetry};
use crate::log::{Log, LogError, LogWriter};
use crate::record::{BodyFrame, Clock, Cloud, Group, ModelRow, Surface, TickRow};
use crate::scene::Scene;
use proptest::prelude::*;
use rt_core::Telemetry;
use rt_core::safety::SafetyState;
use std::io::Cursor;

type InMemory<'a> = LogIndex<Cursor<&'a [u8]>>;

fn open(bytes: &[u8]) -> InMemory<'_> {
    LogIndex::open(Cursor::new(bytes)).expect("a log")
}

/// All ticks of a log, from the first to the last.
fn rows(log: &mut InMemory) -> Vec<TickRow> {
    let mut rows = Vec::new();
    if let Some(first) = log.first().expect("sound") {
        log.ticks_from(first, |_, row| {
            rows.push(row.clone());
            true
        })
        .expect("sound");
    }
    rows
}

/// Positions of three vertices at a tick.
fn positions(tick: u64) -> Vec<f32> {
    (0..9).map(|i| tick as f32 * 0.1 + i as f32).collect()
}

fn surface(epoch: u32) -> Surface {
    Surface {
        body: 0,
        epoch,
        vertices: 3,
        triangle_count: 1,
        rest: vec![0.5; 9],
        triangles: vec![0, 1, 2],
        ..Surface::default()
    }
}

fn write_frame(writer: &mut LogWriter<Cursor<Vec<u8>>>, mut frame: BodyFrame, positions: Vec<f32>) {
    let mut cloud = Cloud {
        time_ns: frame.time_ns,
        positions,
    };
    let stamp = frame.stamp();
    let written = writer
        .write_record(stamp, &mut frame)
        .and_then(|()| writer.write_record(stamp, &mut cloud));
    written.expect("in memory");
}

/// A log of `ticks` ticks with a frame every 40 of them, a flush every 50, and a new topology epoch at tick 200.
fn log_with_frames(ticks: u64) -> Vec<u8> {
    let mut writer = LogWriter::create(Cursor::new(Vec::new()), &header()).expect("in memory");
    writer.add(Group::Frames, 0, "sheet").expect("in memory");
    for tick in 0..ticks {
        let epoch = u32::from(tick >= 200);
        if tick == 0 || tick == 200 {
            let mut surface = surface(epoch);
            let stamp = surface.stamp(tick * 1_000_000);
            let written = writer.write_record(stamp, &mut surface);
            written.expect("in memory");
        }
        if tick % 40 == 0 {
            let frame = BodyFrame {
                body: 0,
                step: tick / 40,
                time_ns: tick * 1_000_000,
                epoch,
            };
            write_frame(&mut writer, frame, positions(tick));
        }
        writer.write(&telemetry(tick)).expect("in memory");
        if tick % 50 == 49 {
            writer.flush().expect("in memory");
        }
    }
    writer.finish().expect("in memory").into_inner()
}

#[test]
fn a_log_by_its_index_has_what_the_whole_log_has() {
    let bytes = log(230);
    let mut log = open(&bytes);
    assert!(log.is_complete() && !log.has_frames());
    let written = header();
    assert_eq!(
        (log.facts(), log.scene(), log.files(), log.limits()),
        (
            &written.facts,
            written.scene.as_str(),
            &written.files,
            written.limits.as_slice()
        )
    );
    let ticks: Vec<_> = (0..230).map(|k| TickRow::from(&telemetry(k))).collect();
    assert_eq!(rows(&mut log), ticks);
    let whole = Log::parse(&bytes).expect("a log");
    let models =
        (0..log.chunk_count()).map(|n| log.chunk(n).expect("sound").records::<ModelRow>().to_vec());
    assert_eq!(models.collect::<Vec<_>>().concat(), whole.models);
    assert_eq!(whole.models.len(), 15);
}

#[test]
fn every_cut_plays_to_where_it_ends() {
    let whole = log(120);
    for end in (mcap::MAGIC.len()..whole.len()).step_by(31) {
        let cut = &whole[..end];
        let mut log = open(cut);
        assert!(!log.is_complete());
        let expected = Log::parse(cut).expect("the beginning of a log");
        assert_eq!(rows(&mut log), expected.rows, "{end}");
    }
}

#[test]
fn a_search_finds_the_last_tick_before_a_time() {
    let bytes = log(230);
    let mut log = open(&bytes);
    let mut places: Vec<TickAt> = Vec::new();
    let first = log.first().expect("sound").expect("ticks");
    log.ticks_from(first, |place, _| {
        places.push(place);
        true
    })
    .expect("sound");
    assert_eq!(places.len(), 230);
    for (tick, place) in (0..).zip(&places) {
        let time_ns = tick * 1_000_000;
        for at in [time_ns, time_ns + 999_999] {
            assert_eq!(log.tick_at(at).expect("sound"), Some(*place));
        }
        assert_eq!(log.row(*place).expect("sound").expect("there").tick, tick);
        let (next, previous) = (
            log.next(*place).expect("sound"),
            log.previous(*place).expect("sound"),
        );
        assert_eq!(next, places.get(tick as usize + 1).copied());
        assert_eq!(previous.is_none(), tick == 0);
        assert!(previous.is_none_or(|p| p == places[tick as usize - 1]));
    }
    assert_eq!(log.last().expect("sound"), places.last().copied());
}

#[test]
fn frames_are_found_by_time_and_replays_do_not_see_them() {
    let bytes = log_with_frames(330);
    let plain = Log::parse(&bytes).expect("a log");
    assert_eq!((plain.rows.len(), plain.models.len()), (330, 0));
    assert_eq!(plain.files, header().files);
    let mut log = open(&bytes);
    assert!(log.has_frames());
    for tick in [0, 39, 40, 119, 200, 329] {
        let at = tick * 1_000_000 + 5;
        let found = log.frame_at("sheet", at).expect("sound").expect("a frame");
        let of = tick / 40 * 40;
        assert_eq!(
            (found.frame.step, found.frame.time_ns),
            (of / 40, of * 1_000_000)
        );
        assert_eq!(*found.positions, *positions(of));
        let epoch = u32::from(tick >= 200);
        assert_eq!(found.frame.epoch, epoch);
        let surface_at = log.surface_at("sheet", at).expect("sound");
        assert_eq!(surface_at.expect("a surface"), surface(epoch));
    }
    assert_eq!(log.frame_at("another", 0).expect("sound"), None);
}

#[test]
fn frames_may_be_larger_than_a_chunk() {
    let many: Vec<f32> = (0..900_000).map(|i| i as f32).collect();
    let mut writer = LogWriter::create(Cursor::new(Vec::new()), &header()).expect("in memory");
    writer.add(Group::Frames, 0, "sheet").expect("in memory");
    for step in 0..3 {
        let frame = BodyFrame {
            step,
            time_ns: step * 1_000_000,
            ..BodyFrame::default()
        };
        write_frame(&mut writer, frame, many.clone());
        writer.write(&telemetry(step)).expect("in memory");
    }
    let bytes = writer.finish().expect("in memory").into_inner();
    let mut log = open(&bytes);
    assert!(log.chunk_count() >= 3);
    let found = log.frame_at("sheet", 2_500_000).expect("sound");
    let found = found.expect("a frame");
    assert_eq!((found.frame.step, found.positions.len()), (2, many.len()));
}

#[test]
fn a_damaged_log_is_refused_with_its_place() {
    let sound = log(120);
    let quarter = 0.25_f64.to_le_bytes();
    let at = sound.windows(8).position(|window| window == quarter);
    let mut bytes = sound.clone();
    bytes[at.expect("a position")] ^= 1;
    // The index is sound, so the damage shows when its chunk is read.
    let mut damaged = open(&bytes);
    let error = damaged.first().expect_err("a check sum");
    let IndexError::Damaged { offset, part, .. } = &error else {
        panic!("{error}");
    };
    assert_eq!(
        (bytes[*offset as usize], *part),
        (mcap::records::op::CHUNK, "a chunk")
    );
    assert!(
        error.to_string().contains(&format!("at byte {offset}")),
        "{error}"
    );

    // The index itself: the last bytes before the footer.
    let mut bytes = sound.clone();
    let at = bytes.len() - 60;
    bytes[at] ^= 1;
    let error = LogIndex::open(Cursor::new(&bytes)).err().expect("refused");
    assert!(
        matches!(
            &error,
            IndexError::Damaged {
                part: "the index",
                ..
            }
        ),
        "{error}"
    );

    // A file of the scene.
    let mut bytes = sound;
    let at = bytes.windows(4).position(|window| window == b"$Mes");
    bytes[at.expect("the mesh")] ^= 1;
    let error = LogIndex::open(Cursor::new(&bytes)).err().expect("refused");
    assert!(
        matches!(
            &error,
            IndexError::Damaged {
                part: "an attached file",
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn other_files_are_refused() {
    for bytes in [&b""[..], b"x", b"time,force\n0,1\n", &[0; 100]] {
        let error = LogIndex::open(Cursor::new(bytes)).err().expect("refused");
        assert!(matches!(error, IndexError::NotALog), "{error}");
    }
    let mut foreign = mcap::Writer::new(Cursor::new(Vec::new())).expect("in memory");
    foreign.finish().expect("in memory");
    let foreign = foreign.into_inner().into_inner();
    let error = LogIndex::open(Cursor::new(&foreign))
        .err()
        .expect("refused");
    assert!(
        matches!(error, IndexError::Log(LogError::NoTicks)),
        "{error}"
    );
    // A changed definition, in a log without an index.
    let mut bytes = log(3);
    while let Some(at) = bytes.windows(9).position(|window| window == b"of tick, ") {
        bytes[at] = b'O';
    }
    let at = bytes
        .windows(12)
        .position(|window| window == b"haptic loop.");
    let at = at.expect("the definition");
    bytes[at] = b'H';
    let cut = &bytes[..bytes.len() - 1];
    let mut log = open(cut);
    let error = log.first().expect_err("another layout");
    let refused = matches!(
        error,
        IndexError::Log(LogError::OtherLayout) | IndexError::Damaged { .. }
    );
    assert!(refused, "{error}");
}

fn builder() -> OverviewBuilder {
    let scene = Scene::embedded_default().expect("the scene is sound");
    OverviewBuilder::new(Gatherer::new(&scene, Clock::Real))
}

fn tick(number: u64) -> Telemetry {
    let mut tick = telemetry(number);
    tick.devices[0].safety = SafetyState::Normal;
    tick.devices[1].safety = SafetyState::Normal;
    tick
}

#[test]
fn an_overview_has_pieces_of_half_a_second_and_is_read_back() {
    let mut builder = builder();
    for number in 0..1750 {
        let mut tick = tick(number);
        tick.lateness_ns = if number == 777 { 5000 } else { 10 };
        if number == 1300 {
            tick.devices[1].safety = SafetyState::TooFast;
        }
        builder.take(&(&tick).into());
    }
    let overview = builder.finish();
    let ticks: Vec<_> = overview.pieces.iter().map(|p| p.folded.ticks).collect();
    assert_eq!(ticks, [500, 500, 500, 250]);
    let sums: Vec<_> = overview.pieces.iter().map(|p| p.sums.ticks).collect();
    assert_eq!(sums, [500, 1000, 1500, 1750]);
    let events: Vec<_> = overview.events.iter().map(|e| e.tick).collect();
    // The model of this log is too old from the first tick on.
    assert_eq!(events, [0, 777, 1300]);
    assert_eq!(overview.totals.trips, 1);
    assert_eq!(Overview::parse(&overview.to_bytes()), Some(overview));
    assert_eq!(Overview::parse(b"{}"), None);
}

#[test]
fn an_overview_is_bounded() {
    let mut builder = builder();
    for number in 0..9000 {
        let mut tick = tick(number);
        // A tick in each half second, and a trip in every second tick.
        tick.time_ns = number * 500_000_000;
        if number % 2 == 1 {
            tick.devices[0].safety = SafetyState::Slewed;
        }
        builder.take(&(&tick).into());
    }
    let overview = builder.finish();
    assert!(overview.pieces.len() <= 8192, "{}", overview.pieces.len());
    let ticks: u64 = overview.pieces.iter().map(|p| p.folded.ticks).sum();
    assert_eq!(ticks, 9000);
    // The worst tick has a place of its own.
    assert_eq!(overview.events.len(), MOST_EVENTS + 1);
    assert!(overview.more_events > 3000);
    assert!(Overview::parse(&overview.to_bytes()).is_some());
}

/// Reads whatever can be read.
fn read_all(bytes: &[u8]) {
    let Ok(mut log) = LogIndex::open(Cursor::new(bytes)) else {
        return;
    };
    for time in [0, 1_500_000, u64::MAX] {
        let _ = log.frame_at("sheet", time);
        let _ = log.surface_at("sheet", time);
        let _ = log.tick_at(time);
    }
    if let Ok(Some(first)) = log.first() {
        let _ = log.ticks_from(first, |_, _| true);
    }
}

proptest! {
    #[test]
    fn damaged_bytes_never_panic(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        end in any::<prop::sample::Index>(),
    ) {
        let mut bytes = log_with_frames(3);
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        read_all(&bytes);
        read_all(&bytes[..end.index(bytes.len())]);
    }
}
