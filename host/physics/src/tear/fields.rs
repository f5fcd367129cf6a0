//! Stretch, stress and energy density in the triangles about a tip.
//!
//! The law is that of the membrane: `F = R U`, `S = 2 mu (U - I) + lambda tr(U - I) I`, `P = R S`. The rotation `R` turns
//! with the sheet in space. The **spin** is the part of this rotation in the plane. The gradient of the
//! displacement needs it: `H = Q U - I` with `Q` the rotation by the spin. The spin of a triangle differs from that of its
//! neighbour by the angle that is left when the neighbour is unfolded about the shared edge. The mean over the patch is
//! subtracted. So a turn of the sheet in space, and a fold or a roll of it, add nothing to `H`.
//!
//! In a sheet that is bent in two directions these angles do not sum to zero about a vertex (Gauss). The spins are then
//! those with the least sum of squares of what remains at the edges: no way through the patch is preferred, and the path of
//! a tear has no side.

use super::law::{TearError, TearMaterial};
use super::rings::Patch;
use super::strength::Symmetric;
use super::unfold::multiply;
use crate::Vec3;
use crate::polar::surface::Polar;
use crate::topology::NONE;

/// The state of one triangle.
#[derive(Clone, Copy, Debug)]
pub struct Stretched {
    /// Gradients of the three hat functions (1/m).
    pub gradients: [[f64; 2]; 3],
    /// Area at rest (m^2).
    pub area: f64,
    /// The columns of the deformation gradient.
    pub f: [Vec3; 2],
    /// The columns of its rotation.
    pub r: [Vec3; 2],
    /// The unit normal.
    pub normal: Vec3,
    /// `U - I`.
    pub strain: Symmetric,
    /// Biot's stress `S` (Pa).
    pub stress: Symmetric,
    /// Energy density (J/m^3).
    pub density: f64,
    /// The spin (rad).
    pub spin: f64,
}

/// The state of a triangle with the `shape` at rest (m) and the corners at `x` (m).
pub fn stretch(shape: &[[f64; 2]; 3], x: [Vec3; 3], material: &TearMaterial) -> Stretched {
    let [a, b, c] = shape;
    let (e1, e2) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
    let twice = e1[0] * e2[1] - e1[1] * e2[0];
    let g1 = [e2[1] / twice, -e2[0] / twice];
    let g2 = [-e1[1] / twice, e1[0] / twice];
    let (d1, d2) = (x[1] - x[0], x[2] - x[0]);
    let f = [0, 1].map(|j| d1 * g1[j] + d2 * g2[j]);
    let polar = Polar::new(&f[0], &f[1]);
    let strain = [polar.u[0] - 1.0, polar.u[1], polar.u[2] - 1.0];
    let (mu, lambda) = (material.shear(), material.lambda_plane_stress());
    let trace = strain[0] + strain[2];
    let stress = [
        2.0 * mu * strain[0] + lambda * trace,
        2.0 * mu * strain[1],
        2.0 * mu * strain[2] + lambda * trace,
    ];
    Stretched {
        gradients: [[-g1[0] - g2[0], -g1[1] - g2[1]], g1, g2],
        area: 0.5 * twice.abs(),
        f,
        r: polar.r,
        normal: polar.n,
        strain,
        stress,
        density: 0.5 * contract(&strain, &stress),
        spin: 0.0,
    }
}

/// `a : b`.
pub(super) fn contract(a: &Symmetric, b: &Symmetric) -> f64 {
    a[0] * b[0] + 2.0 * a[1] * b[1] + a[2] * b[2]
}

/// `S v`.
pub(super) fn times(s: &Symmetric, v: [f64; 2]) -> [f64; 2] {
    [s[0] * v[0] + s[1] * v[1], s[1] * v[0] + s[2] * v[1]]
}

impl Stretched {
    /// Cosine and sine of the spin.
    fn rotation(&self) -> [f64; 2] {
        [libm::cos(self.spin), libm::sin(self.spin)]
    }

    /// `H v`: the derivative of the displacement in the plane by the direction `v`.
    pub fn displacement(&self, v: [f64; 2]) -> [f64; 2] {
        let e = times(&self.strain, v);
        let turned = multiply(self.rotation(), [v[0] + e[0], v[1] + e[1]]);
        [turned[0] - v[0], turned[1] - v[1]]
    }

    /// The force through a line with the normal `n` at rest, in the plane (Pa): `Q S n`.
    pub fn traction(&self, n: [f64; 2]) -> [f64; 2] {
        multiply(self.rotation(), times(&self.stress, n))
    }

    /// The same force in space (Pa): `P n = R S n`.
    pub fn traction_in_space(&self, n: [f64; 2]) -> Vec3 {
        let s = times(&self.stress, n);
        self.r[0] * s[0] + self.r[1] * s[1]
    }

