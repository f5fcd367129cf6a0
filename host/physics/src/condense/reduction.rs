//! The reduction of a body by its shapes to small dense matrices between handles.
//!
//! See [`condenser`](crate::condense::condenser) for the method. The reduction needs the shapes `Psi` on the free nodes
//! and `K Psi` on the handle nodes. It is independent of the method by which the shapes were computed.

use crate::Vec3;
use crate::body::Body;
use crate::body::handle::Freedom;
use crate::linear::dense::{Clip, Clipper, Square};
use crate::linear::places::Places;
use crate::topology::Origin;

/// The condensed matrices of all handles of a body.
///
/// Each matrix is 6 H x 6 H for H handles: for each handle in turn three translations (m, N), then three rotations
/// (rad, N m) about the handle's origin, in world axes. The rows and columns of motions that a handle lacks are zero.
/// The matrices give the wrench of the hand on the body for a motion of the handle. The wrench on the hand has the
/// opposite sign.
#[derive(Clone, Debug, PartialEq)]
pub struct Condensed {
    /// Tangent stiffness, symmetric and positive semidefinite.
    pub stiffness: Square,
    /// Tangent damping, symmetric and positive semidefinite.
    pub damping: Square,
    /// `Psi^T K Psi` with the lever term, neither symmetrized nor clipped.
    pub raw_stiffness: Square,
    /// `Psi^T C Psi`, neither symmetrized nor clipped.
    pub raw_damping: Square,
    /// `Psi^T M Psi`. It serves checks and must not be extrapolated.
    pub mass: Square,
    /// The drift (N/s, N m/s), 6 H numbers: the part of the rate of the wrench on the hand that the stiffness does not
    /// predict. It is `w0' + K v0`, where `w0'` is the mean rate of the wrench over the period if the handles keep the
    /// velocities `v0`.
    pub drift: Vec<f64>,
    /// The part that clipping removed from the stiffness.
    pub stiffness_clip: Clip,
    /// The part that clipping removed from the damping.
    pub damping_clip: Clip,
    /// The length (m) that makes rotations comparable to translations for clipping.
    pub length: f64,
}

/// A motion of a handle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column {
    pub(crate) handle: usize,
    /// 0 to 2: translation; 3 to 5: rotation.
    pub(crate) motion: usize,
}

impl Column {
    pub(crate) fn slot(self) -> usize {
        6 * self.handle + self.motion
    }

    /// The velocity of a point at `arm` from the origin.
    pub(crate) fn at(self, arm: &Vec3) -> Vec3 {
        let axis = Vec3::ith(self.motion % 3, 1.0);
        if self.motion < 3 {
            axis
        } else {
            axis.cross(arm)
        }
    }
}

/// The time of the previous model (s of the body's clock), and its ratio of mass to stiffness (1/s²).
#[derive(Clone, Copy, Debug)]
struct Previous {
    at: f64,
    ratio: f64,
}

/// The time constant, in periods, over which rates of forces are smoothed. A jolt of one step is no trend.
const SMOOTHED: f64 = 2.0;
/// The longest such time constant (s).
const LONGEST_SMOOTHED: f64 = 0.01;

/// The largest ratio of the addition to the drift to the rate of the wrench that the stiffness predicts. In steady
/// motion the ratio is some hundredths. When a strip snaps, the linearization of a step misses far more, and that is no
/// trend.
const LARGEST_TREND: f64 = 0.25;

/// Shapes of one body, and the matrices that follow from them.
#[derive(Clone, Debug)]
pub(crate) struct Reduction {
    /// The places of the nodes, which number the rows of the shapes.
    pub(crate) places: Places,
    /// Lumped mass by place (kg).
    mass: Vec<f64>,
    pub(crate) columns: Vec<Column>,
    /// The handle of each handle node, in the order of the held places; pulls and arms have the same order.
    pub(crate) holder: Vec<u32>,
    /// For each handle, its columns as a range.
    pub(crate) range: Vec<core::ops::Range<usize>>,
    /// `Psi` on the free nodes, by columns.
    pub(crate) shapes: Vec<f64>,
    /// `K Psi` on the handle nodes, by columns.
    pub(crate) pulls: Vec<Vec3>,
    /// Present arm of each handle node from its handle's origin (m).
    pub(crate) arms: Vec<Vec3>,
    /// `Psi_f^T M Psi_f` over columns.
    inner: Square,
    /// The residual `-A Psi` of the column computed last on the free nodes, by the rows of the shapes.
    pub(crate) rest: Vec<f64>,
    /// `Psi_f^T R / (1 + beta / t)` over columns, where `R` are the residuals `-A Psi` of the shapes on the free nodes; zero
    /// for shapes that were computed by a factorization.
    pub(crate) left: Square,
    /// What the bodies that the body touches add to the damping, over columns.
    pub(crate) damped: Square,
    /// The order in which the columns were computed last.
    pub(crate) turn: Vec<u64>,
    clipper: Clipper,
    scale: Vec<f64>,
    /// Velocities of the handles, by columns.
    pub(crate) speeds: Vec<f64>,
    /// The drift by inertia in the previous model, by columns.
    inertia: Vec<f64>,
    /// The addition to the drift in the previous model, by columns.
    trend: Vec<f64>,
    previous: Previous,
    pub(crate) condensed: Condensed,
}

