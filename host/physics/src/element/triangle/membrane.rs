//! In-plane elasticity of a sheet: corotational constant-strain triangles in plane stress.
//!
//! With rest gradients `g_a` of the three hat functions in an orthonormal rest frame of the triangle, the
//! deformation gradient is the 3 x 2 matrix `F = sum x_a g_a^T`. Its polar decomposition `F = R U` has a
//! closed form: with `s = |F_1 x F_2|`, `n` the unit normal and `q^2 = tr C + 2 s`, `C = F^T F`,
//!
//! ```text
//! U = (C + s I) / q        R = (F + [F_2 x n, n x F_1]) / q
//! ```
//!
//! `U` and `R` are finite, and `R` is orthonormal, for a collapsed triangle as well, if `n` is a unit normal of the
//! remaining line or point. The strain is `U - I`, the stress `sigma = 2 mu (U - I) + lambda tr(U - I) I` with the Lame
//! parameters of plane stress. The force is exactly minus the gradient of the energy: `P = R sigma`,
//! `f_a = -t A P g_a`.
//!
//! The tangent, the derivative of `R sigma`, is exact as well. Its in-plane part is that of McAdams et al., "Efficient
//! elasticity for character skinning with contact and collisions", 2011, in two dimensions. The tangent is a sum of
//! three parts, each of known sign:
//!
//! 1. material: `D sym(R^T dF)`, positive semidefinite;
//! 2. in-plane spin: `tr(sigma) / (2 tr U)` times the square of the spin;
//! 3. out of plane: `w^T sigma U^-1 w` for `dF = n w^T`, the geometric stiffness, like that of a taut string.
//!
//! [`Tangent::Clipped`] keeps the positive parts of 2 and 3, so that every element's tangent is positive
//! semidefinite. Without part 3 a step of a sheet under tension is unstable.

use super::frame::{degenerate, rest_axes, rest_corners, rest_frame, shape_of};
use super::triangles::Triangle;
use crate::element::elements::{Elements, placed, renumber, slots};
use crate::element::{Strained, Tearable, Torn, VectorForm};
use crate::error::BodyError;
use crate::linear::block_matrix::{BlockMatrix, ElementSlots};
use crate::material::Material;
use crate::material::Tangent;
use crate::mesh::TriMesh;
use crate::polar::surface::{Polar, STRETCH_FLOOR};
use crate::topology::Shape;
use crate::{Mat3, Vec3};

/// Force and tangent of one triangle at its three vertices.
#[derive(Clone, Copy, Debug)]
pub struct Element {
    /// Elastic force on each vertex (N).
    pub force: [Vec3; 3],
    /// Minus the derivative of the force on vertex `a` by the position of vertex `b` (N/m), at `[a][b]`.
    pub stiffness: [[Mat3; 3]; 3],
}

/// All triangles of a sheet, by arrays over triangles.
#[derive(Clone, Debug)]
pub struct Membrane {
    pub(super) nodes: Vec<[u32; 3]>,
    /// Rest gradients of the second and third hat function (1/m). The first gradient is minus their sum.
    pub(super) gradients: Vec<[[f64; 2]; 2]>,
    /// The axes of the frames of those gradients in world coordinates.
    pub(super) frames: Vec<[Vec3; 2]>,
    /// With a flat pattern, the deformation gradient of the starting positions less the frame. Otherwise empty.
    pub(super) strained: Vec<[Vec3; 2]>,
    /// Shear modulus times thickness times rest area (N m).
    pub(super) mu: Vec<f64>,
    /// Plane-stress Lame parameter times thickness times rest area (N m).
    pub(super) lambda: Vec<f64>,
    /// Thickness times rest area (m^3).
    pub(super) volume: Vec<f64>,
    pub(super) density: Vec<f64>,
    pub(super) slots: Vec<ElementSlots<3>>,
    /// Number of triangles for which there is room, or 0 if no edits are followed.
    limit: usize,
}

/// The frame of a triangle that starts at `corners` (m) with these rest gradients (1/m): the rotation of the deformation
/// gradient. The second value is the difference of deformation gradient and frame, which is the strain at the start.
pub(super) fn start(corners: [&Vec3; 3], [g1, g2]: [[f64; 2]; 2]) -> ([Vec3; 2], [Vec3; 2]) {
    let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
    let f = [0, 1].map(|j| e1 * g1[j] + e2 * g2[j]);
    let frame = Polar::new(&f[0], &f[1]).r;
    (frame, [f[0] - frame[0], f[1] - frame[1]])
}

