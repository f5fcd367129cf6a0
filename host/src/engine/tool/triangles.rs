//! The triangles of a patch: they stand for the triangles of the surface between the vertices of three sites.
//!
//! A triangle between sites is another surface than the triangles for which it stands: over a dent it cuts the corner, and would push
//! the tool out of the dent. The sites that do not touch the tool therefore make room, until no triangle is nearer to the tool than
//! the surface is.

use super::near::{Around, Surface};
use physics::Vec3;
use rt_core::tool::{MAX_SITES, MAX_TRIANGLES, Patch, Triangle};

/// The fraction of the distance of the surface from the hull: a triangle that is still nearer than this would push the tool away
/// from where the surface is not.
const CUTS: f64 = 0.5;
/// The gap, as a fraction of the radius, from which on a site moves as far as a triangle asks. The site of a vertex whose triangle
/// touches stays.
const APART: f64 = 0.1;
/// The sweeps over all triangles, and the least part of a triangle's motion that its corners must be able to make.
const SWEEPS: usize = 4;
const LEAST_YIELD: f64 = 0.01;

/// A triangle between three sites.
#[derive(Clone, Copy, Debug)]
struct Joined {
    corners: [u8; 3],
    friction: f64,
    /// The normal of the nearest triangle of the surface for which it stands, by area.
    outward: Vec3,
}

/// The nearest point of a triangle to the hull of the tool.
struct Foot {
    /// The weights of the corners.
    weights: [f64; 3],
    /// From the foot to the hull (m).
    apart: Vec3,
}

impl Joined {
    fn places(&self, patch: &Patch) -> [Vec3; 3] {
        self.corners
            .map(|site| patch.sites[usize::from(site)].place)
    }

    fn foot(&self, around: &Around<'_>, patch: &Patch) -> Foot {
        let own = self.places(patch).map(|place| place - around.centre);
        let near = around.hull.nearest(own.each_ref());
        let each = own.iter().zip(near.weights);
        Foot {
            weights: near.weights,
            apart: near.point - each.map(|(corner, weight)| corner * weight).sum::<Vec3>(),
        }
    }

    fn looks_outwards(&self, patch: &Patch) -> bool {
        normal(&self.places(patch)).dot(&self.outward) > 0.0
    }
}

/// Fills the triangles of a patch that has its sites: the nearest ones between three sites. A triangle that looks the other way than the
/// triangle for which it stands, or that cuts through the tool, is left out.
pub(super) fn join(surface: &Surface, around: &Around<'_>, patch: &mut Patch) {
    let joined = joined(surface, patch);
    let each = surface.vertices.iter().map(|near| near.skin);
    let skin = each.fold(0.0, f64::max);
    let nearest = surface.triangles.first();
    let nearest = nearest.map_or(0.0, |triangle| triangle.distance - skin);
    let gaps = gaps(surface, around.radius, patch);
    make_room(&joined, nearest, gaps, around, patch);
    patch.head.triangle_count = 0;
    for triangle in &joined {
        let is_clear = triangle.foot(around, patch).apart.norm() > CUTS * nearest;
        if is_clear && triangle.looks_outwards(patch) {
            let head = &mut patch.head;
            head.triangles[usize::from(head.triangle_count)] = Triangle {
                corners: triangle.corners,
                friction: triangle.friction,
            };
            head.triangle_count += 1;
        }
    }
}

/// The nearest triangles between three sites.
fn joined(surface: &Surface, patch: &Patch) -> heapless::Vec<Joined, MAX_TRIANGLES> {
    let mut joined: heapless::Vec<Joined, MAX_TRIANGLES> = heapless::Vec::new();
    for triangle in &surface.triangles {
        let vertices = triangle.vertices.map(|at| &surface.vertices[at]);
        let [a, b, c] = vertices.map(|near| near.site as u8);
        if a == b || b == c || c == a {
            continue;
        }
        // The same triangle begins at its least corner.
        let corners = if a < b && a < c {
            [a, b, c]
        } else if b < c {
            [b, c, a]
        } else {
            [c, a, b]
        };
        let new = Joined {
            corners,
            friction: triangle.friction,
            outward: normal(&vertices.map(|near| near.place)),
        };
        let is_known = joined.iter().any(|other| other.corners == corners);
        if !is_known && new.looks_outwards(patch) && joined.push(new).is_err() {
            break;
        }
    }
    joined
}

/// The gap between the tool and the triangles of each site's vertex (m).
fn gaps(surface: &Surface, radius: f64, patch: &Patch) -> [f64; MAX_SITES] {
    let mut gaps = [0.0; MAX_SITES];
    for (gap, site) in gaps.iter_mut().zip(&patch.sites) {
        let mut vertices = surface.vertices.iter();
        let near = vertices.find(|near| near.vertex.number() == site.vertex);
        *gap = near.map_or(0.0, |near| near.surface - near.skin - radius);
    }
    gaps
}

/// Moves sites away from the tool until no triangle is nearer to the tool than the surface, which has the distance `nearest` (m).
fn make_room(
    joined: &[Joined],
    nearest: f64,
    gaps: [f64; MAX_SITES],
    around: &Around<'_>,
    patch: &mut Patch,
) {
    let apart = APART * around.radius;
    let moves = gaps.map(|gap| (gap / apart).clamp(0.0, 1.0));
    for _ in 0..SWEEPS {
        for triangle in joined {
            let foot = triangle.foot(around, patch);
            let missing = nearest - foot.apart.norm();
            let Some(away) = foot.apart.try_normalize(0.0).filter(|_| missing > 0.0) else {
                continue;
            };
            let corners = triangle.corners.map(usize::from).into_iter();
            let corners = corners.zip(foot.weights);
            let each = corners.clone();
            let yields: f64 = each
                .map(|(site, weight)| weight * weight * moves[site])
                .sum();
            if yields > LEAST_YIELD {
                for (site, weight) in corners {
                    patch.sites[site].place -= away * (missing * weight * moves[site] / yields);
                }
            }
        }
    }
}

/// The normal of a triangle, by area.
fn normal([a, b, c]: &[Vec3; 3]) -> Vec3 {
    (b - a).cross(&(c - a))
}
