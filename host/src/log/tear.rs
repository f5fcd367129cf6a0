//! The message of an edit by which a sheet tore.

use super::cdr::{CdrReader, CdrWriter};
use crate::record::TearEvent;

/// Name of the message type.
pub(super) const SCHEMA_NAME: &str = "palpate_msgs/msg/Tear";

/// The definition of the message.
pub(super) const SCHEMA: &str = "\
# An edit by which a tear of a body grew by one edge, or began inside the body with two.
uint64 step       # number of the host step, from one
uint64 time_ns    # the time at which the step was due
uint32 body       # index in a tick's bodies
uint32 number     # number of the edit in the body, from one
uint32 epoch      # topology epoch after the step
uint32 from_vertex    # the vertex from which the tear grew
float64[3] at     # position of that vertex at rest (m)
float64[3] end    # where the opened edge ends at rest (m): at the new tip, or at the border that the tear met
uint32[2] tips    # the new tip, and that to the other side; 4294967295 where there is none
float64 length    # length of the opened edges at rest (m)
float64 energy    # the energy that the opened edges take (J)
uint32 pieces     # number of pieces of the sheet after the step
bool starts       # whether the tear starts with this edit
";

/// Writes an edit into `bytes`, in place of the former content.
pub(super) fn encode(event: &TearEvent, bytes: &mut Vec<u8>) {
    let mut out = CdrWriter::begin(bytes);
    out.u64(event.step);
    out.u64(event.time_ns);
    for number in [event.body, event.number, event.epoch, event.from] {
        out.u32(number);
    }
    out.vector(&event.at);
    out.vector(&event.end);
    event.tips.iter().for_each(|tip| out.u32(*tip));
    out.f64(event.length);
    out.f64(event.energy);
    out.u32(event.pieces);
    out.u8(u8::from(event.starts));
}

/// Reads an edit back; `None` if the message is too short.
pub(super) fn decode(message: &[u8]) -> Option<TearEvent> {
    let mut from = CdrReader::begin(message)?;
    let (step, time_ns) = (from.u64()?, from.u64()?);
    let [body, number, epoch, vertex] = [from.u32()?, from.u32()?, from.u32()?, from.u32()?];
    Some(TearEvent {
        body,
        number,
        step,
        time_ns,
        epoch,
        from: vertex,
        at: from.vector()?,
        end: from.vector()?,
        tips: [from.u32()?, from.u32()?],
        length: from.f64()?,
        energy: from.f64()?,
        pieces: from.u32()?,
        starts: from.u8()? != 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::Vec3;

    #[test]
    fn an_edit_is_read_back_and_a_short_message_is_refused() {
        let event = TearEvent {
            body: 1,
            number: 7,
            step: 123,
            time_ns: 1_000_000_007,
            epoch: 9,
            from: 42,
            at: Vec3::new(0.1, -0.0, 3e-7),
            end: Vec3::new(0.2, 0.4, -3e-7),
            tips: [43, u32::MAX],
            length: 3e-3,
            energy: 1.2e-3,
            starts: true,
            pieces: 2,
        };
        let mut message = Vec::new();
        encode(&event, &mut message);
        assert_eq!(decode(&message), Some(event));
        for cut in 0..message.len() {
            assert_eq!(decode(&message[..cut]), None, "{cut}");
        }
    }
}
