//! No two things pass through each other in a step, whatever the solver left.
//!
//! **Certificate.** The shortest connection of a pair at the start of a step has the direction `n`. Along linear motion
//! the least `n . x` of the first thing and the largest of the second one bound a gap that is concave in time. If the gap
//! is positive at the end, the pair did not cross. Common translation and sliding cost nothing, unlike a share of the
//! distance for each vertex (Li et al., "Incremental potential contact", 2020, limit the step by continuous collision
//! detection instead). An edge that slides over another one turns the direction of the shortest connection. So if `n` fails,
//! the normal of the triangle or of both edges is tried, and then the direction at the end: the proof holds for any direction.
//! An edge that passes over one parallel to it turns the direction to the other side, and both have no normal; an edge that
//! slides beneath the end of another one, which stands on it, is separated by neither. The last directions are those across
//! an edge and the motion.
//!
//! **Truncation.** If the certificate fails, a plane between the two things divides the space. The displacement of each
//! vertex is scaled by the largest fraction with which the vertex stays on its side. The start satisfies all planes, so
//! the least fraction over its pairs satisfies all pairs of a vertex. A vertex that stops may bring other pairs to fail, so
//! pairs are tested until none fails. Fractions only fall, so this ends. Vertices with a prescribed motion, those of obstacles and
//! of handles, cannot be stopped: the plane makes way for them, as far as the other vertices leave room.
//!
//! **Stretch.** A vertex that stops beside one that goes on would stretch the edge between them, and the surface would gain
//! energy. So the fractions of two neighbours differ such that truncation stretches no edge by more than a bound (`STRETCH`).
//!
//! The pairs must include all that are nearer than their vertices move, both in sum.

use super::pair::{Foot, Pair};
use super::surface::Surfaces;
use crate::Vec3;

/// The fraction of the distance at the start that must be left between a pair, and between a vertex and the plane.
const LEFT: f64 = 0.05;
/// The distance (m) that nothing uses up. Positions are sums of some tenths of a metre, whose rounding is some 1e-17 m. A
/// distance of which truncation leaves a twentieth in step after step would end there, and things without a distance have
/// no sides.
pub(crate) const NEAREST: f64 = 1e-12;
/// The distance (m) below which rounding turns the shortest connection of two things that are a decimetre wide by more than
/// one part in a hundred of what separates them.
const CLOSE: f64 = 1e-8;
/// The strain of an edge that truncation may add. Of 64 throws at 2 m/s, the sums of energies are 638 without this bound, 215
/// with 0.1, 123 with 0.03 and 110 with 0.01, in energies at the start; a smaller strain stops more of a body.
const STRETCH: f64 = 0.03;
/// Rounds of truncation. After them the vertices of a pair that fails are stopped.
const ROUNDS: usize = 60;

/// What a truncation did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Truncation {
    /// Rounds in which a vertex was truncated.
    pub rounds: usize,
    /// Vertices that move less than they would have.
    pub truncated: usize,
    /// Pairs of which vertices with a prescribed motion leave the others no room. They may cross.
    pub squeezed: usize,
}

/// A pair at the start of a step.
struct Start {
    foot: Foot,
    split: usize,
    /// The distance (m), and the direction from the second thing to the first one.
    distance: f64,
    normal: Vec3,
    /// Whether the normal separates the two things.
    separates: bool,
    /// Where the plane between the things cuts the normal (m).
    plane: f64,
}

impl Start {
    /// `None` for a pair without a distance, which has no side.
    fn new(pair: Pair, surfaces: &Surfaces, x: &[Vec3]) -> Option<Self> {
        let foot = pair.foot(surfaces, x);
        let (distance, split) = (foot.apart.norm(), pair.split());
        let normal = foot.apart / distance;
        if !(distance > 0.0 && normal.x.is_finite()) {
            return None;
        }
        if distance < CLOSE {
            return Some(Self::close(pair, foot, split, x));
        }
        let second = foot.vertices.iter().zip(foot.weights).skip(split);
        let on_second: Vec3 = second.map(|(v, w)| x[*v as usize] * -w).sum();
        Some(Self {
            plane: normal.dot(&on_second) + 0.5 * distance,
            foot,
            split,
            distance,
            normal,
            separates: true,
        })
    }

