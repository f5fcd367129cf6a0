//! The share of bending in the energy release rate of a tear.
//!
//! A tear grows as the material about its tip shifts by `q e` below a sheet that stays in space, see
//! [`tear::driving`](crate::tear::driving). The slopes at the sides of a triangle stay as well: each is an angle in space. The
//! curvature changes, because the sides that the slopes are divided by change at rest, and so does the area. The share is
//!
//! ```text
//! - sum dE(X + s q e) / ds                           the domain
//!   + sum q_i (F e)_i . f_i                          the vertices
//! ```
//!
//! for a unit of length, with the energy `E` of a triangle whose corners at rest are at `X`, and the bending force `f_i` on
//! vertex `i`. The sum over vertices is the work of these forces as the vertices follow the shift. With the forces of the
//! membrane they balance the loads.
//!
//! The sheet is flat at rest and isotropic. A sheet that is curved at rest has no share here.

use super::NONE;
use super::build::{bends, condensed};
use super::exact::Bending;
use super::sheet::BentSheet;
use crate::tear::rings::{Patch, Shift};
use crate::{Mat3, Vec3};

/// Steps from triangle to triangle by which the derivative across an edge sees a vertex.
const SEEN: usize = 3;

/// The least bending energy about the tip that counts, as a fraction of the energy of the membrane there.
const LEAST: f64 = 1e-4;

/// The largest energy that would bend the flat sheet to its shape at rest, as a fraction of the bending energy. The shape
/// of a flat sheet has rounding errors.
const FLAT: f64 = 1e-3;

/// The shift for the derivative of the energy, as a fraction of the longest side of a triangle. Differences to both sides
/// err by about the square.
const SMALL: f64 = 1e-4;

impl BentSheet {
    /// The bending energy that the sheet gives up for a unit of length by which the tear of `patch` grows (J/m), at the
    /// positions `x` (m). `nodes` is the vertex of each place in `bending`. [`Patch::measure`] comes before. The result is
    /// 0 if the sheet is almost flat about the tip, and if it is curved at rest.
    pub(crate) fn release(
        &self,
        bending: &Bending,
        patch: &mut Patch,
        x: &[Vec3],
        nodes: &[u32],
    ) -> f64 {
        let plate = self.plate(0);
        // A fold by a small angle takes about the stiffness times the square of the angle.
        if plate.matrix[(0, 0)] * patch.folding() <= LEAST * plate.thickness * patch.energy() {
            return 0.0;
        }
        let triangles = patch.triangles().iter().map(|laid| laid.triangle as usize);
        let (bent, at_rest) = triangles.fold((0.0, 0.0), |(bent, at_rest), triangle| {
            (
                bent + bending.energy_of(triangle, x, nodes),
                at_rest + 0.5 * bending.rest_curvature(triangle).norm_squared(),
            )
        });
        if at_rest > FLAT * bent {
            return 0.0;
        }
        let domain = self.shifted(bending, patch, x, nodes);
        patch.surround(&self.neighbours, SEEN);
        let inside = patch.triangles().iter().map(|laid| laid.triangle);
        let near = inside.chain(patch.around().iter().copied());
        let works = near.map(|triangle| {
            bending.work(triangle as usize, (x, nodes), |vertex| patch.motion(vertex))
        });
        domain + works.sum::<f64>()
    }

    /// The energy that the triangles give up as their material shifts (J/m).
    fn shifted(&self, bending: &Bending, patch: &Patch, x: &[Vec3], nodes: &[u32]) -> f64 {
        let released = |shift: Shift| {
            let triangle = shift.triangle as usize;
            let (slopes, has_edge) = bending.outward_slopes(triangle, x, nodes);
            let matrix = &self.plate(triangle).matrix;
            let energy = |by: f64| bent_energy(&shift.moved(by), &slopes, has_edge, matrix);
            let step = SMALL * shift.longest_side();
            let slope = (energy(step) - energy(-step)) / (2.0 * step);
            // A sliver is softer than its plate.
            let softer = bending.energy_of(triangle, x, nodes) / energy(0.0);
            if softer.is_finite() {
                -softer * slope
            } else {
                0.0
            }
        };
        patch.shifts().map(released).sum()
    }
}

