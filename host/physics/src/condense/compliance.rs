//! The compliance of points of a surface: how far each one gives way to a force at each other.
//!
//! A tool in the tick presses on points of a body, the **sites**, and the body yields to it until the next publication. The force on
//! a site is spread over nodes by weights, its [`Footprint`], and the displacement of the site is the mean of theirs by the same
//! weights: a single node gives way to a force more than the area for which it stands. With `J` the rows of the sites and `A = M / t^2 + C / t + K` at the publication period `t`, the shapes of the sites are `U = A^-1 J^T`,
//! and their values at the sites `S = J U`. The elastic compliance of the sites in the space of the shapes is
//!
//! ```text
//! W = S (U^T K U)^-1 S
//! ```
//!
//! It is the inverse of the stiffness to which `condenser` would condense the body if each site were a handle. It has no inertia
//! and no damping, which a hand would feel as a spring. With the factors `a` of mass and `b` of stiffness in `A`,
//! `U^T K U = (S - a U^T M U) / b`, so that no product with the elements is needed.
//!
//! **Loose pieces.** The rigid motions `R` of a piece that nothing holds (`loose`) are exact and known beforehand. They are taken out of
//! the shapes, whose errors would else be amplified by them. The inertia of one publication resists them, which adds `t^2 J R R^T J^T` to
//! `W`. The contacts of the piece with other things join `J` with the rows of their resultant (`hold`), and are then eliminated.
//!
//! **Slow motions.** Where the elastic forces vanish, as those of a hanging cloth do, inertia alone resists
//! in the time of a publication. The motions come apart in the eigenvectors `V` of `L^-1 U^T M U L^-T`, with `S = L L^T`: one of
//! eigenvalue `m` has the inertia `m`, and the stiffness `(1 - a m) / b`. Its stiffness is taken as at least `m / t^2`, the inertia of
//! one publication. The time `t` is at least [`LEAST_TIME`].
//!
//! The shapes are kept from one publication to the next, as those of handles are (`shapes`): a site that is new is computed at
//! once, the others in turn.

use super::hold::{Held, PATTERNS, patterns};
use super::loose::{Loose, MOTIONS};
use super::shapes::{ShapeOptions, ShapeReport};
use crate::body::Body;
use crate::element::precision::Precision;
use crate::error::CondenseError;
use crate::lanes::{to_node, to_vec};
use crate::linear::dense::{Eigen, Square};
use crate::motion::stepper::{Limits, Solved, Stepper, StepperReport};
use crate::{Mat3, Mat6, Vec3};

/// The least pivot of `S`, as a fraction of its diagonal: what the iterations leave tells no two sites apart.
const LEAST_PIVOT: f64 = 1e-6;
/// The least pivot of `S`, as a fraction of its diagonal, that tells two sites apart beyond the errors of the shapes; and the fractions of the
/// diagonal that are added in turn until all pivots do.
const LEAST_TOLD: f64 = 1e-4;
const MORE: [f64; 5] = [0.0, 1e-3, 1e-2, 3e-2, 1e-1];
/// The least time (s) of the shapes. In a shorter time a force reaches the surroundings of a site only, and the shapes are too
/// stiff for a hand that presses: with one millisecond, the force was wrong by a quarter.
const LEAST_TIME: f64 = 1.0 / 60.0;
/// The error of a compliance, as a fraction of the largest one, by which the stiffness of a resultant is bounded.
const ERROR: f64 = 1e-2;
/// The most of this error, as a fraction of the compliance of the stiffest spring.
const SLIGHT: f64 = 0.1;
/// The least number of iterations that the first computation of a shape may take.
const FIRST_ITERATIONS: usize = 200;

/// The nodes over which a force on a site is spread.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Footprint {
    /// The node of the site.
    pub node: u32,
    /// Nodes with their weights (1), which sum to one.
    pub weights: Vec<(u32, f64)>,
}

impl Footprint {
    /// The node alone.
    pub fn of(node: u32) -> Self {
        Self {
            node,
            weights: vec![(node, 1.0)],
        }
    }
}

