//! The rings of vertices about a tip, and the cut-off function `q`.
//!
//! Ring 0 is the tip. Ring `n + 1` are the further corners of the triangles at ring `n`. The triangles are reached by
//! their neighbours, so a ring never crosses an opened edge. `q` is 1 up to ring `n`, 0 from ring `n + 1` on, and linear
//! in triangles.
//!
//! **In the way.** `q` must be 0 where forces enter that the integrals do not know, and about other tips. If a held
//! vertex or another tip lies in ring `k`, the last ring with `q = 1` is `k - 1`, down to the tip alone. On clamped strips of
//! 300 to 2,000 triangles `G` errs by -15 to +1 % for the tip alone, by -6 to +4 % for ring 1, by -1.7 to +0.5 % for ring
//! 2 and by -0.5 to +0.5 % for ring 3. A border without forces is not in the way: the integrals have terms for it.

use super::fields::Field;
use super::law::TearError;
use super::unfold::{Placement, place};
use crate::Vec3;
use crate::topology::{NONE, Surface};

/// A surface of triangles: corners, neighbours and shapes, one of each for a triangle.
///
/// All triangles are wound in the same sense, and counterclockwise in their shapes. `neighbours[t][k]` is the triangle
/// across the edge opposite to corner `k`, or [`NONE`] at a border. Every vertex has one fan of triangles.
#[derive(Clone, Copy, Debug)]
pub struct Sheet<'a> {
    /// The vertices of each triangle.
    pub triangles: &'a [[u32; 3]],
    /// The neighbours of each triangle.
    pub neighbours: &'a [[u32; 3]],
    /// The corners of each triangle at rest (m), each in a frame of its own or all in one.
    pub shapes: &'a [[[f64; 2]; 3]],
}

impl<'a> From<&'a Surface> for Sheet<'a> {
    fn from(surface: &'a Surface) -> Self {
        Self {
            triangles: surface.triangles(),
            neighbours: surface.neighbours(),
            shapes: surface.shapes(),
        }
    }
}

/// The tip of a tear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tip {
    /// The vertex.
    pub vertex: u32,
    /// A triangle at it.
    pub triangle: u32,
    /// The unit direction of the tear at rest, away from its faces, in the frame of the triangle's shape.
    pub along: [f64; 2],
}

impl Tip {
    /// The tip at `vertex` of a tear in the direction of a fan angle (rad), for instance
    /// [`Surface::straight_ahead`]. The tear continues at this angle plus that of
    /// [`Intensity::kink`](super::Intensity::kink). `None` for an angle outside of the fan.
    pub fn at(surface: &Surface, vertex: u32, angle: f64) -> Option<Self> {
        let (triangle, along) = surface.direction_at(vertex, angle)?;
        Some(Self {
            vertex,
            triangle,
            along,
        })
    }
}

/// Visits the triangles of the fan of `vertex`, beginning with `triangle`. The second argument is the triangle from
/// which the visit came across a shared edge, `None` for the first.
pub(super) fn fan(
    sheet: &Sheet,
    vertex: u32,
    triangle: u32,
    mut visit: impl FnMut(u32, Option<u32>),
) {
    visit(triangle, None);
    for direction in [1, 2] {
        let mut at = triangle;
        // A fan has at most all triangles. The limit ends a walk through inconsistent neighbours.
        for _ in 0..sheet.triangles.len() {
            let corners = &sheet.triangles[at as usize];
            let Some(corner) = corners.iter().position(|&v| v == vertex) else {
                return;
            };
            let next = sheet.neighbours[at as usize][(corner + direction) % 3];
            if next == triangle {
                return;
            }
            if next == NONE {
                break;
            }
            visit(next, Some(at));
            at = next;
        }
    }
}

