//! Triangles that follow the edits of a torn surface: the corners, shapes and materials of the triangles that an edit
//! touched.
//!
//! Moduli times volume are in proportion to the area at rest. A new triangle has those of its original triangle per
//! area.

use super::frame::{area_of, gradients_of};
use super::membrane::{Element, Membrane, piola, start};
use super::triangles::Triangles;
use crate::element::torn::{Strained, TearableKernel, Torn, make_room};
use crate::lanes::block::LANES;
use crate::lanes::{Node, Real, to_vec};
use crate::material::Tangent;
use crate::polar::surface::Polar;
use crate::{Mat3, Vec3};

impl Membrane {
    /// Makes room for `limit` triangles in all.
    pub(super) fn make_room(&mut self, limit: usize) {
        make_room(&mut self.nodes, limit);
        make_room(&mut self.gradients, limit);
        make_room(&mut self.frames, limit);
        make_room(&mut self.mu, limit);
        make_room(&mut self.lambda, limit);
        make_room(&mut self.volume, limit);
        make_room(&mut self.density, limit);
        if !self.strained.is_empty() {
            make_room(&mut self.strained, limit);
        }
    }

    /// Follows an edit.
    pub(super) fn follow_surface(&mut self, torn: &Torn<'_>) {
        for &touched in torn.surface.touched() {
            let (e, parent) = (touched as usize, torn.surface.parent(touched) as usize);
            if e == self.nodes.len() {
                self.nodes.push([0; 3]);
                self.gradients.push(self.gradients[parent]);
                self.frames.push(self.frames[parent]);
                self.mu.push(self.mu[parent]);
                self.lambda.push(self.lambda[parent]);
                self.volume.push(self.volume[parent]);
                self.density.push(self.density[parent]);
                if !self.strained.is_empty() {
                    self.strained.push(self.strained[parent]);
                }
            }
            let (gradients, area) = gradients_of(torn.shape(touched));
            let scale = area / area_of(self.gradients[e]);
            self.nodes[e] = torn.nodes(touched);
            self.gradients[e] = gradients;
            self.mu[e] *= scale;
            self.lambda[e] *= scale;
            self.volume[e] *= scale;
            if let Some(strained) = self.strained.get_mut(e) {
                let corners = self.nodes[e].map(|node| &torn.rest[node as usize]);
                (self.frames[e], *strained) = start(corners, gradients);
            }
        }
        // The slots are those of the triangles before the edit.
        self.slots.clear();
    }

    /// The state of triangle `e`.
    pub(super) fn strained_at(&self, e: usize, x: &[Vec3]) -> Strained {
        let [a, b, c] = self.nodes[e].map(|node| x[node as usize]);
        let [g1, g2] = self.gradients[e];
        let gradient = [0, 1].map(|j| (b - a) * g1[j] + (c - a) * g2[j]);
        let polar = Polar::new(&gradient[0], &gradient[1]);
        let over = 1.0 / self.volume[e];
        let (stress, _) = piola(&polar, [self.mu[e] * over, self.lambda[e] * over]);
        let area = area_of(self.gradients[e]);
        Strained {
            gradient,
            stress,
            density: self.energy_of(e, x) * over,
            area,
            thickness: self.volume[e] / area,
        }
    }
}

impl<T: Real> TearableKernel<T> for Triangles<T> {
    fn reserve(&mut self, triangles: usize) {
        let limit = self.count() + triangles;
        let blocks = limit.div_ceil(LANES);
        make_room(&mut self.places, limit);
        make_room(&mut self.blocks.nodes, blocks);
        make_room(&mut self.blocks.rest, blocks);
        make_room(&mut self.blocks.stiffness, blocks);
        make_room(&mut self.blocks.strained, blocks);
        // A touched triangle may be strained at the start by rounding.
        let zero = [[T::ZERO; LANES]; 6];
        self.blocks.strained.resize(self.blocks.nodes.len(), zero);
        // In double precision, so that repeated divisions lose no digits.
        let moduli = |e: usize| {
            let (rest, lane) = self.rest_of(e);
            let area = area_of(self.gradients_at(e));
            [rest.mu[lane], rest.lambda[lane]].map(|modulus| modulus.to_f64() / area)
        };
        self.moduli = (0..self.count()).map(moduli).collect();
    }

