//! Whether the records in a log's chunks end where their chunk does.
//!
//! Crate `mcap` 0.26 takes the length of a record within an uncompressed chunk from what is left of the
//! chunk, without asking whether that is enough: a damaged length panics in a debug build, and reads on
//! beyond the chunk in a release build. So lengths are looked at before the crate sees them.
//!
//! Layout: <https://mcap.dev/spec>, "Chunk (op=0x06)".

use mcap::{MAGIC, McapError, records::op};

/// An operation code and a length.
const HEAD: usize = 9;
/// Before a chunk's compression: its times, its size, its check sum.
const BEFORE_COMPRESSION: usize = 28;

/// Checks the chunks of a file, which may be cut anywhere.
pub(super) fn check(file: &[u8]) -> Result<(), McapError> {
    let mut rest = file.get(MAGIC.len()..).unwrap_or_default();
    while let Some((opcode, length, data)) = record(rest) {
        if opcode == op::CHUNK {
            check_chunk(data.get(..length).unwrap_or(data))?;
        }
        rest = data.get(length..).unwrap_or_default();
    }
    Ok(())
}

/// Checks one chunk's records. What else may be wrong with it, the crate finds.
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
    // Fewer bytes than a record's head, though the file goes on: the head would reach beyond the chunk.
    if left > 0 && left < HEAD && rest.len() >= left {
        return Err(McapError::UnexpectedEoc);
    }
    Ok(())
}

/// The operation code and length of the record that comes first, and what follows them.
fn record(bytes: &[u8]) -> Option<(u8, usize, &[u8])> {
    let (&[opcode, ref length @ ..], data) = bytes.split_first_chunk::<HEAD>()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
    Some((opcode, length, data))
}