fn dot2(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

impl Membrane {
    /// An empty membrane with room for `count` triangles.
    fn with_capacity(count: usize) -> Self {
        Self {
            nodes: Vec::with_capacity(count),
            gradients: Vec::with_capacity(count),
            frames: Vec::with_capacity(count),
            strained: Vec::new(),
            mu: Vec::with_capacity(count),
            lambda: Vec::with_capacity(count),
            volume: Vec::with_capacity(count),
            density: Vec::with_capacity(count),
            slots: Vec::new(),
            limit: 0,
        }
    }

    /// The triangles of `mesh` over its vertices, with one material for all or one for each.
    ///
    /// # Errors
    ///
    /// [`BodyError`] for no triangles, a material out of range, and a triangle without area or with a vertex
    /// that does not exist.
    pub fn new(mesh: &TriMesh, materials: &[Material]) -> Result<Self, BodyError> {
        let triangles = mesh.triangles.len();
        if triangles == 0 {
            return Err(BodyError::Empty);
        }
        if materials.len() != 1 && materials.len() != triangles {
            return Err(BodyError::MaterialCount {
                found: materials.len(),
                elements: triangles,
            });
        }
        for (triangle, material) in materials.iter().enumerate() {
            material.check(triangle)?;
        }
        mesh.check_pattern()?;
        let count = mesh.positions.len();
        let mut membrane = Self::with_capacity(triangles);
        for (triangle, vertices) in mesh.triangles.iter().enumerate() {
            if let Some(&vertex) = vertices.iter().find(|&&vertex| vertex as usize >= count) {
                return Err(BodyError::ElementVertex {
                    element: triangle,
                    vertex,
                    count,
                });
            }
            let corners = vertices.map(|vertex| &mesh.positions[vertex as usize]);
            let Some((gradients, area)) = rest_frame(corners) else {
                return Err(degenerate(triangle, corners));
            };
            let material = &materials[if materials.len() == 1 { 0 } else { triangle }];
            let Some(flat) = rest_corners(mesh, triangle) else {
                membrane.push(*vertices, gradients, rest_axes(corners), area, material);
                continue;
            };
            let flat = flat.each_ref();
            let (gradients, area) = rest_frame(flat).ok_or_else(|| degenerate(triangle, flat))?;
            let (frame, strained) = start(corners, gradients);
            membrane.push(*vertices, gradients, frame, area, material);
            membrane.strained.push(strained);
        }
        Ok(membrane)
    }

    /// Adds a triangle by its nodes, rest gradients, the axes of their frame and its rest area (m^2).
    fn push(
        &mut self,
        nodes: [u32; 3],
        gradients: [[f64; 2]; 2],
        frame: [Vec3; 2],
        area: f64,
        material: &Material,
    ) {
        self.nodes.push(nodes);
        self.gradients.push(gradients);
        self.frames.push(frame);
        self.mu.push(material.shear() * material.thickness * area);
        self.lambda
            .push(material.lambda_plane_stress() * material.thickness * area);
        self.volume.push(material.thickness * area);
        self.density.push(material.density);
    }

    pub(super) fn polar(&self, e: usize, x: &[Vec3]) -> Polar {
        let [a, b, c] = self.nodes[e].map(|node| x[node as usize]);
        let [g1, g2] = self.gradients[e];
        let (e1, e2) = (b - a, c - a);
        Polar::new(&(e1 * g1[0] + e2 * g2[0]), &(e1 * g1[1] + e2 * g2[1]))
    }

    /// Principal stretches of triangle `e` at node positions `x` (m), the larger first. The stretch at rest is 1.
    pub fn principal_stretches(&self, e: usize, x: &[Vec3]) -> [f64; 2] {
        self.polar(e, x).stretches()
    }

    /// Elastic energy (J) of triangle `e` at node positions `x` (m).
    pub(super) fn energy_of(&self, e: usize, x: &[Vec3]) -> f64 {
        let polar = self.polar(e, x);
        let [xx, xy, yy] = polar.u;
        let (xx, yy) = (xx - 1.0, yy - 1.0);
        let trace = xx + yy;
        self.mu[e] * (xx * xx + 2.0 * xy * xy + yy * yy) + 0.5 * self.lambda[e] * trace * trace
    }

    /// Force and tangent of triangle `e` at node positions `x` (m).
    pub fn element(&self, e: usize, x: &[Vec3], tangent: Tangent) -> Element {
        let moduli = [self.mu[e], self.lambda[e]];
        Element::new(&self.polar(e, x), self.gradients[e], moduli, tangent)
    }
}

/// The two columns of the first Piola-Kirchhoff stress `R sigma`, and `sigma` (xx, xy, yy), in the unit of the moduli.
pub(super) fn piola(polar: &Polar, [mu, lambda]: [f64; 2]) -> ([Vec3; 2], [f64; 3]) {
    let [r1, r2] = polar.r;
    let [uxx, uxy, uyy] = polar.u;
    let pressure = lambda * (uxx - 1.0 + uyy - 1.0);
    let sigma = [
        2.0 * mu * (uxx - 1.0) + pressure,
        2.0 * mu * uxy,
        2.0 * mu * (uyy - 1.0) + pressure,
    ];
    (
        [r1 * sigma[0] + r2 * sigma[1], r1 * sigma[1] + r2 * sigma[2]],
        sigma,
    )
}

impl Element {
    /// Force and tangent of a triangle with this polar decomposition, these rest gradients (1/m) of its second and third
    /// hat function and these moduli times the volume (N m).
    pub(super) fn new(
        polar: &Polar,
        [g1, g2]: [[f64; 2]; 2],
        [mu, lambda]: [f64; 2],
        tangent: Tangent,
    ) -> Self {
        let [r1, r2] = polar.r;
        let ([p1, p2], sigma) = piola(polar, [mu, lambda]);
        let force_1 = -(p1 * g1[0] + p2 * g1[1]);
        let force_2 = -(p1 * g2[0] + p2 * g2[1]);

        let spin = spin_coefficient(&sigma, polar.trace, tangent);
        let geometric = out_of_plane(polar, mu, lambda, tangent);
        let nn = polar.n * polar.n.transpose();
        let g0 = [-g1[0] - g2[0], -g1[1] - g2[1]];
        let block = |a: [f64; 2], b: [f64; 2]| {
            let shear = mu * dot2(a, b);
            let (ja, jb) = ([-a[1], a[0]], [-b[1], b[0]]);
            let entry =
                |i: usize, j: usize| mu * b[i] * a[j] + lambda * a[i] * b[j] + spin * ja[i] * jb[j];
            let k = [
                [entry(0, 0) + shear, entry(0, 1)],
                [entry(1, 0), entry(1, 1) + shear],
            ];
            // R k R^T from the two columns of R.
            let left = [r1 * k[0][0] + r2 * k[1][0], r1 * k[0][1] + r2 * k[1][1]];
            let w = a[0] * (geometric[0] * b[0] + geometric[1] * b[1])
                + a[1] * (geometric[1] * b[0] + geometric[2] * b[1]);
            left[0] * r1.transpose() + left[1] * r2.transpose() + nn * w
        };
        // The gradients sum to zero, so the diagonal blocks are minus the sums of their rows. A
        // translation then gives no force, not even by rounding.
        let k01 = block(g0, g1);
        let k02 = block(g0, g2);
        let k12 = block(g1, g2);
        let (k10, k20, k21) = (k01.transpose(), k02.transpose(), k12.transpose());
        Self {
            force: [-(force_1 + force_2), force_1, force_2],
            stiffness: [
                [-(k01 + k02), k01, k02],
                [k10, -(k10 + k12), k12],
                [k20, k21, -(k20 + k21)],
            ],
        }
    }
}

impl Elements for Membrane {
    fn count(&self) -> usize {
        self.nodes.len()
    }

    fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.gradients.as_slice())
            + size_of_val(self.frames.as_slice())
            + size_of_val(self.strained.as_slice())
            + size_of_val(self.mu.as_slice())
            + size_of_val(self.lambda.as_slice())
            + size_of_val(self.volume.as_slice())
            + size_of_val(self.density.as_slice())
            + size_of_val(self.slots.as_slice())
    }

    fn nodes(&self, element: usize) -> &[u32] {
        &self.nodes[element]
    }

    fn renumber(&mut self, place: &[u32]) {
        renumber(&mut self.nodes, place);
    }

    fn bind(&mut self, matrix: &BlockMatrix, place: &[u32]) {
        self.slots = slots(placed(&self.nodes, place), matrix);
    }

    fn add_mass(&self, mass: &mut [f64], load: &mut [f64]) {
        for (e, nodes) in self.nodes.iter().enumerate() {
            let third = self.density[e] * self.volume[e] / 3.0;
            for &node in nodes {
                mass[node as usize] += third;
                load[node as usize] += third;
            }
        }
    }

    fn energy(&self, x: &[Vec3]) -> f64 {
        let mut energy = 0.0;
        for e in 0..self.nodes.len() {
            energy += self.energy_of(e, x);
        }
        energy
    }

    fn assemble(
        &self,
        x: &[Vec3],
        tangent: Tangent,
        force: &mut [Vec3],
        stiffness: &mut BlockMatrix,
    ) {
        for (e, slots) in self.slots.iter().enumerate() {
            let element = self.element(e, x, tangent);
            for a in 0..3 {
                force[self.nodes[e][a] as usize] += element.force[a];
                for b in 0..3 {
                    stiffness.add(slots[a][b], &element.stiffness[a][b]);
                }
            }
        }
    }

    fn inverted(&self, _: &[Vec3]) -> usize {
        0
    }

    fn stress(&self, element: usize, x: &[Vec3]) -> Mat3 {
        let polar = self.polar(element, x);
        let [xx, xy, yy] = polar.u;
        let (mu, lambda) = (self.mu[element], self.lambda[element]);
        let pressure = lambda * (xx + yy - 2.0);
        let sigma = [
            2.0 * mu * (xx - 1.0) + pressure,
            2.0 * mu * xy,
            2.0 * mu * (yy - 1.0) + pressure,
        ];
        // The Cauchy stress is R sigma U R^T over the stretched area. The thickness is that at rest.
        let [r1, r2] = polar.r;
        let area = xx * yy - xy * xy;
        if area <= 0.0 {
            return Mat3::zeros();
        }
        let s = [
            sigma[0] * xx + sigma[1] * xy,
            sigma[0] * xy + sigma[1] * yy,
            sigma[1] * xy + sigma[2] * yy,
        ];
        let scale = 1.0 / (area * self.volume[element]);
        (r1 * r1.transpose() * s[0]
            + (r1 * r2.transpose() + r2 * r1.transpose()) * s[1]
            + r2 * r2.transpose() * s[2])
            * scale
    }

    fn vector_form(&self) -> Option<VectorForm> {
        let triangle = |e: usize| Triangle {
            nodes: self.nodes[e],
            gradients: self.gradients[e],
            frame: self.frames[e],
            strained: self.strained.get(e).copied().unwrap_or_default(),
            mu: self.mu[e],
            lambda: self.lambda[e],
        };
        let triangles = (0..self.nodes.len()).map(triangle).collect();
        Some(VectorForm::CorotationalTriangles(triangles))
    }

    fn boxed(&self) -> Box<dyn Elements> {
        let mut copy = self.clone();
        copy.make_room(self.limit);
        Box::new(copy)
    }

    fn tearable(&self) -> Option<&dyn Tearable> {
        Some(self)
    }

    fn tearable_mut(&mut self) -> Option<&mut dyn Tearable> {
        Some(self)
    }
}

