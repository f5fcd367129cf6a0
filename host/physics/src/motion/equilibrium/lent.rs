//! The equation of a body in an iteration of an equilibrium with contacts.
//!
//! The matrix is the assembled stiffness and a small part of the mass, and the preconditioner is its factor. So a body alone
//! needs one iteration of conjugate gradients.

use crate::Vec3;
use crate::body::Body;
use crate::motion::joint_equation::JointEquation;
use crate::motion::newton::Newton;

/// The vectors of conjugate gradients, by node. Held nodes and guided axes have a displacement and no residual.
#[derive(Debug, Default)]
pub(super) struct Vectors {
    /// The displacement (m).
    pub(super) u: Vec<Vec3>,
    residual: Vec<Vec3>,
    preconditioned: Vec<Vec3>,
    direction: Vec<Vec3>,
    product: Vec<Vec3>,
    marked: [Vec<Vec3>; 2],
    /// The stiffness of each node in contact (N/m); infinite for a held one.
    pub(super) stiffness: Vec<f64>,
}

impl Vectors {
    pub(super) fn new(body: &Body) -> Self {
        let zeros = || vec![Vec3::zeros(); body.state.x.len()];
        Self {
            u: zeros(),
            residual: zeros(),
            preconditioned: zeros(),
            direction: zeros(),
            product: zeros(),
            marked: [zeros(), zeros()],
            stiffness: vec![f64::INFINITY; body.state.x.len()],
        }
    }

    /// Takes the stiffness of the nodes from the assembled matrix.
    pub(super) fn weigh(&mut self, body: &Body) {
        for (place, node) in body.assembly.places.free_nodes().enumerate() {
            self.stiffness[node] = body.assembly.stiffness.diagonal(place).trace() / 3.0;
        }
    }
}

/// The equation of a body in an iteration.
pub(super) struct Lent<'a> {
    pub(super) body: &'a Body,
    pub(super) newton: &'a mut Newton,
    pub(super) vectors: &'a mut Vectors,
    /// The part of the mass in the matrix (1/s^2).
    pub(super) shift: f64,
    /// The residual to reach (N).
    pub(super) goal: f64,
}

impl Lent<'_> {
    /// Computes the residual of the present displacements.
    pub(super) fn begin(&mut self) {
        let assembly = &self.body.assembly;
        let Vectors { u, residual, .. } = &mut *self.vectors;
        for node in assembly.places.free_nodes() {
            residual[node] = -self.newton.residual()[node]
                - assembly.row_product(node, u)
                - u[node] * (self.shift * self.body.model.mass[node]);
        }
    }

    /// The residual on the free axes of a node (N).
    fn left(&self, node: usize) -> Vec3 {
        let residual = self.vectors.residual[node];
        let mask = self.body.constraints.supports.mask();
        mask.map_or(residual, |mask| residual.component_mul(&mask[node]))
    }
}

/// The most iterations of a pass.
const MOST: usize = 300;

impl JointEquation for Lent<'_> {
    fn displacement(&self, node: u32) -> Vec3 {
        self.vectors.u[node as usize]
    }

    fn goal(&self, _load: f64) -> f64 {
        self.goal
    }

    fn most(&self) -> usize {
        MOST
    }

    fn load(&mut self, node: u32, force: &Vec3) {
        self.vectors.residual[node as usize] += force;
    }

    fn residual(&mut self) -> f64 {
        let free = self.body.assembly.places.free_nodes();
        libm::sqrt(free.map(|node| self.left(node).norm_squared()).sum())
    }

    fn precondition(&mut self) -> f64 {
        let places = &self.body.assembly.places;
        for (place, node) in places.free_nodes().enumerate() {
            let left = self.left(node);
            self.newton.flat[3 * place..3 * place + 3].copy_from_slice(left.as_slice());
        }
        let (cholesky, flat) = (&mut self.newton.cholesky, &mut self.newton.flat);
        cholesky.solve(flat);
        let mut product = 0.0;
        for (node, flat) in places.free_nodes().zip(flat.chunks_exact(3)) {
            let value = Vec3::new(flat[0], flat[1], flat[2]);
            self.vectors.preconditioned[node] = value;
            product += self.vectors.residual[node].dot(&value);
        }
        product
    }

    fn direct(&mut self, beta: f64) {
        let assembly = &self.body.assembly;
        let Vectors {
            preconditioned,
            direction,
            product,
            ..
        } = &mut *self.vectors;
        for node in assembly.places.free_nodes() {
            direction[node] = preconditioned[node] + direction[node] * beta;
        }
        for node in assembly.places.free_nodes() {
            product[node] = assembly.row_product(node, direction)
                + direction[node] * (self.shift * self.body.model.mass[node]);
        }
    }

    fn direction(&self, node: u32) -> Vec3 {
        self.vectors.direction[node as usize]
    }

    fn add_product(&mut self, node: u32, value: &Vec3) {
        self.vectors.product[node as usize] += value;
    }

    fn curvature(&mut self) -> f64 {
        let free = self.body.assembly.places.free_nodes();
        free.map(|node| self.vectors.direction[node].dot(&self.vectors.product[node]))
            .sum()
    }

    fn advance(&mut self, alpha: f64) -> f64 {
        for node in self.body.assembly.places.free_nodes() {
            let Vectors {
                u,
                residual,
                direction,
                product,
                ..
            } = &mut *self.vectors;
            u[node] += direction[node] * alpha;
            residual[node] -= product[node] * alpha;
        }
        self.residual()
    }

    fn stop(&mut self) {
        self.vectors.direction.fill(Vec3::zeros());
    }

    fn mark(&mut self) {
        let Vectors {
            u,
            residual,
            marked,
            ..
        } = &mut *self.vectors;
        marked[0].copy_from_slice(u);
        marked[1].copy_from_slice(residual);
    }

    fn along(&self) -> [f64; 2] {
        let [u0, r0] = &self.vectors.marked;
        let free = self.body.assembly.places.free_nodes();
        free.fold([0.0; 2], |[start, end], node| {
            let by = self.vectors.u[node] - u0[node];
            // The displacement has no part along guided axes.
            [
                start + by.dot(&r0[node]),
                end + by.dot(&self.vectors.residual[node]),
            ]
        })
    }

    fn back(&mut self, a: f64) {
        let Vectors {
            u,
            residual,
            marked: [u0, r0],
            ..
        } = &mut *self.vectors;
        for (to, from) in u.iter_mut().zip(u0).chain(residual.iter_mut().zip(r0)) {
            *to = *from + (*to - *from) * a;
        }
    }

    fn hold_pairs(&mut self) {}

    fn let_go(&mut self) {}

    fn solved(
        &mut self,
        _forces: &mut dyn Iterator<Item = (u32, Vec3)>,
        _load: f64,
        _iterations: usize,
        _residual: f64,
    ) {
    }
}
