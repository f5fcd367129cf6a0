//! The effect of each edit, for programs that show or store how a sheet tears.

use super::Tearing;
use crate::topology::Done;

/// The effect of one edit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grown {
    /// The vertex from which the tear grew.
    pub from: u32,
    /// The new tip, and that of the growth to the other side; [`NONE`](crate::topology::NONE) if there is none.
    pub tips: [u32; 2],
    /// The border vertex that the growth reached, on each side; [`NONE`](crate::topology::NONE) if there is none.
    pub met: [u32; 2],
    /// Whether the tear starts with this edit: no edit before ended at the vertex `from`.
    pub starts: bool,
    /// The length of the opened edges at rest (m).
    pub length: f64,
    /// The energy that the opened edges take (J); zero under the law `thesis`.
    pub energy: f64,
}

impl Tearing {
    /// The effect of each edit of the [journal](Self::journal), in the same order.
    pub fn grown(&self) -> &[Grown] {
        &self.grown
    }

    /// Notes what an edit from the vertex `from` did.
    pub(super) fn note(&mut self, from: u32, done: &Done, length: f64, energy: f64) {
        let starts = !self.grown.iter().any(|before| before.tips.contains(&from));
        self.grown.push(Grown {
            from,
            tips: done.tips,
            met: done.met,
            starts,
            length,
            energy,
        });
    }
}
