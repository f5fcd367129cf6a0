//! Springs in series with the directions of a body that are stiffer than its devices can render.
//!
//! An encoder of count `delta` changes the force of a stiffness `K` by `K delta` at once. The hand stays within the count
//! only if the mechanism's Coulomb friction `f_c` holds it there. Beyond about `2 f_c / delta`, or `2 b / T` if the
//! damping `b` of the mechanism is the better brake, the hand and the body shake at the edge of a count (N. Diolaiti, G.
//! Niemeyer, F. Barbagli and J. K. Salisbury, "Stability of haptic rendering: discretization, quantization, time delay,
//! and Coulomb effects", 2006). Sheets, beams and rods are that stiff along themselves, and soft across. So springs are
//! put in series with the stiff directions alone, over all handles together. The soft directions stay exact.
//!
//! With the limits `d` of all motions of the handles and `E = diag(d)^(-1/2)`,
//!
//! ```text
//! U diag(l) U^T = E Kbar E        the stiffness as a multiple of the limits; all l <= 1: nothing is done
//! C = Q Q^T,  Q = E U diag(1/r - 1/l)^(1/2)      the springs' compliance, r = r(l)
//! R = Q (I + Q^T K Q)^-1 Q^T,  S = I - K R
//! K' = S K     B' = S B S^T     p' = S p     a = w0 - g + B v0
//! w' = g + S a - B' v0          the weight g bypasses the springs
//! V' = V - a . R a / 2          also of each piece
//! q' = S q     root' = root + q . R a     1/area' = 1/area - q . R q        (the tear limit)
//! ```
//!
//! If `Kbar` is the stiffness `K` itself, the eigenvalues of `E K' E` are `r(l)`. Below the limit, `r(l) = l`: the device
//! renders the body. Beyond it, `r` falls to a smaller number `c`, evenly up to `l = 1 + MARGIN`: a direction that the
//! device cannot render is rendered so softly that a hand which trembles at the edge of a count hardly feels the count.
//! `Kbar` is an envelope of the latest stiffnesses: it rises at once and falls within 0.1 s. If the stiffness changes
//! from model to model, springs that came and went with it would shake the hand more than the stiff body does.
//!
//! The **handles** follow the massless proxies between springs and body, as in [`super::virtual_coupling`]. At the
//! device's displacement `d` from the handle of a model, the proxy's is `S^T d + R (a + p s)`, `s` after the model. A handle at the pose of the device would be
//! strained by the tremor of the hand, which the springs are to take up: 0.1 mm loads a sheet of paper by 18 N.

use nalgebra::UnitQuaternion;
use physics::HandlePose;
use physics::linear::dense::{Eigen, Square};
use rt_core::{HandleReference, LocalModel, MAX_HANDLES, Mat6, Pose, Vec3, Vec6, Wrench};

/// How far beyond the limit, as a fraction of it, the rendered stiffness has fallen to its final value.
const MARGIN: f64 = 0.1;

/// Time in which the envelope of the stiffness falls to a lower stiffness (s).
const FALL: f64 = 0.1;

/// What a device can render, in the units of the scene: the stiffness (N/m) and the stiffness of turns (N m/rad) beyond
/// which springs act. Infinite if the device needs no springs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Renderable {
    /// Of displacements (N/m).
    pub stiffness: f64,
    /// Of turns (N m/rad).
    pub turning: f64,
    /// The part of these that is rendered of a direction that is much stiffer, above zero and at most one.
    pub calm: f64,
    /// The largest damping (N s/m) that the tick renders, and that of turns (N m s/rad). Infinite if it bounds none.
    pub damping: [f64; 2],
}

impl Renderable {
    /// Any stiffness.
    pub const ANY: Self = Self {
        stiffness: f64::INFINITY,
        turning: f64::INFINITY,
        calm: 1.0,
        damping: [f64::INFINITY; 2],
    };
}

