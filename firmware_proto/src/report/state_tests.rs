use super::super::{LENGTH, VERSION};
use super::*;
use proptest::prelude::*;
use std::string::ToString;

fn example() -> StateReport {
    StateReport {
        sequence: 0x1234,
        time_us: 0x89AB_CDEF,
        position: [1, -1, 0x0102_0304],
        orientation: [32767, 0, -2, 3],
        velocity: [-1000, i32::MAX, i32::MIN],
        angular_velocity: [1, -1, 0x0506],
        buttons: 0x8001,
        status: status::CALIBRATED | status::FAULT,
    }
}

/// The exact bytes that a device of version 1 sends. Devices in use cannot follow a change of these bytes.
const EXAMPLE: [u8; LENGTH] = [
    0x01, 0x01, 0x34, 0x12, // version, kind, sequence
    0xEF, 0xCD, 0xAB, 0x89, // time
    0x01, 0x00, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0xFF, 0x04, 0x03, 0x02, 0x01, // position
    0xFF, 0x7F, 0x00, 0x00, 0xFE, 0xFF, 0x03, 0x00, // orientation
    0x18, 0xFC, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F, 0x00, 0x00, 0x00, 0x80, // velocity
    0x01, 0x00, 0xFF, 0xFF, 0x06, 0x05, // angular velocity
    0x01, 0x80, // buttons
    0x81, // status
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, // reserved
    0x28, 0xC3, // check sum
];

/// The example with one byte changed and a matching check sum.
fn sealed_with(place: usize, value: u8) -> [u8; LENGTH] {
    let mut bytes = EXAMPLE;
    bytes[place] = value;
    wire::seal(bytes)
}

/// Reports that a device may send.
fn reports() -> impl Strategy<Value = StateReport> {
    let unit = prop::array::uniform4(-1.0..1.0_f64).prop_filter_map("too short", |q| {
        let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
        (length > 1e-3).then(|| q.map(|c| to_i16(c / length, QUATERNION)))
    });
    (
        any::<(u16, u32, [i32; 3], [i32; 3], [i16; 3], u16, u8)>(),
        unit,
    )
        .prop_map(
            |(
                (sequence, time_us, position, velocity, angular_velocity, buttons, status),
                orientation,
            )| {
                StateReport {
                    sequence,
                    time_us,
                    position,
                    orientation,
                    velocity,
                    angular_velocity,
                    buttons,
                    status,
                }
            },
        )
}

#[test]
fn the_layout_is_as_documented() {
    assert_eq!(example().encode(), EXAMPLE);
    assert_eq!(StateReport::decode(&EXAMPLE), Ok(example()));
}

