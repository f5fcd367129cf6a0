//! Loads per area, per length or on a part of a mesh, as forces on vertices.

use crate::Vec3;
use crate::mesh::{Adjacency, Cells, LineMesh, MeshError, TetMesh, TriMesh};
use std::collections::BTreeMap;

/// Faces of a tetrahedron by corners, each with the vertices at the middles of its edges.
const FACES: [([usize; 3], [usize; 3]); 4] = [
    ([0, 2, 1], [6, 5, 4]),
    ([0, 1, 3], [4, 8, 7]),
    ([1, 2, 3], [5, 9, 8]),
    ([0, 3, 2], [7, 9, 6]),
];

/// The distribution of a force on a part of a mesh over vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// The fraction of the force on each vertex of the mesh; the sum is 1.
    pub fractions: Vec<f64>,
    /// The area at rest over which the force is distributed (m^2); 0 if it is distributed over edges or vertices.
    pub area: f64,
}

/// Forces (N), one per vertex, of a uniform dead traction (Pa at rest, world axes), and the area of the loaded faces
/// (m^2). The traction acts on those faces of the mesh's surface whose corners all lie in `vertices`.
pub fn traction(mesh: &TetMesh, vertices: &[u32], traction: Vec3) -> (Vec<Vec3>, f64) {
    let Spread { fractions, area } = spread_on_solid(mesh, vertices);
    let force = traction * area;
    (
        fractions.iter().map(|fraction| force * *fraction).collect(),
        area,
    )
}

/// Distributes a force over those faces of a solid's surface whose corners all lie in `vertices`, or evenly over the
/// vertices if there is no such face.
///
/// Fractions are consistent with the shape functions: each corner of a linear face has a third of the face's fraction, and
/// each middle of an edge of a straight quadratic face has a third. A curved face is integrated.
pub fn spread_on_solid(mesh: &TetMesh, vertices: &[u32]) -> Spread {
    let chosen = chosen(mesh.positions.len(), vertices);
    // A face on the surface belongs to one cell only.
    let mut faces: BTreeMap<[u32; 3], (usize, [u32; 6])> = BTreeMap::new();
    for cell in mesh.cells.vertices() {
        for (corners, middles) in FACES {
            let corners = corners.map(|k| cell[k]);
            if !corners.iter().all(|&vertex| chosen[vertex as usize]) {
                continue;
            }
            let middles = match mesh.cells {
                Cells::Linear(_) => corners,
                Cells::Quadratic(_) => middles.map(|k| cell[k]),
            };
            let mut key = corners;
            key.sort_unstable();
            let [a, b, c] = corners;
            let [ab, bc, ca] = middles;
            let vertices = [a, b, c, ab, bc, ca];
            faces.entry(key).or_insert((0, vertices)).0 += 1;
        }
    }
    let surface = faces.into_iter().filter(|(_, (cells, _))| *cells == 1);
    let parts = surface.map(|(corners, (_, vertices))| {
        let nodes = vertices.map(|vertex| mesh.positions[vertex as usize]);
        let is_quadratic = matches!(mesh.cells, Cells::Quadratic(_));
        if is_quadratic && is_curved(&nodes) {
            let shares = shares_of_curved(&nodes);
            return (vertices, shares, shares.iter().sum());
        }
        let [a, b, c] = corners.map(|vertex| mesh.positions[vertex as usize]);
        let area = 0.5 * (b - a).cross(&(c - a)).norm();
        // The middles of a linear face are its corners.
        (
            vertices,
            [0.0, 0.0, 0.0, area / 3.0, area / 3.0, area / 3.0],
            area,
        )
    });
    let (fractions, area) = weigh_shares(mesh.positions.len(), parts);
    if area > 0.0 {
        return Spread { fractions, area };
    }
    evenly(&chosen)
}

/// Largest distance of an edge's middle from the middle of its ends, as a fraction of the edge, at which a face is
/// straight. Rounding of the coordinates gives a far smaller one.
const STRAIGHT: f64 = 1e-9;
/// Places and weights of a Gauss rule of eight points on the interval from -1 to 1, those of the positive places.
const GAUSS: [[f64; 2]; 4] = [
    [0.183_434_642_495_649_8, 0.362_683_783_378_362],
    [0.525_532_409_916_329, 0.313_706_645_877_887_3],
    [0.796_666_477_413_626_7, 0.222_381_034_453_374_5],
    [0.960_289_856_497_536_3, 0.101_228_536_290_376_3],
];