/// A direction of a body that is stiffer than its devices can render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StiffDirection {
    /// The handle that moves most in this direction.
    pub handle: usize,
    /// The other handles that move at least half as far, each against the limit of its device: a bit for each.
    pub others: u8,
    /// The direction of its motion: a unit vector in the axes of the scene.
    pub direction: Vec3,
    /// Whether the motion is a turn about the direction.
    pub turns: bool,
    /// The stiffness of the body, as a multiple of the stiffness that the devices render.
    pub ratio: f64,
    /// The stiffness that the devices render (N/m, N m/rad).
    pub rendered: f64,
}

/// The springs of one body.
pub struct SeriesSprings {
    /// The diagonal of `E`, zero if there is no limit.
    root: Vec<f64>,
    /// The motions with a limit.
    limited: Vec<usize>,
    /// `c`: the least of the devices on the handles.
    calm: f64,
    /// `E Kbar E` over the motions with a limit, while springs act.
    envelope: Square,
    acts: bool,
    /// Workspaces of the same size.
    scaled: Square,
    difference: Square,
    eigen: Eigen,
    /// The springs against the stiffness of the model, and against the envelope.
    of_model: Factors,
    of_envelope: Factors,
    /// The Cholesky factor of `I + Q^T K Q`, by rows.
    lower: Vec<f64>,
    stiffest: Option<StiffDirection>,
    model: LocalModel,
}

/// The factors `W` and `Y = K W` of springs, by columns: `R = W W^T`, `S = I - Y W^T`.
struct Factors {
    rows: usize,
    follow: Vec<f64>,
    stiff: Vec<f64>,
}

impl Factors {
    fn new(rows: usize) -> Self {
        Self {
            rows,
            follow: Vec::with_capacity(rows * rows),
            stiff: Vec::with_capacity(rows * rows),
        }
    }

    fn clear(&mut self) {
        self.follow.clear();
        self.stiff.clear();
    }

    /// The columns of `W`, each with its column of `Y`.
    fn columns(&self) -> impl Iterator<Item = (&[f64], &[f64])> {
        let columns = self.follow.chunks_exact(self.rows);
        columns.zip(self.stiff.chunks_exact(self.rows))
    }

    /// `x <- S x`.
    fn pass(&self, x: &mut [f64]) {
        self.apply(x, |(follow, stiff)| (follow, stiff));
    }

    /// `x <- S^T x`.
    fn pass_back(&self, x: &mut [f64]) {
        self.apply(x, |(follow, stiff)| (stiff, follow));
    }