/// A triangle of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laid {
    /// The triangle in the sheet.
    pub triangle: u32,
    /// The place in the patch of the triangle beside which this one was laid, `NONE` for the first. It is smaller.
    pub parent: u32,
    /// Places of the corners among the vertices of the patch.
    pub corners: [u32; 3],
    /// Positions of the corners at rest, from the tip (m), in the frame of the tip's triangle.
    pub shape: [[f64; 2]; 3],
    /// The triangle of the sheet across the edge opposite to each corner, [`NONE`] on a border.
    pub neighbours: [u32; 3],
    placement: Placement,
}

/// How the material of a triangle shifts as the tear grows, in the plane of the patch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shift {
    /// The triangle in the sheet.
    pub(crate) triangle: u32,
    /// The corners at rest (m).
    shape: [[f64; 2]; 3],
    /// The shift of each corner for a unit of length: the cut-off function times the direction of the tear.
    shifts: [[f64; 2]; 3],
}

impl Shift {
    /// The corners at rest (m) after the tear has grown by a length (m).
    pub(crate) fn moved(&self, by: f64) -> [[f64; 2]; 3] {
        [0, 1, 2].map(|k| [0, 1].map(|j| self.shape[k][j] + by * self.shifts[k][j]))
    }

    /// The length of the longest side (m).
    pub(crate) fn longest_side(&self) -> f64 {
        let side = |k: usize| {
            let (a, b) = (self.shape[k], self.shape[(k + 1) % 3]);
            libm::hypot(b[0] - a[0], b[1] - a[1])
        };
        side(0).max(side(1)).max(side(2))
    }
}

/// Stands for the place of a triangle around the patch.
const AROUND: u32 = NONE - 1;

/// The triangles and vertices about one tip, and the memory for all computations with them.
///
/// The memory is reserved for the largest sheet and serves any number of tips, one after another.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Place of each vertex of the sheet in the patch, `NONE` outside.
    place_of_vertex: Vec<u32>,
    place_of_triangle: Vec<u32>,
    /// The vertices, ring by ring, and a triangle at each.
    pub(super) vertices: Vec<[u32; 2]>,
    pub(super) triangles: Vec<Laid>,
    /// Number of vertices with `q = 1`. They come first.
    pub(super) inner: usize,
    rings: usize,
    /// The triangles around the patch that [`Patch::surround`] found.
    around: Vec<u32>,
    /// Number of vertices for which the patch would need room, 0 if it suffices.
    lacking: usize,
    pub(super) along: [f64; 2],
    pub(super) field: Field,
}

impl Patch {
    /// Room for sheets of up to this many vertices and triangles.
    pub fn new(vertices: usize, triangles: usize) -> Self {
        Self {
            place_of_vertex: vec![NONE; vertices],
            place_of_triangle: vec![NONE; triangles],
            vertices: Vec::with_capacity(vertices),
            triangles: Vec::with_capacity(triangles),
            inner: 0,
            rings: 0,
            around: Vec::with_capacity(triangles),
            lacking: 0,
            along: [1.0, 0.0],
            field: Field::with_capacity(vertices, triangles),
        }
    }

    /// Finds the triangles about `tip` for `q = 1` up to ring `rings`, or to fewer rings if `barred` names a vertex in
    /// the way: a held one or another tip. Lays them into one plane.
    ///
    /// # Errors
    ///
    /// [`TearError`]: a sheet too large for the patch, a triangle that is not at the tip, a direction that is no unit
    /// vector, a tip that is held. The patch is empty then.
    pub fn find(
        &mut self,
        sheet: &Sheet,
        tip: &Tip,
        rings: usize,
        barred: impl Fn(u32) -> bool,
    ) -> Result<(), TearError> {
        self.clear();
        self.check(sheet, tip)?;
        let Some(corner) = sheet.triangles[tip.triangle as usize]
            .iter()
            .position(|&vertex| vertex == tip.vertex)
        else {
            return Err(TearError::NoCorner {
                triangle: tip.triangle,
                vertex: tip.vertex,
            });
        };
        if barred(tip.vertex) {
            return Err(TearError::Held { vertex: tip.vertex });
        }
        self.along = tip.along;
        let at = sheet.shapes[tip.triangle as usize][corner];
        self.enter(tip.vertex, tip.triangle);
        let first = Placement {
            turn: [1.0, 0.0],
            shift: [-at[0], -at[1]],
        };
        self.lay(sheet, tip.triangle, NONE, first);
        let mut end = 1;
        for ring in 0..=rings {
            let begin = self.inner;
            let blocked = |&[vertex, _]: &[u32; 2]| barred(vertex);
            if begin == end || self.vertices[begin..end].iter().any(blocked) {
                break;
            }
            for place in begin..end {
                let [vertex, triangle] = self.vertices[place];
                fan(sheet, vertex, triangle, |t, from| {
                    self.reach(sheet, t, from);
                });
            }
            (self.inner, self.rings) = (end, ring);
            end = self.vertices.len();
        }
        if self.lacking == 0 {
            return Ok(());
        }
        let found = self.lacking;
        self.clear();
        Err(TearError::Room {
            what: "vertices",
            room: self.place_of_vertex.len(),
            found,
        })
    }