impl Reduction {
    pub(crate) fn new(body: &Body) -> Self {
        let mut columns = Vec::new();
        let mut range = Vec::new();
        let mut holder = Vec::new();
        let mut squares = 0.0;
        let mut counted = 0;
        for (handle, held) in body.constraints.handles.iter().enumerate() {
            let first = columns.len();
            columns.extend((0..held.freedom.count()).map(|motion| Column { handle, motion }));
            range.push(first..columns.len());
            holder.extend(held.offsets.iter().map(|_| handle as u32));
            if held.freedom == Freedom::Rigid {
                squares += held.offsets.iter().map(Vec3::norm_squared).sum::<f64>();
                counted += held.offsets.len();
            }
        }
        let size = 6 * body.constraints.handles.len();
        let places = body.constraints.places();
        let length = characteristic_length(squares, counted, &places.gather(&body.state.x));
        let zeros = || Square::zeros(size);
        Self {
            shapes: vec![0.0; columns.len() * 3 * places.free()],
            pulls: vec![Vec3::zeros(); columns.len() * holder.len()],
            arms: vec![Vec3::zeros(); holder.len()],
            inner: Square::zeros(columns.len()),
            rest: Vec::new(),
            left: Square::zeros(columns.len()),
            damped: Square::zeros(columns.len()),
            turn: vec![0; columns.len()],
            clipper: Clipper::new(size),
            scale: (0..size)
                .map(|slot| if slot % 6 < 3 { 1.0 } else { length })
                .collect(),
            speeds: vec![0.0; columns.len()],
            inertia: vec![0.0; columns.len()],
            trend: vec![0.0; columns.len()],
            previous: Previous {
                at: f64::NAN,
                ratio: f64::NAN,
            },
            mass: places.gather(&body.model.mass),
            places,
            columns,
            holder,
            range,
            condensed: Condensed {
                stiffness: zeros(),
                damping: zeros(),
                raw_stiffness: zeros(),
                raw_damping: zeros(),
                mass: zeros(),
                drift: vec![0.0; size],
                stiffness_clip: Clip::default(),
                damping_clip: Clip::default(),
                length,
            },
        }
    }

    /// Room for all that edits may still add to a body that can tear, so that [`grow`](Self::grow) allocates nothing.
    pub(crate) fn reserve(&mut self, nodes: usize) {
        self.places.reserve(nodes);
        self.mass.reserve(nodes);
        self.shapes.reserve(3 * nodes * self.columns.len());
        self.rest.reserve(3 * (self.places.free() + nodes));
    }

    /// Follows the edits of a body that tears: each new node takes the shapes of its twin, or those of the ends of the
    /// edge that it divides.
    pub(crate) fn grow(&mut self, body: &Body) {
        let (old, count) = (self.places.free(), self.columns.len());
        let (known, nodes) = (self.places.of_nodes().len(), body.state.x.len());
        let new = old + nodes - known;
        self.shapes.resize(3 * new * count, 0.0);
        for column in (0..count).rev() {
            self.shapes
                .copy_within(3 * old * column..3 * old * (column + 1), 3 * new * column);
        }
        for node in known..nodes {
            let origin = body.surface().map(|surface| surface.origin(node as u32));
            let (ends, weight) = match origin {
                Some(Origin::Twin { of }) => ([of; 2], 0.0),
                Some(Origin::Between { ends, weight }) => (ends, weight),
                _ => ([0; 2], 0.0),
            };
            let row = self.places.free();
            for (c, column) in self.columns.iter().enumerate() {
                let shapes = &mut self.shapes[3 * new * c..3 * new * (c + 1)];
                let at = ends.map(|end| match self.places.of(end as usize) {
                    place if place < row => Vec3::from_fn(|axis, _| shapes[3 * place + axis]),
                    place if self.holder[place - row] as usize == column.handle => {
                        column.at(&self.arms[place - row])
                    }
                    _ => Vec3::zeros(),
                });
                let shape = at[0] + (at[1] - at[0]) * weight;
                shapes[3 * row..3 * row + 3].copy_from_slice(shape.as_slice());
            }
            self.places.push_free();
        }
        self.mass.clear();
        let masses = self.places.nodes().iter();
        self.mass
            .extend(masses.map(|&node| body.model.mass[node as usize]));
    }

