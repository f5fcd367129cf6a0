use std::io::{self, Cursor, Seek, SeekFrom, Write};

use proptest::prelude::*;
use rt_core::coupling::HostState;
use rt_core::local_model::ModelHead;
use rt_core::safety::SafetyState;
use rt_core::{
    Axes, Capabilities, DeviceError, DeviceState, EnergyAccount, Freedom, LocalModel, Mat6,
    PieceEnergy, TearLimit, Telemetry, Vec3, Vec6, Withheld,
};

use super::index::IndexError;
use super::{Log, LogError, LogFile, LogHeader, LogWriter, read_log};
use crate::record::cdr::decode;
use crate::record::{BodyFrame, Kind, ModelRow, Surface, TearEvent, TickRow};

/// The limits of a device that is driven with this force at most (N).
fn limits(freedom: Freedom, max_force: f64) -> Capabilities {
    Capabilities {
        sensed: freedom,
        actuated: freedom,
        max_force,
        max_moment: if freedom.turns() { 0.1 + 0.2 } else { 0.0 },
        workspace_radius: 1.0 / 3.0,
        position_step: 1e-5,
    }
}

pub(super) fn header() -> LogHeader {
    LogHeader {
        facts: [("seed", "7"), ("scene", "sheet"), ("clock", "virtual")]
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .into(),
        limits: vec![limits(Freedom::Three, 5.0), limits(Freedom::Six, 0.1)],
        scene: "name = \"sheet\"\n".to_owned(),
        files: [("meshes/sheet.msh".to_owned(), b"$MeshFormat\n".to_vec())].into(),
    }
}

pub(super) fn telemetry(tick: u64) -> Telemetry {
    let x = tick as f64;
    let mut record = Telemetry::empty();
    record.tick = tick;
    record.time_ns = tick * 1_000_000;
    record.lateness_ns = 3;
    record.device_count = 2;
    record.body_count = 1;
    for (i, device) in record.devices.iter_mut().enumerate() {
        device.pose.position = Vec3::new(x, 0.25, i as f64);
        device.wrench.force = Vec3::new(-x, 0.5, 1.0);
        device.wrench.moment.z = 0.125;
        device.twist.angular.y = -2.0;
        device.buttons = 1 + i as u32;
        device.device_time_ns = tick * 1_000_001;
        device.fresh = i == 0;
        device.safety = if i == 0 {
            SafetyState::Limited
        } else {
            SafetyState::Silent
        };
    }
    let mut state = DeviceState::resting();
    state.pose.position.x = -x;
    state.twist.linear.y = f64::MIN_POSITIVE;
    state.buttons = 5;
    state.device_time_ns = tick;
    record.readings[0] = Ok(state);
    record.readings[1] = Err(DeviceError::Disconnected(-19));
    record.devices[0].slip.z = 0.5 * x;
    record.devices[0].slip_angle = 0.25 * x;
    let body = &mut record.bodies[0];
    body.sequence = tick / 16;
    body.epoch = 2;
    body.age_ns = 17;
    body.trust = 0.75;
    body.state = HostState::Fading;
    body.withheld = Withheld {
        force: 0.5 * x,
        of: x,
    };
    body.energy = EnergyAccount {
        supplied: x,
        raised: 2.0 * x,
        least: -x,
        initial: 0.25,
        received: 0.0,
        stored: 3.0 * x,
        credited: 4.0 * x,
        available: -5.0 * x,
        capped: tick,
    };
    record
}

