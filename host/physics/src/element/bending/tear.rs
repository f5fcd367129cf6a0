//! Bending that follows the edits of a torn sheet in place.
//!
//! An edit changes the triangles that it touched. The derivative across an edge depends on two rings of triangles around
//! it, so the derivatives across the edges of all triangles up to two steps away are made again, and then the curvatures
//! of the triangles up to three steps away. All other numbers stay. The result is that of a sheet built from the torn
//! triangles and their neighbours, to rounding.
//!
//! An opened edge becomes two borders: it has no derivative any more, and no moment. The energy of its fold is lost, so
//! an opened edge changes the energy of a bent sheet, unlike that of a membrane. A cut changes this energy, too, up or down:
//! smaller triangles see the same positions as other curvatures.

use super::NONE;
use super::build::{derivative, facet, flat, other_side};
use super::exact::Bending;
use super::few::{Few, MOST_NEAR};
use super::rotation::plain;
use super::scalar::ScalarMatrix;
use super::sheet::BentSheet;
use crate::element::torn::{Torn, make_room, with_room};
use crate::topology::Surface;
use crate::{Mat3, Vec3};

/// Room of a row of a derivative: the vertices of one ring around an edge. A row with more takes [`MOST_NEAR`].
const USUAL: usize = 8;

/// Rows that edits may take beside those of the edges that they add: rows that need more room than the one before.
const WIDE_ROWS: usize = 256;

/// What the bending of a sheet needs to follow edits.
#[derive(Clone, Debug)]
pub(super) struct Tear {
    /// The sheet, over vertices.
    sheet: BentSheet,
    /// Whether the motion of each triangle is prescribed. Parts of a triangle are as the whole.
    rigid: Vec<bool>,
    /// By derivative, the triangle out of which it leads; [`NONE`] for a row without an edge.
    left: Vec<u32>,
    /// Rows without an edge.
    free: Vec<u32>,
    /// Largest numbers of rows and of their entries.
    limits: (usize, usize),
    /// The rows that the latest edit changed.
    pub(super) rows: Vec<u32>,
    /// The triangles whose curvature the latest edit changed.
    pub(super) near: Vec<u32>,
    /// By triangle, the number of the latest edit near it.
    seen: Vec<u32>,
    edit: u32,
}

/// A plate's matrix in a frame at the angle with this cosine and sine from the present one. See
/// [`PlaneStiffness::rotated`](crate::material::sheet_law::PlaneStiffness::rotated).
fn turned(matrix: &Mat3, [c, s]: [f64; 2]) -> Mat3 {
    let (ss, sc, cc) = (s * s, s * c, c * c);
    let turn = Mat3::new(cc, ss, -sc, ss, cc, sc, 2.0 * sc, -2.0 * sc, cc - ss);
    turn.transpose() * matrix * turn
}

/// The cosine and sine of the angle of the first edge of a triangle in the frame of its shape.
fn first_edge([a, b, _]: [[f64; 2]; 3]) -> [f64; 2] {
    let (x, y) = (b[0] - a[0], b[1] - a[1]);
    let length = libm::hypot(x, y);
    [x / length, y / length]
}

impl Clone for BentSheet {
    fn clone(&self) -> Self {
        let own = if self.plates.len() == 1 {
            1
        } else {
            self.limit
        };
        Self {
            triangles: with_room(&self.triangles, self.limit),
            count: self.count,
            neighbours: with_room(&self.neighbours, self.limit),
            plates: with_room(&self.plates, own),
            pattern: with_room(&self.pattern, self.limit),
            is_cut: self.is_cut,
            original: self.original.clone(),
            limit: self.limit,
        }
    }
}