    /// The displacement of a node by a column; zero for a node that the shapes do not have yet.
    pub(crate) fn displacement(&self, column: usize, node: u32) -> Vec3 {
        let (free, motion) = (self.places.free(), self.columns[column]);
        match self.places.of_nodes().get(node as usize) {
            None => Vec3::zeros(),
            Some(&place) if (place as usize) < free => {
                let at = 3 * (free * column + place as usize);
                Vec3::new(self.shapes[at], self.shapes[at + 1], self.shapes[at + 2])
            }
            Some(&place) => {
                let held = place as usize - free;
                if self.holder[held] as usize == motion.handle {
                    motion.at(&self.arms[held])
                } else {
                    Vec3::zeros()
                }
            }
        }
    }

    /// Whether the reduction was made for a body of this topology.
    pub(crate) fn fits(&self, body: &Body) -> bool {
        self.holder.len() == body.constraints.held_nodes().count()
            && self.range.len() == body.constraints.handles.len()
    }

    /// Computes the present arms.
    pub(crate) fn take_arms(&mut self, body: &Body) {
        let handles = body.constraints.handles.iter();
        let held = handles.flat_map(|handle| handle.nodes().map(move |(node, _)| (handle, node)));
        for (arm, (handle, node)) in self.arms.iter_mut().zip(held) {
            *arm = body.state.x[node] - handle.report.pose.position;
        }
    }

    /// Computes the matrices from shapes, pulls and arms. `ratio` is the ratio of mass to stiffness in the matrix of
    /// the shapes (1/s²). `missed` is, for each node, the rate of force that the tangent misses (N/s).
    pub(crate) fn reduce(
        &mut self,
        body: &Body,
        ratio: f64,
        period: f64,
        missed: &[Vec3],
    ) -> &Condensed {
        self.products(ratio);
        self.mirror();
        self.publish(body);
        self.find_drift(body, ratio, period, missed);
        &self.condensed
    }

    /// The sum of the sizes by which the motions of the hands change the force along a column through the stiffness (N/s).
    pub(crate) fn rate(&self, column: usize) -> f64 {
        let slot = self.columns[column].slot();
        let each = self.columns.iter().zip(&self.speeds);
        each.map(|(other, speed)| (self.condensed.stiffness[(slot, other.slot())] * speed).abs())
            .sum()
    }