/// A model of two handles that couples rotations if `turns`, otherwise translations only.
fn model(sequence: u64, turns: bool) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head = ModelHead {
        sequence,
        time_ns: 1_000_000 * sequence,
        period: 1.0 / 60.0,
        horizon: 0.03,
        energy: 0.7,
        released: 0.2,
        epoch: 3,
        handle_count: 2,
        ..ModelHead::empty()
    };
    for i in 0..2 {
        model.handles[i].device = 1 - i as u8;
        model.handles[i].wrench.force.z = 0.1 + i as f64;
        model.handles[i].contact.y = 0.2 + i as f64;
        model.handles[i].weight.z = -0.3 - i as f64;
        model.handles[i].drift.force.x = 40.0 + i as f64;
        for j in 0..2 {
            let used = |r: usize, c: usize| turns || (r < 3 && c < 3);
            let entry = |r: usize, c: usize| (100 * i + 50 * j + 6 * r + c) as f64 - 0.3;
            model.stiffness[i][j] =
                Mat6::from_fn(|r, c| if used(r, c) { entry(r, c) } else { 0.0 });
            model.damping[i][j] = model.stiffness[i][j] * 0.25;
        }
    }
    model
}

/// The model of a body in two pieces, with a tear limit.
fn torn(sequence: u64) -> LocalModel {
    let mut model = model(sequence, false);
    model.head.tear_limit = TearLimit {
        root: 90.0,
        critical: 120.0,
        area: 1e-5,
    };
    for i in 0..2 {
        model.handles[i].piece = i as u8;
        model.handles[i].tear_slope = Vec6::from_fn(|r, _| (6 * i + r) as f64 - 0.5);
        model.head.pieces[i] = PieceEnergy {
            stored: 0.3 + 0.1 * i as f64,
            released: 0.01 * i as f64,
        };
    }
    model
}

/// A log of `ticks` ticks with a flush every 50.
pub(super) fn log(ticks: u64) -> Vec<u8> {
    let mut writer = LogWriter::create(Cursor::new(Vec::new()), &header()).expect("in memory");
    for tick in 0..ticks {
        if tick % 16 == 0 {
            let mut row = ModelRow::new(0, &model(1 + tick / 16, tick % 32 == 0));
            let written = writer.write_record(row.stamp(), &mut row);
            written.expect("in memory");
        }
        writer.write(&telemetry(tick)).expect("in memory");
        if tick % 50 == 49 {
            writer.flush().expect("in memory");
        }
    }
    writer.finish().expect("in memory").into_inner()
}

#[test]
fn a_log_is_read_back_as_written() {
    let log = Log::parse(&log(120)).expect("a log");
    assert!(log.complete);
    assert_eq!(log.facts, header().facts);
    assert_eq!(log.scene, header().scene);
    assert_eq!(log.rows.len(), 120);
    for (row, tick) in log.rows.iter().zip(0..) {
        let expected = telemetry(tick);
        assert_eq!(
            (row.tick, row.time_ns, row.lateness_ns),
            (tick, tick * 1_000_000, 3)
        );
        assert_eq!(*row, TickRow::from(&expected));
        assert_eq!(row.readings[0].reading(), expected.readings[0]);
        assert_eq!(row.readings[1].reading(), expected.readings[1]);
    }
    assert_eq!(log.files, header().files);
    assert_eq!(log.limits, header().limits);
}

#[test]
fn the_limits_of_every_device_are_read_and_wrong_limits_are_refused() {
    let with = |limits: Vec<Capabilities>| {
        let header = LogHeader { limits, ..header() };
        let writer = LogWriter::create(Cursor::new(Vec::new()), &header).expect("in memory");
        let whole = writer.finish().expect("in memory").into_inner();
        // Without its index, as the log of a killed run.
        [Log::parse(&whole), Log::parse(&whole[..whole.len() - 1])]
    };
    for log in with(Vec::new()) {
        assert_eq!(log.expect("a log").limits, []);
    }
    let axes = Axes::new([true, false, true]).expect("two axes");
    let many = vec![limits(Freedom::Along(axes), f64::MIN_POSITIVE); 8];
    for log in with(many.clone()) {
        assert_eq!(log.expect("a log").limits, many);
    }
    let wrong = [
        vec![limits(Freedom::Three, f64::NAN)],
        vec![limits(Freedom::Three, -1.0)],
        vec![limits(Freedom::Three, 1.0); 9],
    ];
    for log in wrong.into_iter().flat_map(with) {
        let error = log.expect_err("refused");
        assert!(
            matches!(error, IndexError::Log(LogError::Limits { .. })),
            "{error}"
        );
    }
}