impl BentSheet {
    /// Makes room for `triangles` more triangles of `surface`, whose triangles are those of the sheet, counterclockwise in
    /// their frames. The sheet takes the shapes of the surface. The bending that it makes from then on follows edits,
    /// unless there are ghosts. The result is `false` if the surface is another one; nothing has changed then.
    pub(crate) fn reserve(&mut self, surface: &Surface, triangles: usize) -> bool {
        if self.triangles != surface.triangles() {
            return false;
        }
        self.limit = self.count + triangles;
        self.pattern = surface.shapes().to_vec();
        self.neighbours.copy_from_slice(surface.neighbours());
        if self.plates.len() > 1 {
            let plates = self.plates.iter().zip(&self.pattern);
            let own = plates.map(|(plate, &shape)| {
                let [c, s] = first_edge(shape);
                turned(&plate.matrix, [c, -s])
            });
            self.original = own.collect();
            make_room(&mut self.plates, self.limit);
        }
        make_room(&mut self.triangles, self.limit);
        make_room(&mut self.neighbours, self.limit);
        make_room(&mut self.pattern, self.limit);
        true
    }

    /// Follows the latest edit of its surface. A sheet that has reserved no room stays as it is.
    pub(crate) fn follow(&mut self, surface: &Surface) {
        if self.limit == 0 {
            return;
        }
        for &touched in surface.touched() {
            let (t, parent) = (touched as usize, surface.parent(touched) as usize);
            let shape = surface.shape(touched);
            if t == self.triangles.len() {
                self.triangles.push([0; 3]);
                self.neighbours.push([NONE; 3]);
                self.pattern.push(shape);
                if !self.original.is_empty() {
                    self.plates.push(self.plates[parent]);
                }
                self.count += 1;
            }
            self.triangles[t] = surface.triangles()[t];
            self.neighbours[t] = surface.neighbours()[t];
            self.pattern[t] = shape;
            if let Some(matrix) = self.original.get(parent) {
                self.plates[t].matrix = turned(matrix, first_edge(shape));
            }
        }
    }
}

impl Clone for Bending {
    fn clone(&self) -> Self {
        let mut copy = Self {
            rotations: self.rotations.clone(),
            triangles: self.triangles.clone(),
            sides: self.sides.clone(),
            facets: self.facets.clone(),
            rest: self.rest.clone(),
            tear: self.tear.clone(),
        };
        copy.make_room();
        copy
    }
}

impl Bending {
    /// Prepares for edits, if `sheet` can tear. `left` is the triangle out of which each derivative leads.
    pub(super) fn tearable(&mut self, sheet: &BentSheet, rigid: &[bool], left: &[usize]) {
        if sheet.limit == 0 {
            return;
        }
        let mut rotations = ScalarMatrix::default();
        for number in 0..self.rotations.rows() {
            let room = self.rotations.row(number).count().max(USUAL);
            rotations.push_roomy(self.rotations.row(number), room);
        }
        // A cut adds at most two triangles and three edges.
        let more = 2 * (sheet.limit - sheet.count) + WIDE_ROWS;
        let limits = (
            rotations.rows() + more,
            rotations.entries() + MOST_NEAR * more,
        );
        self.rotations = rotations;
        if !sheet.is_cut() {
            self.rest.resize(self.facets.len(), Vec3::zeros());
        }
        self.tear = Some(Box::new(Tear {
            sheet: sheet.clone(),
            rigid: rigid.to_vec(),
            left: left.iter().map(|&triangle| triangle as u32).collect(),
            free: Vec::new(),
            limits,
            rows: Vec::new(),
            near: Vec::new(),
            seen: vec![0; sheet.count],
            edit: 0,
        }));
        self.make_room();
    }

    /// Makes the whole room again in a copy.
    fn make_room(&mut self) {
        let Some(tear) = &mut self.tear else { return };
        let limit = tear.sheet.limit;
        let (rows, entries) = tear.limits;
        make_room(&mut tear.rigid, limit);
        make_room(&mut tear.left, rows);
        make_room(&mut tear.free, rows);
        make_room(&mut tear.rows, rows);
        make_room(&mut tear.near, limit);
        make_room(&mut tear.seen, limit);
        self.rotations.make_room(rows, entries);
        make_room(&mut self.triangles, limit);
        make_room(&mut self.sides, limit);
        make_room(&mut self.facets, limit);
        if !tear.sheet.is_cut() {
            make_room(&mut self.rest, limit);
        }
    }