/// Whether a quadratic face, given by its corners and the middles after each corner, has other areas than its corners.
fn is_curved(nodes: &[Vec3; 6]) -> bool {
    (0..3).any(|k| {
        let (from, to) = (nodes[k], nodes[(k + 1) % 3]);
        (nodes[3 + k] - 0.5 * (from + to)).norm() > STRAIGHT * (to - from).norm()
    })
}

/// The area that each vertex of a curved quadratic face carries (m^2): the integral of its shape function.
///
/// The rule is that of a square with 8 by 8 points, one of whose sides is folded to a corner. The area of a curved face is
/// no polynomial; the rule gives a face that bulges by a third of its edges to six digits.
fn shares_of_curved(nodes: &[Vec3; 6]) -> [f64; 6] {
    let points = || {
        let both = GAUSS
            .iter()
            .flat_map(|&[at, weight]| [(-at, weight), (at, weight)]);
        both.map(|(at, weight)| (0.5 * (1.0 + at), 0.5 * weight))
    };
    let mut shares = [0.0; 6];
    for (u, weight_u) in points() {
        for (v, weight_v) in points() {
            // Coordinates of the triangle, and their slopes along the second and the third.
            let (second, third) = (u, v * (1.0 - u));
            let first = 1.0 - second - third;
            let shapes = [
                first * (2.0 * first - 1.0),
                second * (2.0 * second - 1.0),
                third * (2.0 * third - 1.0),
                4.0 * first * second,
                4.0 * second * third,
                4.0 * third * first,
            ];
            let along_second = [
                1.0 - 4.0 * first,
                4.0 * second - 1.0,
                0.0,
                4.0 * (first - second),
                4.0 * third,
                -4.0 * third,
            ];
            let along_third = [
                1.0 - 4.0 * first,
                0.0,
                4.0 * third - 1.0,
                -4.0 * second,
                4.0 * second,
                4.0 * (first - third),
            ];
            let slope = |slopes: [f64; 6]| -> Vec3 {
                nodes
                    .iter()
                    .zip(slopes)
                    .map(|(node, slope)| node * slope)
                    .sum()
            };
            let area = slope(along_second).cross(&slope(along_third)).norm();
            let weight = weight_u * weight_v * (1.0 - u) * area;
            for (share, shape) in shares.iter_mut().zip(shapes) {
                *share += weight * shape;
            }
        }
    }
    shares
}

/// Distributes a force over those lines of a thread whose ends both lie in `vertices`, by length, or evenly over the
/// vertices if there is no such line.
pub fn spread_on_thread(mesh: &LineMesh, vertices: &[u32]) -> Spread {
    let chosen = chosen(mesh.positions.len(), vertices);
    let at = |vertex: u32| mesh.positions[vertex as usize];
    let inside = |ends: &&[u32; 2]| ends.iter().all(|&vertex| chosen[vertex as usize]);
    let lines = mesh.lines.iter().filter(inside);
    let parts = lines.map(|&ends| (ends, (at(ends[1]) - at(ends[0])).norm()));
    let (fractions, length) = weigh(mesh.positions.len(), parts);
    if length > 0.0 {
        return Spread {
            fractions,
            area: 0.0,
        };
    }
    evenly(&chosen)
}

/// Distributes a force over those triangles of a sheet whose corners all lie in `vertices`, by area. If there is no
/// such triangle, the force is distributed over the boundary edges whose ends both lie in `vertices`, by length. If
/// there is no such edge either, it is distributed evenly over the vertices.
pub fn spread_on_sheet(mesh: &TriMesh, vertices: &[u32]) -> Spread {
    let chosen = chosen(mesh.positions.len(), vertices);
    let inside = |corners: &[u32]| corners.iter().all(|&vertex| chosen[vertex as usize]);
    let at = |vertex: u32| mesh.positions[vertex as usize];
    let triangles = (0_u32..).zip(&mesh.triangles);
    let parts = triangles.filter_map(|(triangle, &corners)| {
        let area = || mesh.triangle_area(triangle).unwrap_or_default();
        inside(&corners).then(|| (corners, area()))
    });
    let (fractions, area) = weigh(mesh.positions.len(), parts);
    if area > 0.0 {
        return Spread { fractions, area };
    }
    let mut edges: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for &[a, b, c] in &mesh.triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            *edges.entry([from.min(to), from.max(to)]).or_default() += 1;
        }
    }
    let boundary = edges.into_iter().filter(|(_, triangles)| *triangles == 1);
    let within = boundary.filter(|(ends, _)| inside(ends));
    let parts = within.map(|(ends, _)| (ends, (at(ends[1]) - at(ends[0])).norm()));
    let (fractions, length) = weigh(mesh.positions.len(), parts);
    if length > 0.0 {
        return Spread {
            fractions,
            area: 0.0,
        };
    }
    evenly(&chosen)
}

