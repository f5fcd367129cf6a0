//! The part of a body that devices render, by a condensation of the study's own.
//!
//! A device cannot render a direction of a body that is stiffer than its friction and its damping can hold still. The host
//! puts springs in series with such directions (`host::engine::stiff`). The bodies of a study have the same springs: the
//! springs are a part of the task, as is the largest force of a motor. The law of the springs is the host's. The body, its
//! condensation and the proxies between springs and body are of the study: they take a step in each tick, at the true
//! poses, without models, latency and encoder.
//!
//! The springs follow the stiffness of the body. A condensation costs as much as many steps, so the study makes one every
//! [`RENEWED`] seconds, and fewer of a large body while it is far softer than its devices render. What a new condensation
//! corrects of the proxies' places comes in evenly within the same time: a jump of a micrometre would be an impact.

use crate::StudyError;
use host::engine::plan::renderable;
use host::engine::projected::Projected;
use host::engine::publisher::{fill_blocks, reference_of};
use host::engine::stiff::{Renderable, SeriesSprings};
use host::world::World;
use nalgebra::UnitQuaternion;
use physics::linear::dense::{Eigen, Square};
use physics::{Body, Condenser, HandlePose};
use rt_core::{LocalModel, Pose, Vec3, Vec6};

/// Time from one condensation to the next (s) while springs act or may soon act, and otherwise.
const RENEWED: [f64; 2] = [0.01, 0.1];
/// The stiffness, as a multiple of what the devices render, from which springs may soon act. A thread that becomes taut comes
/// from no stiffness at all, so bodies of up to [`SMALL`] unknowns count as such always.
const SOON: f64 = 0.3;
const SMALL: usize = 1500;

/// The stiffness of one body at its handles, and the springs of its devices.
pub(in crate::stress) struct Rendered {
    condenser: Condenser,
    projected: Projected,
    springs: Option<SeriesSprings>,
    /// What the device of each handle can render.
    limits: Vec<Renderable>,
    model: LocalModel,
    /// The time for which the stiffness is condensed (s).
    horizon: f64,
    /// What the last condensation corrected of the place of each handle (m, rad).
    corrected: Vec<Vec6>,
    /// Time since the last condensation (s), and the time after which the next one is due.
    elapsed: f64,
    due: f64,
}

impl Rendered {
    /// What the `devices` of a world, by handle, render of `body` in models that serve for `horizon` (s).
    pub(in crate::stress) fn new(
        world: &World<'_>,
        devices: &[usize],
        body: &mut Body,
        horizon: f64,
    ) -> Result<Self, StudyError> {
        let all = renderable(world.loaded);
        let numbers: Vec<u8> = devices.iter().map(|device| *device as u8).collect();
        let mut model = LocalModel::empty();
        model.head.handle_count = numbers.len() as u8;
        let projected = Projected::new(world);
        let weights = body.handle_weights();
        for ((handle, device), weight) in model.handles.iter_mut().zip(&numbers).zip(weights) {
            handle.device = *device;
            handle.weight = weight;
            projected.weight(handle);
        }
        let mut rendered = Self {
            condenser: Condenser::new(body)?,
            springs: SeriesSprings::of(&numbers, &all),
            limits: devices.iter().map(|device| all[*device]).collect(),
            projected,
            model,
            horizon,
            corrected: vec![Vec6::zeros(); devices.len()],
            elapsed: 0.0,
            due: 0.0,
        };
        rendered.renew(body)?;
        Ok(rendered)
    }

    /// Condenses the present state of the body.
    pub(in crate::stress) fn renew(&mut self, body: &mut Body) -> Result<(), StudyError> {
        // The stepper of a body that tears goes by the places of the body before its latest edits.
        let mut copy;
        let body = if body.surface().is_some() {
            copy = body.clone();
            &mut copy
        } else {
            body
        };
        body.assemble();
        let condensed = self.condenser.condense(body, self.horizon)?;
        fill_blocks(&mut self.model, condensed);
        self.projected.blocks(&mut self.model);
        let count = usize::from(self.model.head.handle_count);
        for (index, handle) in self.model.handles[..count].iter_mut().enumerate() {
            if let Some(report) = body.handle_report(index) {
                let (weight, drift) = (handle.weight, handle.drift);
                *handle = reference_of(handle.device, report);
                (handle.weight, handle.drift) = (weight, drift);
                self.projected.wrench(handle);
            }
        }
        if let Some(springs) = &mut self.springs {
            springs.through(&self.model, self.elapsed);
        }
        self.elapsed = 0.0;
        self.due = RENEWED[usize::from(body.unknown_count() > SMALL && self.ratio() < SOON)];
        Ok(())
    }

    /// Moves the `targets` of the handles, the poses of the devices, to the proxies, for a step of `step` (s).
    pub(super) fn aim(
        &mut self,
        targets: &mut [HandlePose],
        body: &mut Body,
        step: f64,
    ) -> Result<(), StudyError> {
        if self.springs.is_some() && self.elapsed >= self.due {
            let mut before = targets.to_vec();
            self.correct(&mut before, step);
            self.renew(body)?;
            let mut now = targets.to_vec();
            self.corrected.fill(Vec6::zeros());
            self.correct(&mut now, step);
            let pairs = before.iter().zip(&now).zip(&mut self.corrected);
            for ((before, now), corrected) in pairs {
                *corrected = pose(before).displacement_from(&pose(now));
            }
        }
        self.correct(targets, step);
        self.elapsed += step;
        Ok(())
    }

