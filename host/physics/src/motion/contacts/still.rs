//! Contacts of bodies in equilibrium, and the pressure of contacts.
//!
//! A load step of an equilibrium takes the place of a step. Nothing has a velocity, and obstacles stay where they start. In the
//! stiffness of a row, the stiffness of a vertex takes the place of its mass over the square of the step.

use super::parts::Owner;
use super::{ContactReport, Contacts, facets};
use crate::Vec3;
use crate::body::Body;
use crate::contact::Lists;
use crate::contact::kept::Kept;
use crate::linear::block_matrix::BlockMatrix;
use crate::motion::joined::At;
use crate::motion::joint_equation::JointEquation;
use crate::motion::touching::{self, Touch};

/// Length of the step that a load step takes the place of (s): masses are stiffnesses (N/m).
const UNIT: f64 = 1.0;

/// A body in a load step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Still<'a> {
    /// The body.
    pub(crate) body: &'a Body,
    /// The displacements that are predicted, by node (m).
    pub(crate) u: &'a [Vec3],
    /// The stiffness of each node (N/m); infinite for a held one.
    pub(crate) stiffness: &'a [f64],
}

/// What contacts keep.
#[derive(Debug)]
pub(crate) struct StillKept {
    rows: Vec<Kept>,
    facets: facets::Kept,
}