    /// Takes `to (from . x)` of every column out of `x`.
    fn apply<'a>(
        &'a self,
        x: &mut [f64],
        order: impl Fn((&'a [f64], &'a [f64])) -> (&'a [f64], &'a [f64]),
    ) {
        let mut whole = [0.0; 6 * MAX_HANDLES];
        let whole = &mut whole[..x.len()];
        whole.copy_from_slice(x);
        for (from, to) in self.columns().map(order) {
            add(x, to, -dot(from, whole));
        }
    }

    /// `x <- x + R a`.
    fn add_yield(&self, x: &mut [f64], a: &[f64]) {
        for (follow, _) in self.columns() {
            add(x, follow, dot(follow, a));
        }
    }

    /// `a . R b`.
    fn between(&self, a: &[f64], b: &[f64]) -> f64 {
        let each = self.columns();
        each.map(|(follow, _)| dot(follow, a) * dot(follow, b))
            .sum()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `x <- x + factor y`.
fn add(x: &mut [f64], y: &[f64], factor: f64) {
    for (x, y) in x.iter_mut().zip(y) {
        *x += factor * y;
    }
}

impl SeriesSprings {
    /// Springs for a body whose handles these `devices` hold, by what each device of the scene can render. `None` if
    /// no device has a limit.
    pub fn of(devices: &[u8], renderable: &[Renderable]) -> Option<Self> {
        let limits = devices.iter().take(MAX_HANDLES).map(|device| {
            let known = renderable.get(usize::from(*device));
            known.copied().unwrap_or(Renderable::ANY)
        });
        let calm = limits
            .clone()
            .fold(1.0, |least: f64, limit| least.min(limit.calm));
        let slots = limits.flat_map(|limit| {
            let Renderable {
                stiffness, turning, ..
            } = limit;
            [stiffness, stiffness, stiffness, turning, turning, turning]
        });
        let root: Vec<f64> = slots.map(|limit| 1.0 / limit.sqrt()).collect();
        let limited: Vec<usize> = (0..root.len()).filter(|&slot| root[slot] > 0.0).collect();
        let size = limited.len();
        (size > 0).then(|| Self {
            envelope: Square::zeros(size),
            acts: false,
            scaled: Square::zeros(size),
            eigen: Eigen::new(size),
            of_model: Factors::new(root.len()),
            of_envelope: Factors::new(root.len()),
            lower: Vec::with_capacity(size * size),
            difference: Square::zeros(size),
            stiffest: None,
            model: LocalModel::empty(),
            root,
            limited,
            calm,
        })
    }

    /// The model that the devices render through the springs, if springs act; `None` if the devices can render the
    /// body itself. `elapsed` is the time since the last model (s). A stiffness that is not finite ends the springs: the
    /// tick refuses such a model, and the envelope must not keep the number.
    pub fn through(&mut self, model: &LocalModel, elapsed: f64) -> Option<&LocalModel> {
        self.scale(model);
        if !self.scaled.as_slice().iter().all(|entry| entry.is_finite()) {
            self.acts = false;
            return None;
        }
        if !self.acts {
            if self.eigen.is_below_one(&self.scaled) {
                return None;
            }
            self.envelope.clone_from(&self.scaled);
        }
        self.follow(elapsed);
        self.acts = self.find();
        if !self.acts {
            return None;
        }
        self.factorize(model);
        self.render(model);
        Some(&self.model)
    }

    /// The model of the last [`through`](Self::through), if springs act.
    pub fn model(&self) -> Option<&LocalModel> {
        self.acts.then_some(&self.model)
    }

    /// The stiffest direction of all models so far, if springs acted.
    pub fn stiffest(&self) -> Option<StiffDirection> {
        self.stiffest
    }

    /// The directions in which springs act in the last model, stiffest first.
    pub fn directions(&self) -> Vec<StiffDirection> {
        let each = 0..if self.acts { self.limited.len() } else { 0 };
        let mut found: Vec<_> = each.filter_map(|k| self.direction(k)).collect();
        found.sort_by(|one, other| other.ratio.total_cmp(&one.ratio));
        found
    }

    /// Makes the `targets` of the handles, the poses of the devices in the scene, the poses of the proxies, by a
    /// `model` of the body, whose drift has acted for `ahead` (s).
    ///
    /// The wrench of the present step is no substitute for that of the model. It holds the inertia that the step itself sets
    /// in motion, which the stiffness of a model for many steps does not know: the handles would overshoot from step to step.
    pub fn aim(&self, targets: &mut [HandlePose], model: &LocalModel, ahead: f64) {
        if !self.acts {
            return;
        }
        let rows = self.root.len();
        let now = &model.handles[..rows / 6];
        let [mut whole, mut elastic] = [[0.0; 6 * MAX_HANDLES]; 2];
        let places = whole.chunks_exact_mut(6).zip(elastic.chunks_exact_mut(6));
        let each = places.zip(&*targets).zip(now).enumerate();
        for (index, (((place, load), target), handle)) in each {
            let target = Pose {
                position: target.position,
                rotation: target.rotation,
            };
            place.copy_from_slice(target.displacement_from(&handle.pose).as_slice());
            let elastic = elastic_wrench(model, index, now) + handle.drift.stacked() * ahead;
            load.copy_from_slice(elastic.as_slice());
        }
        let mut followed = whole;
        self.of_envelope.pass_back(&mut followed[..rows]);
        (self.of_envelope).add_yield(&mut followed[..rows], &elastic[..rows]);
        let changes = followed.chunks_exact(6).zip(whole.chunks_exact(6));
        for (((now, before), target), handle) in changes.zip(targets).zip(now) {
            let [now, before] = [now, before].map(Vec6::from_column_slice);
            target.position += (now - before).fixed_rows::<3>(0);
            // The springs leave turns without a limit as they are, and so do these targets, to the bit.
            let (now, before): (Vec3, Vec3) = (
                now.fixed_rows::<3>(3).into(),
                before.fixed_rows::<3>(3).into(),
            );
            if now != before {
                target.rotation = UnitQuaternion::from_scaled_axis(now) * handle.pose.rotation;
            }
        }
    }

    /// `E K E` over the limited motions.
    fn scale(&mut self, model: &LocalModel) {
        for (j, &column) in self.limited.iter().enumerate() {
            for (i, &row) in self.limited.iter().enumerate() {
                let entry = model.stiffness[row / 6][column / 6][(row % 6, column % 6)];
                self.scaled[(i, j)] = self.root[row] * entry * self.root[column];
            }
        }
    }

    /// Moves the envelope towards the scaled stiffness: upwards at once, downwards within [`FALL`].
    fn follow(&mut self, elapsed: f64) {
        let size = self.limited.len();
        for j in 0..size {
            for i in 0..size {
                self.difference[(i, j)] = self.scaled[(i, j)] - self.envelope[(i, j)];
            }
        }
        let fall = (elapsed / FALL).min(1.0);
        self.eigen.solve(&self.difference);
        for k in 0..size {
            let value = self.eigen.value(k);
            let value = if value > 0.0 { value } else { fall * value };
            let vector = self.eigen.vector(k);
            for j in 0..size {
                for i in 0..size {
                    self.envelope[(i, j)] += value * vector[i] * vector[j];
                }
            }
        }
    }

    /// Finds the springs of the envelope: its `Q` as `of_model.follow`, and its factors. Returns whether there are any.
    fn find(&mut self) -> bool {
        let rows = self.root.len();
        self.eigen.solve(&self.envelope);
        self.of_envelope.clear();
        self.of_model.clear();
        for k in 0..self.limited.len() {
            let Some(rendered) = self.rendered(k) else {
                continue;
            };
            let value = self.eigen.value(k);
            let spring = (1.0 / rendered - 1.0 / value).sqrt();
            let first = self.of_model.follow.len();
            for list in [
                &mut self.of_model.follow,
                &mut self.of_envelope.follow,
                &mut self.of_envelope.stiff,
            ] {
                list.resize(first + rows, 0.0);
            }
            for (along, &slot) in self.eigen.vector(k).iter().zip(&self.limited) {
                let (root, at) = (self.root[slot], first + slot);
                self.of_model.follow[at] = root * along * spring;
                self.of_envelope.follow[at] = root * along * spring * (rendered / value).sqrt();
                self.of_envelope.stiff[at] = along / root * (value - rendered).sqrt();
            }
            let stiffest = self.stiffest.map_or(0.0, |before| before.ratio);
            self.stiffest = (self.direction(k))
                .filter(|found| found.ratio > stiffest)
                .or(self.stiffest);
        }
        !self.of_model.follow.is_empty()
    }

    /// What is rendered of eigenvalue `k` of the envelope, as a multiple of the limit; `None` if it is rendered whole.
    fn rendered(&self, k: usize) -> Option<f64> {
        let beyond = self.eigen.value(k) - 1.0;
        let falls = || 1.0 - beyond * (1.0 - self.calm) / MARGIN;
        (beyond > 0.0).then(|| falls().max(self.calm))
    }

    /// The direction of eigenvector `k` of the envelope; `None` if it is rendered whole.
    fn direction(&self, k: usize) -> Option<StiffDirection> {
        let rendered = self.rendered(k)?;
        let mut motions = [[Vec3::zeros(); 2]; MAX_HANDLES];
        for (along, &slot) in self.eigen.vector(k).iter().zip(&self.limited) {
            motions[slot / 6][usize::from(slot % 6 > 2)][slot % 3] = *along;
        }
        let (mut handle, mut kind) = (0, 0);
        for (other, pair) in motions.iter().enumerate() {
            for (which, motion) in pair.iter().enumerate() {
                if motion.norm() > motions[handle][kind].norm() {
                    (handle, kind) = (other, which);
                }
            }
        }
        let most = motions[handle][kind];
        let moves = |pair: &[Vec3; 2]| pair.iter().any(|motion| motion.norm() > 0.5 * most.norm());
        let others = motions.iter().enumerate();
        let others = others.filter(|(other, pair)| *other != handle && moves(pair));
        // Of the two signs, the one with which the direction is easier to read.
        let sign = most[most.iamax()].signum();
        Some(StiffDirection {
            handle,
            others: others.fold(0, |bits, (other, _)| bits | 1 << other),
            direction: most.normalize() * sign,
            turns: kind == 1,
            ratio: self.eigen.value(k) / rendered,
            rendered: rendered * self.root[6 * handle + 3 * kind].powi(-2),
        })
    }

    /// Makes `of_model` of `Q`: with the Cholesky factor `L` of `I + Q^T K Q`, `W = Q L^-T` and `Y = K Q L^-T`.
    fn factorize(&mut self, model: &LocalModel) {
        let rows = self.root.len();
        let Factors { follow, stiff, .. } = &mut self.of_model;
        let springs = follow.len() / rows;
        stiff.resize(follow.len(), 0.0);
        for (w, y) in follow.chunks_exact(rows).zip(stiff.chunks_exact_mut(rows)) {
            for (i, y) in y.iter_mut().enumerate() {
                let blocks = model.stiffness[i / 6].iter().zip(w.chunks_exact(6));
                *y = blocks.map(|(block, w)| row_times(block, i % 6, w)).sum();
            }
        }
        self.lower.clear();
        for j in 0..springs {
            for k in 0..springs {
                let own = if j == k { 1.0 } else { 0.0 };
                let (q, kq) = (&follow[j * rows..][..rows], &stiff[k * rows..][..rows]);
                self.lower.push(own + dot(q, kq));
            }
        }
        let lower = &mut self.lower;
        for j in 0..springs {
            for k in 0..=j {
                let (former, this) = (&lower[k * springs..][..k], &lower[j * springs..][..k]);
                let rest = lower[j * springs + k] - dot(former, this);
                lower[j * springs + k] = if k < j {
                    rest / lower[k * springs + k]
                } else {
                    // The matrix is the identity plus a positive matrix, up to rounding.
                    rest.max(1.0).sqrt()
                };
            }
            for list in [&mut *follow, &mut *stiff] {
                let (former, this) = list.split_at_mut(j * rows);
                let this = &mut this[..rows];
                for (k, former) in former.chunks_exact(rows).enumerate() {
                    add(this, former, -lower[j * springs + k]);
                }
                for x in this {
                    *x /= lower[j * springs + j];
                }
            }
        }
    }

    /// Writes the model that the devices render.
    fn render(&mut self, model: &LocalModel) {
        let (rows, springs) = (self.root.len(), &self.of_model);
        self.model.copy_used_from(model);
        let out = &mut self.model;
        let [mut elastic, mut speeds] = [[0.0; 6 * MAX_HANDLES]; 2];
        for (slot, handle) in speeds.chunks_exact_mut(6).zip(model.handles()) {
            slot.copy_from_slice(handle.twist.stacked().as_slice());
        }
        for (i, slot) in elastic[..rows].chunks_exact_mut(6).enumerate() {
            slot.copy_from_slice(elastic_wrench(model, i, &model.handles[..rows / 6]).as_slice());
        }
        let (elastic, speeds) = (&elastic[..rows], &speeds[..rows]);

        for j in 0..rows {
            for i in 0..rows {
                let entry = &mut out.stiffness[i / 6][j / 6][(i % 6, j % 6)];
                for (_, stiff) in springs.columns() {
                    *entry -= stiff[i] * stiff[j];
                }
            }
        }
        let damping = &mut out.damping;
        let mut line = [0.0; 6 * MAX_HANDLES];
        let line = &mut line[..rows];
        for along_columns in [true, false] {
            for fixed in 0..rows {
                let place = |k: usize| {
                    if along_columns {
                        (k, fixed)
                    } else {
                        (fixed, k)
                    }
                };
                for (k, value) in line.iter_mut().enumerate() {
                    let (i, j) = place(k);
                    *value = damping[i / 6][j / 6][(i % 6, j % 6)];
                }
                springs.pass(line);
                for (k, value) in line.iter().enumerate() {
                    let (i, j) = place(k);
                    damping[i / 6][j / 6][(i % 6, j % 6)] = *value;
                }
            }
        }

        line.copy_from_slice(elastic);
        springs.pass(line);
        for (i, value) in line.iter_mut().enumerate() {
            let blocks = damping[i / 6].iter().zip(speeds.chunks_exact(6));
            *value -= blocks
                .map(|(block, speed)| row_times(block, i % 6, speed))
                .sum::<f64>();
        }
        for (handle, wrench) in out.handles.iter_mut().zip(line.chunks_exact(6)) {
            handle.wrench = Wrench::from_stacked(&Vec6::from_column_slice(wrench));
            handle.wrench.force += handle.weight;
        }
        for (place, handle) in line.chunks_exact_mut(6).zip(model.handles()) {
            place.copy_from_slice(handle.drift.stacked().as_slice());
        }
        springs.pass(line);
        for (handle, drift) in out.handles.iter_mut().zip(line.chunks_exact(6)) {
            handle.drift = Wrench::from_stacked(&Vec6::from_column_slice(drift));
        }
        self.yield_energy(model, elastic);
        self.limit(model, elastic);
    }

    /// Takes the energy that the springs release to the handles out of what the model states.
    fn yield_energy(&mut self, model: &LocalModel, elastic: &[f64]) {
        let springs = &self.of_model;
        let out = &mut self.model;
        out.head.energy = (model.head.energy - 0.5 * springs.between(elastic, elastic)).max(0.0);
        for (piece, energy) in out.head.pieces.iter_mut().enumerate() {
            if energy.stored > 0.0 {
                let mut own = [0.0; 6 * MAX_HANDLES];
                let loads = own.chunks_exact_mut(6).zip(elastic.chunks_exact(6));
                for ((own, elastic), handle) in loads.zip(model.handles()) {
                    if usize::from(handle.piece) == piece {
                        own.copy_from_slice(elastic);
                    }
                }
                energy.stored = (energy.stored - 0.5 * springs.between(&own, &own)).max(0.0);
            }
        }
    }

    /// The tear limit for displacements of the devices.
    fn limit(&mut self, model: &LocalModel, elastic: &[f64]) {
        if !model.head.tear_limit.is_some() {
            return;
        }
        let springs = &self.of_model;
        let mut slope = [0.0; 6 * MAX_HANDLES];
        let slope = &mut slope[..elastic.len()];
        for (place, handle) in slope.chunks_exact_mut(6).zip(model.handles()) {
            place.copy_from_slice(handle.tear_slope.as_slice());
        }
        let limit = &mut self.model.head.tear_limit;
        if limit.is_touch() {
            // The springs give way before the contact does; a touch that they close already is at its gap.
            limit.critical -= springs.between(slope, elastic);
            limit.critical = limit.critical.max(f64::MIN_POSITIVE);
            limit.area = 1.0 / (1.0 / limit.area - springs.between(slope, slope));
        } else {
            limit.root += springs.between(slope, elastic);
        }
        if limit.area > 0.0 {
            let inverse = 1.0 / limit.area - springs.between(slope, slope);
            limit.area = if inverse > 0.0 { 1.0 / inverse } else { 0.0 };
        }
        springs.pass(slope);
        for (handle, slope) in self.model.handles.iter_mut().zip(slope.chunks_exact(6)) {
            handle.tear_slope = Vec6::from_column_slice(slope);
        }
    }
}

/// The wrench `a` of handle number `index`: without the weight, and without the dampers of `model`.
fn elastic_wrench(model: &LocalModel, index: usize, handles: &[HandleReference]) -> Vec6 {
    let dampers = model.damping[index].iter().zip(handles);
    dampers.fold(handles[index].unweighted(), |wrench, (block, other)| {
        wrench + block * other.twist.stacked()
    })
}

/// Row `i` of a block times a part of a vector.
fn row_times(block: &Mat6, i: usize, x: &[f64]) -> f64 {
    block.row(i).iter().zip(x).map(|(k, x)| k * x).sum()
}

#[cfg(test)]
mod tests;