    /// Moves `targets`, the poses of the devices at the end of a step of `step` (s), to the proxies.
    fn correct(&self, targets: &mut [HandlePose], step: f64) {
        let Some(springs) = &self.springs else {
            return;
        };
        springs.aim(targets, &self.model, self.elapsed + step);
        let left = (1.0 - self.elapsed / RENEWED[0]).max(0.0);
        for (target, corrected) in targets.iter_mut().zip(&self.corrected) {
            let moved = corrected * left;
            target.position += Vec3::from(moved.fixed_rows::<3>(0));
            let turned = Vec3::from(moved.fixed_rows::<3>(3));
            // A device that senses no rotation has the same one always.
            if turned != Vec3::zeros() {
                target.rotation = UnitQuaternion::from_scaled_axis(turned) * target.rotation;
            }
        }
    }

    /// The stiffness and the damping that the devices render, and the wrenches at the last condensation.
    pub(in crate::stress) fn model(&self) -> &LocalModel {
        let springs = self.springs.as_ref().and_then(SeriesSprings::model);
        springs.unwrap_or(&self.model)
    }

    /// The largest stiffness of the body in any motion of its handles, as a multiple of what their devices render.
    pub(in crate::stress) fn ratio(&self) -> f64 {
        let (_, eigen) = self.spectrum();
        (0..self.slots().len())
            .map(|k| eigen.value(k))
            .fold(0.0, f64::max)
    }

    /// The force on each handle (N) that displacements of the handles (m, rad) make in the soft directions: those that the
    /// devices render as they are, so that no spring explains a displacement.
    pub(super) fn soft(&self, apart: &[Vec6]) -> Vec<Vec3> {
        let slots = self.slots();
        let (roots, eigen) = self.spectrum();
        let mut forces = vec![Vec3::zeros(); apart.len()];
        for k in (0..slots.len()).filter(|&k| eigen.value(k) <= 1.0) {
            let each = slots.iter().zip(&roots).zip(eigen.vector(k));
            let along: f64 = each
                .map(|((slot, root), u)| u * root * apart[slot / 6][slot % 6])
                .sum();
            for ((slot, root), u) in slots.iter().zip(&roots).zip(eigen.vector(k)) {
                if slot % 6 < 3 {
                    forces[slot / 6][slot % 6] += eigen.value(k) * along * u * root;
                }
            }
        }
        forces
    }

    /// The motions of the handles that their devices limit, of six for each handle.
    fn slots(&self) -> Vec<usize> {
        let all = 0..6 * self.limits.len();
        all.filter(|slot| self.limit(*slot).is_finite()).collect()
    }

    fn limit(&self, slot: usize) -> f64 {
        let limit = &self.limits[slot / 6];
        if slot % 6 < 3 {
            limit.stiffness
        } else {
            limit.turning
        }
    }

    /// The roots of the limits, and the stiffness of the body as a multiple of the limits.
    fn spectrum(&self) -> (Vec<f64>, Eigen) {
        let slots = self.slots();
        let roots: Vec<f64> = slots.iter().map(|slot| self.limit(*slot).sqrt()).collect();
        let mut scaled = Square::zeros(slots.len());
        for (j, column) in slots.iter().enumerate() {
            for (i, row) in slots.iter().enumerate() {
                let block = &self.model.stiffness[row / 6][column / 6];
                scaled[(i, j)] = block[(row % 6, column % 6)] / (roots[i] * roots[j]);
            }
        }
        let mut eigen = Eigen::new(slots.len());
        eigen.solve(&scaled);
        (roots, eigen)
    }
}

fn pose(of: &HandlePose) -> Pose {
    Pose {
        position: of.position,
        rotation: of.rotation,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::scene::Scene;
    use std::collections::BTreeMap;

    /// A strip of paper, fixed at one end and held at the other.
    const PAPER: &str = r#"
name = "paper"

[[body]]
name = "paper"
mesh = { sheet = { length = 0.1, width = 0.06, cells = [8, 4] } }
material = { young = 3e9, poisson = 0.3, thickness = 0.0001, density = 900.0 }
support = [{ name = "wall", group = "left", border = "clamped" }]
handle = [{ name = "end", group = "right", device = "device" }]

[[device]]
name = "device"
model = "falcon"
hand = {}
"#;

    #[test]
    fn only_a_displacement_in_a_soft_direction_counts_as_a_force() {
        let loaded = Scene::load_texts("paper.toml", PAPER, &BTreeMap::new()).expect("it is sound");
        let world = World::new(&loaded).expect("it is sound");
        let mut body = world.bodies[0].body.clone();
        let rendered = Rendered::new(&world, &[0], &mut body, 1.0).expect("it condenses");
        assert!(rendered.ratio() > 10.0);
        let force = |apart: Vec3| {
            let apart = Vec6::new(apart.x, apart.y, apart.z, 0.0, 0.0, 0.0);
            rendered.soft(&[apart])[0]
        };
        // Along itself the paper is stiff, across it is soft. The mesh is flat, so the two do not mix.
        assert!(force(Vec3::x() * 1e-3).norm() < 1e-9);
        let across = force(Vec3::z() * 1e-3);
        let stiffness = rendered.model.stiffness[0][0][(2, 2)];
        // The paper is a million times stiffer along itself, which costs six digits of the soft eigenvalue.
        assert!((across.z / (1e-3 * stiffness) - 1.0).abs() < 1e-6 && stiffness > 0.01);
        // The springs leave the soft direction as it is, and bound the stiff one.
        let through = &rendered.model().stiffness[0][0];
        assert!((through[(2, 2)] / stiffness - 1.0).abs() < 1e-6);
        let limit = rendered.limits[0];
        let bounded = through[(0, 0)] / (limit.stiffness * limit.calm);
        assert!((bounded - 1.0).abs() < 1e-6, "{bounded}");
    }
}
