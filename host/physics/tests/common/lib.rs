//! Small meshes, a generator of random numbers, and norms for the tests.
#![allow(
    clippy::missing_panics_doc,
    clippy::missing_errors_doc,
    reason = "a test that panics has failed"
)]

pub mod kernels;

use physics::mesh::tet::MIDSIDE_ENDS;
use physics::mesh::{Cells, TetMesh, TriMesh};
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Mat3, Material, SolveReport,
    StepError, Vec3,
};

/// The pattern of the diagonals of the grid cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// All diagonals go from the lower left to the upper right.
    Right,
    /// All diagonals go from the upper left to the lower right.
    Left,
    /// The directions alternate like the colours of a chessboard.
    Alternating,
    /// Each grid cell has four triangles, with a vertex in the middle.
    Crossed,
}

/// The rectangle [0, lx] x [0, ly] in the plane z = 0, in nx x ny grid cells. The vertices go row by row along x.
pub fn grid(nx: u32, ny: u32, lx: f64, ly: f64, split: Split) -> TriMesh {
    let mut mesh = TriMesh::default();
    for j in 0..=ny {
        for i in 0..=nx {
            let (x, y) = (
                lx * f64::from(i) / f64::from(nx),
                ly * f64::from(j) / f64::from(ny),
            );
            mesh.positions.push(Vec3::new(x, y, 0.0));
        }
    }
    for j in 0..ny {
        for i in 0..nx {
            let a = j * (nx + 1) + i;
            let (b, c, d) = (a + 1, a + nx + 2, a + nx + 1);
            let right = match split {
                Split::Right => true,
                Split::Left => false,
                Split::Alternating => (i + j) % 2 == 0,
                Split::Crossed => {
                    let middle = mesh.positions.len() as u32;
                    let sum: Vec3 = [a, b, c, d]
                        .map(|v| mesh.positions[v as usize])
                        .iter()
                        .sum();
                    mesh.positions.push(sum / 4.0);
                    for (p, q) in [(a, b), (b, c), (c, d), (d, a)] {
                        mesh.triangles.push([p, q, middle]);
                    }
                    continue;
                }
            };
            if right {
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                mesh.triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    mesh
}

/// Whether a vertex lies on the border of the rectangle of `grid`.
pub fn on_border(x: &Vec3, lx: f64, ly: f64) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9 * lx;
    near(x.x, 0.0) || near(x.x, lx) || near(x.y, 0.0) || near(x.y, ly)
}

/// `grid` with its inner vertices moved by up to `fraction` of a cell.
pub fn irregular(nx: u32, ny: u32, lx: f64, ly: f64, fraction: f64, seed: u64) -> TriMesh {
    let mut mesh = grid(nx, ny, lx, ly, Split::Alternating);
    let mut random = Random(seed);
    for x in &mut mesh.positions {
        if !on_border(x, lx, ly) {
            x.x += fraction * lx / f64::from(nx) * random.signed();
            x.y += fraction * ly / f64::from(ny) * random.signed();
        }
    }
    mesh
}

/// A linear congruential generator (Knuth's constants). It gives the same numbers on every machine.
pub struct Random(pub u64);

impl Random {
    /// A number between -1 and 1.
    pub fn signed(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// A vector of three signed numbers.
    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
}

/// The strip of the reference figures: 1 MPa, 1 mm, and the given Poisson's ratio.
pub fn rubber(poisson: f64) -> Material {
    Material {
        young: 1e6,
        poisson,
        thickness: 1e-3,
        density: 1000.0,
    }
}

/// No gravity, no damping, no bending, and a solver tolerance at the limit of double precision.
pub fn tight() -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        tolerance: 1e-13,
        absolute_tolerance: 0.0,
        max_iterations: 20_000,
        ..BodyConfig::default()
    }
}

/// A handle of every vertex for which `chosen` holds. Its origin is their middle.
pub fn handle(mesh: &TriMesh, freedom: Freedom, chosen: impl Fn(&Vec3) -> bool) -> HandleSpec {
    let vertices: Vec<u32> = (0..mesh.positions.len() as u32)
        .filter(|&vertex| chosen(&mesh.positions[vertex as usize]))
        .collect();
    let sum: Vec3 = vertices
        .iter()
        .map(|&vertex| mesh.positions[vertex as usize])
        .sum();
    HandleSpec {
        origin: sum / vertices.len() as f64,
        vertices,
        freedom,
        border: Border::Hinged,
    }
}

/// The poses of the handles of a body at rest.
pub fn rest_poses(handles: &[HandleSpec]) -> Vec<HandlePose> {
    handles
        .iter()
        .map(|handle| HandlePose::at(handle.origin))
        .collect()
}

/// Takes steps of `h` towards static equilibrium. A long step is one Newton iteration. Velocities are cleared after
/// each step, so that no inertia remains.
pub fn settle(
    sheet: &mut Body,
    targets: &[HandlePose],
    h: f64,
    steps: usize,
) -> Result<SolveReport, StepError> {
    let still = vec![Vec3::zeros(); sheet.vertex_count()];
    let mut report = SolveReport::default();
    for _ in 0..steps {
        report = sheet.step(h, targets)?;
        assert!(sheet.set_velocities(&still).is_ok());
    }
    Ok(report)
}

/// The largest norm.
pub fn largest(values: impl Iterator<Item = Vec3>) -> f64 {
    values.map(|value| value.norm()).fold(0.0, f64::max)
}

/// An in-plane affine map as a matrix.
pub fn in_plane(xx: f64, xy: f64, yx: f64, yy: f64) -> Mat3 {
    Mat3::new(xx, xy, 0.0, yx, yy, 0.0, 0.0, 0.0, 1.0)
}

/// A cube of edge 1 in `n`^3 grid cells of six tetrahedra (Kuhn). Its inner vertices are moved by up to `fraction` of a
/// grid cell.
pub fn cube(n: usize, fraction: f64, quadratic: bool) -> TetMesh {
    block([n; 3], fraction, quadratic)
}

/// The same block with `n` grid cells along each axis.
pub fn block(n: [usize; 3], fraction: f64, quadratic: bool) -> TetMesh {
    let mut random = Random(3);
    let vertex = |at: [usize; 3]| ((at[2] * (n[1] + 1) + at[1]) * (n[0] + 1) + at[0]) as u32;
    let mut positions = Vec::new();
    for k in 0..=n[2] {
        for j in 0..=n[1] {
            for i in 0..=n[0] {
                let at = [i, j, k];
                let inner = (0..3).all(|axis| at[axis] > 0 && at[axis] < n[axis]);
                let off = if inner {
                    random.vector() * fraction
                } else {
                    Vec3::zeros()
                };
                positions.push(Vec3::from_fn(|axis, _| {
                    (at[axis] as f64 + off[axis]) / n[axis] as f64
                }));
            }
        }
    }
    let mut cells = Vec::new();
    for k in 0..n[2] {
        for j in 0..n[1] {
            for i in 0..n[0] {
                // Six paths along the axes from one corner to the opposite one. The last three have the opposite
                // orientation, so two of their vertices are exchanged.
                let even = [[0, 1, 2], [1, 2, 0], [2, 0, 1]];
                let odd = [[1, 0, 2], [0, 2, 1], [2, 1, 0]];
                for path in even.into_iter().chain(odd) {
                    let mut at = [i, j, k];
                    let mut cell = [vertex(at); 4];
                    for (slot, axis) in path.into_iter().enumerate() {
                        at[axis] += 1;
                        cell[slot + 1] = vertex(at);
                    }
                    if odd.contains(&path) {
                        cell.swap(1, 2);
                    }
                    cells.push(cell);
                }
            }
        }
    }
    let cells = if quadratic {
        Cells::Quadratic(elevate(&mut positions, &cells))
    } else {
        Cells::Linear(cells)
    };
    TetMesh {
        positions,
        cells,
        vertex_groups: Vec::new(),
        cell_groups: Vec::new(),
        cell_fields: Vec::new(),
    }
}

fn elevate(positions: &mut Vec<Vec3>, cells: &[[u32; 4]]) -> Vec<[u32; 10]> {
    let mut middles = std::collections::BTreeMap::new();
    let quadratic = |cell: &[u32; 4]| {
        let mut all = [0; 10];
        all[..4].copy_from_slice(cell);
        for (slot, [a, b]) in all[4..].iter_mut().zip(MIDSIDE_ENDS) {
            let ends = (cell[a].min(cell[b]), cell[a].max(cell[b]));
            *slot = *middles.entry(ends).or_insert_with(|| {
                positions.push((positions[ends.0 as usize] + positions[ends.1 as usize]) / 2.0);
                positions.len() as u32 - 1
            });
        }
        all
    };
    cells.iter().map(quadratic).collect()
}
