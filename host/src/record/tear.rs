//! An edit by which a sheet tore, as an event.

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
    /// The new tip, and that of the growth to the other side; `u32::MAX` where there is none.
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
    /// What a person should hear of, in words; `None` for an edit by which a tear only goes on. `pieces` is the number of
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