/// The compliance of the sites of a body, kept from one publication to the next.
#[derive(Debug)]
pub struct SiteCompliance {
    epoch: u64,
    /// The time of the shapes, and that in which inertia resists the rigid motions of loose pieces (s).
    period: f64,
    inert_time: f64,
    /// The factors of mass and stiffness in `A`.
    factors: (f64, f64),
    nodes: usize,
    sites: Vec<Site>,
    next: usize,
    loose: Loose,
    /// The nodes at which something else holds the piece.
    held: Vec<Held>,
    /// The forces on nodes that cause the shapes, by column. A site has three columns, one for each axis; after the sites come the patterns of
    /// what holds the piece. A column of nodes that are held has none.
    loads: Vec<Vec<(u32, Vec3)>>,
    /// The shapes without the rigid motions of loose pieces, by column, then by node (m/N).
    shapes: Vec<Vec3>,
    /// The components of the loads in the rigid motions (N/kg^(1/2)), by column, then by loose piece.
    components: Vec<[f64; MOTIONS]>,
    /// The momentum of the loose pieces in their rigid motions.
    momentum: Vec<[f64; MOTIONS]>,
    /// `S` and `U^T M U`.
    values: Square,
    mass: Square,
    /// `L`, the inertia of the motions, its eigenvectors, and a factor of the compliance.
    factor: Square,
    inertia: Square,
    eigen: Eigen,
    root: Square,
    /// The compliance as a sum of squares, by motion, then by column; and whether inertia alone resists a motion.
    motions: Vec<f64>,
    is_inert: Vec<bool>,
    /// `S` of what holds the piece.
    holding: Square,
    compliance: Square,
    damping: f64,
    /// The velocities of the sites that inertia keeps (m/s), by row.
    drift: Vec<f64>,
}

/// A place in the list of sites.
#[derive(Clone, Debug, Default)]
struct Site {
    node: Option<u32>,
    /// The linearization of its shapes; `None` before their first computation.
    state: Option<u64>,
}

impl SiteCompliance {
    /// Room for this many sites.
    pub fn new(sites: usize) -> Self {
        let columns = 3 * sites + PATTERNS;
        let square = Square::zeros(columns);
        Self {
            epoch: 0,
            period: 0.0,
            inert_time: 0.0,
            factors: (0.0, 0.0),
            nodes: 0,
            sites: vec![Site::default(); sites],
            next: 0,
            loose: Loose::default(),
            held: Vec::new(),
            loads: vec![Vec::new(); columns],
            shapes: Vec::new(),
            components: Vec::new(),
            momentum: Vec::new(),
            values: square.clone(),
            mass: square.clone(),
            factor: square.clone(),
            inertia: square.clone(),
            eigen: Eigen::new(columns),
            root: square,
            motions: Vec::new(),
            is_inert: Vec::new(),
            holding: Square::zeros(PATTERNS),
            compliance: Square::zeros(3 * sites),
            damping: 0.0,
            drift: vec![0.0; 3 * sites],
        }
    }

    /// The displacement of a site by a force at another one (m/N), by their places in the list. Zero for a site that is held, and
    /// for a place without a site.
    ///
    /// # Panics
    /// For a place that is not in the list.
    pub fn between(&self, one: usize, other: usize) -> Mat3 {
        Mat3::from_fn(|row, column| self.compliance[(3 * one + row, 3 * other + column)])
    }

    /// The energies under forces `of` the sites (J): the elastic one, and that with the motions which inertia alone resists.
    pub fn energies(&self, of: &dyn Fn(usize) -> Vec3) -> [f64; 2] {
        let (mut elastic, mut whole) = (0.0, 0.0);
        let forces: Vec<Vec3> = (0..self.sites.len()).map(of).collect();
        let motions = self.motions.chunks_exact(self.loads.len());
        for (motion, is_inert) in motions.zip(&self.is_inert) {
            let by_site = motion.chunks_exact(3).zip(&forces);
            let moved =
                by_site.map(|(of, force)| of[0] * force.x + of[1] * force.y + of[2] * force.z);
            let energy = 0.5 * moved.sum::<f64>().powi(2);
            whole += energy;
            elastic += if *is_inert { 0.0 } else { energy };
        }
        [elastic, whole]
    }

