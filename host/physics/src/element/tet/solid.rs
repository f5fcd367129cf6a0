//! Tetrahedra of an elastic solid: a shape, a law, and arrays over elements.
//!
//! The formulation is total Lagrangian (Bonet and Wood, "Nonlinear continuum mechanics for finite element analysis",
//! 2008, chapter 9). At each quadrature point the deformation gradient is `F = sum x_a g_a^T` with the rest gradients
//! `g_a` of the shape functions. The force is `f_a = -sum w P g_a` with the first Piola-Kirchhoff stress `P` of the
//! law. The stiffness is the modulus of the law between the gradients. All laws are integrated alike. The rotation of
//! the corotational law is that of the quadrature point, which for a linear tetrahedron is the rotation of the element
//! (Müller and Gross, "Interactive virtual materials", 2004, with the exact tangent).

use super::cell::Tetrahedron;
use super::shape::Shape;
use crate::element::VectorForm;
use crate::element::elements::{Elements, placed, renumber, slots};
use crate::error::BodyError;
use crate::linear::block_matrix::BlockMatrix;
use crate::material::SolidMaterial;
use crate::material::Tangent;
use crate::material::law::{Lame, Law, Modulus};
use crate::mesh::tet::MIDSIDE_ENDS;
use crate::{Mat3, Vec3};
use core::marker::PhantomData;

/// A tetrahedron whose volume is below this fraction of the cube of its longest edge has no usable gradients.
const FLAT: f64 = 1e-12;

/// Elements of shape `S` and law `L`, by arrays over elements.
#[derive(Clone, Debug)]
pub struct Solid<const N: usize, const Q: usize, S, L> {
    law: L,
    nodes: Vec<[u32; N]>,
    /// Rest gradients of the shape functions at each point (1/m).
    gradients: Vec<[[Vec3; N]; Q]>,
    /// Rest volume of each point (m^3).
    volumes: Vec<[f64; Q]>,
    lame: Vec<Lame>,
    density: Vec<f64>,
    slots: Vec<[[u32; N]; N]>,
    shape: PhantomData<S>,
}

/// Rest gradients and volumes of an element, or `None` if it is flat or inverted.
fn rest<const N: usize, const Q: usize, S: Shape<N, Q>>(
    x: &[Vec3; N],
) -> Option<([[Vec3; N]; Q], [f64; Q])> {
    let longest = (0..4)
        .flat_map(|a| (0..a).map(move |b| (x[a] - x[b]).norm()))
        .fold(0.0, f64::max);
    let mut gradients = [[Vec3::zeros(); N]; Q];
    let mut volumes = [0.0; Q];
    for (q, at) in S::points().iter().enumerate() {
        let slopes = S::gradients(at);
        // Differences from the first vertex lose no digits far from the origin.
        let mut jacobian = Mat3::zeros();
        for (x_a, slope) in x.iter().zip(&slopes) {
            jacobian += (x_a - x[0]) * slope.transpose();
        }
        let determinant = jacobian.determinant();
        if determinant.is_nan() || determinant <= FLAT * longest * longest * longest {
            return None;
        }
        let inverse = jacobian.try_inverse()?;
        for (gradient, slope) in gradients[q].iter_mut().zip(&slopes) {
            *gradient = inverse.tr_mul(slope);
        }
        volumes[q] = determinant / (6.0 * Q as f64);
    }
    Some((gradients, volumes))
}

