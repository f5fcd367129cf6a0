//! Which rows of a step are kept, and no more than there is room for.
//!
//! Layers that lie on each other have many more rows than their vertices have motions. A vertex keeps its three deepest rows
//! with triangles on each side: nothing else holds it. Two edges keep their row if one of their vertices has fewer than three
//! deeper rows on its side.

use crate::Vec3;

/// Rows of a vertex on a side. With one row of edges for each vertex, a sheet on a ball does not come to rest. Without thinning,
/// a stack has twice the rows and needs a tenth more iterations.
const ROWS: u8 = 3;
/// Sides of a vertex. A further one has no rows.
const SIDES: usize = 4;
/// The least product of two directions of a side.
const SIDE: f64 = 0.5;

/// The rows of a vertex so far: with triangles, and of its edges.
#[derive(Clone, Copy, Debug)]
struct Sides {
    directions: [Vec3; SIDES],
    rows: [[u8; 2]; SIDES],
}

const NO_SIDES: Sides = Sides {
    directions: [Vec3::new(0.0, 0.0, 0.0); SIDES],
    rows: [[0; 2]; SIDES],
};

impl Sides {
    /// Adds a row of a kind, if its side has room.
    fn add(&mut self, direction: &Vec3, kind: usize) -> bool {
        let sides = self.directions.iter_mut().zip(&mut self.rows);
        let mut sides = sides.filter(|(of, rows)| **rows == [0; 2] || of.dot(direction) > SIDE);
        let Some((of, rows)) = sides.next() else {
            return false;
        };
        if *rows == [0; 2] {
            *of = *direction;
        }
        // The edges fill up what the triangles leave.
        let count: u8 = if kind == 0 {
            rows[0]
        } else {
            rows.iter().sum()
        };
        if count < ROWS {
            rows[kind] += 1;
        }
        count < ROWS
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

    /// Whether the row of a vertex is kept that pushes it in a direction. Rows are tried from the deepest one on.
    pub(super) fn keep_vertex(&mut self, vertex: u32, by: &Vec3) -> bool {
        self.sides[vertex as usize].add(by, 0)
    }

    /// Whether the row of two edges is kept that pushes each of these vertices in a direction.
    pub(super) fn keep_edges(&mut self, pushed: impl Iterator<Item = (u32, Vec3)>) -> bool {
        pushed.fold(false, |is_kept, (vertex, by)| {
            self.sides[vertex as usize].add(&by, 1) | is_kept
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertex_has_three_rows_on_each_side() {
        let mut thinning = Thinning::new(2);
        let sides = (0..10).map(|i| if i % 2 == 0 { Vec3::z() } else { -Vec3::z() });
        let kept = sides.filter(|side| thinning.keep_vertex(0, side));
        assert_eq!(kept.count(), 6);
        assert!(!thinning.keep_edges([(0, Vec3::z())].into_iter()));
        // The other vertex has room.
        let pushed = [(0, Vec3::z()), (1, Vec3::z())];
        assert!(thinning.keep_edges(pushed.into_iter()));
        thinning.clear();
        assert!(thinning.keep_vertex(0, &Vec3::z()));
    }

    #[test]
    fn edges_leave_a_vertex_its_rows_with_triangles() {
        let mut thinning = Thinning::new(1);
        let edges = (0..5).filter(|_| thinning.keep_edges([(0, Vec3::z())].into_iter()));
        assert_eq!(edges.count(), 3);
        let kept = (0..5).filter(|_| thinning.keep_vertex(0, &Vec3::z()));
        assert_eq!(kept.count(), 3);
        assert!(!thinning.keep_edges([(0, Vec3::z())].into_iter()));
    }
}
