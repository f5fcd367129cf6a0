//! The border of a sheet where a handle or a support holds it: hinged or clamped.
//!
//! A sheet that bends has no angles among its unknowns, so held vertices alone are a hinge. A clamp adds a rigid triangle
//! beyond each held edge of the border: the parallelogram of the triangle at the edge. The gradient of the rigid triangle is
//! the gradient of the sheet at the edge (`element::bending::build`). The far corner of the rigid triangle is a **ghost**: a
//! node without mass and load, which moves with the handle or stays with the support. The forces on a ghost and on the
//! edge make up the moment of the clamp.
//!
//! Ghosts have the numbers after the vertices: those of each handle, then those of each support. They follow from the
//! constraints alone, and each change of the constraints lays them again. Lists of vertices leave the ghosts
//! out.

use super::constraints::Constraints;
use super::model::Model;
use super::state::State;
use crate::Vec3;
use crate::element::bending::{BentSheet, BorderSide};

/// The number of a ghost that has not been laid.
const UNLAID: u32 = u32::MAX;

/// The effect of a handle or a support on the border of a sheet that bends.
///
/// It concerns the edges of the border of which the handle or the support holds both ends. A triangle that is held as a
/// whole is rigid in both cases, and clamps the triangles beside it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Border {
    /// The sheet turns freely about the edge.
    #[default]
    Hinged,
    /// The sheet leaves the edge in the direction that it had when the handle or the support was added. The direction
    /// turns with the handle.
    Clamped,
}

/// A clamped edge of the border, and its ghost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clamp {
    pub(crate) side: BorderSide,
    /// The node of the ghost.
    pub(crate) ghost: u32,
}

impl Clamp {
    /// The value at the ghost, if `values` by node continue linearly from the triangle at the edge.
    pub(super) fn extend(&self, values: &[Vec3]) -> Vec3 {
        let [a, b] = self.side.ends.map(|end| values[end as usize]);
        a + b - values[self.side.across as usize]
    }

    /// Whether its edge has these ends.
    pub(super) fn joins(&self, [a, b]: [u32; 2]) -> bool {
        self.side.ends == [a, b] || self.side.ends == [b, a]
    }
}

/// The clamps of a handle or a support that holds `vertices`; none for a hinge. An edge whose triangle is held as a whole
/// needs no clamp.
///
/// # Errors
/// The reason why nothing can be clamped.
pub(super) fn clamps(
    border: Border,
    vertices: &[u32],
    sheet: Option<&BentSheet>,
) -> Result<Vec<Clamp>, &'static str> {
    if border == Border::Hinged {
        return Ok(Vec::new());
    }
    let Some(sheet) = sheet else {
        return Err("the body has no stiffness against bending");
    };
    let mut chosen = vertices.to_vec();
    chosen.sort_unstable();
    let holds = |vertex: u32| chosen.binary_search(&vertex).is_ok();
    let mut held = sheet
        .border()
        .filter(|side| side.ends.iter().all(|&end| holds(end)))
        .peekable();
    if held.peek().is_none() {
        return Err("its vertices contain no edge of the sheet's border");
    }
    let free = held.filter(|side| !holds(side.across));
    Ok(free
        .map(|side| Clamp {
            side,
            ghost: UNLAID,
        })
        .collect())
}

/// Gives the ghosts of `clamps` the numbers from `next` on. They are the last of `nodes`.
pub(super) fn number(nodes: &mut [u32], clamps: &mut [Clamp], next: &mut u32) {
    let first = nodes.len() - clamps.len();
    for (node, clamp) in nodes[first..].iter_mut().zip(clamps) {
        (*node, clamp.ghost) = (*next, *next);
        *next += 1;
    }
}

/// Lays the ghosts of the present constraints after `vertices` vertices. A ghost keeps its state; a new one continues the
/// sheet. Returns whether any ghost is new, gone or of another number.
pub(super) fn lay(
    vertices: usize,
    constraints: &mut Constraints,
    model: &mut Model,
    state: &mut State,
) -> bool {
    let before: Vec<Clamp> = constraints.clamps().copied().collect();
    let count = vertices + before.len();
    let changed = state.x.len() != count
        || (vertices..)
            .zip(&before)
            .any(|(node, clamp)| clamp.ghost as usize != node);
    constraints.lay_out(vertices, count);
    if !changed {
        return false;
    }
    for values in [&mut state.x, &mut state.v, &mut state.displacement] {
        let kept = |clamp: &Clamp| values.get(clamp.ghost as usize).copied();
        let ghosts = before
            .iter()
            .map(|clamp| kept(clamp).unwrap_or_else(|| clamp.extend(values)));
        let ghosts: Vec<Vec3> = ghosts.collect();
        values.truncate(vertices);
        values.extend(ghosts);
    }
    model.rest.truncate(vertices);
    for clamp in &before {
        let rest = clamp.extend(&model.rest);
        model.rest.push(rest);
    }
    for values in [&mut model.mass, &mut model.load] {
        values.truncate(vertices);
        values.resize(count, 0.0);
    }
    model.external.truncate(vertices);
    model.external.resize(count, Vec3::zeros());
    true
}