    /// Whether it follows edits. That of a sheet with clamped borders does not.
    pub(crate) fn can_follow(&self) -> bool {
        self.tear.is_some()
    }

    /// Follows the latest edit of the surface of the sheet. `rest` gives the starting position of each place (m). Bending
    /// that cannot follow stays as it is.
    pub(crate) fn follow(&mut self, torn: &Torn<'_>, rest: &dyn Fn(u32) -> Vec3) {
        if let Some(mut tear) = self.tear.take() {
            tear.follow(self, torn, rest);
            self.tear = Some(tear);
        }
    }

    /// The limits of its numbers of triangles, rows and entries.
    pub(super) fn limits(&self) -> (usize, usize, usize) {
        self.tear.as_ref().map_or((0, 0, 0), |tear| {
            (tear.sheet.limit, tear.limits.0, tear.limits.1)
        })
    }

    /// Calls `add` with the blocks (N/m) of the tangent of Gauss and Newton of `triangles`, by row and column, where `x`
    /// are the positions (m) of the rows.
    pub(crate) fn local_stiffness(
        &self,
        triangles: &[u32],
        x: impl Fn(u32) -> Vec3,
        add: &mut dyn FnMut(u32, u32, &Mat3),
    ) {
        for &triangle in triangles {
            let triangle = triangle as usize;
            let bent = self.bent(triangle, &x);
            let derivatives = self.facets[triangle].derivatives(&bent);
            self.sided(triangle).visit(&derivatives, add);
        }
    }
}

impl Tear {
    fn follow(&mut self, bending: &mut Bending, torn: &Torn<'_>, rest: &dyn Fn(u32) -> Vec3) {
        self.sheet.follow(torn.surface);
        for &touched in torn.surface.touched() {
            let (t, parent) = (touched as usize, torn.surface.parent(touched) as usize);
            if t == bending.triangles.len() {
                bending.push([0; 3], [NONE; 3], bending.facets[parent]);
                self.rigid.push(self.rigid[parent]);
                self.seen.push(0);
            }
            bending.triangles[t] = torn.nodes(touched);
        }
        let inner = self.find_near(torn.surface.touched());
        self.release(bending, inner);
        self.rows.clear();
        for at in 0..inner {
            for k in 0..3 {
                self.place_edge(bending, torn, (self.near[at] as usize, k));
            }
        }
        for &triangle in &self.near {
            let t = triangle as usize;
            let numbers = bending.sides[t];
            let left = |number: u32| self.left.get(number as usize);
            let leads_out = numbers.map(|number| left(number) == Some(&triangle));
            let has_edge = numbers.map(|number| number != NONE);
            let (facet, stiffest) = facet(&self.sheet, &[], t, (has_edge, leads_out));
            bending.facets[t] = facet;
            let at_rest = if self.sheet.is_cut() {
                flat(&self.sheet.corners(t, &[]), leads_out)
            } else {
                bending.vectors(t, rest)
            };
            bending.rest(t, at_rest, stiffest);
        }
    }

    /// Finds the triangles up to three steps from those that the edit touched. Returns the number of those up to two
    /// steps away, which come first.
    fn find_near(&mut self, touched: &[u32]) -> usize {
        self.edit += 1;
        self.near.clear();
        self.near.extend_from_slice(touched);
        for &t in touched {
            self.seen[t as usize] = self.edit;
        }
        let (mut first, mut inner) = (0, touched.len());
        for _ in 0..3 {
            inner = self.near.len();
            for at in first..inner {
                for next in self.sheet.neighbours[self.near[at] as usize] {
                    if next != NONE && self.seen[next as usize] != self.edit {
                        self.seen[next as usize] = self.edit;
                        self.near.push(next);
                    }
                }
            }
            first = inner;
        }
        inner
    }