    /// The velocity (m/s) with which a site goes on by inertia: the motions of the body that inertia alone resists have it.
    ///
    /// # Panics
    /// For a place that is not in the list.
    pub fn drift(&self, site: usize) -> Vec3 {
        Vec3::from_fn(|axis, _| self.drift[3 * site + axis])
    }

    /// The ratio of damping to stiffness (s), as one time: `tr(U^T C U) / tr(U^T K U)`.
    pub fn damping(&self) -> f64 {
        self.damping
    }

    /// Computes the compliance of the `sites` of the body that `stepper` moves, after the last step, for publications every
    /// `period` seconds. `sites` are footprints, or places without one. A site whose node stays at its place keeps its shapes, and
    /// their weights, until it is its turn. `held` are the nodes of other contacts of the body, which count if the sites are on a loose
    /// piece. If the body has a local model, that must have been made. The first call allocates.
    ///
    /// # Errors
    ///
    /// [`CondenseError`].
    pub fn renew<T: Precision>(
        &mut self,
        stepper: &mut Stepper<T>,
        body: &Body,
        period: f64,
        sites: &[Option<Footprint>],
        held: &[Held],
        options: &ShapeOptions,
    ) -> Result<ShapeReport, CondenseError> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(CondenseError::Period { found: period });
        }
        if !stepper.is_ready() || stepper.epoch != body.epoch() {
            return Err(CondenseError::NotAssembled);
        }
        self.inert_time = period;
        self.take(stepper, body, period.max(LEAST_TIME), sites);
        self.loose.place(body);
        let state = stepper.elements.count;
        let (count, mut report) = (self.sites.len(), ShapeReport::default());
        let mut left = options.at_a_time;
        for place in 0..count {
            if self.sites[place].node.is_some() && self.sites[place].state.is_none() {
                self.renew_site(stepper, body, (place, sites), options, &mut report);
            }
        }
        let next = self.next;
        for place in (0..count).map(|by| (next + by) % count) {
            let site = &self.sites[place];
            if site.node.is_some() && site.state != Some(state) && left > 0 {
                self.renew_site(stepper, body, (place, sites), options, &mut report);
                (left, self.next) = (left - 1, place + 1);
            }
        }
        self.hold(stepper, body, held, options, &mut report);
        self.find_components(body);
        self.combine(body);
        self.find_drift(body);
        Ok(report)
    }

    /// Takes the nodes of the sites. The shapes of other nodes, of another topology and of another period are forgotten.
    fn take<T: Precision>(
        &mut self,
        stepper: &Stepper<T>,
        body: &Body,
        period: f64,
        sites: &[Option<Footprint>],
    ) {
        let nodes = body.state.x.len();
        if (self.epoch, self.period, self.nodes) != (body.epoch(), period, nodes) {
            (self.epoch, self.period, self.nodes) = (body.epoch(), period, nodes);
            let config = &body.model.config;
            self.factors = (
                1.0 / (period * period) + config.mass_damping / period,
                1.0 + config.stiffness_damping / period,
            );
            self.sites.fill_with(Site::default);
            let supports = &body.constraints.supports;
            let is_held = |node| !stepper.is_free(node) || supports.owner_of(node).is_some();
            self.loose.find(body, &is_held);
            self.begin();
        }
        for place in 0..self.sites.len() {
            let site = sites.get(place).and_then(Option::as_ref);
            let node = site.map(|site| site.node);
            let own = &mut self.sites[place];
            if own.node != node {
                (own.node, own.state) = (node, None);
                (3 * place..3 * place + 3).for_each(|column| self.clear(column));
            }
        }
    }

    /// Makes room for the columns, and forgets all. A body without loose pieces has no columns for patterns.
    fn begin(&mut self) {
        let patterns = if self.loose.count() > 0 { PATTERNS } else { 0 };
        let columns = 3 * self.sites.len() + patterns;
        self.loads.clear();
        self.loads.resize(columns, Vec::new());
        self.shapes.clear();
        self.shapes.resize(columns * self.nodes, Vec3::zeros());
        self.eigen = Eigen::new(columns);
        let own = [&mut self.values, &mut self.mass, &mut self.factor];
        for matrix in own.into_iter().chain([&mut self.inertia, &mut self.root]) {
            *matrix = Square::zeros(columns);
        }
    }

    /// Forgets a column.
    fn clear(&mut self, column: usize) {
        self.loads[column].clear();
        self.shapes[column * self.nodes..(column + 1) * self.nodes].fill(Vec3::zeros());
        for other in 0..self.values.size() {
            for at in [(column, other), (other, column)] {
                (self.values[at], self.mass[at]) = (0.0, 0.0);
            }
        }
    }

    /// Computes the shapes of a site under its present footprint.
    fn renew_site<T: Precision>(
        &mut self,
        stepper: &mut Stepper<T>,
        body: &Body,
        (place, sites): (usize, &[Option<Footprint>]),
        options: &ShapeOptions,
        report: &mut ShapeReport,
    ) {
        self.sites[place].state = Some(stepper.elements.count);
        let given = sites.get(place).and_then(Option::as_ref);
        let weights = given.map_or(&[][..], |given| &given.weights);
        let is_new = self.loads[3 * place].is_empty();
        for axis in 0..3 {
            let load = &mut self.loads[3 * place + axis];
            load.clear();
            let free = weights.iter().filter(|(node, _)| stepper.is_free(*node));
            load.extend(free.map(|(node, weight)| (*node, Vec3::ith(axis, *weight))));
        }
        for column in 3 * place..3 * place + 3 {
            self.solve(stepper, body, (column, is_new), options, report);
        }
    }

    /// Takes what holds the piece of the sites, and computes the shapes of its patterns.
    fn hold<T: Precision>(
        &mut self,
        stepper: &mut Stepper<T>,
        body: &Body,
        held: &[Held],
        options: &ShapeOptions,
        report: &mut ShapeReport,
    ) {
        let first = 3 * self.sites.len();
        let mut nodes = self.sites.iter().filter_map(|site| site.node);
        let piece = nodes.find_map(|node| self.loose.of(node));
        let of_piece = |held: &&Held| piece.is_some() && self.loose.of(held.node) == piece;
        self.held.clear();
        self.held.extend(held.iter().filter(of_piece));
        let was_held = self.loads[first..].iter().any(|load| !load.is_empty());
        patterns(&self.held, &body.state.x, &mut self.loads[first..]);
        for column in first..self.loads.len() {
            if self.loads[column].is_empty() {
                self.clear(column);
            } else {
                self.solve(stepper, body, (column, !was_held), options, report);
            }
        }
    }

    /// Computes the shape of a column, and its products with all others.
    fn solve<T: Precision>(
        &mut self,
        stepper: &mut Stepper<T>,
        body: &Body,
        (column, is_new): (usize, bool),
        options: &ShapeOptions,
        report: &mut ShapeReport,
    ) {
        if self.loads[column].is_empty() {
            return;
        }
        let max_iterations = if is_new {
            options.max_iterations.max(FIRST_ITERATIONS)
        } else {
            options.max_iterations
        };
        let limits = Limits {
            of: Solved::Shape,
            uses_learned: true,
            // The force that causes a shape is 1 N.
            goal: options.tolerance,
            start: options.tolerance,
            max_iterations,
        };
        let (x, mass) = (&body.state.x, &body.model.mass);
        let shape = &mut self.shapes[column * self.nodes..(column + 1) * self.nodes];
        let mut rigid = vec![[0.0; MOTIONS]; self.loose.count()];
        for (node, force) in &self.loads[column] {
            self.loose.add_components(x, (*node, force), &mut rigid);
        }
        let (inertia, _) = self.factors;
        rigid
            .as_flattened_mut()
            .iter_mut()
            .for_each(|of| *of /= inertia);
        self.loose.add(x, &rigid, shape);
        let found = stepper.response_to(&self.loads[column], self.factors, limits, shape);
        // The rigid motion that the iterations found, with their errors.
        rigid.fill([0.0; MOTIONS]);
        for ((node, u), mass) in (0_u32..).zip(&*shape).zip(mass) {
            self.loose
                .add_components(x, (node, &(u * -mass)), &mut rigid);
        }
        self.loose.add(x, &rigid, shape);
        report.iterations += found.iterations;
        report.residual = report.residual.max(found.residual);
        report.renewed += 1;
        self.multiply(body, column);
    }

    /// Computes the products of a column with all others.
    fn multiply(&mut self, body: &Body, column: usize) {
        let (nodes, mass) = (self.nodes, &body.model.mass);
        let shape = &self.shapes[column * nodes..(column + 1) * nodes];
        for (other, load) in self.loads.iter().enumerate() {
            if load.is_empty() {
                continue;
            }
            let its = &self.shapes[other * nodes..(other + 1) * nodes];
            let along = load.iter();
            let along = along.map(|(node, force)| force.dot(&shape[*node as usize]));
            let (value, product) = (along.sum(), weighted(shape, its, mass));
            for at in [(column, other), (other, column)] {
                (self.values[at], self.mass[at]) = (value, product);
            }
        }
    }

    /// Finds the components of the loads and of the momentum in the rigid motions.
    fn find_components(&mut self, body: &Body) {
        let (x, v, mass) = (&body.state.x, &body.state.v, &body.model.mass);
        let count = self.loose.count();
        self.components.clear();
        self.components
            .resize(self.loads.len() * count, [0.0; MOTIONS]);
        self.momentum.clear();
        self.momentum.resize(count, [0.0; MOTIONS]);
        if count == 0 {
            return;
        }
        for (load, own) in self
            .loads
            .iter()
            .zip(self.components.chunks_exact_mut(count))
        {
            for (node, force) in load {
                self.loose.add_components(x, (*node, force), own);
            }
        }
        for ((node, v), mass) in (0_u32..).zip(v).zip(mass) {
            self.loose
                .add_components(x, (node, &(v * *mass)), &mut self.momentum);
        }
    }

    /// Computes the compliance from the products.
    fn combine(&mut self, body: &Body) {
        let (a, b) = self.factors;
        let size = self.values.size();
        let [mut stored, mut inert] = [0.0; 2];
        for j in 0..size {
            stored += (self.values[(j, j)] - a * self.mass[(j, j)]) / b;
            inert += self.mass[(j, j)];
        }
        let config = &body.model.config;
        self.damping = config.stiffness_damping;
        if stored > 0.0 {
            self.damping += config.mass_damping * inert / stored;
        }
        self.find_factor();
        self.inertia.copy_from(&self.mass);
        for _ in 0..2 {
            for column in 0..size {
                substitute(&self.factor, &mut self.inertia, column);
            }
            self.inertia.transpose();
        }
        self.inertia.symmetrize();
        self.find_root();
        self.find_motions();
        self.eliminate();
        let motions = || self.motions.chunks_exact(size);
        for j in 0..self.compliance.size() {
            for i in 0..=j {
                let sum: f64 = motions().map(|motion| motion[i] * motion[j]).sum();
                (self.compliance[(i, j)], self.compliance[(j, i)]) = (sum, sum);
            }
        }
    }

    /// Joins the motions of the root with the rigid ones. A column that is held has no part in them.
    fn find_motions(&mut self) {
        let (size, count) = (self.loads.len(), self.loose.count());
        let of = |column: usize, value: f64| {
            if self.values[(column, column)] > 0.0 {
                value
            } else {
                0.0
            }
        };
        self.motions.clear();
        for row in 0..size {
            let entries = (0..size).map(|column| of(column, self.root[(row, column)]));
            self.motions.extend(entries);
        }
        for piece in 0..count {
            let own = |column: usize| &self.components[column * count + piece];
            if (0..size).all(|column| *own(column) == [0.0; MOTIONS]) {
                continue;
            }
            for motion in 0..MOTIONS {
                let entries = (0..size).map(|column| own(column)[motion] * self.inert_time);
                self.motions.extend(entries);
                self.is_inert.push(true);
            }
        }
    }

    /// Eliminates the patterns of what holds the piece: their displacements are zero.
    fn eliminate(&mut self) {
        let (size, first) = (self.loads.len(), 3 * self.sites.len());
        if self.loads[first..].iter().all(Vec::is_empty) {
            return;
        }
        let product = |i: usize, j: usize| -> f64 {
            let motions = self.motions.chunks_exact(size);
            motions.map(|motion| motion[i] * motion[j]).sum()
        };
        for i in 0..PATTERNS {
            for j in 0..PATTERNS {
                self.holding[(i, j)] = product(first + i, first + j);
            }
            // Patterns may depend on each other: their contacts are softer by the errors of their shapes.
            self.holding[(i, i)] += ERROR * self.values[(first + i, first + i)];
        }
        factorize(&mut self.holding);
        // The forces by which the patterns answer to a force at a site, by column of the site.
        let mut forces = Square::zeros(size.max(PATTERNS));
        for column in 0..first {
            for pattern in 0..PATTERNS {
                forces[(pattern, column)] = -product(first + pattern, column);
            }
            solve(&self.holding, &mut forces, column);
        }
        for motion in self.motions.chunks_exact_mut(size) {
            let (sites, held) = motion.split_at_mut(first);
            for (column, site) in sites.iter_mut().enumerate() {
                let each = held.iter().enumerate();
                *site += each
                    .map(|(at, held)| held * forces[(at, column)])
                    .sum::<f64>();
            }
        }
    }

    /// Finds the velocities that inertia keeps: those of a loose piece, `J R R^T M v`, and `a U^T M v`, a part of those of a deformation, the
    /// smaller the stiffer it is.
    fn find_drift(&mut self, body: &Body) {
        let (nodes, count, (a, _)) = (self.nodes, self.loose.count(), self.factors);
        for (column, drift) in self.drift.iter_mut().enumerate() {
            let shape = &self.shapes[column * nodes..(column + 1) * nodes];
            let own = &self.components[column * count..(column + 1) * count];
            let rigid = own.as_flattened().iter().zip(self.momentum.as_flattened());
            *drift = a * weighted(shape, &body.state.v, &body.model.mass)
                + rigid.map(|(of, momentum)| of * momentum).sum::<f64>();
        }
    }

    /// Finds `L`. If errors make the matrix all but indefinite, the least fraction of its diagonal is added with which it is not (Nocedal and Wright, "Numerical
    /// optimization", 2006, algorithm 3.3). Without it, the errors of a loose piece, which moves so much further than it deforms, would be
    /// motions of their own.
    fn find_factor(&mut self) {
        for more in MORE {
            self.factor.copy_from(&self.values);
            for at in 0..self.factor.size() {
                self.factor[(at, at)] *= 1.0 + more;
            }
            // What was added must be left: a smaller pivot is made of errors.
            if factorize(&mut self.factor) >= (0.5 * more).max(LEAST_TOLD) {
                break;
            }
        }
    }

    /// Finds a matrix `R` with `W = R^T R`, from `L` and the inertia of the motions.
    fn find_root(&mut self) {
        let (a, b) = self.factors;
        let size = self.values.size();
        let rate = 1.0 / (self.period * self.period);
        // A motion whose stiffness is its inertia has an eigenvalue of one here.
        self.root.copy_from(&self.inertia);
        self.root.scale(a + b * rate);
        self.is_inert.clear();
        self.is_inert.resize(size, false);
        if self.eigen.is_below_one(&self.root) {
            // `(1 - a m) / b` of all motions, and its factor.
            self.inertia.scale(-a / b);
            for i in 0..size {
                self.inertia[(i, i)] += 1.0 / b;
            }
            factorize(&mut self.inertia);
            self.root.copy_from(&self.factor);
            self.root.clear_upper();
            self.root.transpose();
            for column in 0..size {
                substitute(&self.inertia, &mut self.root, column);
            }
            return;
        }
        self.eigen.solve(&self.inertia);
        for k in 0..size {
            // No motion has more inertia than `1 / a`; shapes of different states may seem to.
            let inertia = self.eigen.value(k).max(0.0).min(1.0 / a);
            let elastic = (1.0 - a * inertia) / b;
            self.is_inert[k] = elastic < inertia * rate;
            let stiffness = elastic.max(inertia * rate);
            let part = 1.0 / stiffness.sqrt();
            for i in 0..size {
                let vector = self.eigen.vector(k).iter().take(i + 1).enumerate();
                let sum: f64 = vector.map(|(j, v)| self.factor[(i, j)] * v).sum();
                self.root[(k, i)] = sum * part;
            }
        }
    }
}