impl<const N: usize, const Q: usize, S: Shape<N, Q>, L: Law> Solid<N, Q, S, L> {
    /// The elements `cells` of rest positions `positions`, with one material for all or one for each.
    ///
    /// # Errors
    ///
    /// [`BodyError`] for a material out of range and for a cell that is flat, is inverted or names a vertex that does
    /// not exist.
    pub fn new(
        law: L,
        positions: &[Vec3],
        cells: &[[u32; N]],
        materials: &[SolidMaterial],
    ) -> Result<Self, BodyError> {
        if materials.len() != 1 && materials.len() != cells.len() {
            return Err(BodyError::MaterialCount {
                found: materials.len(),
                elements: cells.len(),
            });
        }
        for (element, material) in materials.iter().enumerate() {
            material.check(element)?;
        }
        let mut solid = Self {
            law,
            nodes: Vec::with_capacity(cells.len()),
            gradients: Vec::with_capacity(cells.len()),
            volumes: Vec::with_capacity(cells.len()),
            lame: Vec::with_capacity(cells.len()),
            density: Vec::with_capacity(cells.len()),
            slots: Vec::new(),
            shape: PhantomData,
        };
        for (element, cell) in cells.iter().enumerate() {
            let mut x = [Vec3::zeros(); N];
            for (x, &vertex) in x.iter_mut().zip(cell) {
                let Some(&position) = positions.get(vertex as usize) else {
                    return Err(BodyError::ElementVertex {
                        element,
                        vertex,
                        count: positions.len(),
                    });
                };
                *x = position;
            }
            let Some((gradients, volumes)) = rest::<N, Q, S>(&x) else {
                return Err(BodyError::FlatCell { cell: element });
            };
            let material = &materials[if materials.len() == 1 { 0 } else { element }];
            solid.nodes.push(*cell);
            solid.gradients.push(gradients);
            solid.volumes.push(volumes);
            solid.lame.push(Lame::new(material.young, material.poisson));
            solid.density.push(material.density);
        }
        Ok(solid)
    }

    fn at(&self, element: usize, x: &[Vec3]) -> [Vec3; N] {
        self.nodes[element].map(|node| x[node as usize])
    }

    /// Rest volume of an element (m^3).
    pub fn volume(&self, element: usize) -> f64 {
        self.volumes[element].iter().sum()
    }

    /// Deformation gradient of an element at each of its quadrature points, at node positions `x`.
    pub fn deformation(&self, element: usize, x: &[Vec3]) -> [Mat3; Q] {
        let x = self.at(element, x);
        core::array::from_fn(|q| deformation(&self.gradients[element][q], &x))
    }

    /// The elements as those of a kernel, or `None` if they do not have `M` nodes and `P` points.
    fn tets<const M: usize, const P: usize>(&self) -> Option<Vec<Tetrahedron<M, P>>> {
        if (N, Q) != (M, P) {
            return None;
        }
        let tet = |element: usize| {
            // The shape functions reproduce a barycentric coordinate, a linear field: it is 1 at its corner and 1/2 at
            // the middles of the edges that meet there.
            let coordinates = |gradients: &[Vec3; N]| {
                [1, 2, 3].map(|corner| {
                    let ends = gradients[4..].iter().zip(MIDSIDE_ENDS);
                    let middles = ends.filter(|(_, ends)| ends.contains(&corner));
                    gradients[corner] + middles.map(|(gradient, _)| gradient).sum::<Vec3>() * 0.5
                })
            };
            Some(Tetrahedron {
                nodes: *self.nodes[element].first_chunk()?,
                gradients: *self.gradients[element]
                    .each_ref()
                    .map(coordinates)
                    .first_chunk()?,
                volumes: *self.volumes[element].first_chunk()?,
                lambda: self.lame[element].lambda,
                mu: self.lame[element].mu,
            })
        };
        (0..self.nodes.len()).map(tet).collect()
    }
}

/// `sum x_a g_a^T` by differences from the first node, since the gradients sum to zero.
#[inline]
fn deformation<const N: usize>(gradients: &[Vec3; N], x: &[Vec3; N]) -> Mat3 {
    let mut f = Mat3::zeros();
    for a in 1..N {
        f += (x[a] - x[0]) * gradients[a].transpose();
    }
    f
}

/// Adds `weight g_a[j] g_b[l] modulus[j][l]` to the blocks above the diagonal.
#[inline]
fn add_stiffness<const N: usize>(
    blocks: &mut [[Mat3; N]; N],
    modulus: &Modulus,
    gradients: &[Vec3; N],
    weight: f64,
) {
    for b in 1..N {
        let g = gradients[b] * weight;
        let column: [Mat3; 3] = core::array::from_fn(|j| {
            modulus[j][0] * g.x + modulus[j][1] * g.y + modulus[j][2] * g.z
        });
        for a in 0..b {
            let g = &gradients[a];
            blocks[a][b] += column[0] * g.x + column[1] * g.y + column[2] * g.z;
        }
    }
}

