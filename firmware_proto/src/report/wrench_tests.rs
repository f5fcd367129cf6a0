use super::super::{Field, StateReport};
use super::*;
use proptest::prelude::*;
use std::string::ToString;

fn example() -> WrenchReport {
    WrenchReport {
        sequence: 0xFFFE,
        force: [1_000_000, -2, 0x0A0B_0C0D],
        moment: [i32::MIN, 0, i32::MAX],
        flags: flags::ENABLE,
    }
}

/// The exact bytes that a device of version 1 understands.
const EXAMPLE: [u8; LENGTH] = [
    0x01, 0x81, 0xFE, 0xFF, // version, kind, sequence
    0x40, 0x42, 0x0F, 0x00, 0xFE, 0xFF, 0xFF, 0xFF, 0x0D, 0x0C, 0x0B, 0x0A, // force
    0x00, 0x00, 0x00, 0x80, 0x00, 0x00, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0x7F, // moment
    0x01, // flags
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, // reserved
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, // reserved
    0x0F, 0x6B, // check sum
];

fn reports() -> impl Strategy<Value = WrenchReport> {
    any::<(u16, [i32; 3], [i32; 3], u8)>().prop_map(|(sequence, force, moment, flags)| {
        WrenchReport {
            sequence,
            force,
            moment,
            flags,
        }
    })
}

#[test]
fn the_layout_is_as_documented() {
    assert_eq!(example().encode(), EXAMPLE);
    assert_eq!(WrenchReport::decode(&EXAMPLE), Ok(example()));
}

proptest! {
    #[test]
    fn encoding_and_decoding_give_the_same_report(report in reports()) {
        prop_assert_eq!(WrenchReport::decode(&report.encode()), Ok(report));
    }

    #[test]
    fn si_and_back_is_the_same_report(report in reports()) {
        // i32 is exact in f64, and scaling back and forth errs by far less than half a unit.
        prop_assert_eq!(WrenchReport::from_si(report.sequence, &report.to_si(), report.flags), report);
    }

    #[test]
    fn rounding_errs_by_half_a_unit_at_most(force: [i16; 3], part in -1.0..1.0_f64) {
        let si = WrenchSi { force: force.map(|f| f64::from(f) * part), moment: [part; 3] };
        // Larger forces saturate, which another test checks.
        let si = WrenchSi { force: si.force.map(|f| f.clamp(-2000.0, 2000.0)), ..si };
        let back = WrenchReport::from_si(0, &si, 0).to_si();
        let pairs = si.force.iter().zip(back.force).chain(si.moment.iter().zip(back.moment));
        for (sent, received) in pairs {
            // Half a µN, and the rounding of numbers of up to 2e9.
            prop_assert!((sent - received).abs() <= 0.5e-6 * (1.0 + 1e-5), "{sent} {received}");
        }
    }

    #[test]
    fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..130)) {
        // Random bytes pass the check sum once in 65536, and then have the wrong version.
        prop_assert!(WrenchReport::decode(&bytes).is_err());
    }
}

#[test]
fn every_flipped_bit_is_found() {
    for bit in 0..LENGTH * 8 {
        let mut bytes = EXAMPLE;
        bytes[bit / 8] ^= 1 << (bit % 8);
        let found = WrenchReport::decode(&bytes);
        assert!(
            matches!(found, Err(ReportError::Crc { .. })),
            "bit {bit}: {found:?}"
        );
    }
}

#[test]
fn other_lengths_versions_kinds_and_reserved_bytes_are_refused() {
    let sealed_with = |place: usize, value: u8| {
        let mut bytes = EXAMPLE;
        bytes[place] = value;
        WrenchReport::decode(&wire::seal(bytes))
    };
    assert_eq!(
        WrenchReport::decode(&EXAMPLE[1..]),
        Err(ReportError::Length { found: 63 })
    );
    assert_eq!(sealed_with(0, 0), Err(ReportError::Version { found: 0 }));
    let error = sealed_with(1, Kind::State as u8);
    assert_eq!(
        error,
        Err(ReportError::Kind {
            expected: Kind::Wrench,
            found: 1
        })
    );
    let (field, least, most, found) = (Field::Reserved, 0, 0, 1);
    for place in 29..62 {
        let error = sealed_with(place, 1);
        assert_eq!(
            error,
            Err(ReportError::OutOfRange {
                field,
                least,
                most,
                found
            })
        );
    }
    // A report of one kind is never taken for the other.
    let error = StateReport::decode(&EXAMPLE);
    assert_eq!(
        error,
        Err(ReportError::Kind {
            expected: Kind::State,
            found: 0x81
        })
    );
}

#[test]
fn forces_beyond_the_range_saturate_and_not_a_number_is_zero() {
    let si = WrenchSi {
        force: [3000.0, -3000.0, f64::NAN],
        moment: [f64::INFINITY, f64::NEG_INFINITY, -0.000_000_6],
    };
    let report = WrenchReport::from_si(0, &si, flags::ENABLE);
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
        ReportError::Version { found: 9 },
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
            "report of protocol version 9, expected 1",
            "report whose sum of the reserved bytes is 5, expected 0 to 0",
        ]
    );
}
