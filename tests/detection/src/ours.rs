//! The product: kept lists, and the same search without what was kept.

use super::narrow::Things;
use super::{Method, NEED, motions};
use physics::Vec3;
use physics::contact::{Lists, Pair};

/// The kept lists.
pub(crate) struct Kept(Lists);

impl Kept {
    pub(crate) fn new(things: &Things, x: &[Vec3]) -> Self {
        Self(Lists::new(things.surfaces, x))
    }
}

impl Method for Kept {
    fn name(&self) -> &'static str {
        "Palpate, kept lists"
    }

    fn build(&mut self, things: &Things, x: &[Vec3]) {
        self.0 = Lists::new(things.surfaces, x);
    }

    fn refit(&mut self, things: &Things, x: &[Vec3]) -> bool {
        self.0.follow(things.surfaces, x, |_, _| motions::MOVES);
        true
    }

    fn search(&mut self, things: &Things, x: &[Vec3], found: &mut Vec<Pair>) -> usize {
        pairs(&self.0, things, x, found)
    }
}

/// A search of all clusters in each step, by lists that have seen no other step.
pub(crate) struct Anew(Lists);

impl Anew {
    pub(crate) fn new(things: &Things, x: &[Vec3]) -> Self {
        Self(Lists::new(things.surfaces, x))
    }
}

impl Method for Anew {
    fn name(&self) -> &'static str {
        "Palpate, every step anew"
    }

    fn build(&mut self, things: &Things, x: &[Vec3]) {
        self.0 = Lists::new(things.surfaces, x);
    }

    fn refit(&mut self, _: &Things, _: &[Vec3]) -> bool {
        false
    }

    fn search(&mut self, things: &Things, x: &[Vec3], found: &mut Vec<Pair>) -> usize {
        self.0.follow(things.surfaces, x, |_, _| motions::MOVES);
        self.0.counts().relisted + pairs(&self.0, things, x, found)
    }
}

/// The pairs of the lists that are nearer than [`NEED`].
fn pairs(lists: &Lists, things: &Things, x: &[Vec3], found: &mut Vec<Pair>) -> usize {
    let mut distances = 0;
    lists.each(things.surfaces, x, &mut |pair| {
        distances += 1;
        if pair.foot(things.surfaces, x).apart.norm() <= NEED {
            found.push(match pair {
                Pair::EdgeEdge(a, b) => Pair::EdgeEdge(a.min(b), a.max(b)),
                pair @ Pair::VertexTriangle(..) => pair,
            });
        }
    });
    distances
}
