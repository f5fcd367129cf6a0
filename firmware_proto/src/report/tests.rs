use super::units::{QUATERNION, to_i16};
use super::*;
use core::ops::Range;
use proptest::prelude::*;
use std::string::ToString;
use std::vec::Vec;

fn condition() -> Condition {
    Condition {
        time_us: 0x89AB_CDEF,
        since_us: 0x89AB_C000,
        wrench: 0x0102,
        buttons: 0x8001,
        status: status::CALIBRATED | status::IN_FORCE,
        mode: Mode::Active,
        refused: 7,
        fault: 0,
    }
}

fn state() -> StateReport {
    StateReport {
        sequence: 0x1234,
        session: 0xCAFE_F00D,
        condition: condition(),
        position: [1, -1, 0x0102_0304],
        orientation: [32767, 0, -2, 3],
        velocity: [-1000, i32::MAX, i32::MIN],
        angular_velocity: [1, -1, 0x0506],
    }
}

fn wrench() -> WrenchReport {
    WrenchReport {
        sequence: 0xFFFE,
        session: 0xCAFE_F00D,
        answers: 0x1234,
        force: [1_000_000, -2, 0x0A0B_0C0D],
        moment: [i32::MIN, 0, i32::MAX],
        flags: flags::ENABLE,
    }
}

/// The exact bytes that a device of version 2 sends. Devices in use cannot follow a change of these bytes.
const STATE: [u8; LENGTH] = [
    0x02, 0x01, 0x34, 0x12, // version, kind, sequence
    0x0D, 0xF0, 0xFE, 0xCA, // session
    0xEF, 0xCD, 0xAB, 0x89, 0x00, 0xC0, 0xAB, 0x89, // time, since
    0x02, 0x01, 0x01, 0x80, // wrench, buttons
    0x11, 0x03, 0x07, 0x00, // status, mode, refused, fault
    0x01, 0x00, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0xFF, 0x04, 0x03, 0x02, 0x01, // position
    0xFF, 0x7F, 0x00, 0x00, 0xFE, 0xFF, 0x03, 0x00, // orientation
    0x18, 0xFC, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F, 0x00, 0x00, 0x00, 0x80, // velocity
    0x01, 0x00, 0xFF, 0xFF, 0x06, 0x05, // angular velocity
    0xA5, 0xE3, // check sum
];

/// The exact bytes that a device of version 2 understands.
const WRENCH: [u8; LENGTH] = [
    0x02, 0x81, 0xFE, 0xFF, // version, kind, sequence
    0x0D, 0xF0, 0xFE, 0xCA, // session
    0x34, 0x12, 0x01, 0x00, // answers, flags
    0x40, 0x42, 0x0F, 0x00, 0xFE, 0xFF, 0xFF, 0xFF, 0x0D, 0x0C, 0x0B, 0x0A, // force
    0x00, 0x00, 0x00, 0x80, 0x00, 0x00, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0x7F, // moment
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, // reserved
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, // reserved
    0xEF, 0x67, // check sum
];

/// A report of version 1: a state at rest.
const VERSION_1: [u8; LENGTH] = {
    let mut bytes = [0; LENGTH];
    bytes[0] = 1;
    bytes[1] = 1;
    bytes[20] = 0xFF;
    bytes[21] = 0x7F;
    bytes
};

fn name() -> [u8; 16] {
    *b"test paddle\0\0\0\0\0"
}

fn capabilities() -> CapabilitiesReport {
    CapabilitiesReport {
        sequence: 3,
        session: 0xCAFE_F00D,
        hello: 9,
        hello_time_us: 77_000,
        watchdog_us: WATCHDOG_US,
        model: Model {
            sensed: axes::ALL,
            actuated: axes::TRANSLATIONS,
            firmware: FirmwareVersion {
                major: 1,
                minor: 2,
                patch: 345,
            },
            max_force: 12_000_000,
            max_moment: 0,
            workspace_radius: 1_000_000,
            position_step_nm: 55_000,
            rate: [500, 2000],
            sends: Sends::Counts { encoders: 3 },
            name: name(),
        },
    }
}

