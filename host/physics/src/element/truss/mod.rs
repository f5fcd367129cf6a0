//! Trusses: threads, sutures and nets of bars. Each bar has two nodes and resists along its axis alone.
//!
//! [`bar`](self) has the equations of one bar. [`Truss`] is their sum over a mesh of lines, with the interface to a
//! body ([`Elements`]). The realtime step uses the assembled matrix of a truss.
//!
//! Mass is lumped: each node of a bar has half of its mass. Damping is the body's, `alpha M + beta K`.

mod bar;

use super::elements::{Elements, placed, renumber, slots};
use crate::error::BodyError;
use crate::linear::block_matrix::{BlockMatrix, ElementSlots};
use crate::material::{Tangent, ThreadMaterial};
use crate::mesh::LineMesh;
use crate::{Mat3, Vec3};
use bar::Bar;

/// All bars of a body, as arrays over bars.
#[derive(Clone, Debug)]
pub struct Truss {
    nodes: Vec<[u32; 2]>,
    bars: Vec<Bar>,
    /// Cross-section at rest (m^2).
    areas: Vec<f64>,
    /// Mass (kg).
    masses: Vec<f64>,
    slots: Vec<ElementSlots<2>>,
}

impl Truss {
    /// Builds bars from the lines of `mesh`, with nodes numbered as vertices. `materials` holds one material for all
    /// lines or one for each.
    ///
    /// # Errors
    /// [`BodyError`] for a mesh without lines, a material out of range, and a line without length or with a vertex that
    /// does not exist.
    pub fn new(mesh: &LineMesh, materials: &[ThreadMaterial]) -> Result<Self, BodyError> {
        let lines = mesh.lines.len();
        if lines == 0 {
            return Err(BodyError::Empty);
        }
        if materials.len() != 1 && materials.len() != lines {
            return Err(BodyError::MaterialCount {
                found: materials.len(),
                elements: lines,
            });
        }
        for (line, material) in materials.iter().enumerate() {
            material.check(line)?;
        }
        let count = mesh.positions.len();
        let mut truss = Self {
            nodes: mesh.lines.clone(),
            bars: Vec::with_capacity(lines),
            areas: Vec::with_capacity(lines),
            masses: Vec::with_capacity(lines),
            slots: Vec::new(),
        };
        for (line, ends) in mesh.lines.iter().enumerate() {
            if let Some(&vertex) = ends.iter().find(|&&vertex| vertex as usize >= count) {
                return Err(BodyError::ElementVertex {
                    element: line,
                    vertex,
                    count,
                });
            }
            let [a, b] = ends.map(|vertex| mesh.positions[vertex as usize]);
            let rest = (b - a).norm();
            let material = &materials[if materials.len() == 1 { 0 } else { line }];
            let stiffness = material.young * material.area / rest;
            // A length that is not a number, or so small that the stiffness overflows, is refused as well.
            if !(rest > 0.0 && stiffness.is_finite()) {
                return Err(BodyError::NoLength { line, length: rest });
            }
            truss.bars.push(Bar {
                stiffness,
                rest,
                tension_only: material.tension_only,
            });
            truss.areas.push(material.area);
            truss.masses.push(material.density * material.area * rest);
        }
        Ok(truss)
    }

    fn ends(&self, bar: usize, x: &[Vec3]) -> [Vec3; 2] {
        self.nodes[bar].map(|node| x[node as usize])
    }
}

impl Elements for Truss {
    fn count(&self) -> usize {
        self.nodes.len()
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
        for (nodes, whole) in self.nodes.iter().zip(&self.masses) {
            for &node in nodes {
                mass[node as usize] += 0.5 * whole;
                load[node as usize] += 0.5 * whole;
            }
        }
    }

    fn energy(&self, x: &[Vec3]) -> f64 {
        let mut energy = 0.0;
        for (number, bar) in self.bars.iter().enumerate() {
            let [a, b] = self.ends(number, x);
            energy += bar.energy(&bar.between(&a, &b));
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
        for (number, slots) in self.slots.iter().enumerate() {
            let [a, b] = self.ends(number, x);
            let bar = &self.bars[number];
            let at = bar.between(&a, &b);
            let pull = at.axis * bar.tension(&at);
            let [first, second] = self.nodes[number];
            force[first as usize] += pull;
            force[second as usize] -= pull;
            let own = bar.tangent(&at, tangent);
            let other = -own;
            stiffness.add(slots[0][0], &own);
            stiffness.add(slots[0][1], &other);
            stiffness.add(slots[1][0], &other);
            stiffness.add(slots[1][1], &own);
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.bars.as_slice())
            + size_of_val(self.areas.as_slice())
            + size_of_val(self.masses.as_slice())
            + size_of_val(self.slots.as_slice())
    }

    /// Always 0: a bar has no volume.
    fn inverted(&self, _: &[Vec3]) -> usize {
        0
    }

    /// Tension over the cross-section at rest, along the axis (Pa).
    fn stress(&self, element: usize, x: &[Vec3]) -> Mat3 {
        let [a, b] = self.ends(element, x);
        let bar = &self.bars[element];
        let at = bar.between(&a, &b);
        at.axis * at.axis.transpose() * (bar.tension(&at) / self.areas[element])
    }

    fn boxed(&self) -> Box<dyn Elements> {
        Box::new(self.clone())
    }
}