/// The facts of a log reach the terminals of people who replay it.
#[test]
fn facts_are_read_without_control_characters() {
    let hostile = "virtual\u{1b}]0;pwned\u{7}\nsecond line\u{9b}2J";
    let header = LogHeader {
        facts: [("clock".to_owned(), hostile.to_owned())].into(),
        ..header()
    };
    let writer = LogWriter::create(Cursor::new(Vec::new()), &header).expect("in memory");
    let bytes = writer.finish().expect("in memory").into_inner();
    let facts = Log::parse(&bytes).expect("a log").facts;
    assert_eq!(facts["clock"], "virtual?]0;pwned??second line?2J");
}

#[test]
fn a_model_is_read_back_as_published_and_takes_room_for_its_used_blocks_only() {
    let mut writer = LogWriter::create(Cursor::new(Vec::new()), &header()).expect("in memory");
    let mut negative_zero = model(3, false);
    negative_zero.damping[1][0][(4, 4)] = -0.0;
    let mut passed = torn(4);
    passed.head.received = -0.25;
    let models = vec![
        model(1, false),
        model(2, true),
        negative_zero,
        torn(4),
        passed,
    ];
    for (body, model) in (0..).zip(&models) {
        let mut row = ModelRow::new(body, model);
        let written = writer.write_record(row.stamp(), &mut row);
        written.expect("in memory");
    }
    let bytes = writer.finish().expect("in memory").into_inner();
    let log = Log::parse(&bytes).expect("a log");
    assert_eq!(log.models.len(), 5);
    for ((body, model), row) in (0..).zip(&models).zip(&log.models) {
        assert_eq!((row.body, row.model()), (body, *model));
    }
    let zero = log.models[2].model().damping[1][0][(4, 4)];
    assert!(zero.is_sign_negative(), "equal numbers, but not equal bits");
    // Each of two handles has 31 numbers: pose 7, twist, wrench and drift 6, contact and weight 3. The matrices have
    // 2 x 36 or 2 x 144 numbers. The other fields and the padding have less than 120 bytes.
    let length = |model: &LocalModel| ModelRow::new(0, model).message().len();
    assert!(length(&models[0]) < 8 * (2 * 31 + 2 * 36) + 120);
    assert!(length(&models[1]) < 8 * (2 * 31 + 2 * 144) + 120);
}

/// Logs of earlier versions are read only while these bytes stay.
#[test]
fn definitions_and_messages_are_those_of_earlier_versions() {
    let definitions = [
        TickRow::definition(),
        ModelRow::definition(),
        TearEvent::definition(),
        BodyFrame::definition(),
        Surface::definition(),
    ];
    let mut bytes = definitions.concat().into_bytes();
    bytes.extend(TickRow::from(&telemetry(3)).message());
    let whole = ModelRow::new(1, &model(2, true)).message();
    bytes.extend(&whole);
    bytes.extend(ModelRow::new(1, &torn(4)).message());
    // FNV-1a.
    let hash = bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    });
    assert_eq!(hash, 0x9abd_a401_c9d3_504e, "{hash:#x}");

    // A message from before bodies passed energy on ends before this work, and one from before they could tear before the
    // list of tears.
    let tick = TickRow::from(&telemetry(3)).message();
    // A tick from before there were tools and stamps lacks their lists.
    for missing in [4, 8, 12, 16, 20] {
        let before: TickRow = decode(&tick[..tick.len() - missing]).expect("a tick");
        assert_eq!(before, TickRow::from(&telemetry(3)));
    }
    for missing in [4, 8] {
        let before: ModelRow = decode(&whole[..whole.len() - missing]).expect("a model");
        assert_eq!(before.model(), model(2, true));
    }
}

#[test]
fn equal_ticks_give_equal_bytes() {
    assert_eq!(log(75), log(75));
}

#[test]
fn a_log_without_ticks_is_a_log() {
    assert_eq!(read_log(&log(0)).expect("a log"), []);
}

