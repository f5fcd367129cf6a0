//! Which rows of a step are kept: per vertex and side the three deepest ones, and no more than there is room for.
//!
//! Layers that lie on each other have many more rows than their vertices have motions: three rows that push a vertex to one
//! side hold it there. A row is left out if each of its vertices has three deeper ones on that side.

use crate::Vec3;

/// Rows of a vertex on a side.
const ROWS: u8 = 3;
/// Sides of a vertex. A further one has no rows.
const SIDES: usize = 4;
/// The least product of two directions of a side.
const SIDE: f64 = 0.5;

/// The rows of a vertex so far.
#[derive(Clone, Copy, Debug)]
struct Sides {
    directions: [Vec3; SIDES],
    rows: [u8; SIDES],
}

const NO_SIDES: Sides = Sides {
    directions: [Vec3::new(0.0, 0.0, 0.0); SIDES],
    rows: [0; SIDES],
};

impl Sides {
    /// The side of a direction, and whether it has room.
    fn side(&self, direction: &Vec3) -> Option<usize> {
        let sides = self.directions.iter().zip(&self.rows);
        let mut sides = sides.map(|(of, rows)| *rows == 0 || of.dot(direction) > SIDE);
        sides.position(|is_side| is_side)
    }

    fn has_room(&self, direction: &Vec3) -> bool {
        self.side(direction)
            .is_some_and(|side| self.rows[side] < ROWS)
    }

    fn add(&mut self, direction: &Vec3) {
        if let Some(side) = self.side(direction) {
            if self.rows[side] == 0 {
                self.directions[side] = *direction;
            }
            self.rows[side] = self.rows[side].saturating_add(1);
        }
    }
}

/// The rows of all vertices.
#[derive(Debug)]
pub(super) struct Thinning {
    sides: Vec<Sides>,
}

impl Thinning {
    pub(super) fn new(vertices: usize) -> Self {
        Self {
            sides: vec![NO_SIDES; vertices],
        }
    }

    /// Forgets all rows.
    pub(super) fn clear(&mut self) {
        self.sides.fill(NO_SIDES);
    }

    /// Whether a row is kept that pushes each of these vertices in a direction. Rows are tried from the deepest one on.
    pub(super) fn keep(&mut self, pushed: impl Iterator<Item = (u32, Vec3)> + Clone) -> bool {
        let mut each = pushed.clone();
        let is_kept = each.any(|(vertex, by)| self.sides[vertex as usize].has_room(&by));
        if is_kept {
            pushed.for_each(|(vertex, by)| self.sides[vertex as usize].add(&by));
        }
        is_kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertex_has_three_rows_on_each_side() {
        let mut thinning = Thinning::new(2);
        let kept: Vec<bool> = (0..10)
            .map(|i| {
                thinning.keep([(0, if i % 2 == 0 { Vec3::z() } else { -Vec3::z() })].into_iter())
            })
            .collect();
        assert_eq!(kept.iter().filter(|kept| **kept).count(), 6);
        // The other vertex has room.
        let pushed = [(0, Vec3::z()), (1, Vec3::z())];
        assert!(thinning.keep(pushed.into_iter()));
        assert!(!thinning.keep([(0, Vec3::z())].into_iter()));
        thinning.clear();
        assert!(thinning.keep([(0, Vec3::z())].into_iter()));
    }
}