    /// Computes the drift from the shapes and the velocities of the free nodes.
    ///
    /// Consider one implicit Euler step of the linearized body over the period `t`, while the handles keep the
    /// velocities `v0`. It changes the wrench on the hands by
    ///
    /// ```text
    /// w0' t = -(K_c + r Psi_f^T M Psi_f) v0 t + r t Psi_f^T M v_f + Psi_f^T M a_f
    /// ```
    ///
    /// with `K_c = Psi^T K Psi`, `r` the ratio of mass to stiffness in the matrix of the shapes, and `v_f`, `a_f` the
    /// present velocities and accelerations of the free nodes. (`K_hf A_ff^-1` is proportional to `-Psi_f^T`, so no
    /// element is evaluated.) The accelerations are omitted: they contain the tremor of the hand and no part of a
    /// steady motion. The remainder beside the stiffness is `p = r Psi_f^T M (v_f - Psi_f v0)`. It vanishes if the body
    /// moves by its shapes, and it attenuates motions that are faster than the period.
    ///
    /// Two terms, smoothed over a few periods, are added to `p`. First, the force that the tangent misses along the
    /// motion. With its rate `g` on the nodes it changes the wrench at the rate `Psi^T g`, since the shapes carry a
    /// force on a free node to the hands. Second, the damping of the shapes responds to every change of the hands'
    /// velocities at once, although the body follows with a lag. `beta` times the rate of `p` since the previous model
    /// corrects this.
    fn find_drift(&mut self, body: &Body, ratio: f64, period: f64, missed: &[Vec3]) {
        let rows = 3 * self.places.free();
        for (speed, column) in self.speeds.iter_mut().zip(&self.columns) {
            let report = &body.constraints.handles[column.handle].report;
            *speed = if column.motion < 3 {
                report.linear_velocity[column.motion]
            } else {
                report.angular_velocity[column.motion - 3]
            };
        }
        let Condensed {
            stiffness,
            raw_stiffness,
            drift,
            ..
        } = &mut self.condensed;
        drift.fill(0.0);
        let since = body.state.clock - self.previous.at;
        let goes_on = self.previous.ratio == ratio && since >= 0.0;
        self.previous = Previous {
            at: body.state.clock,
            ratio,
        };
        // Without a previous model the present addition is taken whole.
        let blend = if goes_on {
            since / (since + (SMOOTHED * period).min(LONGEST_SMOOTHED))
        } else {
            1.0
        };
        let damped = if goes_on && since > 0.0 {
            body.model.config.stiffness_damping / since
        } else {
            0.0
        };
        let masses = || self.places.free_nodes().zip(&self.mass);
        for (c, column) in self.columns.iter().enumerate() {
            let shape = &self.shapes[c * rows..(c + 1) * rows];
            let mut sum = momentum(shape, &body.state.v, masses());
            let (mut clipped, mut rate) = (0.0, 0.0);
            for (r, (other, speed)) in self.columns.iter().zip(&self.speeds).enumerate() {
                let at = (column.slot(), other.slot());
                sum -= self.inner[(c, r)] * speed;
                clipped += (stiffness[at] - raw_stiffness[at]) * speed;
                rate += (stiffness[at] * speed).abs();
            }
            let inertia = ratio * sum;
            let mut beside = along(shape, missed, self.places.free_nodes())
                + damped * (inertia - self.inertia[c]);
            let held = self.holder.iter().zip(&self.arms);
            for ((&holder, arm), node) in held.zip(self.places.held_nodes()) {
                if holder as usize == column.handle {
                    beside += column.at(arm).dot(&missed[node]);
                }
            }
            let most = LARGEST_TREND * rate;
            let beside = beside.max(-most).min(most);
            let trend = self.trend[c] + blend * (beside - self.trend[c]);
            // A number that overflowed must not remain in later models.
            self.trend[c] = if trend.is_finite() { trend } else { 0.0 };
            self.inertia[c] = inertia;
            drift[column.slot()] = inertia + clipped + self.trend[c];
        }
    }

    /// Computes `Psi^T K Psi` and `Psi^T M Psi`, without the lever term.
    fn products(&mut self, ratio: f64) {
        let free = self.places.free();
        let rows = 3 * free;
        let count = self.columns.len();
        for c in 0..count {
            for r in 0..=c {
                let left = &self.shapes[r * rows..(r + 1) * rows];
                let right = &self.shapes[c * rows..(c + 1) * rows];
                let value = mass_product(left, right, &self.mass[..free]);
                self.inner[(r, c)] = value;
                self.inner[(c, r)] = value;
            }
        }
        let stiffness = &mut self.condensed.raw_stiffness;
        let mass = &mut self.condensed.mass;
        stiffness.fill(0.0);
        mass.fill(0.0);
        for c in 0..count {
            for r in 0..count {
                let at = (self.columns[r].slot(), self.columns[c].slot());
                stiffness[at] = -ratio * self.inner[(r, c)] - self.left[(r, c)];
                mass[at] = self.inner[(r, c)];
            }
        }
        for (held, arm) in self.arms.iter().enumerate() {
            let row = free + held;
            let own = self.range[self.holder[held] as usize].clone();
            if own.is_empty() {
                continue;
            }
            for (c, column) in self.columns.iter().enumerate() {
                let force = self.pulls[c * self.holder.len() + held];
                for motion in &self.columns[own.clone()] {
                    stiffness[(motion.slot(), column.slot())] += motion.at(arm).dot(&force);
                }
            }
            for column in &self.columns[own.clone()] {
                let shape = column.at(arm);
                for motion in &self.columns[own.clone()] {
                    let at = (motion.slot(), column.slot());
                    mass[at] += self.mass[row] * motion.at(arm).dot(&shape);
                }
            }
        }
    }