    /// The angle by which this triangle is turned in the plane against `other` when their hinge is unfolded (rad).
    fn spin_against(&self, other: &Self) -> f64 {
        // The smallest rotation from one normal to the other turns about the hinge.
        let between = 1.0 + self.normal.dot(&other.normal);
        let carry = |a: &Vec3| {
            if between < 1e-9 {
                return *a;
            }
            a - (self.normal + other.normal) * (self.normal.dot(a) / between)
        };
        let (c, s) = (
            self.r[0].dot(&carry(&other.r[0])),
            self.r[0].dot(&carry(&other.r[1])),
        );
        libm::atan2(s, c)
    }
}

/// The states of the triangles of a patch and the sums at its inner vertices.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) triangles: Vec<Stretched>,
    /// The angle of the middle of each triangle about the tip (rad), counted on along the patch.
    pub(super) angles: Vec<f64>,
    pub(super) nodes: Vec<Node>,
    /// Room for the [spins](Patch::even_spins): for each triangle the remainder at its edges, the direction of a search, and
    /// the change of the remainder along this direction.
    search: Vec<[f64; 3]>,
    pub(super) young: f64,
    pub(super) poisson: f64,
}

/// Sums at a vertex over its triangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Force of the membrane, over the thickness (N/m).
    pub(super) force: Vec3,
    /// The same force in the plane (N/m).
    pub(super) planar: [f64; 2],
    /// Area (m^2) times the columns of the deformation gradient.
    pub(super) f: [Vec3; 2],
    pub(super) area: f64,
    /// Whether the vertex is on a border, for instance on a face of the tear.
    pub(super) on_border: bool,
}

const NOTHING: Node = Node {
    force: Vec3::new(0.0, 0.0, 0.0),
    planar: [0.0; 2],
    f: [Vec3::new(0.0, 0.0, 0.0); 2],
    area: 0.0,
    on_border: false,
};

impl Field {
    pub(super) fn with_capacity(vertices: usize, triangles: usize) -> Self {
        Self {
            triangles: Vec::with_capacity(triangles),
            angles: Vec::with_capacity(triangles),
            nodes: Vec::with_capacity(vertices),
            search: Vec::with_capacity(triangles),
            young: 1.0,
            poisson: 0.0,
        }
    }

    pub(super) fn clear(&mut self) {
        self.triangles.clear();
        self.angles.clear();
        self.nodes.clear();
        self.search.clear();
    }
}

/// Most iterations for the spins, and the sum of squares (rad²) of what they leave out of balance at the end.
const MOST_SEARCHES: usize = 200;
const BALANCED: f64 = 1e-16;

impl Patch {
    /// Computes the states of the triangles of the patch at the positions `x` of the sheet's vertices (m).
    ///
    /// # Errors
    ///
    /// [`TearError::Positions`] for fewer positions than the vertices of the patch need. The states are empty then.
    pub fn measure(&mut self, x: &[Vec3], material: &TearMaterial) -> Result<(), TearError> {
        self.stretch(x, material)?;
        for place in 0..self.triangles.len() {
            let parent = self.triangles[place].parent;
            if parent != NONE {
                let (before, rest) = self.field.triangles.split_at_mut(place);
                let parent = &before[parent as usize];
                rest[0].spin = parent.spin + rest[0].spin_against(parent);
            }
        }
        self.even_spins();
        let states = self.field.triangles.iter();
        let (spin, area) = states.fold((0.0, 0.0), |(spin, area), state| {
            (spin + state.area * state.spin, area + state.area)
        });
        let mean = if area > 0.0 { spin / area } else { 0.0 };
        for state in &mut self.field.triangles {
            state.spin -= mean;
        }
        self.sum_nodes();
        self.count_angles();
        Ok(())
    }

    /// As [`measure`](Self::measure), for the [driving](Self::driving) alone, which needs no spins and no angles.
    ///
    /// # Errors
    ///
    /// As [`measure`](Self::measure).
    pub(crate) fn measure_driving(
        &mut self,
        x: &[Vec3],
        material: &TearMaterial,
    ) -> Result<(), TearError> {
        self.stretch(x, material)?;
        self.sum_nodes();
        Ok(())
    }

    /// Computes the states of the triangles without spins.
    fn stretch(&mut self, x: &[Vec3], material: &TearMaterial) -> Result<(), TearError> {
        self.field.clear();
        let needed = self.vertices().max().map_or(0, |last| last as usize + 1);
        if x.len() < needed {
            return Err(TearError::Positions {
                needed,
                found: x.len(),
            });
        }
        (self.field.young, self.field.poisson) = (material.young, material.poisson);
        for laid in &self.triangles {
            let state = stretch(&laid.shape, self.corners_at(laid, x), material);
            self.field.triangles.push(state);
        }
        Ok(())
    }

    /// Calls `visit` with the places of the two triangles at each inner edge of the patch.
    fn inner_edges(&self, mut visit: impl FnMut(usize, usize)) {
        for (place, laid) in self.triangles.iter().enumerate() {
            for next in laid.neighbours {
                if let Some(other) = self.place_of(next)
                    && other > place
                {
                    visit(place, other);
                }
            }
        }
    }