/// The bending energy (J) of a triangle with these corners (m), outward slopes at its sides, and plate (N m). A side
/// without an edge has no moment.
fn bent_energy(
    [a, b, c]: &[[f64; 2]; 3],
    slopes: &[f64; 3],
    has_edge: [bool; 3],
    plate: &Mat3,
) -> f64 {
    let (e1, e2) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
    let twice = e1[0] * e2[1] - e1[1] * e2[0];
    let g1 = [e2[1] / twice, -e2[0] / twice];
    let g2 = [-e1[1] / twice, e1[0] / twice];
    let area = 0.5 * twice.abs();
    let (bends, _) = bends([g1, g2], area);
    let plate = condensed(&(plate * area), &bends, has_edge);
    let curvature: Vec3 = bends
        .iter()
        .zip(slopes)
        .map(|(bend, slope)| bend * *slope)
        .sum();
    0.5 * curvature.dot(&(plate * curvature))
}

impl Bending {
    /// The slopes at the sides of a triangle, positive if the sheet bends to the side of the normal outside of the side,
    /// and whether there is an edge at each side.
    fn outward_slopes(&self, triangle: usize, x: &[Vec3], nodes: &[u32]) -> ([f64; 3], [bool; 3]) {
        let bent = self.bent(triangle, |place| x[nodes[place as usize] as usize]);
        let has_edge = self.sides[triangle].map(|edge| edge != NONE);
        (bent.outward_slopes(), has_edge)
    }