/// The stiffness (N/m, N, N m) of points against a common displacement and a common rotation, from their compliance `between` each two of
/// them (m/N) and their `arms` from the centre of the rotation (m). A spring much stiffer than `stiffest` (N/m) need only be known to be
/// stiffer. `None` if a point does not yield.
pub fn resultant(
    arms: &[Vec3],
    stiffest: f64,
    between: &dyn Fn(usize, usize) -> Mat3,
) -> Option<Mat6> {
    let count = arms.len();
    let mut factor = Square::zeros(3 * count);
    for column in 0..3 * count {
        for row in 0..3 * count {
            factor[(row, column)] = between(row / 3, column / 3)[(row % 3, column % 3)];
        }
    }
    if count == 0 || (0..3 * count).any(|at| factor[(at, at)] <= 0.0) {
        return None;
    }
    // Shapes of different states make common displacements look rigid that are not: these few points then would be as stiff as the errors of
    // their compliance are small. A direction of little compliance beside one of much (along a sheet, and across it) stays stiff.
    let largest = (0..3 * count).fold(0.0, |most: f64, at| most.max(factor[(at, at)]));
    let error = (ERROR * largest).min(SLIGHT / stiffest);
    for at in 0..3 * count {
        factor[(at, at)] += error;
    }
    factorize(&mut factor);
    // By motion: the displacements of the points, times the inverse of the factor.
    let mut moved = Square::zeros((3 * count).max(6));
    for column in 0..6 {
        let axis = Vec3::ith(column % 3, 1.0);
        for (point, arm) in arms.iter().enumerate() {
            let way = if column < 3 { axis } else { axis.cross(arm) };
            for (row, way) in way.iter().enumerate() {
                moved[(3 * point + row, column)] = *way;
            }
        }
        substitute(&factor, &mut moved, column);
    }
    Some(Mat6::from_fn(|i, j| {
        let rows = 0..3 * count;
        rows.map(|row| moved[(row, i)] * moved[(row, j)]).sum()
    }))
}