    /// Gives the triangles the spins with the least sum of squares of `s_i - s_j - turn_ij` over the inner edges, where
    /// `turn_ij` is the angle by which triangle `i` is turned against `j`. The normal equations are solved by conjugate
    /// gradients from the spins that are carried along the triangles in the order in which they were found: in a sheet that
    /// is flat or bent in one direction these are exact.
    fn even_spins(&mut self) {
        let mut search = core::mem::take(&mut self.field.search);
        search.resize(self.triangles.len(), [0.0; 3]);
        let states = &self.field.triangles;
        self.inner_edges(|i, j| {
            let left = states[i].spin_against(&states[j]) - (states[i].spin - states[j].spin);
            // The spins along two ways may differ by whole turns.
            let left = left - core::f64::consts::TAU * libm::round(left / core::f64::consts::TAU);
            search[i][0] += left;
            search[j][0] -= left;
        });
        let mut size: f64 = search.iter().map(|[left, ..]| left * left).sum();
        for entry in &mut search {
            entry[1] = entry[0];
        }
        let mut searches = 0;
        // The comparison is false for a value that is not a number.
        while size > BALANCED && searches < MOST_SEARCHES {
            searches += 1;
            for entry in &mut search {
                entry[2] = 0.0;
            }
            self.inner_edges(|i, j| {
                let change = search[i][1] - search[j][1];
                search[i][2] += change;
                search[j][2] -= change;
            });
            let along: f64 = search.iter().map(|entry| entry[1] * entry[2]).sum();
            let length = size / along;
            for (state, entry) in self.field.triangles.iter_mut().zip(&mut search) {
                state.spin += length * entry[1];
                entry[0] -= length * entry[2];
            }
            let before =
                core::mem::replace(&mut size, search.iter().map(|[left, ..]| left * left).sum());
            for entry in &mut search {
                entry[1] = entry[0] + size / before * entry[1];
            }
        }
        self.field.search = search;
    }

    /// The sum of the squares of the angles between neighbouring triangles of the patch (rad²), if they are small;
    /// zero before [`Patch::measure`].
    pub(crate) fn folding(&self) -> f64 {
        let states = self.triangles.iter().zip(&self.field.triangles);
        let squares = states.filter_map(|(laid, state)| {
            let parent = self.field.triangles.get(laid.parent as usize)?;
            Some((state.normal - parent.normal).norm_squared())
        });
        squares.sum()
    }

    fn sum_nodes(&mut self) {
        self.field.nodes.resize(self.inner, NOTHING);
        for (laid, state) in self.triangles.iter().zip(&self.field.triangles) {
            for (k, (&place, &g)) in laid.corners.iter().zip(&state.gradients).enumerate() {
                let Some(node) = self.field.nodes.get_mut(place as usize) else {
                    continue;
                };
                let beside = [(k + 1) % 3, (k + 2) % 3];
                node.on_border |= beside.iter().any(|&side| laid.neighbours[side] == NONE);
                node.force -= state.traction_in_space(g) * state.area;
                let planar = state.traction(g);
                node.planar[0] -= planar[0] * state.area;
                node.planar[1] -= planar[1] * state.area;
                node.f[0] += state.f[0] * state.area;
                node.f[1] += state.f[1] * state.area;
                node.area += state.area;
            }
        }
    }

    /// The angle of a triangle's middle differs by less than half a turn from that of the middle of the edge which it shares
    /// with the triangle before, and so does the angle of the triangle before. Two large triangles at the tip differ by more.
    fn count_angles(&mut self) {
        for laid in &self.triangles {
            let middle_of = |corners: &[[f64; 2]]| {
                [0, 1].map(|j| corners.iter().map(|at| at[j]).sum::<f64>() / corners.len() as f64)
            };
            let middle = middle_of(&laid.shape);
            let mut angle = 0.0;
            if laid.parent != NONE {
                let parent = &self.triangles[laid.parent as usize].corners;
                let alone = laid
                    .corners
                    .iter()
                    .position(|place| !parent.contains(place));
                let first = alone.map_or(0, |alone| alone + 1);
                let shared = [0, 1].map(|k| laid.shape[(first + k) % 3]);
                angle = self.angle_of(laid.parent as usize, middle_of(&shared));
            }
            angle += angle_from(direction(self.along, angle), middle);
            self.field.angles.push(angle);
        }
    }

    /// The angle of `point` about the tip (rad), less than half a turn from that of the middle of triangle `place`.
    pub(super) fn angle_of(&self, place: usize, point: [f64; 2]) -> f64 {
        let middle = self.field.angles[place];
        middle + angle_from(direction(self.along, middle), point)
    }
}

/// The direction at `angle` (rad) from `along`.
fn direction(along: [f64; 2], angle: f64) -> [f64; 2] {
    multiply(along, [libm::cos(angle), libm::sin(angle)])
}

/// The angle of `v` against the unit vector `axis`, from -pi to pi.
fn angle_from(axis: [f64; 2], v: [f64; 2]) -> f64 {
    let turned = multiply([axis[0], -axis[1]], v);
    libm::atan2(turned[1], turned[0])
}