    fn check(&self, sheet: &Sheet, tip: &Tip) -> Result<(), TearError> {
        let triangles = sheet
            .triangles
            .len()
            .min(sheet.neighbours.len())
            .min(sheet.shapes.len());
        if triangles > self.place_of_triangle.len() {
            return Err(TearError::Room {
                what: "triangles",
                room: self.place_of_triangle.len(),
                found: triangles,
            });
        }
        if tip.triangle as usize >= triangles {
            return Err(TearError::NoCorner {
                triangle: tip.triangle,
                vertex: tip.vertex,
            });
        }
        if tip.vertex as usize >= self.place_of_vertex.len() {
            return Err(TearError::Room {
                what: "vertices",
                room: self.place_of_vertex.len(),
                found: tip.vertex as usize + 1,
            });
        }
        let length = libm::hypot(tip.along[0], tip.along[1]);
        if (length - 1.0).abs() <= 1e-6 {
            Ok(())
        } else {
            Err(TearError::Direction { length })
        }
    }

    fn clear(&mut self) {
        for &[vertex, _] in &self.vertices {
            self.place_of_vertex[vertex as usize] = NONE;
        }
        for laid in &self.triangles {
            self.place_of_triangle[laid.triangle as usize] = NONE;
        }
        for &triangle in &self.around {
            self.place_of_triangle[triangle as usize] = NONE;
        }
        self.vertices.clear();
        self.triangles.clear();
        self.around.clear();
        self.field.clear();
        (self.inner, self.rings, self.lacking) = (0, 0, 0);
    }

    fn enter(&mut self, vertex: u32, triangle: u32) -> u32 {
        let Some(place) = self.place_of_vertex.get_mut(vertex as usize) else {
            self.lacking = self.lacking.max(vertex as usize + 1);
            return 0;
        };
        if *place == NONE {
            *place = self.vertices.len() as u32;
            self.vertices.push([vertex, triangle]);
        }
        *place
    }

    /// Lays triangle `t` beside the one from which it was reached, unless it is in the patch.
    fn reach(&mut self, sheet: &Sheet, t: u32, from: Option<u32>) {
        if self.place_of_triangle[t as usize] != NONE {
            return;
        }
        let Some(from) = from else { return };
        let parent = self.place_of_triangle[from as usize];
        let before = self.triangles[parent as usize].placement;
        self.lay(sheet, t, parent, place(sheet, from, t, &before));
    }

    fn lay(&mut self, sheet: &Sheet, t: u32, parent: u32, placement: Placement) {
        self.place_of_triangle[t as usize] = self.triangles.len() as u32;
        let corners = sheet.triangles[t as usize].map(|vertex| self.enter(vertex, t));
        self.triangles.push(Laid {
            triangle: t,
            parent,
            corners,
            shape: sheet.shapes[t as usize].map(|p| placement.apply(p)),
            neighbours: sheet.neighbours[t as usize],
            placement,
        });
    }

