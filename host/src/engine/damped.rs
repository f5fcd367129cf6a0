//! The part of a body's damping that its devices render.
//!
//! Under `capped` the tick bounds the damping of each handle by what its device can render
//! ([`rt_core::velocity::most_damping`]). A body of more damping feels thinner in motion than it is. Its models tell at
//! which handle, in which direction and by how much.

use super::stiff::Renderable;
use nalgebra::Matrix3;
use rt_core::{LocalModel, Vec3};

/// The largest fraction of the damping that counts as less than the whole. The just-noticeable difference of a force is
/// about a tenth.
const NOTICED: f64 = 0.9;

/// The direction in which one handle has the most damping, of which its device renders a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DampedDirection {
    /// The handle.
    pub handle: usize,
    /// The direction of its motion: a unit vector in the axes of the scene.
    pub direction: Vec3,
    /// Whether the motion is a turn about the direction.
    pub turns: bool,
    /// The damping of the body in this motion of the handle alone (N s/m, N m s/rad).
    pub damping: f64,
    /// The damping that the device renders.
    pub rendered: f64,
}

/// The least part of the damping of one body that devices rendered.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Damped {
    least: Option<DampedDirection>,
}

impl Damped {
    /// The handle and the direction of which the least part was rendered, of all models so far; `None` if the devices
    /// rendered the whole.
    pub(super) fn least(&self) -> Option<DampedDirection> {
        self.least
    }

    /// Takes a published `model`. `renderable` is what each device of the scene can render.
    pub(super) fn see(&mut self, model: &LocalModel, renderable: &[Renderable]) {
        let most = |device: u8| {
            let known = renderable.get(usize::from(device));
            known.unwrap_or(&Renderable::ANY).damping
        };
        let fractions = model.rendered_damping(most);
        for (handle, fractions) in fractions.iter().enumerate() {
            for (kind, &fraction) in fractions.iter().enumerate() {
                let least = self.least.map_or(NOTICED, |at| at.rendered / at.damping);
                if fraction < least {
                    self.least = Some(direction(model, handle, kind == 1, fraction));
                }
            }
        }
    }
}

/// The direction of the largest damping of a handle, of which the device renders `fraction`.
fn direction(model: &LocalModel, handle: usize, turns: bool, fraction: f64) -> DampedDirection {
    let first = if turns { 3 } else { 0 };
    let own = model.damping[handle][handle].fixed_view::<3, 3>(first, first);
    let eigen = Matrix3::from(own).symmetric_eigen();
    let most = eigen.eigenvalues.imax();
    let along: Vec3 = eigen.eigenvectors.column(most).into();
    let damping = eigen.eigenvalues[most];
    DampedDirection {
        handle,
        // Of the two signs, the one with which the direction is easier to read.
        direction: along * along[along.iamax()].signum(),
        turns,
        damping,
        rendered: fraction * damping,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_part_of_all_handles_and_models_is_told_with_its_direction() {
        let limits = [20.0, 10.0].map(|most| Renderable {
            damping: [most, 0.1],
            ..Renderable::ANY
        });
        let mut model = LocalModel::empty();
        model.head.handle_count = 2;
        model.handles[1].device = 1;
        let mut damped = Damped::default();
        // 5 % more than the device renders are not noticed.
        model.damping[0][0][(0, 0)] = 21.0;
        damped.see(&model, &limits);
        assert_eq!(damped.least(), None);
        model.damping[0][0][(0, 0)] = 25.0;
        model.damping[1][1][(2, 2)] = 40.0;
        damped.see(&model, &limits);
        let expected = DampedDirection {
            handle: 1,
            direction: Vec3::z(),
            turns: false,
            damping: 40.0,
            rendered: 10.0,
        };
        assert_eq!(damped.least(), Some(expected));
        // A turn, in a later model; the least so far stays if the next model has less damping.
        model.damping[0][0][(4, 4)] = 1.0;
        damped.see(&model, &limits);
        damped.see(&LocalModel::empty(), &limits);
        let found = damped.least().expect("a tenth");
        assert!(found.turns && found.handle == 0 && found.direction == Vec3::y());
        assert!((found.rendered - 0.1).abs() < 1e-12, "{found:?}");
    }
}