impl<const N: usize, const Q: usize, S: Shape<N, Q> + 'static, L: Law> Elements
    for Solid<N, Q, S, L>
{
    fn count(&self) -> usize {
        self.nodes.len()
    }

    fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.gradients.as_slice())
            + size_of_val(self.volumes.as_slice())
            + size_of_val(self.lame.as_slice())
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
        let (lumping, weights) = (S::lumping(), S::weights());
        for (element, nodes) in self.nodes.iter().enumerate() {
            let whole = self.density[element] * self.volume(element);
            for (a, &node) in nodes.iter().enumerate() {
                mass[node as usize] += whole * lumping[a];
                load[node as usize] += whole * weights[a];
            }
        }
    }

    fn energy(&self, x: &[Vec3]) -> f64 {
        let mut energy = 0.0;
        for element in 0..self.nodes.len() {
            let x = self.at(element, x);
            for (gradients, volume) in self.gradients[element].iter().zip(&self.volumes[element]) {
                let f = deformation(gradients, &x);
                energy += volume * self.law.energy(self.lame[element], &f);
            }
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
        for (element, slots) in self.slots.iter().enumerate() {
            let x = self.at(element, x);
            let mut forces = [Vec3::zeros(); N];
            let mut blocks = [[Mat3::zeros(); N]; N];
            for (gradients, &volume) in self.gradients[element].iter().zip(&self.volumes[element]) {
                let f = deformation(gradients, &x);
                let response = self.law.respond(self.lame[element], &f, tangent);
                for a in 1..N {
                    forces[a] -= response.stress * (gradients[a] * volume);
                }
                add_stiffness(&mut blocks, &response.modulus, gradients, volume);
            }
            // The gradients sum to zero, so the remaining blocks and forces are minus sums. A translation then gives
            // no force, and the forces have no resultant, not even by rounding.
            forces[0] = -forces[1..].iter().sum::<Vec3>();
            for a in 0..N {
                force[self.nodes[element][a] as usize] += forces[a];
                let mut diagonal = Mat3::zeros();
                for b in 0..N {
                    let block = match a.cmp(&b) {
                        core::cmp::Ordering::Less => blocks[a][b],
                        core::cmp::Ordering::Equal => continue,
                        core::cmp::Ordering::Greater => blocks[b][a].transpose(),
                    };
                    diagonal -= block;
                    stiffness.add(slots[a][b], &block);
                }
                stiffness.add(slots[a][a], &diagonal);
            }
        }
    }

    fn inverted(&self, x: &[Vec3]) -> usize {
        (0..self.nodes.len())
            .filter(|&element| {
                let deformation = self.deformation(element, x);
                deformation.iter().any(|f| f.determinant() <= 0.0)
            })
            .count()
    }

    fn stress(&self, element: usize, x: &[Vec3]) -> Mat3 {
        let mut sum = Mat3::zeros();
        let mut volume = 0.0;
        for (f, &rest) in self
            .deformation(element, x)
            .iter()
            .zip(&self.volumes[element])
        {
            // The weight is the present volume, whose sign cancels. The mean is defined for a collapsed element as
            // well.
            sum += self.law.stress(self.lame[element], f) * f.transpose() * rest;
            volume += rest * f.determinant();
        }
        if volume == 0.0 {
            Mat3::zeros()
        } else {
            sum / volume
        }
    }

    fn vector_form(&self) -> Option<VectorForm> {
        let (frame, law) = (L::FRAME, L::ISOTROPIC);
        if let Some(tets) = self.tets() {
            return match frame {
                Some(frame) => Some(VectorForm::HookeanTets(frame, tets)),
                None => Some(VectorForm::IsotropicTets(law?, tets)),
            };
        }
        let tets = self.tets()?;
        match frame {
            Some(frame) => Some(VectorForm::HookeanQuadraticTets(frame, tets)),
            None => Some(VectorForm::IsotropicQuadraticTets(law?, tets)),
        }
    }

    fn boxed(&self) -> Box<dyn Elements> {
        Box::new(self.clone())
    }
}