    /// The last ring on which `q` is 1.
    pub fn rings(&self) -> usize {
        self.rings
    }

    /// The triangles on which `q` is not 0 everywhere.
    pub fn triangles(&self) -> &[Laid] {
        &self.triangles
    }

    /// The vertices of these triangles, ring by ring.
    pub fn vertices(&self) -> impl ExactSizeIterator<Item = u32> + '_ {
        self.vertices.iter().map(|&[vertex, _]| vertex)
    }

    /// The place of a triangle of the sheet in the patch, or `None`.
    pub(super) fn place_of(&self, triangle: u32) -> Option<usize> {
        let place = *self.place_of_triangle.get(triangle as usize)? as usize;
        (place < self.triangles.len()).then_some(place)
    }

    /// `q` at a vertex of the patch, by its place.
    pub fn q(&self, place: u32) -> f64 {
        if (place as usize) < self.inner {
            1.0
        } else {
            0.0
        }
    }

    /// Finds the triangles around the patch from which at most `steps` edges lead into it, by the neighbours of each
    /// triangle of the sheet.
    pub(crate) fn surround(&mut self, neighbours: &[[u32; 3]], steps: usize) {
        let mut begin = 0;
        for step in 0..steps {
            let end = self.around.len();
            let first = if step == 0 { self.triangles.len() } else { 0 };
            for place in 0..first {
                let triangle = self.triangles[place].triangle;
                self.enter_neighbours(neighbours, triangle);
            }
            for place in begin..end {
                self.enter_neighbours(neighbours, self.around[place]);
            }
            begin = end;
        }
    }

    fn enter_neighbours(&mut self, neighbours: &[[u32; 3]], triangle: u32) {
        for &next in neighbours.get(triangle as usize).into_iter().flatten() {
            if let Some(place) = self.place_of_triangle.get_mut(next as usize)
                && *place == NONE
            {
                *place = AROUND;
                self.around.push(next);
            }
        }
    }

    /// The triangles around the patch that [`surround`](Self::surround) found.
    pub(crate) fn around(&self) -> &[u32] {
        &self.around
    }

    /// The shifts of the material of all triangles in which the cut-off function changes.
    pub(crate) fn shifts(&self) -> impl Iterator<Item = Shift> + '_ {
        self.triangles.iter().filter_map(|laid| {
            let q = laid.corners.map(|place| self.q(place));
            // A triangle that shifts as a whole keeps its energy.
            (q[0] != q[1] || q[1] != q[2]).then(|| Shift {
                triangle: laid.triangle,
                shape: laid.shape,
                shifts: q.map(|q| self.along.map(|along| q * along)),
            })
        })
    }

    /// By how much a vertex of the sheet follows a unit shift of the material about the tip: `q F e`. [`Patch::measure`]
    /// comes before.
    pub(crate) fn motion(&self, vertex: u32) -> Vec3 {
        let place = self.place_of_vertex.get(vertex as usize);
        // A vertex outside has a place beyond all others.
        let node = place.and_then(|&place| self.field.nodes.get(place as usize));
        let [x, y] = self.along;
        node.map_or_else(Vec3::zeros, |node| {
            (node.f[0] * x + node.f[1] * y) / node.area
        })
    }

    /// The direction of the tear at the tip in the plane of the patch.
    pub fn along(&self) -> [f64; 2] {
        self.along
    }

    /// The unit direction at `angle` (rad) from the direction of the tear, counterclockwise, in the frame of the tip's
    /// triangle.
    pub fn turned(&self, angle: f64) -> [f64; 2] {
        let [c, s] = [libm::cos(angle), libm::sin(angle)];
        let [x, y] = self.along;
        [c * x - s * y, s * x + c * y]
    }

    pub(super) fn corners_at(&self, laid: &Laid, x: &[Vec3]) -> [Vec3; 3] {
        laid.corners
            .map(|place| x[self.vertices[place as usize][0] as usize])
    }
}
