//! The change of the energy by snapping.
//!
//! A vertex that moves at rest samples the deformation of the sheet elsewhere. In a field that varies, this changes the
//! elastic energy of its triangles, and the lumped masses change the kinetic energy. An edge is cut instead if either
//! energy would rise by more than a small fraction of the energy that the torn edge takes, or if something is in the way.

use super::{IsClear, Tearing};
use crate::body::Body;
use crate::tear::fields::stretch;
use crate::topology::{Edit, Growth, Surface};

/// The largest rise of energy by snapping, as a fraction of the toughness times the area of the edge.
const MOST: f64 = 1e-3;

impl Tearing {
    /// Whether the snapping of an edit raises elastic and kinetic energy little and its way is clear, or the edit does not snap.
    pub(super) fn may_snap(&self, body: &Body, edit: &Edit, is_clear: &IsClear<'_>) -> bool {
        let Some(surface) = body.surface() else {
            return false;
        };
        let growths = [Some(edit.ahead), edit.behind];
        growths.into_iter().flatten().all(|growth| match growth {
            Growth::Snap { vertex, shift } => {
                self.snap_is_allowed(body, surface, edit.tip, vertex, shift, is_clear)
            }
            Growth::Open { .. } | Growth::Cut { .. } => true,
        })
    }

    fn snap_is_allowed(
        &self,
        body: &Body,
        surface: &Surface,
        tip: u32,
        vertex: u32,
        shift: [f64; 2],
        is_clear: &IsClear<'_>,
    ) -> bool {
        let material = &self.options.material;
        let (x, v) = (body.node_positions(), body.node_velocities());
        let Ok(moved) = surface.foresee_snap(tip, vertex, shift, |_, _| ()) else {
            return false;
        };
        let at = |values: &[crate::Vec3]| {
            let corners = moved.corners.iter().zip(moved.weights);
            corners
                .map(|(&corner, weight)| values[corner as usize] * weight)
                .sum::<crate::Vec3>()
        };
        let (place, velocity) = (at(x), at(v));
        let density = body.mass_per_area(vertex);
        let (mut elastic, mut kinetic, mut length) = (0.0, 0.0, 0.0);
        let mut add = |triangle: u32, shape: &crate::topology::Shape| {
            let corners = surface.triangles()[triangle as usize];
            let old = stretch(
                &surface.shape(triangle),
                corners.map(|corner| x[corner as usize]),
                material,
            );
            let there = |corner: u32| {
                if corner == vertex {
                    place
                } else {
                    x[corner as usize]
                }
            };
            let new = stretch(shape, corners.map(there), material);
            elastic += (new.density * new.area - old.density * old.area) * material.thickness;
            let square = |corner: u32, moved: bool| {
                let v = if moved && corner == vertex {
                    velocity
                } else {
                    v[corner as usize]
                };
                v.norm_squared()
            };
            let squares = |moved: bool| {
                corners
                    .iter()
                    .map(|&corner| square(corner, moved))
                    .sum::<f64>()
            };
            kinetic += density / 6.0 * (new.area * squares(true) - old.area * squares(false));
            if let (Some(k), Some(l)) = (
                corners.iter().position(|&corner| corner == vertex),
                corners.iter().position(|&corner| corner == tip),
            ) {
                length = libm::hypot(shape[k][0] - shape[l][0], shape[k][1] - shape[l][1]);
            }
        };
        let seen = surface.foresee_snap(tip, vertex, shift, &mut add);
        let most = MOST * material.toughness * material.thickness * length;
        seen.is_ok() && elastic <= most && kinetic <= most && is_clear(body, vertex, &place)
    }
}