proptest! {
    #[test]
    fn encoding_and_decoding_give_the_same_report(report in reports()) {
        prop_assert_eq!(StateReport::decode(&report.encode()), Ok(report));
    }

    #[test]
    fn si_and_back_is_the_same_report(report in reports()) {
        // i32 and i16 are exact in f64, and scaling back and forth errs by far less than half a unit.
        let StateReport { sequence, time_us, buttons, status, .. } = report;
        let again = StateReport::from_si(sequence, time_us, &report.to_si(), buttons, status);
        prop_assert_eq!(again, report);
    }

    #[test]
    fn any_bytes_are_refused_or_encode_to_themselves(
        mut bytes in prop::collection::vec(any::<u8>(), 0..130),
        as_report: bool,
    ) {
        if as_report {
            bytes.resize(LENGTH, 0);
            bytes[0] = VERSION;
            bytes[1] = Kind::State as u8;
            bytes[20..28].copy_from_slice(&EXAMPLE[20..28]);
            bytes[49..].fill(0);
            let array = <[u8; LENGTH]>::try_from(&bytes[..]).unwrap();
            bytes = wire::seal(array).to_vec();
        }
        match StateReport::decode(&bytes) {
            Ok(report) => prop_assert_eq!(&report.encode()[..], &bytes[..]),
            Err(_) => prop_assert!(!as_report),
        }
    }

    #[test]
    fn three_flipped_bits_are_found(
        report in reports(),
        bits in prop::sample::subsequence((0..LENGTH * 8).collect::<std::vec::Vec<_>>(), 3),
    ) {
        let mut bytes = report.encode();
        for bit in bits {
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        let found = StateReport::decode(&bytes);
        prop_assert!(matches!(found, Err(ReportError::Crc { .. })), "{:?}", found);
    }
}

#[test]
fn every_flipped_bit_and_pair_of_bits_is_found() {
    let refused = |bytes: &[u8]| matches!(StateReport::decode(bytes), Err(ReportError::Crc { .. }));
    for first in 0..LENGTH * 8 {
        let mut bytes = EXAMPLE;
        bytes[first / 8] ^= 1 << (first % 8);
        assert!(refused(&bytes), "bit {first}");
        for second in 0..first {
            let mut bytes = bytes;
            bytes[second / 8] ^= 1 << (second % 8);
            assert!(refused(&bytes), "bits {first} and {second}");
        }
    }
}

#[test]
fn other_lengths_versions_and_kinds_are_refused() {
    for found in [0, 1, 63] {
        assert_eq!(
            StateReport::decode(&EXAMPLE[..found]),
            Err(ReportError::Length { found })
        );
    }
    let longer = [EXAMPLE, EXAMPLE].concat();
    assert_eq!(
        StateReport::decode(&longer),
        Err(ReportError::Length { found: 128 })
    );
    assert_eq!(
        StateReport::decode(&longer[..65]),
        Err(ReportError::Length { found: 65 })
    );
    assert_eq!(
        StateReport::decode(&sealed_with(0, 2)),
        Err(ReportError::Version { found: 2 })
    );
    let wrench = Kind::Wrench as u8;
    let error = StateReport::decode(&sealed_with(1, wrench)).unwrap_err();
    assert_eq!(
        error,
        ReportError::Kind {
            expected: Kind::State,
            found: wrench
        }
    );
    assert_eq!(error.to_string(), "report of kind 0x81, expected 0x01");
    // A stalled device may send zeros, and an unplugged device may send ones.
    assert!(matches!(
        StateReport::decode(&[0; LENGTH]),
        Err(ReportError::Crc { .. })
    ));
    assert!(matches!(
        StateReport::decode(&[0xFF; LENGTH]),
        Err(ReportError::Crc { .. })
    ));
}

#[test]
fn orientations_that_turn_nothing_are_refused() {
    let decoded = |w: i16| {
        let report = StateReport {
            orientation: [w, 0, 0, 0],
            ..example()
        };
        StateReport::decode(&report.encode())
    };
    // 99 % of 32767 is 32439.3.
    assert!(decoded(32440).is_ok() && decoded(-32440).is_ok() && decoded(i16::MIN).is_ok());
    for w in [0, 1, 32439_i16] {
        let (least, most) = ORIENTATION_LENGTH;
        let found = u64::from(w.unsigned_abs()).pow(2);
        let field = Field::OrientationLength;
        assert_eq!(
            decoded(w),
            Err(ReportError::OutOfRange {
                field,
                least,
                most,
                found
            })
        );
    }
    let report = StateReport {
        orientation: [i16::MIN; 4],
        ..example()
    };
    let found = StateReport::decode(&report.encode());
    assert!(
        matches!(
            found,
            Err(ReportError::OutOfRange {
                found: 0x1_0000_0000,
                ..
            })
        ),
        "{found:?}"
    );
}

#[test]
fn reserved_bytes_must_be_zero() {
    for place in 49..62 {
        let (least, most, found) = (0, 0, 7);
        assert_eq!(
            StateReport::decode(&sealed_with(place, 7)),
            Err(ReportError::OutOfRange {
                field: Field::Reserved,
                least,
                most,
                found
            })
        );
    }
}

#[test]
fn si_is_scaled_rounded_and_saturated() {
    let si = StateSi {
        position: [0.1, -1.24e-7, 300.0],
        orientation: [1.0, 0.0, -0.5, -2.0],
        velocity: [0.25, -3000.0, f64::NAN],
        angular_velocity: [1.5, f64::INFINITY, f64::NEG_INFINITY],
    };
    let report = StateReport::from_si(1, 2, &si, 3, 4);
    let StateReport {
        sequence,
        time_us,
        buttons,
        status,
        ..
    } = report;
    assert_eq!((sequence, time_us, buttons, status), (1, 2, 3, 4));
    assert_eq!(report.position, [1_000_000, -1, i32::MAX]);
    assert_eq!(report.orientation, [32767, 0, -16384, i16::MIN]);
    assert_eq!(report.velocity, [250_000, i32::MIN, 0]);
    assert_eq!(report.angular_velocity, [1500, i16::MAX, i16::MIN]);

    let back = report.to_si();
    assert_eq!(back.position, [0.1, -1e-7, 214.748_364_7]);
    assert_eq!(back.orientation[..2], [1.0, 0.0]);
    assert_eq!(back.velocity, [0.25, -2_147.483_648, 0.0]);
    assert_eq!(back.angular_velocity, [1.5, 32.767, -32.768]);
}