    /// Of things so close that their shortest connection is inexact: the direction of this connection or the normal of the
    /// triangle or of both edges, whichever separates them further.
    fn close(pair: Pair, foot: Foot, split: usize, x: &[Vec3]) -> Self {
        let at = |vertex: u32| x[vertex as usize];
        let plane = plane_normal(pair, foot.vertices.map(at));
        let directions = [foot.apart, plane * plane.dot(&foot.apart).signum()];
        let [first, second] = directions.map(|direction| {
            let direction = direction.normalize();
            (foot.gap(split, &direction, at), direction)
        });
        // A degenerate direction has no gap.
        let (distance, normal) = if second.0 > first.0 { second } else { first };
        let ends = foot.vertices.iter().skip(split);
        let far = ends.map(|vertex| normal.dot(&at(*vertex)));
        Self {
            plane: far.fold(f64::NEG_INFINITY, f64::max) + 0.5 * distance,
            foot,
            split,
            distance,
            normal,
            separates: distance > 0.0,
        }
    }

    /// For each vertex, its place along the normal on its side of the plane at the start (m), and how far it moves towards
    /// the plane (m).
    fn sides(&self, x: &[Vec3], u: &[Vec3]) -> [(u32, f64, f64); 4] {
        let mut index = 0;
        self.foot.vertices.map(|vertex| {
            let sign = if index < self.split { 1.0 } else { -1.0 };
            index += 1;
            let (at, by) = (&x[vertex as usize], &u[vertex as usize]);
            let place = sign * (self.normal.dot(at) - self.plane);
            (vertex, place, -sign * self.normal.dot(by))
        })
    }

    /// How far the plane moves in the step to the side of the second thing (m), so that vertices with a prescribed motion stay
    /// by `margin` (m) on their sides.
    fn way(&self, sides: &[(u32, f64, f64); 4], margin: f64, is_free: &dyn Fn(u32) -> bool) -> f64 {
        let (first, second) = sides.split_at(self.split);
        let [first, second] = [first, second].map(|side| {
            let prescribed = side.iter().filter(|(vertex, ..)| !is_free(*vertex));
            let beyond = prescribed.map(|(_, place, by)| by - place + margin);
            beyond.fold(f64::NEG_INFINITY, f64::max)
        });
        if first + second > 0.0 {
            0.5 * (first - second)
        } else {
            0_f64.clamp(first, -second)
        }
    }
}

/// The normal of the triangle or of both edges of a pair, whose vertices are at these places (m); not of length one.
fn plane_normal(pair: Pair, [a, b, c, d]: [Vec3; 4]) -> Vec3 {
    match pair {
        Pair::VertexTriangle(..) => (c - b).cross(&(d - b)),
        Pair::EdgeEdge(..) => (b - a).cross(&(d - c)),
    }
}

/// Whether a pair moves from the positions `at` to the positions `ends` (m) without a crossing: one of five directions separates
/// it at both, and of the gap in this direction (m) as much is left as `left` says. `start` is its connection at the start.
pub(crate) fn is_certain(
    pair: Pair,
    surfaces: &Surfaces,
    start: &Foot,
    at: impl Fn(u32) -> Vec3 + Copy,
    ends: impl Fn(u32) -> Vec3 + Copy,
    left: impl Fn(f64) -> f64,
) -> bool {
    let split = pair.split();
    // A degenerate direction separates nothing, because comparisons with it fail.
    let separates = |direction: &Vec3| {
        let direction = direction.normalize();
        // Things that pass over each other are further apart at the start than in the direction that separates them.
        let gap = start.gap(split, &direction, at);
        gap >= 0.0 && start.gap(split, &direction, ends) >= left(gap)
    };
    separates(&start.apart) || {
        let ends_at_start = start.vertices.map(at);
        let [a, b, c, d] = ends_at_start;
        let plane = plane_normal(pair, ends_at_start);
        let separates_signed =
            |direction: Vec3| separates(&(direction * direction.dot(&start.apart).signum()));
        separates_signed(plane)
            || separates(&pair.foot_at(surfaces, ends).apart)
            || matches!(pair, Pair::EdgeEdge(..)) && {
                let [p, q, r, s] = start.vertices.map(|vertex| ends(vertex) - at(vertex));
                let motion = p + q - r - s;
                separates_signed((b - a).cross(&motion)) || separates_signed((d - c).cross(&motion))
            }
    }
}

