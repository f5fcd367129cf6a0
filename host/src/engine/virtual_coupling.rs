//! Virtual coupling: springs and dampers connect devices to massless proxies, and the proxies touch the body.
//!
//! The coupling is that of J. E. Colgate, M. C. Stanley and J. M. Brown, "Issues in the haptic display of tool use"
//! (1995). The proxy is that of C. B. Zilles and J. K. Salisbury, "A constraint-based god-object method for haptic
//! display" (1995). However stiff the body is, the stiffness at the hand does not exceed that of the spring, which is
//! chosen so that the device can render it.
//!
//! The proxies have no mass. At their displacements `q`, the wrench `a - K q` of the linearized body balances the
//! wrench `Kc (d - q)` of the springs. Here `K` is the body's stiffness, `a` its wrench without the wrench of its
//! dampers, and `d` are the displacements of the devices. So the devices render body and springs in series, all
//! handles together:
//!
//! ```text
//! S  = (I + K C)^-1         C = Kc^-1: the springs' compliance; the proxies move by S^T d + C S a
//! a' = S a
//! K' = S K = S K S^T + (I - S) Kc (I - S)^T
//! B' = S B S^T + (I - S) Bc (I - S)^T
//! p' = S p
//! ```
//!
//! The second form of `K'` corresponds to the energy of body and springs. The form of `B'` corresponds to the power
//! that body and dampers dissipate as the proxies follow. Both matrices are positive if those of the body are, and
//! the motion of a free body is not damped. With `C = R R`, the matrix to factorize is `M = I + R K R`. It is
//! symmetric and never near singular, even if the body yields or a motion has no spring (`R = 0`: the proxy
//! coincides with the device). `Y = M^-1 R K` gives `S = I - Y^T R`. With the ratio `t` of a spring's damping to its
//! stiffness, `K' = S K S^T + Y^T Y` and `B' = S B S^T + Y^T t Y`.
//!
//! The host computes the coupling, and the tick renders the published model as it is.

use physics::linear::dense::Square;
use rt_core::{LocalModel, MAX_HANDLES, PieceEnergy, TearLimit, Vec6, Wrench};
use sim::DeviceModel;

/// The spring and the damper between one device and its proxy, in the units of the scene.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spring {
    /// Stiffness (N/m), above zero.
    pub stiffness: f64,
    /// Damping (N s/m).
    pub damping: f64,
}

impl Spring {
    /// The largest stiffness and damping that the device's driver recommends.
    pub fn recommended(device: &DeviceModel) -> Self {
        Self {
            stiffness: device.driver_stiffness,
            damping: device.driver_damping,
        }
    }
}

/// Couples one body to the devices of its handles.
pub struct VirtualCoupling {
    links: Vec<Spring>,
    /// The lever arm (m) at which a spring resists a turn.
    length: f64,
    /// The diagonals of `R` and `t`.
    root: Vec<f64>,
    ratio: Vec<f64>,
    body: [Square; 2],
    coupled: [Square; 2],
    /// The factor of `M`; `follow` is `Y`, and `fraction` is `S`.
    factor: Square,
    follow: Square,
    fraction: Square,
    speed: Vec<f64>,
    wrench: Vec<f64>,
    drift: Vec<f64>,
    model: LocalModel,
}

impl VirtualCoupling {
    /// A coupling with one link for each handle.
    pub fn new(links: Vec<Spring>) -> Self {
        let size = 6 * links.len().min(MAX_HANDLES);
        let zeros = || Square::zeros(size);
        Self {
            links,
            length: 1.0,
            root: vec![0.0; size],
            ratio: vec![0.0; size],
            body: [zeros(), zeros()],
            coupled: [zeros(), zeros()],
            factor: zeros(),
            follow: zeros(),
            fraction: zeros(),
            speed: vec![0.0; size],
            wrench: vec![0.0; size],
            drift: vec![0.0; size],
            model: LocalModel::empty(),
        }
    }

    /// The links, by handle.
    pub(super) fn links(&self) -> &[Spring] {
        &self.links
    }

    /// Sets the lever arm `length` (m) at which the springs resist turns. The coupling does not resist the turns of a
    /// handle if the body does not resist them.
    pub(crate) fn set_length(&mut self, length: f64) {
        self.length = length;
    }

    /// The model that devices render through their springs. It does not state the energy stored in body and springs:
    /// those fields are zero. It has no tear limit, for the limit belongs to the displacements of the handles.
    pub fn through(&mut self, model: &LocalModel) -> &LocalModel {
        self.model = *model;
        self.model.head.energy = 0.0;
        self.model.head.released = 0.0;
        self.model.head.received = 0.0;
        self.model.head.pieces = [PieceEnergy::default(); MAX_HANDLES];
        self.model.head.tear_limit = TearLimit::none();
        self.read(model);
        self.factorize();
        self.combine();
        self.write(model);
        &self.model
    }

    /// The latest model of [`through`](Self::through).
    pub fn model(&self) -> &LocalModel {
        &self.model
    }

