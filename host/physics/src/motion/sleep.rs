//! Bodies at rest are not stepped.
//!
//! A body falls asleep when none of its vertices has been faster than a given speed for [`STEPS`] steps in a row:
//! then nothing accelerates it by more than that speed over those steps either, so the forces that do not balance
//! are below its mass times that, and a creep with time constant `tau` has less than `speed tau` to go. It is left
//! exactly where it is until something reaches it: a hand moves further than the speed allows, or anything is set
//! from outside.

use crate::Vec3;
use crate::body::Body;
use crate::body::handle::HandlePose;

/// Steps in a row without motion after which a body sleeps.
pub(crate) const STEPS: u32 = 20;

/// Whether a body sleeps.
#[derive(Clone, Debug)]
pub(crate) struct Sleep {
    still: u32,
    /// Where the hands were when it fell asleep, and what had been set until then.
    poses: Vec<HandlePose>,
    revision: u64,
    h: f64,
}

impl Sleep {
    pub(crate) fn new(body: &Body) -> Self {
        Self {
            still: 0,
            poses: body
                .constraints
                .handles
                .iter()
                .map(|h| h.report.pose)
                .collect(),
            revision: 0,
            h: 0.0,
        }
    }

    /// Whether nothing reaches a body that sleeps: a step of `h` to `targets` would not move it.
    pub(crate) fn goes_on(&self, body: &Body, h: f64, targets: &[HandlePose], speed: f64) -> bool {
        // Turns are felt at the arm of the handle's vertices: about a body's length, at most a metre.
        let near = |(now, then): (&HandlePose, &HandlePose)| {
            (now.position - then.position).norm() <= speed * h
                && now.rotation.angle_to(&then.rotation) <= speed * h
        };
        self.still >= STEPS
            && self.revision == body.state.revision
            && self.h == h
            && targets.iter().zip(&self.poses).all(near)
    }

    /// A step was taken; puts the body to sleep if it is time to.
    pub(crate) fn observe(&mut self, body: &mut Body, h: f64, targets: &[HandlePose], speed: f64) {
        let fastest = body
            .state
            .v
            .iter()
            .map(Vec3::norm_squared)
            .fold(0.0, f64::max);
        let still = fastest <= speed * speed;
        self.still = if still { self.still + 1 } else { 0 };
        if self.still >= STEPS {
            body.state.v.fill(Vec3::zeros());
            for handle in &mut body.constraints.handles {
                handle.report.linear_velocity = Vec3::zeros();
                handle.report.angular_velocity = Vec3::zeros();
            }
            self.poses.copy_from_slice(targets);
            self.revision = body.state.revision;
            self.h = h;
        }
    }

    /// Something moved it.
    pub(crate) fn wake(&mut self) {
        self.still = 0;
    }
}
