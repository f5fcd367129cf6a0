//! The facts about a sheet that resists bending: triangles, their neighbours, and the plate's matrix.

use super::exact::Bending;
use super::{NONE, build};
use crate::error::BodyError;
use crate::{Mat3, Vec3};

/// A sheet that resists bending, over vertices. A body keeps these facts, from which its bending is built again where
/// handles or supports change.
#[derive(Clone, Debug)]
pub(crate) struct BentSheet {
    pub(super) triangles: Vec<[u32; 3]>,
    /// By triangle, the neighbour across each side, or [`NONE`].
    pub(super) neighbours: Vec<[u32; 3]>,
    /// One for all triangles or one for each.
    plates: Vec<Plate>,
}

/// The plate that a triangle is a part of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plate {
    /// The matrix between moments and curvatures (xx, yy, 2 xy) in the rest frame of the triangle (N m).
    pub(crate) matrix: Mat3,
    /// The thickness (m).
    pub(crate) thickness: f64,
}

/// A side of a triangle: its vertices in ascending order, the triangle, and the number of the side.
type Side = (u32, u32, usize, usize);

/// For each side of each triangle in turn, the triangle across it, or [`NONE`].
fn neighbours(triangles: &[[u32; 3]]) -> Result<Vec<[u32; 3]>, BodyError> {
    let mut sides: Vec<Side> = Vec::with_capacity(3 * triangles.len());
    for (triangle, vertices) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (p, q) = (vertices[(k + 1) % 3], vertices[(k + 2) % 3]);
            sides.push((p.min(q), p.max(q), triangle, k));
        }
    }
    sides.sort_unstable();
    let mut neighbours = vec![[NONE; 3]; triangles.len()];
    for group in sides.chunk_by(|p, q| (p.0, p.1) == (q.0, q.1)) {
        match *group {
            [_] => {}
            [(_, _, p, kp), (_, _, q, kq)] => {
                neighbours[p][kp] = q as u32;
                neighbours[q][kq] = p as u32;
            }
            _ => {
                let (a, b, ..) = group[0];
                let count = group.len();
                return Err(BodyError::NonManifold { a, b, count });
            }
        }
    }
    Ok(neighbours)
}

impl BentSheet {
    /// A sheet of `triangles` with these plates, one for all triangles or one for each.
    ///
    /// # Errors
    ///
    /// [`BodyError::NonManifold`].
    pub(crate) fn new(triangles: &[[u32; 3]], plates: Vec<Plate>) -> Result<Self, BodyError> {
        Ok(Self {
            triangles: triangles.to_vec(),
            neighbours: neighbours(triangles)?,
            plates,
        })
    }

    /// The plate of a triangle.
    pub(super) fn plate(&self, triangle: usize) -> &Plate {
        let one = self.plates.len() == 1;
        &self.plates[if one { 0 } else { triangle }]
    }

    /// The bending of the sheet, whose vertices are at `x` (m) at rest. `is_rigid` says whether the motion of a triangle
    /// is prescribed.
    pub(crate) fn bending(&self, x: &[Vec3], is_rigid: impl Fn(&[u32; 3]) -> bool) -> Bending {
        build::bending(self, x, &self.rigid(is_rigid))
    }

    /// Whether the motion of each triangle is prescribed.
    pub(crate) fn rigid(&self, is_rigid: impl Fn(&[u32; 3]) -> bool) -> Vec<bool> {
        self.triangles.iter().map(is_rigid).collect()
    }

    /// Memory that it holds beside itself (bytes).
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.triangles.as_slice())
            + size_of_val(self.neighbours.as_slice())
            + size_of_val(self.plates.as_slice())
    }
}
