//! The deformed vertices of a body as a ROS 2 point cloud, which public tools show: `sensor_msgs/msg/PointCloud2` with
//! the fields x, y and z (`float32`), in the frame `scene`.
//!
//! All bytes of such a message but the positions follow from its time and its number of vertices. A message whose other
//! bytes differ is refused.

use super::cdr::CdrWriter;
use super::kind::{Group, Kind};

/// The deformed vertices of a body at one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// Time at which the step was due (ns).
    pub time_ns: u64,
    /// Positions (m), three numbers a vertex.
    pub positions: Vec<f32>,
}

impl Kind for Cloud {
    const SCHEMA_NAME: &'static str = "sensor_msgs/msg/PointCloud2";
    const GROUP: Group = Group::Frames;

    fn topic(body: &str) -> String {
        format!("/bodies/{body}")
    }

    fn definition() -> String {
        DEFINITION.to_owned()
    }

    fn encode(&mut self, message: &mut Vec<u8>) {
        encode(self.time_ns, &self.positions, message);
    }

    fn decode(time_ns: u64, message: &[u8]) -> Option<Self> {
        let positions = decode(time_ns, message)?;
        Some(Self { time_ns, positions })
    }

    fn size(&self) -> usize {
        size_of_val(self.positions.as_slice())
    }
}

impl Cloud {
    /// The message for the positions of a body (m), three numbers a vertex.
    pub fn message_of(time_ns: u64, positions: &[f32]) -> Vec<u8> {
        let mut message = Vec::new();
        encode(time_ns, positions, &mut message);
        message
    }
}

/// The message definition of ROS 2, with the definitions that it uses.
const DEFINITION: &str = "\
std_msgs/Header header
uint32 height
uint32 width
sensor_msgs/PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: sensor_msgs/PointField
uint8 INT8=1
uint8 UINT8=2
uint8 INT16=3
uint8 UINT16=4
uint8 INT32=5
uint8 UINT32=6
uint8 FLOAT32=7
uint8 FLOAT64=8
string name
uint32 offset
uint8 datatype
uint32 count
";

/// The coordinate frame of the positions: the axes of the scene.
const FRAME: &str = "scene";
/// Bytes of a vertex.
const POINT: usize = 12;
/// `FLOAT32` of the message definition.
const FLOAT32: u8 = 7;

/// Writes a cloud into `bytes`, in place of the former content. `positions` has three numbers a vertex (m).
fn encode(time_ns: u64, positions: &[f32], bytes: &mut Vec<u8>) {
    let count = positions.len() / 3;
    begin(time_ns, count, bytes);
    for value in positions.iter().take(3 * count) {
        bytes.extend(value.to_le_bytes());
    }
    // The points are complete: none of them is invalid.
    bytes.push(1);
}

/// Everything before the positions.
fn begin(time_ns: u64, count: usize, bytes: &mut Vec<u8>) {
    let mut out = CdrWriter::begin(bytes);
    out.u32((time_ns / 1_000_000_000) as u32);
    out.u32((time_ns % 1_000_000_000) as u32);
    out.text(FRAME);
    out.u32(1);
    out.u32(count as u32);
    out.u32(3);
    for (name, offset) in ["x", "y", "z"].into_iter().zip([0, 4, 8]) {
        out.text(name);
        out.u32(offset);
        out.u8(FLOAT32);
        out.u32(1);
    }
    out.u8(0);
    out.u32(POINT as u32);
    out.u32((POINT * count) as u32);
    out.u32((POINT * count) as u32);
}

/// Reads the positions of a cloud of this time; `None` if the message has another layout or another time.
fn decode(time_ns: u64, message: &[u8]) -> Option<Vec<f32>> {
    let mut head = Vec::new();
    begin(time_ns, 0, &mut head);
    let count = message.len().checked_sub(head.len() + 1)? / POINT;
    begin(time_ns, count, &mut head);
    let rest = message.strip_prefix(head.as_slice())?;
    let (&[1], positions) = rest.split_last_chunk::<1>().map(|(a, b)| (b, a))? else {
        return None;
    };
    if positions.len() != POINT * count {
        return None;
    }
    let (numbers, _) = positions.as_chunks();
    Some(
        numbers
            .iter()
            .map(|four| f32::from_le_bytes(*four))
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_read_back_bit_for_bit() {
        let positions = [1.5, -0.0, f32::MIN_POSITIVE, 0.1, 2e7, -3.25];
        let mut message = Vec::new();
        encode(2_000_000_003, &positions, &mut message);
        let read = decode(2_000_000_003, &message).expect("a cloud");
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&read), bits(&positions));
        encode(5, &[], &mut message);
        assert_eq!(decode(5, &message), Some(Vec::new()));
    }

    #[test]
    fn another_layout_is_refused() {
        let mut message = Vec::new();
        encode(7, &[1.0, 2.0, 3.0], &mut message);
        assert_eq!(decode(8, &message), None, "another time");
        for cut in 0..message.len() {
            assert_eq!(decode(7, &message[..cut]), None, "{cut}");
        }
        // A changed byte before the positions.
        for at in 4..message.len() - 13 {
            let mut other = message.clone();
            other[at] ^= 1;
            assert_eq!(decode(7, &other), None, "{at}");
        }
    }
}
