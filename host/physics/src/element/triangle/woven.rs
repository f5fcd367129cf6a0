//! In-plane elasticity of a woven sheet: constant-strain triangles with any [`SheetLaw`].
//!
//! With a flat pattern the warp is a direction in the plane of the pattern.
//!
//! This module is the counterpart of [`Membrane`](crate::element::triangle::membrane::Membrane) for cloth and for other
//! laws. Each triangle has an orthonormal rest frame whose first axis is the warp, projected onto its plane. With
//! the gradients `g_a` of the hat functions in that frame the deformation gradient is `F = sum x_a g_a^T`,
//! the force `f_a = -A P g_a` and the stiffness `K_ab = A sum_jl g_a[j] g_b[l] dP_j / dF_l` (Bonet and Wood,
//! "Nonlinear continuum mechanics for finite element analysis", chapter Discretization and solution).

use super::frame::{degenerate, rest_corners, rest_frame};
use super::membrane::Element;
use crate::element::elements::{Elements, placed, renumber, slots};
use crate::error::BodyError;
use crate::linear::block_matrix::{BlockMatrix, ElementSlots};
use crate::material::Tangent;
use crate::material::sheet_law::{PlaneStiffness, SheetLaw};
use crate::material::weave::{Weave, unit};
use crate::mesh::TriMesh;
use crate::{Mat3, Vec3};

/// The least sine of the angle between the warp and a triangle's normal. Below it, the projection of the warp onto the
/// plane of the triangle has no meaningful direction.
const LEAST_WARP: f64 = 1e-6;

/// All triangles of a woven sheet, by arrays over triangles.
///
/// The node positions `x` that methods take must have an entry for every node that was pushed.
#[derive(Clone, Debug, Default)]
pub struct Woven<L: SheetLaw> {
    law: L,
    nodes: Vec<[u32; 3]>,
    /// Rest gradients of the second and third hat function in the frame of the warp (1/m). The first gradient is
    /// minus their sum.
    gradients: Vec<[[f64; 2]; 2]>,
    /// Rest area (m^2).
    area: Vec<f64>,
    stiffness: Vec<PlaneStiffness>,
    thickness: Vec<f64>,
    density: Vec<f64>,
    slots: Vec<ElementSlots<3>>,
}

impl<L: SheetLaw> Woven<L> {
    /// An empty sheet with room for `count` triangles.
    pub fn with_capacity(count: usize) -> Self {
        Self {
            law: L::default(),
            nodes: Vec::with_capacity(count),
            gradients: Vec::with_capacity(count),
            area: Vec::with_capacity(count),
            stiffness: Vec::with_capacity(count),
            thickness: Vec::with_capacity(count),
            density: Vec::with_capacity(count),
            slots: Vec::new(),
        }
    }

    /// The triangles of `mesh` over its vertices, with one material for all or one for each.
    ///
    /// # Errors
    ///
    /// [`BodyError`] for no triangles, for a vertex that does not exist, and the errors of [`push`](Self::push).
    pub fn new(mesh: &TriMesh, weaves: &[Weave]) -> Result<Self, BodyError> {
        let (triangles, count) = (mesh.triangles.len(), mesh.positions.len());
        if triangles == 0 {
            return Err(BodyError::Empty);
        }
        if weaves.len() != 1 && weaves.len() != triangles {
            return Err(BodyError::MaterialCount {
                found: weaves.len(),
                elements: triangles,
            });
        }
        mesh.check_pattern()?;
        let mut woven = Self::with_capacity(triangles);
        for (element, vertices) in mesh.triangles.iter().enumerate() {
            if let Some(&vertex) = vertices.iter().find(|&&vertex| vertex as usize >= count) {
                return Err(BodyError::ElementVertex {
                    element,
                    vertex,
                    count,
                });
            }
            let corners = vertices.map(|vertex| &mesh.positions[vertex as usize]);
            let weave = &weaves[if weaves.len() == 1 { 0 } else { element }];
            match rest_corners(mesh, element) {
                Some(flat) => {
                    // The triangle has to have a plane at the start, too.
                    rest_frame(corners).ok_or_else(|| degenerate(element, corners))?;
                    woven.push(*vertices, flat.each_ref(), weave)?
                }
                None => woven.push(*vertices, corners, weave)?,
            };
        }
        Ok(woven)
    }