    fn follow(&mut self, torn: &Torn<'_>) {
        for &touched in torn.surface.touched() {
            let (e, parent) = (touched as usize, torn.surface.parent(touched) as usize);
            if e == self.places.len() {
                self.push_lane(parent);
            }
            let (block, lane) = self.places[e];
            let (block, lane) = (block as usize, lane as usize);
            let nodes = torn.nodes(touched);
            let corners = nodes.map(|node| &torn.rest[node as usize]);
            let (gradients, area) = gradients_of(torn.shape(touched));
            let (frame, strained) = start(corners, gradients);
            let [mu, lambda] = self.moduli[parent].map(|modulus| T::of(modulus * area));
            let rest = &mut self.blocks.rest[block];
            (rest.mu[lane], rest.lambda[lane]) = (mu, lambda);
            let start = &mut self.blocks.strained[block];
            for a in 0..2 {
                for j in 0..2 {
                    rest.gradients[2 * a + j][lane] = T::of(gradients[a][j]);
                }
                for i in 0..3 {
                    rest.frame[3 * a + i][lane] = T::of(frame[a][i]);
                    start[3 * a + i][lane] = T::of(strained[a][i]);
                }
            }
            self.blocks.nodes[block][lane] = nodes;
        }
    }

    fn local_stiffness(
        &self,
        triangles: &[u32],
        d: &[Node<T>],
        add: &mut dyn FnMut(u32, u32, &Mat3),
    ) {
        for &triangle in triangles {
            let (nodes, blocks) = self.exact_stiffness(triangle as usize, d);
            for (&row, blocks) in nodes.iter().zip(&blocks) {
                for (&column, block) in nodes.iter().zip(blocks) {
                    add(row, column, block);
                }
            }
        }
    }
}

impl<T: Real> Triangles<T> {
    /// Gives a new triangle the next lane. A new block consists of copies of the triangle `like` without stiffness.
    fn push_lane(&mut self, like: usize) {
        let e = self.places.len();
        let (block, lane) = (e / LANES, e % LANES);
        if block == self.blocks.nodes.len() {
            let (from, at) = self.places[like];
            let (from, at) = (from as usize, at as usize);
            let spread = |row: &mut [T; LANES]| *row = [row[at]; LANES];
            let mut rest = self.blocks.rest[from].clone();
            rest.gradients.iter_mut().for_each(spread);
            rest.frame.iter_mut().for_each(spread);
            (rest.mu, rest.lambda) = ([T::ZERO; LANES], [T::ZERO; LANES]);
            let mut strained = self.blocks.strained[from];
            strained.iter_mut().for_each(spread);
            let nodes = [self.blocks.nodes[from][at]; LANES];
            let stiffness = self.blocks.stiffness[from].map(|_| [T::ZERO; LANES]);
            self.blocks.nodes.push(nodes);
            self.blocks.rest.push(rest);
            self.blocks.strained.push(strained);
            self.blocks.stiffness.push(stiffness);
        }
        self.places.push((block as u32, lane as u32));
    }

    fn gradients_at(&self, e: usize) -> [[f64; 2]; 2] {
        let (rest, lane) = self.rest_of(e);
        [0, 1].map(|a| [0, 1].map(|j| rest.gradients[2 * a + j][lane].to_f64()))
    }

    /// The nodes and the stiffness of triangle `e` at displacements `d` (m), by the exact form.
    fn exact_stiffness(&self, e: usize, d: &[Node<T>]) -> ([u32; 3], [[Mat3; 3]; 3]) {
        let (rest, lane) = self.rest_of(e);
        let nodes = self.nodes(e);
        let [a, b, c] = nodes.map(|node| to_vec(&d[node as usize]));
        let [g1, g2] = self.gradients_at(e);
        let strained = self.blocks.strained.get(self.places[e].0 as usize);
        let f = [0, 1].map(|j| {
            let column =
                |rows: &[[T; LANES]; 6]| Vec3::from_fn(|i, _| rows[3 * j + i][lane].to_f64());
            let start = column(&rest.frame) + strained.map_or_else(Vec3::zeros, column);
            start + (b - a) * g1[j] + (c - a) * g2[j]
        });
        let moduli = [rest.mu[lane].to_f64(), rest.lambda[lane].to_f64()];
        let polar = Polar::new(&f[0], &f[1]);
        let element = Element::new(&polar, [g1, g2], moduli, Tangent::Clipped);
        (nodes, element.stiffness)
    }
}