/// `sum m_i a_i . b_i`.
fn weighted(a: &[Vec3], b: &[Vec3], mass: &[f64]) -> f64 {
    let mut sum = Vec3::zeros();
    for ((a, b), mass) in a.iter().zip(b).zip(mass) {
        sum += a.component_mul(b) * *mass;
    }
    sum.sum()
}

/// Replaces a symmetric matrix by a lower factor `L`: that of Cholesky, if the matrix is positive definite. A column without shape
/// has a factor of one.
///
/// Shapes that were computed at different states of the body give a matrix that is not definite. Two sites then seem to move
/// together more than each moves by itself. The factor takes no entry beyond this, so that no diagonal entry of `L L^T` grows. Returns
/// the least pivot, as a fraction of its diagonal.
fn factorize(matrix: &mut Square) -> f64 {
    let size = matrix.size();
    let mut least = f64::INFINITY;
    for j in 0..size {
        let own = matrix[(j, j)];
        let mut pivot = own;
        for k in 0..j {
            pivot -= matrix[(j, k)] * matrix[(j, k)];
        }
        let pivot = if own > 0.0 {
            least = least.min(pivot / own);
            pivot.max(LEAST_PIVOT * own).sqrt()
        } else {
            1.0
        };
        matrix[(j, j)] = pivot;
        for i in j + 1..size {
            let mut entry = matrix[(i, j)];
            let mut left = matrix[(i, i)];
            for k in 0..j {
                entry -= matrix[(i, k)] * matrix[(j, k)];
                left -= matrix[(i, k)] * matrix[(i, k)];
            }
            let most = left.max(0.0).sqrt();
            matrix[(i, j)] = (entry / pivot).clamp(-most, most);
        }
    }
    least
}