    /// Adds a triangle by its nodes, its corners at rest (m) and its material. Returns its rest area (m^2).
    ///
    /// # Errors
    ///
    /// [`BodyError`], which names the triangle by its number in this sheet. After an error the sheet is unchanged. The
    /// errors are [`Degenerate`](BodyError::Degenerate) for a triangle without area, those of [`Weave::check`], and
    /// [`Warp`](BodyError::Warp) if the warp is within 1e-6 rad of the triangle's normal.
    pub fn push(
        &mut self,
        nodes: [u32; 3],
        corners: [&Vec3; 3],
        weave: &Weave,
    ) -> Result<f64, BodyError> {
        let triangle = self.nodes.len();
        weave.check(triangle)?;
        let stiffness = weave.stiffness(triangle)?;
        let (gradients, area) = rest_frame(corners).ok_or_else(|| degenerate(triangle, corners))?;
        let [c, s] = warp_in_frame(triangle, corners, &weave.warp)?;
        self.nodes.push(nodes);
        // The change from the frame along the first edge to the frame along the warp.
        self.gradients
            .push(gradients.map(|g| [c * g[0] + s * g[1], c * g[1] - s * g[0]]));
        self.area.push(area);
        self.stiffness.push(stiffness);
        self.thickness.push(weave.thickness);
        self.density.push(weave.density);
        Ok(area)
    }

    /// The two columns of the deformation gradient of triangle `e`, along the warp and the weft.
    pub fn gradient(&self, e: usize, x: &[Vec3]) -> [Vec3; 2] {
        let [a, b, c] = self.nodes[e].map(|node| x[node as usize]);
        let [g1, g2] = self.gradients[e];
        let (e1, e2) = (b - a, c - a);
        [e1 * g1[0] + e2 * g2[0], e1 * g1[1] + e2 * g2[1]]
    }

    /// Force and tangent of triangle `e` at node positions `x`.
    pub fn element(&self, e: usize, x: &[Vec3], tangent: Tangent) -> Element {
        let gradient = self.gradient(e, x);
        let response = self.law.respond(&self.stiffness[e], &gradient, tangent);
        let [[m00, m01], [m10, m11]] = response.modulus;
        let area = self.area[e];
        let [g1, g2] = self.gradients[e];
        let g0 = [-g1[0] - g2[0], -g1[1] - g2[1]];
        let block = |a: [f64; 2], b: [f64; 2]| {
            m00 * (area * a[0] * b[0])
                + m01 * (area * a[0] * b[1])
                + m10 * (area * a[1] * b[0])
                + m11 * (area * a[1] * b[1])
        };
        // The gradients sum to zero, so the diagonal blocks are minus the sums of their rows. A
        // translation then gives no force, not even by rounding.
        let k01 = block(g0, g1);
        let k02 = block(g0, g2);
        let k12 = block(g1, g2);
        let (k10, k20, k21) = (k01.transpose(), k02.transpose(), k12.transpose());
        // `-A P g_a` for the second and the third vertex.
        let [s1, s2] = response.stress;
        let [f1, f2] = [g1, g2].map(|g| s1 * (-area * g[0]) + s2 * (-area * g[1]));
        Element {
            force: [-(f1 + f2), f1, f2],
            stiffness: [
                [-(k01 + k02), k01, k02],
                [k10, -(k10 + k12), k12],
                [k20, k21, -(k20 + k21)],
            ],
        }
    }
}

/// Cosine and sine of the angle from the first edge to the warp in the plane of the triangle.
///
/// # Errors
///
/// [`BodyError::Warp`].
pub(crate) fn warp_in_frame(
    triangle: usize,
    corners: [&Vec3; 3],
    warp: &Vec3,
) -> Result<[f64; 2], BodyError> {
    let none = |sine| BodyError::Warp {
        triangle,
        fraction: sine,
    };
    let warp = unit(warp).ok_or_else(|| none(f64::NAN))?;
    let along = (corners[1] - corners[0]).normalize();
    let normal = along.cross(&(corners[2] - corners[0])).normalize();
    let (x, y) = (warp.dot(&along), warp.dot(&normal.cross(&along)));
    let sine = libm::hypot(x, y);
    if sine > LEAST_WARP {
        Ok([x / sine, y / sine])
    } else {
        Err(none(sine))
    }
}

impl<L: SheetLaw> Elements for Woven<L> {
    fn count(&self) -> usize {
        self.nodes.len()
    }

    fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.gradients.as_slice())
            + size_of_val(self.area.as_slice())
            + size_of_val(self.stiffness.as_slice())
            + size_of_val(self.thickness.as_slice())
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
            let third = self.density[e] * self.thickness[e] * self.area[e] / 3.0;
            for &node in nodes {
                mass[node as usize] += third;
                load[node as usize] += third;
            }
        }
    }

    fn energy(&self, x: &[Vec3]) -> f64 {
        (0..self.count())
            .map(|e| self.area[e] * self.law.energy(&self.stiffness[e], &self.gradient(e, x)))
            .sum()
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

    /// Cauchy stress over the stretched area. The thickness is that at rest.
    fn stress(&self, element: usize, x: &[Vec3]) -> Mat3 {
        let [f1, f2] = self.gradient(element, x);
        let [p1, p2] = self.law.stress(&self.stiffness[element], &[f1, f2]);
        let area = f1.cross(&f2).norm();
        if area > 0.0 {
            (p1 * f1.transpose() + p2 * f2.transpose()) / (area * self.thickness[element])
        } else {
            Mat3::zeros()
        }
    }

    fn boxed(&self) -> Box<dyn Elements> {
        Box::new(self.clone())
    }
}
