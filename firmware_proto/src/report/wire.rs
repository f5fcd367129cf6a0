//! Bytes at fixed offsets in a report, the check sum, and the checks that every report must pass.
//!
//! An offset is a constant. The compiler checks that every field lies inside the report, so no access can fail at run
//! time.

use super::{Field, Kind, LENGTH, ReportError, VERSION};
use crc::{CRC_16_IBM_3740, Crc};

static CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_3740);

/// Offsets of the fields that all reports share.
mod at {
    pub(super) const VERSION: usize = 0;
    pub(super) const KIND: usize = 1;
    pub(super) const SEQUENCE: usize = 2;
    pub(super) const CRC: usize = 62;
}

/// The `N` bytes from offset `AT`.
pub(super) fn get<const AT: usize, const N: usize>(report: &[u8; LENGTH]) -> [u8; N] {
    const { assert!(AT + N <= LENGTH, "a field reaches beyond its report") };
    let mut bytes = [0; N];
    for (byte, from) in bytes.iter_mut().zip(report.iter().skip(AT)) {
        *byte = *from;
    }
    bytes
}

/// Writes `bytes` from offset `AT`.
pub(super) fn put<const AT: usize, const N: usize>(report: &mut [u8; LENGTH], bytes: [u8; N]) {
    const { assert!(AT + N <= LENGTH, "a field reaches beyond its report") };
    for (byte, from) in report.iter_mut().skip(AT).zip(bytes) {
        *byte = from;
    }
}

/// Three numbers of four bytes from offset `AT`.
pub(super) fn get_3_i32<const AT: usize>(report: &[u8; LENGTH]) -> [i32; 3] {
    let [a, b, c, d, e, f, g, h, i, j, k, l] = get::<AT, 12>(report);
    [[a, b, c, d], [e, f, g, h], [i, j, k, l]].map(i32::from_le_bytes)
}

/// Writes three numbers of four bytes from offset `AT`.
pub(super) fn put_3_i32<const AT: usize>(report: &mut [u8; LENGTH], numbers: [i32; 3]) {
    let [[a, b, c, d], [e, f, g, h], [i, j, k, l]] = numbers.map(i32::to_le_bytes);
    put::<AT, 12>(report, [a, b, c, d, e, f, g, h, i, j, k, l]);
}

/// Three numbers of two bytes from offset `AT`.
pub(super) fn get_3_i16<const AT: usize>(report: &[u8; LENGTH]) -> [i16; 3] {
    let [a, b, c, d, e, f] = get::<AT, 6>(report);
    [[a, b], [c, d], [e, f]].map(i16::from_le_bytes)
}

/// Writes three numbers of two bytes from offset `AT`.
pub(super) fn put_3_i16<const AT: usize>(report: &mut [u8; LENGTH], numbers: [i16; 3]) {
    let [[a, b], [c, d], [e, f]] = numbers.map(i16::to_le_bytes);
    put::<AT, 6>(report, [a, b, c, d, e, f]);
}

/// Four numbers of two bytes from offset `AT`.
pub(super) fn get_4_i16<const AT: usize>(report: &[u8; LENGTH]) -> [i16; 4] {
    let [a, b, c, d, e, f, g, h] = get::<AT, 8>(report);
    [[a, b], [c, d], [e, f], [g, h]].map(i16::from_le_bytes)
}

/// Writes four numbers of two bytes from offset `AT`.
pub(super) fn put_4_i16<const AT: usize>(report: &mut [u8; LENGTH], numbers: [i16; 4]) {
    let [[a, b], [c, d], [e, f], [g, h]] = numbers.map(i16::to_le_bytes);
    put::<AT, 8>(report, [a, b, c, d, e, f, g, h]);
}

/// The sequence number.
pub(super) fn sequence(report: &[u8; LENGTH]) -> u16 {
    u16::from_le_bytes(get::<{ at::SEQUENCE }, 2>(report))
}

/// A report of zeros with its version, kind and sequence number.
pub(super) fn start(kind: Kind, sequence: u16) -> [u8; LENGTH] {
    let mut report = [0; LENGTH];
    put::<{ at::VERSION }, 1>(&mut report, [VERSION]);
    put::<{ at::KIND }, 1>(&mut report, [kind as u8]);
    put::<{ at::SEQUENCE }, 2>(&mut report, sequence.to_le_bytes());
    report
}

/// Completes a report with its check sum.
pub(super) fn seal(mut report: [u8; LENGTH]) -> [u8; LENGTH] {
    let sum = check_sum(&report);
    put::<{ at::CRC }, 2>(&mut report, sum.to_le_bytes());
    report
}

fn check_sum(report: &[u8; LENGTH]) -> u16 {
    CRC.checksum(&get::<0, { at::CRC }>(report))
}

/// Checks the properties of every report: length, check sum, version and kind. The check sum comes before the version,
/// so that a damaged version is not taken for another version.
///
/// # Errors
/// [`ReportError`], except `OutOfRange`.
pub(super) fn check(bytes: &[u8], kind: Kind) -> Result<&[u8; LENGTH], ReportError> {
    let Ok(report) = <&[u8; LENGTH]>::try_from(bytes) else {
        return Err(ReportError::Length { found: bytes.len() });
    };
    let expected = check_sum(report);
    let found = u16::from_le_bytes(get::<{ at::CRC }, 2>(report));
    if found != expected {
        return Err(ReportError::Crc { expected, found });
    }
    let [found] = get::<{ at::VERSION }, 1>(report);
    if found != VERSION {
        return Err(ReportError::Version { found });
    }
    let [found] = get::<{ at::KIND }, 1>(report);
    if found != kind as u8 {
        return Err(ReportError::Kind {
            expected: kind,
            found,
        });
    }
    Ok(report)
}

/// Checks that the reserved bytes, from offset `AT` to the check sum, are zero: this version must not overlook the
/// fields that a later version puts there.
pub(super) fn check_reserved<const AT: usize>(report: &[u8; LENGTH]) -> Result<(), ReportError> {
    const { assert!(AT <= at::CRC, "reserved bytes begin behind the check sum") };
    let reserved = report.iter().take(at::CRC).skip(AT);
    match reserved.map(|&byte| u64::from(byte)).sum() {
        0 => Ok(()),
        found => Err(ReportError::OutOfRange {
            field: Field::Reserved,
            least: 0,
            most: 0,
            found,
        }),
    }
}
