//! Checks that the records in each chunk of a log end where the chunk ends.
//!
//! Crate `mcap` 0.26 subtracts the length of a record within an uncompressed chunk from the rest of the chunk
//! without a check that the rest is long enough. A damaged length therefore panics in a debug build, and reads
//! beyond the chunk in a release build. This module checks the lengths before the crate reads them.
//!
//! Layout: <https://mcap.dev/spec>, "Chunk (op=0x06)".

use mcap::{McapError, records::op};

/// Size of a record's head: an operation code and a length (bytes).
const HEAD: usize = 9;
/// Size of the fields before the name of a chunk's compression: times, size and check sum (bytes).
const BEFORE_COMPRESSION: usize = 28;

/// Checks the record of one chunk, with its head. The record may be cut anywhere.
pub(super) fn check(bytes: &[u8]) -> Result<(), McapError> {
    match record(bytes) {
        Some((op::CHUNK, length, data)) => check_chunk(data.get(..length).unwrap_or(data)),
        _ => Ok(()),
    }
}

/// Checks the records of one chunk. The crate finds all other faults.
fn check_chunk(chunk: &[u8]) -> Result<(), McapError> {
    let Some((&length, rest)) = chunk
        .get(BEFORE_COMPRESSION..)
        .and_then(|rest| rest.split_first_chunk())
    else {
        return Ok(());
    };
    if length != [0; 4] {
        return Ok(()); // compressed
    }
    let Some((&length, mut rest)) = rest.split_first_chunk() else {
        return Ok(());
    };
    let mut left = usize::try_from(u64::from_le_bytes(length)).unwrap_or(usize::MAX);
    while left > 0 {
        let Some((_, length, data)) = record(rest) else {
            break;
        };
        left = left
            .checked_sub(length.saturating_add(HEAD))
            .ok_or(McapError::UnexpectedEoc)?;
        rest = data.get(length..).unwrap_or_default();
    }
    // Fewer bytes remain than a record's head has, although the file continues: the head would reach beyond the
    // chunk.
    if left > 0 && left < HEAD && rest.len() >= left {
        return Err(McapError::UnexpectedEoc);
    }
    Ok(())
}

/// The operation code and the length of the first record, and the bytes after them.
fn record(bytes: &[u8]) -> Option<(u8, usize, &[u8])> {
    let (&[opcode, ref length @ ..], data) = bytes.split_first_chunk::<HEAD>()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
    Some((opcode, length, data))
}
