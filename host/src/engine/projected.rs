//! The part of a local model that devices of one or two degrees of freedom render.
//!
//! The mechanism of such a device holds its handle across the device's axes and bears the force there. With the
//! orthogonal projection `P_i` onto the axes of the device of handle `i` (in the axes of the scene), the hand feels the
//! wrench `P_i w_i`, and only the displacements `P_j d_j` occur. The model of the hands is therefore
//! `P_i w0_i + P_i p_i s - sum_j (P_i K_ij P_j d_j + P_i B_ij P_j e_j)`. This model is what the body publishes. The force
//! that the mechanism bears does no work, so the energy of the model is that of the body; the tangent's estimate of it
//! (`stored.rs`) is taken from the projected model, because hands cannot recover energy across the axes.

use crate::world::World;
use nalgebra::Matrix3;
use rt_core::{HandleReference, LocalModel, Mat6, Vec3};

/// The projections onto the axes of a scene's devices, by device.
#[derive(Clone, Debug, Default)]
pub struct Projected {
    /// `None` for a device that moves along all axes, and for one beyond the list.
    axes: Vec<Option<Matrix3<f64>>>,
}

impl Projected {
    /// The projections for the devices of a world.
    pub fn new(world: &World<'_>) -> Self {
        let each = world.loaded.models.iter().zip(&world.mounts);
        let each = each.map(|(model, mount)| {
            let rotation = mount.rotation.to_rotation_matrix();
            let diagonal = model.axes?.part(&Vec3::repeat(1.0));
            let part = Matrix3::from_diagonal(&diagonal);
            Some(rotation.matrix() * part * rotation.matrix().transpose())
        });
        Self {
            axes: each.collect(),
        }
    }

    /// Leaves only what hands feel of a model's stiffness, damping and drift.
    pub fn blocks(&self, model: &mut LocalModel) {
        let handles = usize::from(model.head.handle_count);
        let LocalModel {
            handles: references,
            stiffness,
            damping,
            ..
        } = model;
        for (i, reference) in references.iter_mut().enumerate().take(handles) {
            if let Some(part) = self.of(reference.device) {
                reference.drift.force = part * reference.drift.force;
                for j in 0..handles {
                    for block in [&mut stiffness[i][j], &mut damping[i][j]] {
                        rows(block, part);
                    }
                    for block in [&mut stiffness[j][i], &mut damping[j][i]] {
                        columns(block, part);
                    }
                }
            }
        }
    }

    /// Leaves only what its hand feels of the wrench on a handle, and only the displacements that its device allows of
    /// the slope of a tear limit.
    pub fn wrench(&self, reference: &mut HandleReference) {
        if let Some(part) = self.of(reference.device) {
            reference.wrench.force = part * reference.wrench.force;
            let slope = part * reference.tear_slope.fixed_rows::<3>(0);
            reference
                .tear_slope
                .fixed_rows_mut::<3>(0)
                .copy_from(&slope);
        }
    }

    /// Leaves only what its hand feels of the weight on a handle.
    pub fn weight(&self, reference: &mut HandleReference) {
        if let Some(part) = self.of(reference.device) {
            reference.weight = part * reference.weight;
        }
    }

    fn of(&self, device: u8) -> Option<&Matrix3<f64>> {
        self.axes.get(usize::from(device))?.as_ref()
    }
}

/// Replaces the rows of a block that belong to the force by their part.
fn rows(block: &mut Mat6, part: &Matrix3<f64>) {
    let left = part * block.fixed_rows::<3>(0);
    block.fixed_rows_mut::<3>(0).copy_from(&left);
}

/// Replaces the columns of a block that belong to the translation by their part.
fn columns(block: &mut Mat6, part: &Matrix3<f64>) {
    let left = block.fixed_columns::<3>(0) * part;
    block.fixed_columns_mut::<3>(0).copy_from(&left);
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Vector3};
    use rt_core::{Pose, Twist};

    /// Two handles; the device of the first moves along a slanting line, that of the second along all axes.
    fn example() -> (Projected, LocalModel, Vec3) {
        let line = Rotation3::from_euler_angles(0.3, -0.4, 0.7) * Vector3::x();
        let projected = Projected {
            axes: vec![Some(line * line.transpose())],
        };
        let mut model = LocalModel::empty();
        model.head.handle_count = 2;
        model.handles[1].device = 1;
        for i in 0..2 {
            let reference = &mut model.handles[i];
            reference.wrench.force = Vec3::new(0.3, -1.0, 0.2 + i as f64);
            reference.drift.force = Vec3::new(3.0, 1.0, -2.0);
            reference.weight = Vec3::new(0.0, 0.0, -0.5);
            for j in 0..2 {
                // Symmetric as a whole.
                let block = |scale: f64| {
                    Mat6::from_fn(|r, c| {
                        let (a, b) = (6 * i + r, 6 * j + c);
                        scale / (1.0 + (a as f64 - b as f64).abs()) + if a == b { 9.0 } else { 0.0 }
                    })
                };
                (model.stiffness[i][j], model.damping[i][j]) = (block(1.0), block(0.1));
            }
        }
        (projected, model, line)
    }

    #[test]
    fn a_hand_on_a_line_feels_the_bodys_force_along_the_line_and_none_across() {
        let (projected, whole, line) = example();
        let mut part = whole;
        projected.blocks(&mut part);
        for handle in &mut part.handles {
            projected.wrench(handle);
            projected.weight(handle);
        }
        // A displacement along the line, as the device allows it.
        let at = |by: Vec3, speed: Vec3| {
            let twist = Twist {
                linear: speed,
                ..Twist::zero()
            };
            (Pose::at(by), twist)
        };
        let devices = [
            at(line * 2e-3, line * -0.1),
            at(Vec3::new(1e-3, -2e-3, 3e-3), Vec3::new(0.1, 0.0, 0.2)),
        ];
        let [before, after] =
            [&whole, &part].map(|model| model.wrenches(&model.deviations(&devices), 0.004));
        // Rounding of numbers of order one.
        let along = line * line.dot(&before[0].force);
        assert!((after[0].force - along).norm() < 1e-14);
        assert!((after[1].force - before[1].force).norm() < 1e-14);
        assert!(before[0].force.cross(&line).norm() > 0.5);
        assert!(part.handles[0].weight.cross(&line).norm() < 1e-15);
        // The other hand's model alone is that of the body.
        assert_eq!(part.stiffness[1][1], whole.stiffness[1][1]);
        assert_eq!(part.handles[1], whole.handles[1]);
        // The whole stays symmetric.
        for (i, j) in [(0, 0), (0, 1)] {
            let difference = part.stiffness[i][j] - part.stiffness[j][i].transpose();
            assert!(difference.norm() < 1e-14);
        }
    }

    #[test]
    fn devices_of_all_axes_leave_a_model_as_it_is() {
        let (_, whole, _) = example();
        let mut part = whole;
        Projected::default().blocks(&mut part);
        assert_eq!(part, whole);
    }
}
