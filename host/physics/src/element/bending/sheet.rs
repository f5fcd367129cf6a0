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
    /// Number of the sheet's own triangles. The triangles of ghosts come after them.
    pub(super) count: usize,
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

/// A side of a triangle on the border of a sheet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BorderSide {
    triangle: u32,
    /// The vertex of the triangle across the side: 0, 1 or 2.
    corner: u32,
    pub(crate) ends: [u32; 2],
    pub(crate) across: u32,
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
            count: triangles.len(),
            neighbours: neighbours(triangles)?,
            plates,
        })
    }

    /// The plate of a triangle.
    pub(super) fn plate(&self, triangle: usize) -> &Plate {
        let one = self.plates.len() == 1;
        &self.plates[if one { 0 } else { triangle }]
    }

    /// The bending of the sheet, whose nodes are at `x` (m) at rest. `is_rigid` says whether the motion of a triangle is
    /// prescribed. Each of the `ghosts` is the far corner of another triangle beyond a side of the border. These triangles
    /// have no energy of their own.
    pub(crate) fn bending(
        &self,
        x: &[Vec3],
        ghosts: impl Iterator<Item = (BorderSide, u32)>,
        is_rigid: impl Fn(&[u32; 3]) -> bool,
    ) -> Bending {
        let mut ghosts = ghosts.peekable();
        if ghosts.peek().is_none() {
            return build::bending(self, x, &self.rigid(is_rigid));
        }
        let mut sheet = self.clone();
        for (side, ghost) in ghosts {
            let beyond = sheet.triangles.len() as u32;
            let [a, b] = side.ends;
            sheet.triangles.push([a, b, ghost]);
            sheet.neighbours.push([NONE, NONE, side.triangle]);
            sheet.neighbours[side.triangle as usize][side.corner as usize] = beyond;
        }
        build::bending(&sheet, x, &sheet.rigid(is_rigid))
    }

    /// The sides of its border.
    pub(crate) fn border(&self) -> impl Iterator<Item = BorderSide> + '_ {
        let triangles = self.triangles.iter().zip(&self.neighbours).enumerate();
        triangles.flat_map(|(triangle, (vertices, neighbours))| {
            let sides = (0..3).filter(|&k| neighbours[k] == NONE);
            sides.map(move |k| BorderSide {
                triangle: triangle as u32,
                corner: k as u32,
                ends: [vertices[(k + 1) % 3], vertices[(k + 2) % 3]],
                across: vertices[k],
            })
        })
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