    /// Takes the product of each two columns from the column that was computed last, which knew the other as it is now.
    fn mirror(&mut self) {
        let stiffness = &mut self.condensed.raw_stiffness;
        for (c, column) in self.columns.iter().enumerate() {
            for (r, row) in self.columns.iter().enumerate() {
                if self.turn[c] > self.turn[r] {
                    stiffness[(column.slot(), row.slot())] = stiffness[(row.slot(), column.slot())];
                }
            }
        }
    }

    /// Adds damping and lever term, symmetrizes and clips.
    fn publish(&mut self, body: &Body) {
        let Condensed {
            stiffness,
            damping,
            raw_stiffness,
            raw_damping,
            mass,
            stiffness_clip,
            damping_clip,
            ..
        } = &mut self.condensed;
        let (alpha, beta) = (
            body.model.config.mass_damping,
            body.model.config.stiffness_damping,
        );
        for j in 0..mass.size() {
            for i in 0..mass.size() {
                raw_damping[(i, j)] = alpha * mass[(i, j)] + beta * raw_stiffness[(i, j)];
            }
        }
        for (c, column) in self.columns.iter().enumerate() {
            for (r, row) in self.columns.iter().enumerate() {
                raw_damping[(row.slot(), column.slot())] += self.damped[(r, c)];
            }
        }
        let grips = body.constraints.grips();
        for (held, (arm, force)) in self.arms.iter().zip(grips).enumerate() {
            let own = self.range[self.holder[held] as usize].clone();
            for column in self.columns[own.clone()]
                .iter()
                .filter(|column| column.motion >= 3)
            {
                let change = column.at(arm).cross(force);
                for motion in self.columns[own.clone()]
                    .iter()
                    .filter(|row| row.motion >= 3)
                {
                    raw_stiffness[(motion.slot(), column.slot())] += change[motion.motion - 3];
                }
            }
        }
        stiffness.copy_from(raw_stiffness);
        stiffness.symmetrize();
        damping.copy_from(raw_damping);
        damping.symmetrize();
        *stiffness_clip = self.clipper.clip(stiffness, &self.scale);
        *damping_clip = self.clipper.clip(damping, &self.scale);
    }
}

/// `sum a_i b_i`. Eight running sums make additions independent of each other.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_end), (b, b_end)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sum = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..8 {
            sum[lane] += a[lane] * b[lane];
        }
    }
    let end: f64 = a_end.iter().zip(b_end).map(|(a, b)| a * b).sum();
    sum.iter().sum::<f64>() + end
}

/// `sum m_i a_i . b_i`. Three running sums make additions independent of each other.
fn mass_product(a: &[f64], b: &[f64], mass: &[f64]) -> f64 {
    let mut sum = [0.0; 3];
    for ((a, b), &mass) in a.chunks_exact(3).zip(b.chunks_exact(3)).zip(mass) {
        for axis in 0..3 {
            sum[axis] += mass * a[axis] * b[axis];
        }
    }
    sum[0] + sum[1] + sum[2]
}

/// `sum a_i . f_i` over the `free` nodes. `force` is by node.
fn along(shape: &[f64], force: &[Vec3], free: impl Iterator<Item = usize>) -> f64 {
    let mut sum = Vec3::zeros();
    for (a, node) in shape.chunks_exact(3).zip(free) {
        sum += Vec3::new(a[0], a[1], a[2]).component_mul(&force[node]);
    }
    sum.sum()
}

/// `sum m_i a_i . v_i` over the `free` nodes, each with its mass. `velocity` is by node.
fn momentum<'a>(
    shape: &[f64],
    velocity: &[Vec3],
    free: impl Iterator<Item = (usize, &'a f64)>,
) -> f64 {
    let mut sum = Vec3::zeros();
    for (a, (node, &mass)) in shape.chunks_exact(3).zip(free) {
        sum += Vec3::new(a[0], a[1], a[2]).component_mul(&velocity[node]) * mass;
    }
    sum.sum()
}

/// The root mean square of the rigid handles' offsets (m), or of the body's extent if all offsets are zero.
fn characteristic_length(squares: f64, count: usize, x: &[Vec3]) -> f64 {
    if squares > 0.0 {
        return libm::sqrt(squares / count as f64);
    }
    let centre = x.iter().sum::<Vec3>() / x.len() as f64;
    libm::sqrt(x.iter().map(|x| (x - centre).norm_squared()).sum::<f64>() / x.len() as f64)
}
