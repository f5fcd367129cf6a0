//! The messages beside a body's point cloud: the step and the topology epoch of the cloud, and the surface of each
//! topology epoch.

use super::cdr::{CdrReader, CdrWriter};
use crate::record::Surface;

/// Name of the type of [`BodyFrame`].
pub(super) const FRAME_SCHEMA_NAME: &str = "palpate_msgs/msg/BodyFrame";

/// The definition of [`BodyFrame`].
pub(super) const FRAME_SCHEMA: &str = "\
# A frame of a body. The positions are in the point cloud of the same time on the channel /bodies/NAME.
uint64 step      # number of the host step, from one; zero for the state before the first step
uint64 time_ns   # the time at which the step was due
uint32 epoch     # topology epoch
uint32 body      # index in a tick's bodies
";

/// Name of the type of a surface.
pub(super) const SURFACE_SCHEMA_NAME: &str = "palpate_msgs/msg/Surface";

/// The definition of a surface.
pub(super) const SURFACE_SCHEMA: &str = "\
# The surface of a body in one topology epoch.
uint32 body         # index in a tick's bodies
uint32 epoch        # topology epoch
uint32 vertices     # number of vertices of the body, including those inside
float32[] rest      # positions at rest (m), three numbers a vertex
uint32[] triangles  # three vertices each
uint32[] lines      # the bars of a thread, two vertices each
";

/// The facts beside the positions of a frame of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BodyFrame {
    /// Index of the body.
    pub body: u32,
    /// Number of the host step, from one; zero for the state before the first step.
    pub step: u64,
    /// Time at which the step was due (ns).
    pub time_ns: u64,
    /// Topology epoch.
    pub epoch: u32,
}

/// Writes a frame into `bytes`, in place of the former content.
pub(super) fn encode_frame(frame: &BodyFrame, bytes: &mut Vec<u8>) {
    let mut out = CdrWriter::begin(bytes);
    out.u64(frame.step);
    out.u64(frame.time_ns);
    out.u32(frame.epoch);
    out.u32(frame.body);
}

/// Reads a frame back; `None` if the message is too short.
pub(super) fn decode_frame(message: &[u8]) -> Option<BodyFrame> {
    let mut from = CdrReader::begin(message)?;
    Some(BodyFrame {
        step: from.u64()?,
        time_ns: from.u64()?,
        epoch: from.u32()?,
        body: from.u32()?,
    })
}

/// Writes a surface into `bytes`, in place of the former content.
pub(super) fn encode_surface(surface: &Surface, bytes: &mut Vec<u8>) {
    let mut out = CdrWriter::begin(bytes);
    out.u32(surface.body);
    out.u32(surface.epoch);
    out.u32(surface.vertices);
    out.u32(surface.rest.len() as u32);
    surface.rest.iter().for_each(|x| out.u32(x.to_bits()));
    for indices in [&surface.triangles, &surface.lines] {
        out.u32(indices.len() as u32);
        for index in indices {
            out.u32(*index);
        }
    }
}

/// Reads a surface back; `None` if the message is too short, or its numbers contradict each other.
pub(super) fn decode_surface(message: &[u8]) -> Option<Surface> {
    let mut from = CdrReader::begin(message)?;
    let (body, epoch, vertices) = (from.u32()?, from.u32()?, from.u32()?);
    // No memory is reserved for the counts: a false count only runs into the end of the message.
    let mut numbers = || {
        let count = from.u32()?;
        (0..count).map(|_| from.u32()).collect::<Option<Vec<_>>>()
    };
    let rest: Vec<f32> = numbers()?.into_iter().map(f32::from_bits).collect();
    let (triangles, lines) = (numbers()?, numbers()?);
    let inside = |indices: &[u32]| indices.iter().all(|index| *index < vertices);
    let whole = rest.len() as u64 == 3 * u64::from(vertices)
        && triangles.len().is_multiple_of(3)
        && lines.len().is_multiple_of(2);
    (whole && inside(&triangles) && inside(&lines)).then_some(Surface {
        body,
        epoch,
        vertices,
        triangle_count: triangles.len() as u32 / 3,
        line_count: lines.len() as u32 / 2,
        rest,
        triangles,
        lines,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_and_a_surface_are_read_back() {
        let mut message = Vec::new();
        let frame = BodyFrame {
            body: 1,
            step: 7,
            time_ns: 9,
            epoch: 3,
        };
        encode_frame(&frame, &mut message);
        assert_eq!(decode_frame(&message), Some(frame));
        let surface = Surface {
            body: 1,
            epoch: 2,
            vertices: 3,
            triangle_count: 1,
            line_count: 1,
            rest: (0..9_u8).map(f32::from).collect(),
            triangles: vec![0, 1, 2],
            lines: vec![2, 0],
        };
        encode_surface(&surface, &mut message);
        assert_eq!(decode_surface(&message), Some(surface));
        for cut in 0..message.len() {
            assert_eq!(decode_surface(&message[..cut]), None, "{cut}");
        }
    }

    #[test]
    fn a_surface_with_a_vertex_that_does_not_exist_is_refused() {
        let surface = Surface {
            vertices: 1,
            rest: vec![0.0; 3],
            triangles: vec![0, 0, 1],
            ..Surface::default()
        };
        let mut message = Vec::new();
        encode_surface(&surface, &mut message);
        assert_eq!(decode_surface(&message), None);
    }
}