    fn read(&mut self, model: &LocalModel) {
        let arm = self.length;
        let rows = self.root.iter_mut().zip(&mut self.ratio).enumerate();
        for (slot, (root, ratio)) in rows {
            let Spring { stiffness, damping } = self.links[slot / 6];
            let lever = if slot % 6 < 3 { 1.0 } else { arm };
            *root = 1.0 / (lever * stiffness.sqrt());
            *ratio = damping / stiffness;
        }
        let blocks = [&model.stiffness, &model.damping];
        for (matrix, blocks) in self.body.iter_mut().zip(blocks) {
            for j in 0..matrix.size() {
                for i in 0..matrix.size() {
                    matrix[(i, j)] = blocks[i / 6][j / 6][(i % 6, j % 6)];
                }
            }
        }
    }

    /// Computes `Y` and `S` with a Cholesky factor of `M`.
    fn factorize(&mut self) {
        let (root, [stiffness, _]) = (&self.root, &self.body);
        let size = root.len();
        for j in 0..size {
            for i in j..size {
                let mut sum = root[i] * stiffness[(i, j)] * root[j];
                if i == j {
                    sum += 1.0;
                }
                for k in 0..j {
                    sum -= self.factor[(i, k)] * self.factor[(j, k)];
                }
                self.factor[(i, j)] = if i == j {
                    sum.sqrt()
                } else {
                    sum / self.factor[(j, j)]
                };
            }
        }
        for c in 0..size {
            for i in 0..size {
                let mut sum = root[i] * stiffness[(i, c)];
                for k in 0..i {
                    sum -= self.factor[(i, k)] * self.follow[(k, c)];
                }
                self.follow[(i, c)] = sum / self.factor[(i, i)];
            }
            for i in (0..size).rev() {
                let mut sum = self.follow[(i, c)];
                for k in i + 1..size {
                    sum -= self.factor[(k, i)] * self.follow[(k, c)];
                }
                self.follow[(i, c)] = sum / self.factor[(i, i)];
            }
        }
        for j in 0..size {
            for i in 0..size {
                let whole = if i == j { 1.0 } else { 0.0 };
                self.fraction[(i, j)] = whole - self.follow[(j, i)] * root[j];
            }
        }
    }

    /// Computes `K'` and `B'`.
    fn combine(&mut self) {
        let size = self.root.len();
        let half = &mut self.factor;
        let each = self.coupled.iter_mut().zip(&self.body).enumerate();
        for (which, (coupled, body)) in each {
            for j in 0..size {
                for i in 0..size {
                    half[(i, j)] = (0..size)
                        .map(|k| self.fraction[(i, k)] * body[(k, j)])
                        .sum();
                }
            }
            for j in 0..size {
                for i in 0..size {
                    let through = (0..size).map(|k| half[(i, k)] * self.fraction[(j, k)]);
                    let spring = (0..size).map(|k| {
                        let weight = if which == 0 { 1.0 } else { self.ratio[k] };
                        weight * self.follow[(k, i)] * self.follow[(k, j)]
                    });
                    coupled[(i, j)] = through.sum::<f64>() + spring.sum::<f64>();
                }
            }
            coupled.symmetrize();
        }
    }

    /// Writes the model's blocks and its wrenches, `a' - B' v`, with the velocity `v` of the handles.
    fn write(&mut self, model: &LocalModel) {
        let places = self.speed.chunks_exact_mut(6);
        let places = places.zip(self.wrench.chunks_exact_mut(6));
        let places = places.zip(self.drift.chunks_exact_mut(6));
        for (((speed, wrench), drift), handle) in places.zip(model.handles()) {
            speed.copy_from_slice(handle.twist.stacked().as_slice());
            drift.copy_from_slice(handle.drift.stacked().as_slice());
            wrench.copy_from_slice(handle.wrench.stacked().as_slice());
        }
        let size = self.root.len();
        let times = |matrix: &Square, vector: &[f64], i: usize| -> f64 {
            (0..size).map(|k| matrix[(i, k)] * vector[k]).sum()
        };
        let [stiffness, damping] = &self.coupled;
        for i in 0..size {
            self.wrench[i] += times(&self.body[1], &self.speed, i);
        }
        for (h, handle) in self.model.handles.iter_mut().enumerate().take(size / 6) {
            let wrench = Vec6::from_fn(|r, _| {
                let slot = 6 * h + r;
                times(&self.fraction, &self.wrench, slot) - times(damping, &self.speed, slot)
            });
            handle.wrench = Wrench::from_stacked(&wrench);
            let drift = Vec6::from_fn(|r, _| times(&self.fraction, &self.drift, 6 * h + r));
            handle.drift = Wrench::from_stacked(&drift);
        }
        for j in 0..size {
            for i in 0..size {
                let at = (i % 6, j % 6);
                self.model.stiffness[i / 6][j / 6][at] = stiffness[(i, j)];
                self.model.damping[i / 6][j / 6][at] = damping[(i, j)];
            }
        }
    }
}

#[cfg(test)]
mod tests;