impl Contacts {
    /// Finds the rows of bodies, those of facets up to gaps of `ahead` (m). This may be called again for another prediction. Each
    /// row then has the force of no displacement.
    pub(crate) fn begin_still(&mut self, bodies: &[Still<'_>], ahead: f64) {
        for (part, owner) in self.surfaces.parts.iter().zip(&self.owners) {
            let range = part.vertices.start as usize..part.vertices.end as usize;
            let (x, u) = (&mut self.x[range.clone()], &mut self.u[range.clone()]);
            self.v[range.clone()].fill(Vec3::zeros());
            match owner {
                Owner::Body(body) => {
                    let Still {
                        body,
                        u: by,
                        stiffness,
                    } = bodies[*body];
                    let count = x.len().min(body.node_positions().len());
                    x[..count].copy_from_slice(&body.node_positions()[..count]);
                    u[..count].copy_from_slice(&by[..count]);
                    self.mass[range][..count].copy_from_slice(&stiffness[..count]);
                }
                Owner::Obstacle(number) => {
                    self.obstacles[*number].write_positions(0.0, x);
                    u.fill(Vec3::zeros());
                }
            }
        }
        for (placed, number) in self.shapes.iter_mut().zip(&self.of_shapes) {
            placed.start = self.obstacles[*number].pose(0.0);
            placed.end = placed.start;
        }
        self.find(UNIT);
        let mut touches = core::mem::take(&mut self.touches);
        touching::fill(&mut touches, self.rows.contacts(), &|vertex| {
            self.at(vertex)
        });
        self.touches = touches;
        self.of_row.clear();
        self.of_row.extend(0..self.touches.len());
        let mut facets = core::mem::take(&mut self.facets);
        let at = |vertex| self.at(vertex);
        facets.find(&self.x, &self.mass, ahead, &at);
        self.facets = facets;
        self.report = ContactReport {
            counts: self.lists.as_ref().map(Lists::counts).unwrap_or_default(),
            rows: self.began,
            ..ContactReport::default()
        };
    }

    /// Solves the bodies with their rows. The multipliers are carried on `updates` times.
    pub(crate) fn solve_still<E: JointEquation>(
        &mut self,
        bodies: &mut [Option<E>],
        updates: usize,
    ) {
        if self.facets.touches.is_empty() {
            let (touches, room) = (&mut self.touches, &mut self.room);
            self.report.solved = touching::solve(bodies, touches, updates, room, &mut || false);
            return;
        }
        let facets = self.facets.touches.len();
        let mut all = core::mem::take(&mut self.facets.touches);
        let others = self.touches.iter();
        all.extend(others.map(|touch| Touch::new(touch.nodes.to_vec(), touch.row)));
        let room = &mut self.room;
        self.report.solved = touching::solve(bodies, &mut all, updates, room, &mut || false);
        for (touch, solved) in self.touches.iter_mut().zip(all.drain(facets..)) {
            (touch.row, touch.response) = (solved.row, solved.response);
        }
        self.facets.touches = all;
    }

    /// Finds the fractions of the displacements with which nothing crosses. Returns how many vertices have less than the whole.
    pub(crate) fn shorten_still(&mut self, displacements: &[&[Vec3]]) -> usize {
        for (part, owner) in self.surfaces.parts.iter().zip(&self.owners) {
            if let Owner::Body(body) = owner {
                let u = &mut self.u[part.vertices.start as usize..part.vertices.end as usize];
                let count = u.len().min(displacements[*body].len());
                u[..count].copy_from_slice(&displacements[*body][..count]);
            }
        }
        self.shorten();
        self.fractions.iter().filter(|part| **part < 1.0).count()
    }

    /// The fractions of the nodes of a body; those of nodes that are not listed are 1.
    pub(crate) fn fractions(&self, body: usize) -> &[f64] {
        match self.part_of_body(body) {
            Some(part) => {
                let vertices = &self.surfaces.parts[part].vertices;
                &self.fractions[vertices.start as usize..vertices.end as usize]
            }
            None => &[],
        }
    }

    /// Keeps the forces of the solution for the next load step.
    pub(crate) fn end_still(&mut self) {
        self.sum_up();
        self.facets.keep();
    }

    /// Calls `add` with the force of each contact on each of its nodes (N).
    pub(crate) fn each_force(&self, add: &mut dyn FnMut(At, Vec3)) {
        for touch in &self.touches {
            touch.add(&touch.force(), add);
        }
        for touch in &self.facets.touches {
            touch.add(&touch.force(), add);
        }
    }

    /// Adds the stiffness of contacts of a body to its `matrix`, in which each node has its place: of those with obstacles, or of
    /// `all`. The coupling to other bodies is left out.
    pub(crate) fn stiffen(&self, body: usize, all: bool, places: &[u32], matrix: &mut BlockMatrix) {
        for touch in &self.touches {
            // The weights of both feet add up to zero, and an obstacle has no node.
            let sum: f64 = touch.nodes.iter().map(|(_, weight)| weight).sum();
            if !all && sum.abs() < 0.5 {
                continue;
            }
            let tangent = touch.row.tangent(&touch.response);
            let free = matrix.free();
            let own = touch.nodes.map(|(at, weight)| {
                let is_own = at.body == body && weight != 0.0;
                let place = is_own.then(|| places[at.node as usize])?;
                ((place as usize) < free).then_some((place, weight))
            });
            for (row, by) in own.iter().flatten() {
                for (column, weight) in own.iter().flatten() {
                    if let Some(slot) = matrix.slot(*row, *column) {
                        matrix.add(slot, &(tangent * (by * weight)));
                    }
                }
            }
        }
        // The nodes of facets are no neighbours in the matrix. The sum of each row stands on its diagonal, as large as the
        // row for a translation and larger otherwise.
        for touch in self.facets.touches.iter().filter(|_| all) {
            let tangent = touch.row.tangent(&touch.response);
            let own = || touch.nodes.iter().filter(|(at, _)| at.body == body);
            let sum: f64 = own().map(|(_, weight)| weight.abs()).sum();
            for (at, weight) in own() {
                let place = places[at.node as usize];
                if (place as usize) < matrix.free()
                    && let Some(slot) = matrix.slot(place, place)
                {
                    matrix.add(slot, &(tangent * (weight.abs() * sum)));
                }
            }
        }
    }

    /// What the contacts keep.
    pub(crate) fn kept(&self) -> StillKept {
        StillKept {
            rows: self.rows.kept(),
            facets: self.facets.kept.clone(),
        }
    }

    /// Takes back what contacts kept at another time.
    pub(crate) fn go_back_to(&mut self, kept: StillKept) {
        self.rows.go_back_to(&kept.rows);
        self.facets.kept = kept.facets;
    }

    fn part_of_body(&self, body: usize) -> Option<usize> {
        (self.owners.iter()).position(|owner| *owner == Owner::Body(body))
    }

    /// Adds what the contacts of the last step press on each vertex of a body to `found`, which is empty.
    pub fn press(&self, body: usize, found: &mut Vec<Pressed>) {
        let Some(part) = self
            .part_of_body(body)
            .map(|part| &self.surfaces.parts[part])
        else {
            return;
        };
        found.resize(part.vertices.len(), Pressed::default());
        for touch in &self.touches {
            let own = (touch.nodes.iter()).filter(|(at, weight)| at.body == body && *weight != 0.0);
            for (at, weight) in own {
                let pressed = &mut found[at.node as usize];
                let force = touch.response.normal * weight.abs();
                pressed.force += force;
                // A sheet between two things is pressed from both sides.
                let normal = touch.row.normal * force;
                let is_other = pressed.direction.dot(&normal) < 0.0;
                pressed.direction += if is_other { -normal } else { normal };
            }
        }
        let at = |vertex: u32| &self.x[vertex as usize];
        let mut share = |vertices: &[u32], area: &dyn Fn(&Vec3) -> f64| {
            for vertex in vertices {
                let own = &mut found[(vertex - part.vertices.start) as usize];
                own.area += area(&own.direction) / vertices.len() as f64;
            }
        };
        for number in part.triangles.clone() {
            let corners = self.surfaces.triangles[number as usize];
            let [a, b, c] = corners.map(at);
            let whole = 0.5 * (b - a).cross(&(c - a));
            share(&corners, &|direction| {
                let along = direction.try_normalize(0.0);
                along.map_or_else(|| whole.norm(), |along| whole.dot(&along).abs())
            });
        }
        if part.triangles.is_empty() {
            for number in part.edges.clone() {
                let ends = self.surfaces.edges[number as usize];
                let [a, b] = ends.map(at);
                let area = 2.0 * part.radius * (b - a).norm();
                share(&ends, &|_| area);
            }
        }
        self.facets.press(body, part.vertices.start, found);
    }
}

/// What contacts press on a vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pressed {
    /// The sum of the normal forces on the vertex, by size (N); of facets, what their pressure there presses on `area`.
    pub force: f64,
    /// A third of the area of its triangles, seen along `direction`, or half of that of the segments of a thread, as wide as
    /// their diameter (m²); 0 inside a solid.
    pub area: f64,
    /// The direction of the normal forces; zero without contacts of vertices and edges.
    pub direction: Vec3,
}

impl Pressed {
    /// Force over area (Pa); 0 without an area.
    pub fn pressure(&self) -> f64 {
        if self.area > 0.0 {
            self.force / self.area
        } else {
            0.0
        }
    }
}