    /// Frees the rows at the sides of the inner triangles.
    fn release(&mut self, bending: &mut Bending, inner: usize) {
        for &t in &self.near[..inner] {
            for side in &mut bending.sides[t as usize] {
                let number = core::mem::replace(side, NONE);
                // Both triangles at an edge may be near.
                if let Some(left) = self.left.get_mut(number as usize)
                    && *left != NONE
                {
                    *left = NONE;
                    self.free.push(number);
                }
            }
        }
    }

    /// Makes the derivative across side `k` of a triangle, unless there is none or it is made.
    fn place_edge(&mut self, bending: &mut Bending, torn: &Torn<'_>, (t, k): (usize, usize)) {
        let beyond = self.sheet.neighbours[t][k];
        if beyond == NONE || bending.sides[t][k] != NONE {
            return;
        }
        let Some(j) = other_side(&self.sheet, (t, k)) else {
            return;
        };
        // As in a sheet that is built anew, the derivative leads out of the triangle with the lower number.
        let beyond = beyond as usize;
        let (from, other) = if beyond < t {
            ((beyond, j), (t, k))
        } else {
            ((t, k), (beyond, j))
        };
        let mut weights = derivative(&self.sheet, &[], &self.rigid, from);
        let mut row = self.take_row(bending, weights.len());
        if row.is_none() {
            // The mean of the two gradients has four vertices. It is less accurate on uneven triangles.
            weights = plain(&self.sheet, from);
            row = self.take_row(bending, weights.len());
        }
        let number = row.unwrap_or(NONE);
        bending.sides[from.0][from.1] = number;
        bending.sides[other.0][other.1] = number;
        let Some(row) = row else { return };
        self.left[row as usize] = from.0 as u32;
        self.rows.push(row);
        let placed: Few<(u32, f64)> = weights.iter().map(|&(v, w)| (torn.place(v), w)).collect();
        let entries = placed.iter().copied();
        bending.rotations.set_row(row as usize, entries);
    }

    /// A row with room for `count` entries, or `None` if the reserve is used up.
    fn take_row(&mut self, bending: &mut Bending, count: usize) -> Option<u32> {
        let rotations = &mut bending.rotations;
        let has_room = |&row: &u32| rotations.room(row as usize) >= count;
        if let Some(at) = self.free.iter().position(has_room) {
            return Some(self.free.swap_remove(at));
        }
        if rotations.rows() >= self.limits.0 {
            return None;
        }
        let room = if count > USUAL { MOST_NEAR } else { USUAL };
        rotations.push_roomy(core::iter::empty(), room);
        self.left.push(NONE);
        Some(rotations.rows() as u32 - 1)
    }

    /// Memory that it holds beside itself (bytes).
    pub(super) fn bytes(&self) -> usize {
        let lists = [&self.left, &self.free, &self.rows, &self.near, &self.seen];
        let lists: usize = lists.iter().map(|list| size_of_val(list.as_slice())).sum();
        self.sheet.bytes() + size_of_val(self.rigid.as_slice()) + lists
    }
}

#[cfg(test)]
impl Bending {
    /// Where its vectors are in memory.
    pub(crate) fn addresses(&self) -> Vec<usize> {
        let mut all = vec![
            self.triangles.as_ptr().addr(),
            self.sides.as_ptr().addr(),
            self.facets.as_ptr().addr(),
            self.rest.as_ptr().addr(),
        ];
        if let Some(tear) = &self.tear {
            let lists = [&tear.left, &tear.free, &tear.rows, &tear.near, &tear.seen];
            all.extend(lists.map(|list| list.as_ptr().addr()));
            all.push(tear.rigid.as_ptr().addr());
            all.push(tear.sheet.triangles.as_ptr().addr());
            all.push(tear.sheet.neighbours.as_ptr().addr());
            all.push(tear.sheet.pattern.as_ptr().addr());
        }
        all.extend(self.rotations.addresses());
        all
    }
}