/// Calls its argument for each pair.
pub type Each<'a> = dyn Fn(&mut dyn FnMut(Pair)) + 'a;

/// Scales the displacements `u` (m) from the positions `x` (m) by `fractions` of vertices such that no pair crosses. `each`
/// gives the pairs; `is_free` tells whether a vertex may be stopped. The fractions only fall; they stay as they are if every
/// certificate holds.
pub fn truncate(
    surfaces: &Surfaces,
    x: &[Vec3],
    u: &[Vec3],
    each: &Each<'_>,
    is_free: &dyn Fn(u32) -> bool,
    fractions: &mut [f64],
) -> Truncation {
    let mut report = Truncation::default();
    // A little less than truncation leaves, so that a truncated pair does not fail by rounding.
    let left = |gap: f64| (0.9 * LEFT * gap).max(NEAREST.min(0.9 * gap));
    loop {
        let mut is_changed = false;
        report.squeezed = 0;
        each(&mut |pair| {
            let Some(start) = Start::new(pair, surfaces, x) else {
                report.squeezed += 1;
                return;
            };
            if !start.separates {
                let vertices = start.foot.vertices.iter();
                report.squeezed += usize::from(!vertices.clone().all(|vertex| is_free(*vertex)));
                for vertex in vertices.filter(|vertex| is_free(**vertex)) {
                    let fraction = &mut fractions[*vertex as usize];
                    is_changed |= *fraction > 0.0;
                    *fraction = 0.0;
                }
                return;
            }
            let sides = start.sides(x, u);
            let end = |from: usize, to: usize| {
                let ends = sides[from..to].iter();
                let places =
                    ends.map(|(vertex, place, by)| place - by * fractions[*vertex as usize]);
                places.fold(f64::INFINITY, f64::min)
            };
            if end(0, start.split) + end(start.split, 4) >= left(start.distance) {
                return;
            }
            let ends = |v: u32| x[v as usize] + u[v as usize] * fractions[v as usize];
            let at = |v: u32| x[v as usize];
            if is_certain(pair, surfaces, &start.foot, at, ends, left) {
                return;
            }
            let margin = (LEFT * start.distance).max(NEAREST);
            let way = start.way(&sides, margin, is_free);
            let mut has_room = true;
            for (index, (vertex, place, by)) in sides.into_iter().enumerate() {
                let way = if index < start.split { way } else { -way };
                let room = place + way - margin;
                let fraction = &mut fractions[vertex as usize];
                if by * *fraction <= room {
                    continue;
                }
                has_room &= is_free(vertex) && room >= 0.0;
                if is_free(vertex) {
                    let most = if report.rounds < ROUNDS {
                        (room / by).max(0.0)
                    } else {
                        0.0
                    };
                    is_changed |= most < *fraction;
                    *fraction = most.min(*fraction);
                }
            }
            report.squeezed += usize::from(!has_room);
        });
        if !is_changed {
            break;
        }
        follow(surfaces, x, u, is_free, fractions);
        report.rounds += 1;
    }
    report.truncated = fractions.iter().filter(|t| **t < 1.0).count();
    report
}