/// One report of each kind.
fn examples() -> [Report; 7] {
    [
        Report::State(state()),
        Report::Encoders(EncodersReport {
            sequence: 1,
            session: 0,
            condition: condition(),
            counts: [1, -1, i32::MAX, i32::MIN, 0, 0, 0, 0],
            number: 4,
        }),
        Report::Capabilities(capabilities()),
        Report::Geometry(GeometryReport {
            sequence: 4,
            session: 5,
            kinematics: kinematics::WOODEN_HAPTICS,
            number: 6,
            parameters: [
                800_000, 2_050_000, 2_450_000, 2_200_000, 0, 800_000, 0, 0, 0, 0, 0, 0,
            ],
        }),
        Report::Joint(JointReport {
            sequence: 5,
            session: 5,
            encoder: 2,
            quantity: Quantity::Angle,
            scale: -5_092_958_179,
            offset: 6_108_652,
        }),
        Report::Wrench(wrench()),
        Report::Hello(HelloReport {
            sequence: 0,
            session: 1,
            newest: VERSION,
            watchdog_us: 5000,
        }),
    ]
}

/// Any valid report: bytes at random, made valid field by field.
fn reports() -> impl Strategy<Value = Report> {
    let unit = prop::array::uniform4(-1.0..1.0_f64).prop_filter_map("too short", |q| {
        let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
        (length > 1e-3).then(|| q.map(|c| to_i16(c / length, QUATERNION)))
    });
    let condition = (any::<(u32, u32, u16, u16, u8, u8)>(), 0..5_u8, 1..=255_u8).prop_map(
        |((time_us, since_us, wrench, buttons, status, refused), mode, fault)| Condition {
            time_us,
            since_us,
            wrench,
            buttons,
            status: status & status::KNOWN,
            mode: Mode::of(mode).expect("a mode"),
            refused,
            fault: if mode == 4 { fault } else { 0 },
        },
    );
    let head = (any::<u16>(), 1..=u32::MAX);
    let state = (
        (any::<(u16, u32)>(), condition.clone(), unit),
        any::<([i32; 3], [i32; 3], [i16; 3])>(),
    )
        .prop_map(|(((sequence, session), condition, orientation), numbers)| {
            let (position, velocity, angular_velocity) = numbers;
            Report::State(StateReport {
                sequence,
                session,
                condition,
                position,
                orientation,
                velocity,
                angular_velocity,
            })
        });
    let encoders = (any::<(u16, u32)>(), condition, any::<[i32; 8]>(), 1..=8_u8).prop_map(
        |((sequence, session), condition, mut counts, number)| {
            counts[usize::from(number)..].fill(0);
            Report::Encoders(EncodersReport {
                sequence,
                session,
                condition,
                counts,
                number,
            })
        },
    );
    let model = (
        (1..64_u8, 0..64_u8, any::<(u8, u8, u16)>()),
        any::<[u32; 4]>(),
        (1..=1000_u16, 1000..=u16::MAX),
        (0..=8_u8, prop::collection::vec(b' '..=b'~', 1..=16)),
    )
        .prop_map(
            |((sensed, actuated, firmware), sizes, rate, (encoders, text))| {
                let (major, minor, patch) = firmware;
                let mut name = [0; 16];
                name[..text.len()].copy_from_slice(&text);
                Model {
                    sensed,
                    actuated,
                    firmware: FirmwareVersion {
                        major,
                        minor,
                        patch,
                    },
                    max_force: sizes[0],
                    max_moment: sizes[1],
                    workspace_radius: sizes[2],
                    position_step_nm: sizes[3],
                    rate: [rate.0, rate.1],
                    sends: match encoders {
                        0 => Sends::Poses,
                        encoders => Sends::Counts { encoders },
                    },
                    name,
                }
            },
        );
    let watchdog = WATCHDOG_LEAST_US..=WATCHDOG_MOST_US;
    let capabilities = (head.clone(), any::<(u16, u32)>(), watchdog.clone(), model).prop_map(
        |((sequence, session), (hello, hello_time_us), watchdog_us, model)| {
            Report::Capabilities(CapabilitiesReport {
                sequence,
                session,
                hello,
                hello_time_us,
                watchdog_us,
                model,
            })
        },
    );
    let geometry = (head.clone(), any::<(u16, [i32; 12])>(), 0..=12_u8).prop_map(
        |((sequence, session), (kinematics, mut parameters), number)| {
            parameters[usize::from(number)..].fill(0);
            Report::Geometry(GeometryReport {
                sequence,
                session,
                kinematics,
                number,
                parameters,
            })
        },
    );
    let joint = (head.clone(), 0..8_u8, any::<(bool, i64, i32)>()).prop_map(
        |((sequence, session), encoder, (length, scale, offset))| {
            Report::Joint(JointReport {
                sequence,
                session,
                encoder,
                quantity: if length {
                    Quantity::Length
                } else {
                    Quantity::Angle
                },
                scale: if scale == 0 { 1 } else { scale },
                offset,
            })
        },
    );
    let wrench = (head.clone(), any::<(u16, [i32; 3], [i32; 3])>(), 0..4_u8).prop_map(
        |((sequence, session), (answers, force, moment), flags)| {
            Report::Wrench(WrenchReport {
                sequence,
                session,
                answers,
                force,
                moment,
                flags,
            })
        },
    );
    let watchdog = prop_oneof![Just(0), watchdog];
    let hello =
        (head, VERSION..=255, watchdog).prop_map(|((sequence, session), newest, watchdog_us)| {
            Report::Hello(HelloReport {
                sequence,
                session,
                newest,
                watchdog_us,
            })
        });
    prop_oneof![
        state,
        encoders,
        capabilities,
        geometry,
        joint,
        wrench,
        hello
    ]
}

