//! Parses the records of a log, after a check that their lengths fit.
//!
//! Crate `mcap` 0.26 reserves the memory that the length of a text says before it reads the text, and panics on an
//! attachment that is too short. A file of sixty bytes could therefore end the program. This module walks over the
//! texts of a record first.
//!
//! Layout: <https://mcap.dev/spec>, "Records".

use mcap::records::{Record, op};
use mcap::{McapError, parse_record};

/// Parses a record of a log.
///
/// # Errors
/// If the record is too short for what its lengths say, or is damaged in another way.
pub(super) fn parse(opcode: u8, data: &[u8]) -> Result<Record<'_>, McapError> {
    match lengths(opcode, data) {
        Some(()) => parse_record(opcode, data),
        None => Err(McapError::UnexpectedEof),
    }
}

/// `None` if a text of the record would end after the record.
fn lengths(opcode: u8, data: &[u8]) -> Option<()> {
    let mut rest = Rest(data);
    match opcode {
        op::SCHEMA => {
            rest.skip(2)?;
            rest.text()?;
            rest.text()
        }
        op::CHANNEL => {
            rest.skip(4)?;
            rest.text()?;
            rest.text()?;
            rest.texts()
        }
        op::METADATA => {
            rest.text()?;
            rest.texts()
        }
        // The numbers before the name of the compression: four places and times, and the places of the messages.
        op::CHUNK_INDEX => {
            rest.skip(32)?;
            rest.text()?;
            rest.skip(8)?;
            rest.text()
        }
        op::ATTACHMENT_INDEX => {
            rest.skip(40)?;
            rest.text()?;
            rest.text()
        }
        op::METADATA_INDEX => {
            rest.skip(16)?;
            rest.text()
        }
        op::ATTACHMENT => {
            let file = attachment(data)?;
            // The check sum.
            (file.after >= size_of::<u32>()).then_some(())
        }
        // These records have numbers of a fixed size.
        _ => Some(()),
    }
}

/// The bytes of a record that have not been walked over yet.
struct Rest<'a>(&'a [u8]);

impl Rest<'_> {
    fn skip(&mut self, bytes: usize) -> Option<()> {
        self.0 = self.0.get(bytes..)?;
        Some(())
    }

    /// The length of a text or a list.
    fn length(&mut self) -> Option<usize> {
        let (length, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        usize::try_from(u32::from_le_bytes(*length)).ok()
    }

    /// A text after its length, or a list of numbers after its length in bytes.
    fn text(&mut self) -> Option<()> {
        let length = self.length()?;
        self.skip(length)
    }

    /// A list of pairs of texts, after its length in bytes.
    fn texts(&mut self) -> Option<()> {
        let length = self.length()?;
        let before = self.0.len();
        while before - self.0.len() < length {
            self.text()?;
            self.text()?;
        }
        Some(())
    }
}

/// An attachment record.
pub(super) struct Attached<'a> {
    pub(super) name: &'a str,
    pub(super) media_type: &'a str,
    pub(super) content: &'a [u8],
    /// Number of bytes after the content.
    after: usize,
}

/// Reads an attachment record without its check sum.
pub(super) fn attachment(record: &[u8]) -> Option<Attached<'_>> {
    // The record holds two times, then name, media type and content, each after its length.
    let (_, rest) = record.split_at_checked(16)?;
    let (name, rest) = text(rest)?;
    let (media_type, rest) = text(rest)?;
    let (length, rest) = rest.split_first_chunk()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    let (content, after) = rest.split_at_checked(length)?;
    Some(Attached {
        name,
        media_type,
        content,
        after: after.len(),
    })
}

/// A text after its length, and the bytes after the text.
fn text(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    let (text, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    Some((std::str::from_utf8(text).ok()?, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A text after its length.
    fn text(text: &str) -> Vec<u8> {
        let mut bytes = (text.len() as u32).to_le_bytes().to_vec();
        bytes.extend_from_slice(text.as_bytes());
        bytes
    }

    /// Sound records of every kind that has texts: the operation code, the content, and the places of its lengths.
    fn records() -> Vec<(u8, Vec<u8>, Vec<usize>)> {
        let pair = [text("key"), text("value")].concat();
        let pairs = [(pair.len() as u32).to_le_bytes().to_vec(), pair].concat();
        let kinds: [(u8, Vec<Vec<u8>>); 6] = [
            (
                op::SCHEMA,
                vec![vec![1, 0], text("name"), text("ros2msg"), text("int8 x")],
            ),
            (
                op::CHANNEL,
                vec![vec![0; 4], text("/tick"), text("cdr"), pairs.clone()],
            ),
            (op::METADATA, vec![text("palpate"), pairs]),
            (
                op::CHUNK_INDEX,
                vec![
                    vec![0; 32],
                    text("0123456789"),
                    vec![0; 8],
                    text(""),
                    vec![0; 16],
                ],
            ),
            (
                op::ATTACHMENT_INDEX,
                vec![vec![0; 40], text("name"), text("type")],
            ),
            (op::METADATA_INDEX, vec![vec![0; 16], text("name")]),
        ];
        let of = |(opcode, parts): (u8, Vec<Vec<u8>>)| {
            let mut places = Vec::new();
            let mut bytes = Vec::new();
            for part in parts {
                // The parts without a length are all zero, or the number of a schema.
                let length = part.first_chunk().map(|l| u32::from_le_bytes(*l) as usize);
                if length.is_some_and(|length| length > 0 && length + 4 == part.len()) {
                    places.push(bytes.len());
                }
                bytes.extend(part);
            }
            (opcode, bytes, places)
        };
        kinds.into_iter().map(of).collect()
    }

    #[test]
    fn sound_records_are_parsed() {
        for (opcode, bytes, places) in records() {
            assert!(!places.is_empty());
            let record = parse(opcode, &bytes).expect("a sound record");
            assert_eq!(record.opcode(), opcode);
        }
    }

    /// A length of four gigabytes would be reserved by the crate. Here no memory is reserved.
    #[test]
    fn a_length_beyond_the_record_is_refused() {
        for (opcode, bytes, places) in records() {
            for place in places {
                for length in [bytes.len() as u32, u32::MAX >> 1, u32::MAX] {
                    let mut bytes = bytes.clone();
                    bytes[place..place + 4].copy_from_slice(&length.to_le_bytes());
                    // The crate checks the length of a definition itself.
                    let refused = parse(opcode, &bytes).is_err();
                    assert!(refused, "record {opcode}, place {place}, length {length}");
                    assert!(
                        lengths(opcode, &bytes).is_none() || opcode == op::SCHEMA,
                        "record {opcode}, place {place}, length {length}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_length_within_a_list_of_texts_is_checked() {
        let (opcode, mut bytes, places) = records().swap_remove(2);
        assert_eq!(opcode, op::METADATA);
        let key = places[1] + 4;
        bytes[key..key + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(matches!(
            parse(opcode, &bytes),
            Err(McapError::UnexpectedEof)
        ));
    }

    #[test]
    fn a_cut_record_is_refused() {
        for (opcode, bytes, _) in records() {
            for end in 0..bytes.len() {
                assert!(parse(opcode, &bytes[..end]).is_err(), "{opcode}, {end}");
            }
        }
    }
}