/// Lowers the fractions of neighbours of truncated vertices until no edge is stretched by more than it may be.
pub(crate) fn follow(
    surfaces: &Surfaces,
    x: &[Vec3],
    u: &[Vec3],
    is_free: &dyn Fn(u32) -> bool,
    fractions: &mut [f64],
) {
    let mut is_changed = true;
    while core::mem::take(&mut is_changed) {
        for ends in surfaces
            .edges
            .iter()
            .filter(|ends| ends.iter().all(|v| is_free(*v)))
        {
            let [a, b] = ends.map(|v| v as usize);
            let (slower, faster) = if fractions[a] <= fractions[b] {
                (a, b)
            } else {
                (b, a)
            };
            let room = STRETCH * (x[a] - x[b]).norm();
            let most = fractions[slower] + room / u[faster].norm();
            if most < fractions[faster] {
                fractions[faster] = most;
                is_changed = true;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Skin;
    use crate::mesh::{LineMesh, Mesh};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_prescribed_has_the_right_of_way(
            is_edges: bool,
            first_is_prescribed: bool,
            ahead in 0.0..3.0,
            spread in [0.0..0.4, 0.0..0.4],
            others in [-1.0..3.0, -1.0..3.0, -1.0..3.0],
        ) {
            // Two things at a distance of one. The vertices of the prescribed one go `ahead` or up to 0.4 less, and those of the
            // other one towards it by `others`.
            let corners = if is_edges {
                [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]
            } else {
                [[0.0, 0.0, 1.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]
            };
            let x = corners.map(Vec3::from);
            let mut surfaces = Surfaces::default();
            (surfaces.triangles, surfaces.edges) = (vec![[1, 2, 3]], vec![[0, 1], [2, 3]]);
            let pair = if is_edges { Pair::EdgeEdge(0, 1) } else { Pair::VertexTriangle(0, 0) };
            let split = pair.split();
            let is_free = |vertex: u32| ((vertex as usize) < split) != first_is_prescribed;
            let u = [0, 1, 2, 3].map(|vertex: usize| {
                let (towards, own) = if vertex < split { (-1.0, vertex) } else { (1.0, vertex - split) };
                let less = [0.0, spread[0], spread[1]][own];
                Vec3::z() * towards * if is_free(vertex as u32) { others[own] } else { ahead - less }
            });
            let mut fractions = [1.0; 4];
            let each = |visit: &mut dyn FnMut(Pair)| visit(pair);
            let report = truncate(&surfaces, &x, &u, &each, &is_free, &mut fractions);
            // The other thing stops before the prescribed one, or all of it makes way.
            let count = if first_is_prescribed { 4 - split } else { split };
            let way = others[..count].iter().fold(f64::INFINITY, |way, by| way.min(-by)).max(0.0);
            if ahead + 2.1 * LEFT < 1.0 + way {
                prop_assert_eq!(report.squeezed, 0);
            }
            // Nothing moves aside, so that the feet stay where they are.
            let each = pair.foot(&surfaces, &x).weights.into_iter().enumerate();
            let apart: f64 = each.map(|(at, w)| w * (x[at] + u[at] * fractions[at]).z).sum();
            prop_assert!(report.squeezed > 0 || apart > 0.0, "{}", apart);
            let mut prescribed = (0..4).filter(|vertex| !is_free(*vertex));
            prop_assert!(prescribed.all(|vertex| fractions[vertex as usize] == 1.0));
        }
    }

    #[test]
    fn a_vertex_that_is_stopped_step_after_step_stays_on_its_side() {
        let mut surfaces = Surfaces::default();
        let skin = Skin {
            radius: 1e-4,
            touches_itself: true,
            is_obstacle: false,
        };
        // A triangle far from the origin, where positions are rounded to 1e-17 m, and a thread that falls on it.
        let corners = [[0.1, 0.1], [0.12, 0.1], [0.11, 0.12]];
        let mut x = corners.map(|[x, y]| Vec3::new(x, y, 0.1)).to_vec();
        x.extend([Vec3::new(0.11, 0.105, 0.1001), Vec3::new(0.11, 0.105, 0.11)]);
        let triangle = crate::mesh::TriMesh {
            positions: x[..3].to_vec(),
            triangles: vec![[0, 1, 2]],
            ..crate::mesh::TriMesh::default()
        };
        let thread = LineMesh {
            positions: x[3..].to_vec(),
            lines: vec![[0, 1]],
            ..LineMesh::default()
        };
        for mesh in [Mesh::Sheet(triangle), Mesh::Thread(thread)] {
            surfaces.add(&mesh, skin).expect("a surface");
        }
        let falls = [0.0, 0.0, 0.0, -1e-3, -1e-3].map(|z| Vec3::z() * z);
        let pair = Pair::VertexTriangle(3, 0);
        for _ in 0..100 {
            let mut fractions = [1.0; 5];
            let each = |visit: &mut dyn FnMut(Pair)| visit(pair);
            truncate(&surfaces, &x, &falls, &each, &|_| true, &mut fractions);
            for ((x, u), fraction) in x.iter_mut().zip(&falls).zip(fractions) {
                *x += u * fraction;
            }
            assert!(x[3].z - x[0].z > 0.5 * NEAREST, "{}", x[3].z - x[0].z);
        }
        // The vertex came as near as it may.
        assert!(x[3].z - x[0].z < 50.0 * NEAREST);
    }

    #[test]
    fn rounding_of_a_short_connection_lets_nothing_cross() {
        // A triangle of a decimetre in any position, and a vertex that is this far from it. Corners and vertex move towards each
        // other by as much as rounding turns the connection.
        let mut surfaces = Surfaces::default();
        let skin = Skin {
            radius: 1e-4,
            touches_itself: true,
            is_obstacle: false,
        };
        let corners = [[0.0, 0.0], [0.09, 0.01], [0.03, 0.08]];
        let flat = corners.map(|[x, y]| Vec3::new(x, y, 0.0));
        let triangle = crate::mesh::TriMesh {
            positions: flat.to_vec(),
            triangles: vec![[0, 1, 2]],
            ..crate::mesh::TriMesh::default()
        };
        let thread = LineMesh {
            positions: vec![Vec3::z(), Vec3::z() * 2.0],
            lines: vec![[0, 1]],
            ..LineMesh::default()
        };
        for mesh in [Mesh::Sheet(triangle), Mesh::Thread(thread)] {
            surfaces.add(&mesh, skin).expect("a surface");
        }
        let pair = Pair::VertexTriangle(3, 0);
        for number in 0..2000_u32 {
            let angle = f64::from(number);
            let turn = nalgebra::Rotation3::from_euler_angles(angle, 1.7 * angle, 0.3 * angle);
            let place = Vec3::new(0.11, 0.07, 0.13);
            let distance = 1e-12 * f64::powf(10.0, f64::from(number % 50) / 10.0);
            let over = flat[0] * 0.4 + flat[1] * 0.35 + flat[2] * 0.25;
            let mut x = flat.map(|corner| turn * corner + place).to_vec();
            x.push(turn * (over + Vec3::z() * distance) + place);
            x.push(turn * (over + Vec3::z() * 0.01) + place);
            let above = |x: &[Vec3]| {
                let normal = (x[1] - x[0]).cross(&(x[2] - x[0])).normalize();
                normal.dot(&(x[3] - x[0]))
            };
            let by = [3e-9, -5e-10, 2e-8, -1e-8, 0.0];
            let u = by.map(|by| turn * Vec3::z() * by);
            let mut fractions = [1.0; 5];
            let each = |visit: &mut dyn FnMut(Pair)| visit(pair);
            truncate(&surfaces, &x, &u, &each, &|_| true, &mut fractions);
            let ends: Vec<Vec3> = (0..5).map(|i| x[i] + u[i] * fractions[i]).collect();
            let [start, end] = [above(&x), above(&ends)];
            assert!(start > 0.0 && end > 0.0, "{number}: {start} {end}");
        }
    }

    #[test]
    fn an_edge_may_pass_over_one_that_is_parallel() {
        let mut surfaces = Surfaces::default();
        let skin = Skin {
            radius: 1e-4,
            touches_itself: true,
            is_obstacle: false,
        };
        // The second edge is parallel but for rounding, and 0.3 mm higher.
        let x = [
            Vec3::new(0.0, 0.0, 0.0),
            Vec3::new(0.0, 0.01, 0.0),
            Vec3::new(-1e-3, 0.002, 3e-4),
            Vec3::new(-1e-3 + 1e-18, 0.012, 3e-4),
        ];
        for ends in [[0, 1], [2, 3]] {
            let ends = ends.map(|vertex: usize| x[vertex]);
            let mesh = LineMesh {
                positions: ends.to_vec(),
                lines: vec![[0, 1]],
                ..LineMesh::default()
            };
            surfaces.add(&Mesh::Thread(mesh), skin).expect("a thread");
        }
        let pair = Pair::EdgeEdge(0, 1);
        let start = pair.foot(&surfaces, &x);
        let is_safe = |by: Vec3| {
            let ends =
                |vertex: u32| x[vertex as usize] + if vertex < 2 { by } else { Vec3::zeros() };
            is_certain(
                pair,
                &surfaces,
                &start,
                |v| x[v as usize],
                ends,
                |gap| 0.05 * gap,
            )
        };
        assert!(is_safe(Vec3::new(-2e-3, 0.0, 0.0)));
        assert!(is_safe(Vec3::new(-2e-3, 0.0, 1e-4)));
        assert!(!is_safe(Vec3::new(-2e-3, 0.0, 6e-4)));
    }
}
