//! The pieces of a torn body: sums over each piece (mass, elastic energy, and the energy of its loads), and pieces that
//! leave the scene.
//!
//! A piece that no hand holds leaves in two steps, because solvers have to follow. It [leaves](Body::leave): no tear edits
//! it any more, but it still moves. Once it has [halted](Body::halt), it stands still, and is no part of the equations of
//! solvers that are made from then on.

use super::Body;
use super::handle::Handle;
use crate::Vec3;
use crate::topology::{NONE, Pieces};

/// Sums over one piece.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PieceSums {
    /// Mass (kg).
    pub mass: f64,
    /// Elastic energy (J) at the present state, with bending.
    pub elastic: f64,
    /// Potential energy of gravity and the external forces (J).
    pub potential: f64,
}

impl Body {
    /// Computes the sums over each of the `pieces` of a sheet that tears, by the number of the piece. Pieces past the end
    /// of `sums` are left out. Nothing is allocated.
    pub fn sums_of_pieces(&self, pieces: &Pieces, sums: &mut [PieceSums]) {
        sums.fill(PieceSums::default());
        let x = &self.state.x;
        for (vertex, x) in (0_u32..).zip(x) {
            if let Some(sums) = sums.get_mut(pieces.of_vertex(vertex) as usize) {
                sums.mass += self.model.mass[vertex as usize];
                sums.potential -=
                    self.model.load_factor * self.model.external[vertex as usize].dot(x);
            }
        }
        for set in &self.model.elements {
            let Some(sheet) = set.tearable() else {
                continue;
            };
            for triangle in 0..set.count() {
                let piece = pieces.of_triangle(triangle as u32);
                if let (Some(sums), Some(strained)) =
                    (sums.get_mut(piece as usize), sheet.strained(triangle, x))
                {
                    sums.elastic += strained.density * strained.area * strained.thickness;
                }
            }
        }
        if let Some(bending) = &self.model.bending {
            let nodes = self.assembly.places.nodes();
            for triangle in 0..bending.count() {
                if let Some(sums) = sums.get_mut(pieces.of_triangle(triangle as u32) as usize) {
                    sums.elastic += bending.energy_of(triangle, x, nodes);
                }
            }
        }
    }

    /// Lets vertices leave the scene: all those of a piece. Returns `false` if a handle or a support has one of them;
    /// nothing has changed then. Vertices that leave or have left are ignored. Nothing is allocated.
    pub fn leave(&mut self, vertices: impl Iterator<Item = u32> + Clone) -> bool {
        let is_bound = |vertex: u32| self.constraints.supports.owner_of(vertex).is_some();
        let is_gripped = |vertex: u32| {
            let mut handles = self.constraints.handles.iter();
            handles.any(|handle| handle.own().contains(&vertex))
        };
        if vertices.clone().any(|v| is_bound(v) || is_gripped(v)) {
            return false;
        }
        let (constraints, count) = (&self.constraints, self.state.x.len());
        if let Some(sheet) = &mut self.sheet {
            for vertex in vertices {
                let is_known = constraints.holds(vertex) || sheet.leaving.contains(&vertex);
                if (vertex as usize) < count && !is_known {
                    sheet.leaving.push(vertex);
                }
            }
        }
        true
    }

    /// The vertices that leave and have not halted.
    pub fn leaving(&self) -> &[u32] {
        self.sheet.as_ref().map_or(&[], |sheet| &sheet.leaving)
    }

    /// Halts vertices that [leave](Self::leave). A solver that was made before has to be replaced by one that was made for
    /// a copy with the same vertices halted.
    pub fn halt(&mut self, vertices: &[u32]) {
        let Some(sheet) = &mut self.sheet else {
            return;
        };
        sheet.leaving.retain(|vertex| !vertices.contains(vertex));
        self.constraints.halt(vertices);
        for &node in self.constraints.gone() {
            let node = node as usize;
            (self.state.v[node], self.state.displacement[node]) = (Vec3::zeros(), Vec3::zeros());
        }
    }

    /// The pieces that a handle holds, by the number of the piece: one, unless the handle joins several.
    pub fn pieces_of_handle<'a>(
        &'a self,
        handle: usize,
        pieces: &'a Pieces,
    ) -> impl Iterator<Item = u32> + 'a {
        let held = self.constraints.handles.get(handle);
        let vertices = held.into_iter().flat_map(Handle::own);
        vertices
            .map(|&vertex| pieces.of_vertex(vertex))
            .filter(|&piece| piece != NONE)
    }
}