fn chosen(count: usize, vertices: &[u32]) -> Vec<bool> {
    let mut chosen = vec![false; count];
    for &vertex in vertices {
        if let Some(chosen) = chosen.get_mut(vertex as usize) {
            *chosen = true;
        }
    }
    chosen
}

/// Fractions of vertices, and the sum of the sizes. Each part carries a fraction by its size, evenly on its vertices.
fn weigh<const N: usize>(
    count: usize,
    parts: impl Iterator<Item = ([u32; N], f64)>,
) -> (Vec<f64>, f64) {
    weigh_shares(
        count,
        parts.map(|(carriers, size)| (carriers, [size / N as f64; N], size)),
    )
}

/// As [`weigh`], with the share of each of a part's vertices before its size.
fn weigh_shares<const N: usize>(
    count: usize,
    parts: impl Iterator<Item = ([u32; N], [f64; N], f64)>,
) -> (Vec<f64>, f64) {
    let mut fractions = vec![0.0; count];
    let mut whole = 0.0;
    for (carriers, shares, size) in parts {
        whole += size;
        for (vertex, share) in carriers.into_iter().zip(shares) {
            fractions[vertex as usize] += share;
        }
    }
    if whole > 0.0 {
        for fraction in &mut fractions {
            *fraction /= whole;
        }
    }
    (fractions, whole)
}

fn evenly(chosen: &[bool]) -> Spread {
    let count = chosen.iter().filter(|chosen| **chosen).count().max(1);
    let fraction = |&chosen: &bool| f64::from(u8::from(chosen)) / count as f64;
    Spread {
        fractions: chosen.iter().map(fraction).collect(),
        area: 0.0,
    }
}

/// Forces (N), one per vertex, on those boundary edges of a sheet whose ends both lie in `vertices`, and the length of
/// these edges (m).
///
/// `per_length` gives the force per length at rest (N/m, world axes), from the position and the outward normal in the
/// sheet's plane. The force is integrated with two Gauss points per edge against the linear shape functions. The result
/// is exact if the force is quadratic along the edge.
///
/// # Errors
///
/// [`MeshError::CrowdedEdge`] if more than two triangles meet at an edge.
pub fn edge_traction(
    mesh: &TriMesh,
    vertices: &[u32],
    per_length: impl Fn(&Vec3, &Vec3) -> Vec3,
) -> Result<(Vec<Vec3>, f64), MeshError> {
    let count = mesh.positions.len();
    let chosen = chosen(count, vertices);
    let mut forces = vec![Vec3::zeros(); count];
    let mut whole = 0.0;
    // Half the distance between the Gauss points, as a fraction of the edge.
    let offset = 0.5 / libm::sqrt(3.0);
    for edge in Adjacency::new(&mesh.triangles)?.boundary {
        if !edge.vertices.iter().all(|&vertex| chosen[vertex as usize]) {
            continue;
        }
        let [a, b] = edge.vertices.map(|vertex| mesh.positions[vertex as usize]);
        let along = b - a;
        let length = along.norm();
        let inward = mesh.positions[edge.opposite as usize] - a;
        let outward = along * (inward.dot(&along) / (length * length)) - inward;
        let normal = outward / outward.norm();
        for fraction in [0.5 - offset, 0.5 + offset] {
            let force = per_length(&(a + along * fraction), &normal) * (0.5 * length);
            forces[edge.vertices[0] as usize] += force * (1.0 - fraction);
            forces[edge.vertices[1] as usize] += force * fraction;
        }
        whole += length;
    }
    Ok((forces, whole))
}
