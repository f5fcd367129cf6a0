//! The facts about a sheet that resists bending: triangles, their neighbours, and the plate's matrix.

use super::exact::Bending;
use super::{NONE, build};
use crate::error::BodyError;
use crate::mesh::FlatPattern;
use crate::{Mat3, Vec3};

/// A sheet that resists bending, over vertices. A body keeps these facts, from which its bending is built again when
/// handles or supports change.
#[derive(Debug)]
pub(crate) struct BentSheet {
    pub(super) triangles: Vec<[u32; 3]>,
    /// Number of the sheet's own triangles. The triangles of ghosts come after them.
    pub(super) count: usize,
    /// By triangle, the neighbour across each side, or [`NONE`].
    pub(super) neighbours: Vec<[u32; 3]>,
    /// One for all triangles or one for each.
    pub(super) plates: Vec<Plate>,
    /// The corners of each triangle (m) in a flat pattern, or in the frames of a surface that can tear. Otherwise empty.
    pub(super) pattern: Vec<[[f64; 2]; 3]>,
    /// Whether the sheet is cut out of a flat pattern, and flat at rest.
    pub(super) is_cut: bool,
    /// By original triangle, the plate's matrix in the frame of the surface (N m). Empty if there is one plate for all,
    /// which has no direction then, or if the sheet cannot tear.
    pub(super) original: Vec<Mat3>,
    /// Number of triangles for which there is room, or 0 if the sheet cannot tear.
    pub(super) limit: usize,
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
            pattern: Vec::new(),
            is_cut: false,
            original: Vec::new(),
            limit: 0,
        })
    }

    /// The same sheet, cut out of this flat pattern of its triangles, if there is one.
    pub(crate) fn cut(mut self, pattern: Option<&FlatPattern>) -> Self {
        self.is_cut = pattern.is_some();
        self.pattern = pattern.map_or_else(Vec::new, |pattern| pattern.corners.clone());
        self
    }

    /// Whether the sheet is flat at rest, as cut out of a pattern, whatever its starting positions.
    pub(super) fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// The corners of a triangle at rest (m), if `x` are the starting positions of the vertices (m). Those of a pattern lie
    /// in the plane z = 0.
    pub(super) fn corners(&self, triangle: usize, x: &[Vec3]) -> [Vec3; 3] {
        match self.pattern.get(triangle) {
            Some(corners) => corners.map(|[u, v]| Vec3::new(u, v, 0.0)),
            None => self.triangles[triangle].map(|vertex| x[vertex as usize]),
        }
    }

    /// The places of some vertices of a triangle, as [`corners`](Self::corners) gives them.
    pub(super) fn places<const N: usize>(
        &self,
        triangle: usize,
        vertices: [u32; N],
        x: &[Vec3],
    ) -> [Vec3; N] {
        let corners = self.corners(triangle, x);
        let named = &self.triangles[triangle];
        vertices.map(|vertex| corners[named.iter().position(|&v| v == vertex).unwrap_or_default()])
    }

    /// The length at rest of the edge opposite vertex `k` of a triangle (m): the mean of both triangles there. The two
    /// sides of a seam may differ in length.
    pub(super) fn length(&self, (triangle, k): (usize, usize), x: &[Vec3]) -> f64 {
        let vertices = &self.triangles[triangle];
        let ends = [1, 2].map(|i| vertices[(k + i) % 3]);
        let beyond = self.neighbours[triangle][k] as usize;
        let [own, other] = [triangle, beyond].map(|triangle| {
            let [a, b] = self.places(triangle, ends, x);
            (b - a).norm()
        });
        0.5 * (own + other)
    }

    /// The plate of a triangle.
    pub(super) fn plate(&self, triangle: usize) -> &Plate {
        let one = self.plates.len() == 1;
        &self.plates[if one { 0 } else { triangle }]
    }

    /// The bending of the sheet, whose nodes start at `x` (m), at rest there or flat as cut out of a pattern. `is_rigid`
    /// says whether the motion of a triangle is prescribed. Each of the `ghosts` is the far corner of another triangle
    /// beyond a side of the border. These triangles have no energy of their own.
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
        // A sheet with clamped borders follows no edits.
        sheet.limit = 0;
        for (side, ghost) in ghosts {
            let beyond = sheet.triangles.len() as u32;
            let [a, b] = side.ends;
            sheet.triangles.push([a, b, ghost]);
            if !self.pattern.is_empty() {
                // The parallelogram of the triangle at the edge.
                let triangle = side.triangle as usize;
                let [a, b] = self.places(triangle, side.ends, x);
                let [across] = self.places(triangle, [side.across], x);
                let corners = [a, b, a + b - across];
                sheet
                    .pattern
                    .push(corners.map(|corner| [corner.x, corner.y]));
            }
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
            + size_of_val(self.pattern.as_slice())
            + size_of_val(self.original.as_slice())
    }
}