    /// The work of the bending forces of a triangle over small motions of the vertices (J), at positions `x` (m).
    fn work(
        &self,
        triangle: usize,
        (x, nodes): (&[Vec3], &[u32]),
        motion: impl Fn(u32) -> Vec3,
    ) -> f64 {
        let node = |place: u32| nodes[place as usize];
        let (theta, sides) = self.vectors(triangle, |place| motion(node(place)));
        let moved = theta.iter().chain(&sides);
        if moved.clone().all(|v| *v == Vec3::zeros()) {
            return 0.0;
        }
        let bent = self.bent(triangle, |place| x[node(place) as usize]);
        let gradient = self.facets[triangle].gradient(&bent);
        -gradient
            .iter()
            .zip(moved)
            .map(|(g, v)| g.dot(v))
            .sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::bending::Plate;
    use crate::tear::rings::Laid;
    use crate::tear::{Sheet, TearLaw, TearMaterial, Tip};

    const CELLS: u32 = 24;
    const CELL: f64 = 0.004;
    /// The curvature along the bent direction (1/m), and its slope (1/m²).
    const CURVATURE: [f64; 2] = [6.0, 60.0];
    /// The angle of the bent direction in the sheet (rad).
    const BENT: f64 = 0.4;
    /// Bending stiffness (N m) and Poisson's ratio.
    const STIFFNESS: f64 = 0.02;
    const POISSON: f64 = 0.3;

    fn unit(angle: f64) -> [f64; 2] {
        [libm::cos(angle), libm::sin(angle)]
    }

    /// A flat grid without order, centred at the origin, with alternating diagonals.
    fn grid() -> (Vec<[u32; 3]>, Vec<Vec3>) {
        let row = CELLS + 1;
        let noise = |seed: u32| libm::sin(f64::from(seed) * 12.9898) * 0.15 * CELL;
        let vertices = (0..row * row).map(|vertex| {
            let [u, v] = [vertex % row, vertex / row].map(|k| (f64::from(k) - 12.0) * CELL);
            Vec3::new(u + noise(vertex), v + noise(vertex + 7919), 0.0)
        });
        let mut triangles = Vec::new();
        for cell in 0..CELLS * CELLS {
            let (i, j) = (cell % CELLS, cell / CELLS);
            let [a, b] = [j * row + i, (j + 1) * row + i];
            triangles.extend(if (i + j) % 2 == 0 {
                [[a, a + 1, b + 1], [a, b + 1, b]]
            } else {
                [[a, a + 1, b], [a + 1, b + 1, b]]
            });
        }
        (triangles, vertices.collect())
    }

    /// The place of a point of the sheet that is bent about one direction without a stretch.
    fn bent(rest: &Vec3) -> Vec3 {
        let [c, s] = unit(BENT);
        let (along, beside) = (rest.x * c + rest.y * s, rest.y * c - rest.x * s);
        let angle = |l: f64| CURVATURE[0] * l + 0.5 * CURVATURE[1] * l * l;
        // Simpson's rule on a smooth function.
        let steps = 20;
        let width = along / f64::from(steps);
        let mut place = Vec3::new(0.0, beside, 0.0);
        for step in 0..steps {
            let at = |part: f64| unit(angle(width * (f64::from(step) + part)));
            for (part, weight) in [(0.0, 1.0), (0.5, 4.0), (1.0, 1.0)] {
                let [x, z] = at(part);
                place += Vec3::new(x, 0.0, z) * (weight * width / 6.0);
            }
        }
        place
    }

    /// A sheet in which nothing tears gives up no energy if a piece of its material shifts: the sums over triangles and
    /// over vertices cancel. For a shift along the bent direction, in which the curvature is `k`, the sum over triangles is
    /// `-integral q D k k'`.
    #[test]
    fn a_sheet_without_a_tear_gives_up_nothing() {
        let (triangles, rest) = grid();
        let plate = Plate {
            matrix: Mat3::new(
                1.0,
                POISSON,
                0.0,
                POISSON,
                1.0,
                0.0,
                0.0,
                0.0,
                0.5 * (1.0 - POISSON),
            ) * STIFFNESS,
            thickness: 1e-3,
        };
        let sheet = BentSheet::new(&triangles, vec![plate]).unwrap();
        let bending = sheet.bending(&rest, core::iter::empty(), |_| false);
        let nodes: Vec<u32> = (0..rest.len() as u32).collect();
        let x: Vec<Vec3> = rest.iter().map(bent).collect();
        let shapes: Vec<_> = triangles
            .iter()
            .map(|corners| corners.map(|v| [rest[v as usize].x, rest[v as usize].y]))
            .collect();
        let surface = Sheet {
            triangles: &triangles,
            neighbours: &sheet.neighbours,
            shapes: &shapes,
        };
        let middle = (CELLS / 2) * (CELLS + 2);
        let triangle = triangles.iter().position(|t| t.contains(&middle)).unwrap() as u32;
        let mut patch = Patch::new(rest.len(), triangles.len());
        // The membrane is so soft that its energy is below that of bending.
        let material = TearMaterial {
            law: TearLaw::Toughness,
            young: 1.0,
            poisson: POISSON,
            thickness: 1e-3,
            strength: 1.0,
            toughness: 1.0,
        };
        let [c, s] = unit(BENT);
        let of_triangle = |patch: &Patch, laid: &Laid| {
            let corners = triangles[laid.triangle as usize].map(|v| rest[v as usize]);
            let area = 0.5
                * (corners[1] - corners[0])
                    .cross(&(corners[2] - corners[0]))
                    .z;
            let q = laid
                .corners
                .iter()
                .map(|&place| patch.q(place))
                .sum::<f64>()
                / 3.0;
            let along = corners.iter().map(|x| x.x * c + x.y * s).sum::<f64>() / 3.0;
            let curvature = CURVATURE[0] + CURVATURE[1] * along;
            -area * q * STIFFNESS * curvature * CURVATURE[1]
        };
        let exact = |patch: &Patch| -> f64 {
            let laid = patch.triangles().iter();
            laid.map(|laid| of_triangle(patch, laid)).sum()
        };
        // The first tear grows along the bent direction.
        for angle in [BENT, BENT + 0.5, BENT + 2.0] {
            let tip = Tip {
                vertex: middle,
                triangle,
                along: unit(angle),
            };
            patch.find(&surface, &tip, 3, |_| false).unwrap();
            patch.measure(&x, &material).unwrap();
            let domain = sheet.shifted(&bending, &patch, &x, &nodes);
            if angle == BENT {
                let exact = exact(&patch);
                // The cut-off function falls within one triangle, whose curvature is a mean over a few.
                assert!((domain / exact - 1.0).abs() < 0.15, "{domain} {exact}");
            }
            let all = sheet.release(&bending, &mut patch, &x, &nodes);
            // The sums cancel on any mesh, but for the mean of the deformation gradient at a vertex.
            assert!(all.abs() < 0.02 * domain.abs(), "{angle}: {all} {domain}");
        }
    }
}
