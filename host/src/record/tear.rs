//! An edit by which a sheet tore, as an event: its words and its message.

use super::field::{Record, Visitor, fields, record};
use super::kind::{Stamp, kind};
use physics::Vec3;
use physics::topology::NONE;

/// An edit by which a tear of a body grew.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TearEvent {
    /// Index of the body.
    pub body: u32,
    /// Number of the edit in the body, from one.
    pub number: u32,
    /// Number of the host step, from one.
    pub step: u64,
    /// Time at which the step was due (ns).
    pub time_ns: u64,
    /// Topology epoch after the step.
    pub epoch: u32,
    /// The vertex from which the tear grew.
    pub from: u32,
    /// Position of that vertex at rest (m).
    pub at: Vec3,
    /// Where the opened edge ends at rest (m): at the new tip, or at the border that the tear met.
    pub end: Vec3,
    /// The new tip, and that of the growth to the other side; `u32::MAX` if there is none.
    pub tips: [u32; 2],
    /// Length of the opened edges at rest (m).
    pub length: f64,
    /// The energy that the opened edges take (J).
    pub energy: f64,
    /// Whether the tear starts with this edit.
    pub starts: bool,
    /// Number of pieces of the sheet after the step.
    pub pieces: u32,
}

impl TearEvent {
    /// The event in words for people; `None` for an edit by which a tear only grows. `pieces` is the number of
    /// pieces before.
    pub fn words(&self, pieces: u32) -> Option<String> {
        if self.pieces > pieces {
            let count = self.pieces;
            Some(format!(
                "the sheet came apart {}: {count} pieces",
                place(&self.end)
            ))
        } else if self.tips[0] == NONE {
            Some(format!("a tear reached a border {}", place(&self.end)))
        } else if self.starts {
            Some(format!("a tear started {}", place(&self.at)))
        } else {
            None
        }
    }
}

/// A place at rest, in words.
fn place(at: &Vec3) -> String {
    // In tenths of a millimetre. The sum makes a negative zero positive.
    let [x, y, z] = [at.x, at.y, at.z].map(|x| (1e4 * x).round() / 10.0 + 0.0);
    format!("at x {x:.1}, y {y:.1}, z {z:.1} mm at rest")
}

impl TearEvent {
    /// The stamp of its message.
    pub fn stamp(&self) -> Stamp {
        Stamp {
            body: self.body as usize,
            number: Some(self.number),
            time_ns: self.time_ns,
        }
    }
}

kind! { TearEvent: "palpate_msgs/msg/Tear", Tears, |body| format!("/bodies/{body}/tears"); }

record! { TearEvent: Self::default();
    "# An edit by which a tear of a body grew by one edge, or began inside the body with two.";
    "uint64 step       # number of the host step, from one" step;
    "uint64 time_ns    # the time at which the step was due" time_ns;
    "uint32 body       # index in a tick's bodies" body;
    "uint32 number     # number of the edit in the body, from one" number;
    "uint32 epoch      # topology epoch after the step" epoch;
    "uint32 from_vertex    # the vertex from which the tear grew" from;
    "float64[3] at     # position of that vertex at rest (m)" at;
    "float64[3] end    # where the opened edge ends at rest (m): at the new tip, or at the border that the tear met" end;
    "uint32[2] tips    # the new tip, and that to the other side; 4294967295 where there is none" tips;
    "float64 length    # length of the opened edges at rest (m)" length;
    "float64 energy    # the energy that the opened edges take (J)" energy;
    "uint32 pieces     # number of pieces of the sheet after the step" pieces;
    "bool starts       # whether the tear starts with this edit" starts;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Kind;
    use crate::record::cdr::decode;

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
        let message = event.message();
        assert_eq!(decode(&message), Some(event));
        for cut in 0..message.len() {
            assert_eq!(decode::<TearEvent>(&message[..cut]), None, "{cut}");
        }
    }
}