/// Replaces a column of `values` by its product with the inverse of a lower factor.
fn substitute(factor: &Square, values: &mut Square, column: usize) {
    for i in 0..factor.size() {
        let mut value = values[(i, column)];
        for k in 0..i {
            value -= factor[(i, k)] * values[(k, column)];
        }
        values[(i, column)] = value / factor[(i, i)];
    }
}

/// Replaces a column of `values` by its product with the inverse of `L L^T`.
fn solve(factor: &Square, values: &mut Square, column: usize) {
    substitute(factor, values, column);
    for i in (0..factor.size()).rev() {
        let mut value = values[(i, column)];
        for k in i + 1..factor.size() {
            value -= factor[(k, i)] * values[(k, column)];
        }
        values[(i, column)] = value / factor[(i, i)];
    }
}

impl<T: Precision> Stepper<T> {
    /// The displacement of all nodes (m) by forces on nodes (N), from the `shape` before.
    fn response_to(
        &mut self,
        loads: &[(u32, Vec3)],
        factors: (f64, f64),
        limits: Limits,
        shape: &mut [Vec3],
    ) -> StepperReport {
        let (mass_factor, stiffness_factor) = factors;
        for place in self.places.taken() {
            let u = shape[self.places.node[place] as usize];
            self.cg.u[place] = to_node(&u);
            self.cg.residual[place] = to_node(&(u * (-mass_factor * self.places.mass[place])));
        }
        self.subtract_elements(stiffness_factor);
        for (node, force) in loads {
            self.load(*node, force);
        }
        let found = self.iterate(factors, limits, &mut || false);
        for place in self.places.taken() {
            shape[self.places.node[place] as usize] = to_vec(&self.cg.u[place]);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIZE: usize = 6;

    proptest! {
        #[test]
        fn a_factor_has_no_larger_diagonal_than_its_matrix(
            entries in proptest::collection::vec(-1.0..1.0_f64, SIZE * SIZE),
            scales in proptest::array::uniform6(-4.0..4.0_f64),
        ) {
            // A matrix of shapes from different states: not definite, and of sites that yield differently.
            let scale = scales.map(|x| 10.0_f64.powf(x));
            let mut matrix = Square::zeros(SIZE);
            for j in 0..SIZE {
                for i in 0..SIZE {
                    let entry = if i == j { 1.0 } else { entries[i.min(j) * SIZE + i.max(j)] };
                    matrix[(i, j)] = entry * scale[i] * scale[j];
                }
            }
            let mut factor = matrix.clone();
            factorize(&mut factor);
            for i in 0..SIZE {
                let sum: f64 = (0..=i).map(|k| factor[(i, k)] * factor[(i, k)]).sum();
                // The least pivot is a millionth of the diagonal.
                prop_assert!(sum <= matrix[(i, i)] * (1.0 + 2.0 * LEAST_PIVOT));
                prop_assert!(factor[(i, i)] > 0.0);
            }
        }
    }
}
