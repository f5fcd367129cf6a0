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
    pub(super) const SESSION: usize = 4;
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

/// The byte at offset `AT`.
pub(super) fn get_u8<const AT: usize>(report: &[u8; LENGTH]) -> u8 {
    let [byte] = get::<AT, 1>(report);
    byte
}

/// A number of two bytes from offset `AT`.
pub(super) fn get_u16<const AT: usize>(report: &[u8; LENGTH]) -> u16 {
    u16::from_le_bytes(get::<AT, 2>(report))
}

/// A number of four bytes from offset `AT`.
pub(super) fn get_u32<const AT: usize>(report: &[u8; LENGTH]) -> u32 {
    u32::from_le_bytes(get::<AT, 4>(report))
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

/// `N` numbers of four bytes from offset `AT`.
pub(super) fn get_i32s<const AT: usize, const N: usize>(report: &[u8; LENGTH]) -> [i32; N] {
    const { assert!(AT + 4 * N <= LENGTH, "numbers reach beyond their report") };
    let mut numbers = [0; N];
    let (chunks, _) = report.get(AT..).unwrap_or_default().as_chunks();
    for (number, chunk) in numbers.iter_mut().zip(chunks) {
        *number = i32::from_le_bytes(*chunk);
    }
    numbers
}

/// Writes `N` numbers of four bytes from offset `AT`.
pub(super) fn put_i32s<const AT: usize, const N: usize>(
    report: &mut [u8; LENGTH],
    numbers: [i32; N],
) {
    const { assert!(AT + 4 * N <= LENGTH, "numbers reach beyond their report") };
    let (chunks, _) = report.get_mut(AT..).unwrap_or_default().as_chunks_mut();
    for (chunk, number) in chunks.iter_mut().zip(numbers) {
        *chunk = number.to_le_bytes();
    }
}

/// The sequence number.
pub(super) fn sequence(report: &[u8; LENGTH]) -> u16 {
    get_u16::<{ at::SEQUENCE }>(report)
}

/// The session number.
pub(super) fn session(report: &[u8; LENGTH]) -> u32 {
    get_u32::<{ at::SESSION }>(report)
}

/// A report of zeros with its version, kind, sequence number and session.
pub(super) fn start(kind: Kind, sequence: u16, session: u32) -> [u8; LENGTH] {
    let mut report = [0; LENGTH];
    put::<{ at::VERSION }, 1>(&mut report, [VERSION]);
    put::<{ at::KIND }, 1>(&mut report, [kind as u8]);
    put::<{ at::SEQUENCE }, 2>(&mut report, sequence.to_le_bytes());
    put::<{ at::SESSION }, 4>(&mut report, session.to_le_bytes());
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

/// Checks length, check sum and version. The check sum comes before the version, so that a damaged version is not taken
/// for another version.
fn check_version(bytes: &[u8]) -> Result<&[u8; LENGTH], ReportError> {
    let Ok(report) = <&[u8; LENGTH]>::try_from(bytes) else {
        return Err(ReportError::Length { found: bytes.len() });
    };
    let expected = check_sum(report);
    let found = get_u16::<{ at::CRC }>(report);
    if found != expected {
        return Err(ReportError::Crc { expected, found });
    }
    match get_u8::<{ at::VERSION }>(report) {
        VERSION => Ok(report),
        found => Err(ReportError::Version { found }),
    }
}

/// Checks the properties of every report: length, check sum, version and kind.
///
/// # Errors
/// [`ReportError`], except `OutOfRange`.
pub(super) fn check(bytes: &[u8], kind: Kind) -> Result<&[u8; LENGTH], ReportError> {
    let report = check_version(bytes)?;
    let found = get_u8::<{ at::KIND }>(report);
    if found != kind as u8 {
        return Err(ReportError::Kind {
            expected: kind,
            found,
        });
    }
    Ok(report)
}

/// Checks what [`check`] checks, for a report of any kind. Returns the kind.
///
/// # Errors
/// [`ReportError`], except `Kind` and `OutOfRange`.
pub(super) fn check_any(bytes: &[u8]) -> Result<(&[u8; LENGTH], Kind), ReportError> {
    let report = check_version(bytes)?;
    let found = get_u8::<{ at::KIND }>(report);
    match Kind::of(found) {
        Some(kind) => Ok((report, kind)),
        None => Err(ReportError::UnexpectedKind { found }),
    }
}

/// Checks that `found` lies between `least` and `most`.
pub(super) fn check_range(
    field: Field,
    least: u64,
    most: u64,
    found: impl Into<u64>,
) -> Result<(), ReportError> {
    let found = found.into();
    if (least..=most).contains(&found) {
        return Ok(());
    }
    Err(ReportError::OutOfRange {
        field,
        least,
        most,
        found,
    })
}

/// Checks that `found` has no bits but those of `known`.
pub(super) fn check_bits(field: Field, known: u8, found: u8) -> Result<(), ReportError> {
    if found & !known == 0 {
        return Ok(());
    }
    Err(ReportError::OutOfRange {
        field,
        least: 0,
        most: known.into(),
        found: found.into(),
    })
}

/// Checks that a report to a device is of a session.
pub(super) fn check_session(report: &[u8; LENGTH]) -> Result<(), ReportError> {
    check_range(Field::Session, 1, u32::MAX.into(), session(report))
}

/// Checks that the numbers behind the first `used` ones are zero.
pub(super) fn check_unused(numbers: &[i32], used: u8) -> Result<(), ReportError> {
    let unused = numbers.iter().skip(used.into());
    let found = unused.filter(|&&number| number != 0).count() as u64;
    check_range(Field::Unused, 0, 0, found)
}

/// Checks that the reserved bytes, from offset `AT` up to `END`, are zero: this version must not overlook the fields
/// that a later version puts there.
pub(super) fn check_reserved<const AT: usize, const END: usize>(
    report: &[u8; LENGTH],
) -> Result<(), ReportError> {
    const {
        assert!(
            AT < END && END <= at::CRC,
            "reserved bytes reach the check sum"
        );
    };
    let reserved = report.iter().take(END).skip(AT);
    let found: u64 = reserved.map(|&byte| u64::from(byte)).sum();
    check_range(Field::Reserved, 0, 0, found)
}

/// The offset behind the last byte that can be reserved.
pub(super) const END: usize = at::CRC;