/// `bytes` with some bytes from `place` on replaced, and with a matching check sum.
fn sealed_with(mut bytes: [u8; LENGTH], place: usize, values: &[u8]) -> [u8; LENGTH] {
    bytes[place..place + values.len()].copy_from_slice(values);
    wire::seal(bytes)
}

fn field_of(bytes: &[u8]) -> Option<Field> {
    match Report::decode(bytes) {
        Err(ReportError::OutOfRange { field, .. }) => Some(field),
        _ => None,
    }
}

#[test]
fn the_layout_is_as_documented() {
    assert_eq!(state().encode(), STATE);
    assert_eq!(StateReport::decode(&STATE), Ok(state()));
    assert_eq!(wrench().encode(), WRENCH);
    assert_eq!(WrenchReport::decode(&WRENCH), Ok(wrench()));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn encoding_and_decoding_give_the_same_report(report in reports()) {
        prop_assert_eq!(Report::decode(&report.encode()), Ok(report));
    }

    #[test]
    fn si_and_back_is_the_same_report(report in reports()) {
        // i32 and i16 are exact in f64, and scaling back and forth errs by far less than half a unit.
        match report {
            Report::State(state) => {
                let StateReport { sequence, session, condition, .. } = state;
                let again = StateReport::from_si(sequence, session, condition, &state.to_si());
                prop_assert_eq!(again, state);
            }
            Report::Wrench(wrench) => {
                let WrenchReport { sequence, session, answers, flags, .. } = wrench;
                let again = WrenchReport::from_si(sequence, session, answers, &wrench.to_si(), flags);
                prop_assert_eq!(again, wrench);
            }
            _ => {}
        }
    }

    #[test]
    fn any_bytes_are_refused_or_encode_to_themselves(
        bytes in prop::collection::vec(any::<u8>(), 0..130),
        report in reports(),
        changes in prop::collection::vec((0..62_usize, any::<u8>()), 0..3),
    ) {
        // Random bytes pass the check sum once in 65536, and then have the wrong version.
        prop_assert!(Report::decode(&bytes).is_err());
        let mut changed = report.encode();
        for (place, value) in changes {
            changed[place] = value;
        }
        let sealed = wire::seal(changed);
        if let Ok(report) = Report::decode(&sealed) {
            prop_assert_eq!(report.encode(), sealed);
        }
    }

    #[test]
    fn three_flipped_bits_are_found(
        report in reports(),
        bits in prop::sample::subsequence((0..LENGTH * 8).collect::<Vec<_>>(), 3),
    ) {
        let mut bytes = report.encode();
        for bit in bits {
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        let found = Report::decode(&bytes);
        prop_assert!(matches!(found, Err(ReportError::Crc { .. })), "{:?}", found);
    }

    #[test]
    fn rounding_errs_by_half_a_unit_at_most(force: [i16; 3], part in -1.0..1.0_f64) {
        let si = WrenchSi { force: force.map(|f| f64::from(f) * part), moment: [part; 3] };
        // Larger forces saturate, which another test checks.
        let si = WrenchSi { force: si.force.map(|f| f.clamp(-2000.0, 2000.0)), ..si };
        let back = WrenchReport::from_si(0, 1, 0, &si, 0).to_si();
        let pairs = si.force.iter().zip(back.force).chain(si.moment.iter().zip(back.moment));
        for (sent, received) in pairs {
            // Half a µN, and the rounding of numbers of up to 2e9.
            prop_assert!((sent - received).abs() <= 0.5e-6 * (1.0 + 1e-5), "{sent} {received}");
        }
    }
}

#[test]
fn every_flipped_bit_and_pair_of_bits_is_found() {
    let refused = |bytes: &[u8]| matches!(Report::decode(bytes), Err(ReportError::Crc { .. }));
    for report in examples() {
        let bytes = report.encode();
        for first in 0..LENGTH * 8 {
            let mut bytes = bytes;
            bytes[first / 8] ^= 1 << (first % 8);
            assert!(refused(&bytes), "bit {first} of {report:?}");
            for second in 0..first {
                let mut bytes = bytes;
                bytes[second / 8] ^= 1 << (second % 8);
                assert!(refused(&bytes), "bits {first} and {second} of {report:?}");
            }
        }
    }
}

#[test]
fn other_lengths_versions_and_kinds_are_refused() {
    for found in [0, 1, 63] {
        assert_eq!(
            StateReport::decode(&STATE[..found]),
            Err(ReportError::Length { found })
        );
    }
    let longer = [STATE, STATE].concat();
    for found in [65, 128] {
        assert_eq!(
            StateReport::decode(&longer[..found]),
            Err(ReportError::Length { found })
        );
    }
    assert_eq!(
        StateReport::decode(&sealed_with(STATE, 0, &[3])),
        Err(ReportError::Version { found: 3 })
    );
    let error = StateReport::decode(&WRENCH).unwrap_err();
    assert_eq!(
        error,
        ReportError::Kind {
            expected: Kind::State,
            found: 0x81
        }
    );
    assert_eq!(error.to_string(), "report of kind 0x81, expected 0x01");
    assert_eq!(
        Report::decode(&sealed_with(STATE, 1, &[0x55])),
        Err(ReportError::UnexpectedKind { found: 0x55 })
    );
    // A stalled device may send zeros, and an unplugged device may send ones.
    for bytes in [[0; LENGTH], [0xFF; LENGTH]] {
        assert!(matches!(
            Report::decode(&bytes),
            Err(ReportError::Crc { .. })
        ));
    }
}

#[test]
fn an_older_and_a_newer_peer_are_named_with_a_remedy() {
    let old = Report::decode(&wire::seal(VERSION_1)).unwrap_err();
    assert_eq!(old, ReportError::Version { found: 1 });
    assert_eq!(
        old.to_string(),
        "report of protocol version 1, expected 2: its sender is older; update it, or use a peer of version 1"
    );
    assert_eq!(
        ReportError::Version { found: 3 }.to_string(),
        "report of protocol version 3, expected 2: its sender is newer; update this side, or use a peer of version 2"
    );
}

#[test]
fn every_reserved_byte_is_zero() {
    // The first part, and the part before the check sum.
    let reserved: [(usize, Range<usize>, Range<usize>); 5] = [
        (1, 0..0, 57..62),
        (3, 11..12, 60..62),
        (4, 10..12, 24..62),
        (5, 11..12, 36..62),
        (6, 9..12, 16..62),
    ];
    for (example, first, last) in reserved {
        let bytes = examples()[example].encode();
        for place in first.chain(last) {
            let field = field_of(&sealed_with(bytes, place, &[1]));
            assert_eq!(field, Some(Field::Reserved), "{example} {place}");
        }
    }
}

#[test]
fn fields_out_of_range_are_refused() {
    let cases: [(usize, usize, &[u8], Field); 25] = [
        (0, 20, &[0x20], Field::Status),
        (0, 21, &[5], Field::Mode),
        (0, 23, &[1], Field::Fault),
        (0, 21, &[4, 0, 0], Field::Fault),
        (0, 36, &[0, 0], Field::OrientationLength),
        (1, 56, &[0], Field::Encoders),
        (1, 56, &[9], Field::Encoders),
        (1, 56, &[3], Field::Unused),
        (2, 4, &[0, 0, 0, 0], Field::Session),
        (2, 10, &[0], Field::Axes),
        (2, 10, &[0x40], Field::Axes),
        (2, 11, &[0x80], Field::Axes),
        (2, 32, &[0, 0], Field::Rate),
        (2, 34, &[1, 0], Field::Rate),
        (2, 36, &[0, 0, 0, 0], Field::Watchdog),
        (2, 44, &[3, 3], Field::Sends),
        (2, 44, &[1, 3], Field::Encoders),
        (2, 44, &[2, 0], Field::Encoders),
        (2, 46, &[0], Field::Name),
        (2, 60, b"x", Field::Name),
        (3, 10, &[13], Field::Parameters),
        (4, 8, &[8], Field::Encoder),
        (4, 9, &[2], Field::Quantity),
        (4, 12, &[0; 8], Field::Scale),
        (6, 12, &[0xCF, 0x07, 0, 0], Field::Watchdog),
    ];
    for (example, place, values, expected) in cases {
        let bytes = sealed_with(examples()[example].encode(), place, values);
        let field = field_of(&bytes);
        assert_eq!(field, Some(expected), "{example} {place} {values:?}");
    }
    let hello = examples()[6].encode();
    assert_eq!(field_of(&sealed_with(hello, 8, &[1])), Some(Field::Newest));
    assert_eq!(field_of(&sealed_with(WRENCH, 10, &[4])), Some(Field::Flags));
    assert_eq!(
        field_of(&sealed_with(WRENCH, 4, &[0; 4])),
        Some(Field::Session)
    );
    // 99 % of 32767 is 32439.3.
    let decoded = |w: i16| {
        let orientation = [w, 0, 0, 0];
        StateReport::decode(
            &StateReport {
                orientation,
                ..state()
            }
            .encode(),
        )
    };
    assert!(decoded(32440).is_ok() && decoded(-32440).is_ok() && decoded(i16::MIN).is_ok());
    assert!([0, 1, 32439].map(decoded).iter().all(Result::is_err));
}

#[test]
fn values_beyond_the_range_saturate_and_not_a_number_is_zero() {
    let si = StateSi {
        position: [300.0, -300.0, f64::NAN],
        orientation: [1.0, 0.0, 0.0, 0.0],
        velocity: [f64::INFINITY, -0.000_000_6, 0.0],
        angular_velocity: [40.0, -40.0, 0.0],
    };
    let report = StateReport::from_si(0, 1, condition(), &si);
    assert_eq!(report.position, [i32::MAX, i32::MIN, 0]);
    assert_eq!(report.velocity, [i32::MAX, -1, 0]);
    assert_eq!(report.angular_velocity, [i16::MAX, i16::MIN, 0]);
    let si = WrenchSi {
        force: [3000.0, -3000.0, f64::NAN],
        moment: [f64::INFINITY, f64::NEG_INFINITY, -0.000_000_6],
    };
    let report = WrenchReport::from_si(0, 1, 0, &si, flags::ENABLE);
    assert_eq!(report.force, [i32::MAX, i32::MIN, 0]);
    assert_eq!(report.moment, [i32::MAX, i32::MIN, -1]);
}

#[test]
fn errors_say_what_was_expected_and_found() {
    let texts = [
        ReportError::Length { found: 3 },
        ReportError::Crc {
            expected: 0x00AB,
            found: 0x1234,
        },
        ReportError::UnexpectedKind { found: 1 },
        ReportError::OutOfRange {
            field: Field::Reserved,
            least: 0,
            most: 0,
            found: 5,
        },
    ]
    .map(|error| error.to_string());
    assert_eq!(
        texts,
        [
            "report of 3 bytes, expected 64",
            "report with check sum 0x1234, expected 0x00ab",
            "report of kind 0x01, which this side does not take",
            "report whose sum of the reserved bytes is 5, expected 0 to 0",
        ]
    );
}
