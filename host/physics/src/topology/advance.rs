//! The choice of the edit that lets a tear follow a direction.

use super::edit::{Edit, Growth};
use super::surface::Surface;

/// How [`Surface::advance`] follows a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdvanceOptions {
    /// How far a vertex may move at rest onto the path, as a fraction of the shortest edge at the vertex: 0 without
    /// snapping, at most 0.5.
    pub snapping: f64,
}

impl Surface {
    /// The edit by which the tear grows from `tip` in the direction of a fan angle (rad, see
    /// [`Surface::straight_ahead`], [`Surface::fan_angle`]), by one edge. `None` if the direction points out of the
    /// surface, if the tip is inside the surface, or if every edit would make too thin a triangle.
    ///
    /// `may_move` says whether a vertex inside the surface may move at rest. Vertices on borders never move.
    pub fn advance(
        &self,
        tip: u32,
        direction: f64,
        options: &AdvanceOptions,
        may_move: impl Fn(u32) -> bool,
    ) -> Option<Edit> {
        if !self.on_border(tip) {
            return None;
        }
        let ahead = self.growth(tip, direction, options, &may_move)?;
        Some(Edit::grow(tip, ahead))
    }

    /// The edit by which a slit of two edges begins at a vertex inside the surface, in the direction of a fan angle
    /// (rad) and in the opposite direction.
    pub fn begin_slit(
        &self,
        vertex: u32,
        direction: f64,
        options: &AdvanceOptions,
        may_move: impl Fn(u32) -> bool,
    ) -> Option<Edit> {
        if self.on_border(vertex) {
            return None;
        }
        let back = direction + 0.5 * self.total_angle(vertex);
        let ahead = self.growth(vertex, direction, options, &may_move)?;
        let behind = self.growth(vertex, back, options, &may_move)?;
        Some(Edit {
            tip: vertex,
            ahead,
            behind: Some(behind),
        })
    }

    fn growth(
        &self,
        _tip: u32,
        _direction: f64,
        _options: &AdvanceOptions,
        _may_move: &impl Fn(u32) -> bool,
    ) -> Option<Growth> {
        None
    }
}