#[test]
fn every_cut_gives_the_ticks_before_it() {
    let whole = log(60);
    let rows = read_log(&whole).expect("a log");
    assert_eq!(rows.len(), 60);
    let mut left = 60;
    for end in (mcap::MAGIC.len()..whole.len()).rev().step_by(29) {
        let cut = Log::parse(&whole[..end]).expect("the beginning of a log");
        assert!(!cut.complete);
        assert_eq!(cut.rows, rows[..cut.rows.len()]);
        // No cut of 29 bytes removes more than one tick.
        assert!(cut.rows.len() == left || cut.rows.len() + 1 == left);
        left = cut.rows.len();
    }
    assert_eq!(left, 0);
}

#[test]
fn flushed_ticks_can_be_read_during_the_run() {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    let mut writer = LogWriter::begin_file(LogFile::open(file.path()).expect("a file"), &header())
        .expect("room on the disk");
    for tick in 0..10 {
        writer.write(&telemetry(tick)).expect("room on the disk");
    }
    writer.flush().expect("room on the disk");
    writer.write(&telemetry(10)).expect("room on the disk");
    let bytes = std::fs::read(file.path()).expect("the file");
    assert_eq!(read_log(&bytes).expect("a log").len(), 10);
}

#[test]
fn other_bytes_are_refused() {
    for bytes in [
        &b""[..],
        b"x",
        b"time,force\n0,1\n",
        &[0x89, b'M'],
        &[0; 100],
    ] {
        assert!(
            matches!(read_log(bytes), Err(IndexError::NotALog)),
            "{bytes:?}"
        );
    }
    let mut foreign = mcap::Writer::new(Cursor::new(Vec::new())).expect("in memory");
    foreign.finish().expect("in memory");
    let foreign = foreign.into_inner().into_inner();
    assert!(matches!(
        read_log(&foreign),
        Err(IndexError::Log(LogError::NoTicks))
    ));
}

#[test]
fn a_changed_byte_in_a_tick_is_found() {
    let mut bytes = log(60);
    let quarter = 0.25_f64.to_le_bytes();
    let at = bytes
        .windows(8)
        .position(|window| window == quarter)
        .expect("a position");
    bytes[at] ^= 1;
    assert!(matches!(
        read_log(&bytes),
        Err(IndexError::Damaged {
            source: mcap::McapError::BadChunkCrc { .. },
            ..
        })
    ));
}

/// A disk with room for `room` bytes.
struct FullDisk {
    room: usize,
}

impl Write for FullDisk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if bytes.len() > self.room {
            return Err(io::ErrorKind::StorageFull.into());
        }
        self.room -= bytes.len();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for FullDisk {
    fn seek(&mut self, _: SeekFrom) -> io::Result<u64> {
        Ok(0)
    }
}

#[test]
fn a_full_disk_is_reported_and_later_writes_fail_quietly() {
    for room in [0, 10, 300, 6000, 20_000] {
        let mut met = None;
        match LogWriter::create(FullDisk { room }, &header()) {
            Err(error) => met = Some(error),
            Ok(mut writer) => {
                for tick in 0..100 {
                    let written = writer.write(&telemetry(tick)).and_then(|()| writer.flush());
                    met = met.or(written.err());
                }
                assert!(writer.finish().is_err());
            }
        }
        match met {
            Some(LogError::Write { source, .. }) => {
                assert_eq!(source.kind(), io::ErrorKind::StorageFull);
            }
            other => panic!("room {room}: {other:?}"),
        }
    }
}

#[test]
fn an_error_names_the_file() {
    let path = std::path::Path::new("no such folder/run.mcap");
    let error = LogFile::open(path).err().expect("no such folder");
    assert!(
        error.to_string().contains("no such folder/run.mcap"),
        "{error}"
    );
}

proptest! {
    #[test]
    fn damaged_bytes_never_panic(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        end in any::<prop::sample::Index>(),
    ) {
        let mut bytes = log(3);
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        let _ = read_log(&bytes);
        let _ = read_log(&bytes[..end.index(bytes.len())]);
    }
}
