//! Sums over the pieces of a torn body: mass, elastic energy, and the energy of its loads.

use super::Body;
use super::handle::Handle;
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
            for triangle in 0..set.count() {
                let piece = pieces.of_triangle(triangle as u32);
                if let (Some(sums), Some(strained)) =
                    (sums.get_mut(piece as usize), set.strained(triangle, x))
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
