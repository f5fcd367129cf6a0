//! Which triangles or segments of a part a vertex touches: those whose foot is nearer than the neighbours' feet.
//!
//! A foot on an edge or at a vertex belongs to all things that share the edge or the vertex, and counts once. If another of
//! these things is nearer, the foot is no least distance, and no contact.

use super::feet::Feet;

/// Feet of a vertex that are nearer to each other than this fraction of the thickness are one contact. If a vertex lies
/// over another one, the triangles about it, which are not quite flat, would take the force from each other.
const ONE: f64 = 1e-3;
/// Lengths that differ by less than this fraction are equal.
const EQUAL: f64 = 1e-9;

/// A vertex that may touch a triangle or a segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub vertex: u32,
    /// The part of the other thing.
    pub part: u32,
    /// The vertices of the other thing, ascending. A segment has its second vertex twice.
    pub corners: [u32; 3],
    pub feet: Feet,
    pub thickness: f64,
}

impl Candidate {
    /// Number of vertices that the foot lies between, at the start or at the end of the step.
    fn support(&self, is_end: bool) -> usize {
        let weights = self.feet.at(is_end).foot.weights;
        weights.iter().filter(|weight| **weight < 0.0).count()
    }

    /// Whether the foot is a point of another candidate's thing, or near its foot.
    fn is_shared_by(&self, other: &Self, is_end: bool) -> bool {
        let foot = &self.feet.at(is_end).foot;
        let between = foot.apart - other.feet.at(is_end).foot.apart;
        if between.norm() < ONE * self.thickness {
            return true;
        }
        let mut on = foot.vertices.iter().zip(&foot.weights);
        on.all(|(vertex, weight)| *weight >= 0.0 || other.corners.contains(vertex))
    }

    /// Whether a foot that both share is that of `self`.
    fn precedes(&self, other: &Self, is_end: bool) -> bool {
        let (own, its) = (self.feet.at(is_end).length, other.feet.at(is_end).length);
        if (own - its).abs() > EQUAL * its {
            return own < its;
        }
        // A foot inside a thing is nearer than one on its border but for rounding.
        let by_support = other.support(is_end).cmp(&self.support(is_end));
        by_support.then(self.corners.cmp(&other.corners)).is_lt()
    }
}

/// Calls `found` for each contact among the candidates of one vertex with one part, and with whether its foot is that at the
/// end of the step. `of` gives a candidate by its number. A thing has one candidate.
pub(super) fn of_group<'a>(
    numbers: &[u32],
    of: impl Fn(u32) -> &'a Candidate + Copy,
    found: &mut dyn FnMut(&Candidate, bool),
) {
    let least = |is_end: bool| {
        let candidates = numbers.iter().map(move |number| of(*number));
        candidates.filter(move |one| {
            let mut others = numbers.iter().map(|number| of(*number));
            one.feet.may_touch(is_end, one.thickness)
                && !others.any(|other| {
                    one.corners != other.corners
                        && one.is_shared_by(other, is_end)
                        && other.precedes(one, is_end)
                })
        })
    };
    // Feet at the start and at the end are not mixed, because a foot at one of them may belong to two things.
    let is_end = least(true).all(|one| one.feet.is_certain);
    least(is_end).for_each(|one| found(one, is_end));
}