impl Tearable for Membrane {
    fn mass(&self, triangle: usize) -> f64 {
        self.density[triangle] * self.volume[triangle]
    }

    fn rest_shape(&self, triangle: usize) -> Shape {
        shape_of(self.gradients[triangle])
    }

    fn reserve(&mut self, triangles: usize) {
        self.limit = self.nodes.len() + triangles;
        self.make_room(self.limit);
    }

    fn follow(&mut self, torn: &Torn<'_>) {
        self.follow_surface(torn);
    }

    fn strained(&self, triangle: usize, x: &[Vec3]) -> Option<Strained> {
        (triangle < self.nodes.len()).then(|| self.strained_at(triangle, x))
    }
}

/// Part 2 of the tangent: the coefficient of the square of the in-plane spin.
fn spin_coefficient(sigma: &[f64; 3], trace: f64, tangent: Tangent) -> f64 {
    let floor = 2.0 * STRETCH_FLOOR;
    let coefficient = 0.5 * (sigma[0] + sigma[2]) / trace.max(floor);
    match tangent {
        Tangent::Exact => coefficient,
        Tangent::Clipped => coefficient.max(0.0),
    }
}

/// Part 3 of the tangent: `sigma U^-1` or its positive part (xx, xy, yy). Its principal axes are those of `U`.
fn out_of_plane(polar: &Polar, mu: f64, lambda: f64, tangent: Tangent) -> [f64; 3] {
    let stretch = polar.stretches();
    let pressure = lambda * (stretch[0] + stretch[1] - 2.0);
    let value = stretch.map(|stretch| {
        let s = (2.0 * mu * (stretch - 1.0) + pressure) / stretch.max(STRETCH_FLOOR);
        match tangent {
            Tangent::Exact => s,
            Tangent::Clipped => s.max(0.0),
        }
    });
    polar.with_principal(stretch, value)
}
