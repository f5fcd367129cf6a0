//! The law of a contact: a carried normal multiplier, and a friction spring with a return map.
//!
//! A row joins up to four nodes by weights `w`: `J u = sum w_i u_i` is the displacement of the first foot against the
//! second one over the step, and `o` that of an obstacle's material point. With the gap `g(u) = g0 + n . (J u - o)`:
//!
//! ```text
//! normal    lam(u) = min(max(0, lam^ - k_n g(u)), most)
//! friction  tau(u) = tau^ - k_t (I - n n^T)(J u - o),    force tau min(1, mu lam / |tau|)
//! ```
//!
//! `lam^` is carried from step to step (augmented Lagrangian: Alart and Curnier, "A mixed formulation for frictional
//! contact problems prone to Newton like solution methods", 1991), so that a resting body stands without penetration at a
//! stiffness that is low. The anchor of the friction spring moves with a slipping contact (return map: Simo and Laursen,
//! "An augmented Lagrangian treatment of contact problems involving friction", 1992).
//!
//! **Stability of carrying.** A mass `m` on a carried multiplier has modes with `(1 - 1/z)^3 = -kappa`, with
//! `kappa = k h^2 / m`: the multiplier decays if `kappa > 1`. With `j` updates in a step `(1 + kappa)^j - 1` takes the
//! place of `kappa`. [`Stiffness`] keeps `kappa` at eight or above for the vertices themselves. One update a step beyond the
//! first costs nothing at rest, and a dropped sheet comes to rest in a third of the steps.

//!
//! **Held.** A tool that takes hold of a surface keeps the points that it touches. Their rows do not open and do not slip: `lam` may be
//! negative, and the friction force has no bound.

use crate::{Mat3, Vec3};

/// Displacement (m) at which a full friction force slips: the anchor's spring stretches by this much at most.
const SLIP: f64 = 10e-6;
/// The least `kappa` of the masses of a row.
const KAPPA: f64 = 8.0;
/// The largest friction force (N) of a row that is held. It is finite, so that differences of such bounds are numbers.
const UNBOUNDED: f64 = f64::MAX;

/// The law of a row in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// From the second foot to the first one; of length one.
    pub normal: Vec3,
    /// The gap (m) for no displacement, by the linearization of the gap.
    pub gap: f64,
    /// The motion of the obstacle's material point over the step (m); zero between bodies.
    pub motion: Vec3,
    /// Coefficient of friction.
    pub friction: f64,
    /// The depth that the contact may have (m): beyond it, the multiplier is carried on within the step.
    pub depth: f64,
    /// Stiffness along the normal (N/m).
    pub normal_stiffness: f64,
    /// Stiffness of the friction spring (N/m).
    pub friction_stiffness: f64,
    /// The multiplier that is carried (N).
    pub carried: f64,
    /// The largest normal force (N).
    pub most: f64,
    /// The force of the friction spring that is carried (N), across the normal.
    pub anchored: Vec3,
    /// Whether the contact neither opens nor slips.
    pub is_held: bool,
}

/// What a row does for a displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// The gap (m).
    pub gap: f64,
    /// The normal force (N); negative only where a row is held.
    pub normal: f64,
    /// The friction force (N), across the normal.
    pub friction: Vec3,
    /// The force of the friction spring before the return map (N).
    pub spring: Vec3,
    /// Whether the contact slips.
    pub slips: bool,
}

impl Response {
    /// Whether the contact has a force.
    pub fn acts(&self) -> bool {
        self.normal != 0.0
    }
}

impl Row {
    /// The response to the displacement `ju` of the first foot against the second one (m).
    pub fn response(&self, ju: &Vec3) -> Response {
        let relative = ju - self.motion;
        let gap = self.gap + self.normal.dot(&relative);
        let normal = self.normal_force(gap);
        self.with_normal(&relative, gap, normal, self.most_friction(normal))
    }

    /// The largest friction force (N) under a normal force (N): that of Coulomb's cone.
    pub fn most_friction(&self, normal: f64) -> f64 {
        if self.is_held {
            UNBOUNDED
        } else {
            self.friction * normal
        }
    }

    /// The response to the displacement `ju` (m) with friction forces up to `most` (N).
    pub fn response_within(&self, ju: &Vec3, most: f64) -> Response {
        let relative = ju - self.motion;
        let gap = self.gap + self.normal.dot(&relative);
        self.with_normal(&relative, gap, self.normal_force(gap), most)
    }

    /// The normal force (N) at a gap (m).
    fn normal_force(&self, gap: f64) -> f64 {
        let linear = self.carried - self.normal_stiffness * gap;
        let least = if self.is_held { -self.most } else { 0.0 };
        linear.max(least).min(self.most)
    }

    /// Whether a response has the largest normal force.
    pub fn is_at_most(&self, response: &Response) -> bool {
        response.normal.abs() >= self.most
    }

    fn with_normal(&self, relative: &Vec3, gap: f64, normal: f64, most: f64) -> Response {
        let across = relative - self.normal * self.normal.dot(relative);
        let spring = self.anchored - across * self.friction_stiffness;
        let length = spring.norm();
        let slips = length > most;
        let friction = if slips {
            spring * (most / length)
        } else {
            spring
        };
        Response {
            gap,
            normal,
            friction,
            spring,
            slips,
        }
    }

    /// The force (N) on the first foot. The second one has the opposite force.
    pub fn force(&self, ju: &Vec3) -> Vec3 {
        let response = self.response(ju);
        self.normal * response.normal + response.friction
    }

    /// The force (N) with the largest friction force held at `most` (N). It is the gradient of a convex function of the
    /// displacement, so the residual along a direction falls monotonically: what a line search needs.
    pub fn force_with(&self, ju: &Vec3, most: f64) -> Vec3 {
        let response = self.response_within(ju, most);
        self.normal * response.normal + response.friction
    }

    /// The energy (J) whose gradient is the normal force and the `friction` force (N), for a displacement (m).
    pub fn energy(&self, ju: &Vec3, friction: &Vec3) -> f64 {
        let relative = ju - self.motion;
        let gap = self.gap + self.normal.dot(&relative);
        let normal = self.normal_force(gap);
        let linear = self.carried - self.normal_stiffness * gap;
        normal * (linear - 0.5 * normal) / self.normal_stiffness - friction.dot(&relative)
    }

    /// The tangent (N/m) at a response: symmetric and positive semidefinite. The coupling of the friction force to the
    /// normal force is left out; the passes of the solver find it.
    pub fn tangent(&self, response: &Response) -> Mat3 {
        if !response.acts() && !self.is_held {
            return Mat3::zeros();
        }
        let along = self.normal * self.normal.transpose();
        let mut across = Mat3::identity() - along;
        let mut stiffness = self.friction_stiffness;
        if response.slips {
            let length = response.spring.norm();
            let direction = response.spring / length;
            across -= direction * direction.transpose();
            stiffness *= response.friction.norm() / length;
        }
        let along = if self.is_at_most(response) {
            Mat3::zeros()
        } else {
            along * self.normal_stiffness
        };
        along + across * stiffness
    }
}

/// The stiffness of a row, by what it has to hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffness {
    /// The mass (kg) that the row moves: `1 / sum(w_i^2 / m_i)` over free nodes.
    pub mass: f64,
    /// Length of the step (s).
    pub step: f64,
    /// The distance at which the parts touch (m).
    pub thickness: f64,
    /// The speed at which the feet approach each other (m/s).
    pub approach: f64,
    /// The larger normal force of the last two steps (N).
    pub force: f64,
    /// Coefficient of friction.
    pub friction: f64,
}

impl Stiffness {
    /// The depth that a contact may have (m): a tenth of the thickness.
    pub fn depth(&self) -> f64 {
        0.1 * self.thickness
    }

    /// The stiffness along the normal (N/m): as carrying needs it, as an impact needs it to stop within the depth, and as
    /// the force needs it.
    pub fn normal(&self) -> f64 {
        let by_mass = self.mass / (self.step * self.step);
        let by_impact = by_mass * self.approach.max(0.0) * self.step / self.depth();
        (KAPPA * by_mass)
            .max(by_impact)
            .max(self.force / self.depth())
    }

    /// The stiffness of the friction spring (N/m). No stiffness of the body bounds it: a stiff row costs no iteration, because
    /// the factor has it.
    pub fn friction(&self) -> f64 {
        let by_mass = self.mass / (self.step * self.step);
        (KAPPA * by_mass).max(self.friction * self.force / SLIP)
    }
}

/// The multiplier to carry (N), from the normal forces of the last two steps (N), the latest first, and the speed at which
/// the contact opens (m/s). A contact that opens carries the smaller force, and less of it: the multiplier would throw it.
pub fn carried(forces: [f64; 2], opening: f64, step: f64, depth: f64) -> f64 {
    if opening <= 0.0 {
        return forces[0];
    }
    let kept = (1.0 - opening * step / depth).clamp(0.0, 1.0);
    forces[0].min(forces[1]) * kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn row() -> Row {
        Row {
            normal: Vec3::z(),
            gap: 0.0,
            motion: Vec3::zeros(),
            depth: 1e-5,
            friction: 0.5,
            normal_stiffness: 100.0,
            friction_stiffness: 50.0,
            carried: 1.0,
            most: 2.0,
            anchored: Vec3::zeros(),
            is_held: false,
        }
    }

    /// The size of oscillations of a mass under a carried multiplier after 60 steps, with `updates` a step.
    fn rest(kappa: f64, updates: usize) -> f64 {
        let (mass, h, weight) = (1.0, 1.0, 1.0);
        let stiffness = kappa * mass / (h * h);
        let (mut place, mut speed, mut multiplier) = (0.0, 0.0, 0.9);
        for _ in 0..60 {
            let mut end = place;
            for _ in 0..updates {
                // m (end - place - h v) / h^2 = -weight + multiplier - k end, in touch throughout.
                let free: f64 = place + h * speed - h * h * weight / mass;
                end = (free + h * h * multiplier / mass) / (1.0 + kappa);
                multiplier -= stiffness * end;
            }
            speed = (end - place) / h;
            place = end;
        }
        f64::abs(multiplier - weight)
    }

    #[test]
    fn carrying_is_stable_above_a_kappa_of_one() {
        for (kappa, updates, is_stable) in [
            (0.7, 1, false),
            (1.5, 1, true),
            (0.3, 2, false),
            (0.58, 2, true),
        ] {
            let left = rest(kappa, updates);
            assert_eq!(left < 0.1, is_stable, "{kappa} {updates}: {left}");
        }
    }

    #[test]
    fn friction_sticks_below_the_cone_and_slips_on_it() {
        let row = row();
        let sticks = row.response(&Vec3::new(0.005, 0.0, 0.0));
        assert!(!sticks.slips);
        assert!((sticks.friction - Vec3::new(-0.25, 0.0, 0.0)).norm() < 1e-15);
        let slips = row.response(&Vec3::new(0.02, 0.0, 0.0));
        assert!(slips.slips && (slips.friction.norm() - 0.5).abs() < 1e-15);
        let open = row.response(&Vec3::new(0.0, 0.0, 0.02));
        assert_eq!((open.normal, open.friction), (0.0, Vec3::zeros()));
    }

    #[test]
    fn a_force_does_not_grow_beyond_the_largest_one() {
        let row = row();
        let [below, beyond] = [-0.009, -0.1].map(|z| row.response(&Vec3::new(0.0, 0.0, z)));
        assert_eq!((below.normal, row.is_at_most(&below)), (1.9, false));
        assert_eq!((beyond.normal, row.is_at_most(&beyond)), (2.0, true));
        assert_eq!(row.tangent(&beyond).column(2), Vec3::zeros());
    }

    #[test]
    fn a_row_that_is_held_neither_opens_nor_slips() {
        let row = Row {
            is_held: true,
            ..row()
        };
        let pulled = row.response(&Vec3::new(0.5, 0.0, 0.02));
        assert!((pulled.normal + 1.0).abs() < 1e-15 && !pulled.slips && pulled.acts());
        assert_eq!(pulled.friction, Vec3::new(-25.0, 0.0, 0.0));
        let whole = Mat3::from_diagonal(&Vec3::new(50.0, 50.0, 100.0));
        assert!((row.tangent(&pulled) - whole).norm() < 1e-12);
        // The force is the gradient of the energy, also where the row pulls.
        let [near, far] = [0.0199, 0.0201].map(|z| row.energy(&(Vec3::z() * z), &Vec3::zeros()));
        assert!(((far - near) / -2e-4 + 1.0).abs() < 1e-9);
        // A cone that has no bound has no difference either.
        assert_eq!(row.most_friction(1.0) - row.most_friction(-1.0), 0.0);
    }

    #[test]
    fn an_opening_contact_carries_less() {
        assert_eq!(carried([2.0, 1.0], 0.0, 1e-3, 1e-5), 2.0);
        assert_eq!(carried([2.0, 3.0], -1.0, 1e-3, 1e-5), 2.0);
        assert_eq!(carried([3.0, 2.0], 0.005, 1e-3, 1e-5), 1.0);
        assert_eq!(carried([2.0, 3.0], 1.0, 1e-3, 1e-5), 0.0);
    }

    proptest! {
        #[test]
        fn the_tangent_is_that_of_the_force_with_its_friction_held(
            ju in [-0.02..0.02, -0.02..0.02, -0.02..0.02],
            anchored in [-0.3..0.3, -0.3..0.3],
        ) {
            let row = Row { anchored: Vec3::new(anchored[0], anchored[1], 0.0), ..row() };
            let ju = Vec3::from(ju);
            let response = row.response(&ju);
            let most = row.friction * response.normal;
            // Away from the corners of the law.
            let near_most = (row.carried - row.normal_stiffness * response.gap - row.most).abs() < 1e-3;
            prop_assume!((response.spring.norm() - most).abs() > 1e-3 && response.normal != 0.0 && !near_most);
            let tangent = row.tangent(&response);
            for axis in 0..3 {
                let mut by = Vec3::zeros();
                by[axis] = 1e-7;
                let change = (row.force_with(&(ju + by), most) - row.force_with(&(ju - by), most)) / 2e-7;
                prop_assert!((change + tangent.column(axis)).norm() < 1e-4 * 150.0, "{change} {tangent}");
            }
        }

        #[test]
        fn the_force_is_the_gradient_of_the_energy(ju in [-0.02..0.02, -0.02..0.02, -0.02..0.02]) {
            let (row, ju) = (row(), Vec3::from(ju));
            let response = row.response(&ju);
            let energy = |by: Vec3| row.energy(&(ju + by), &response.friction);
            for axis in 0..3 {
                let mut by = Vec3::zeros();
                by[axis] = 1e-7;
                let force = -(energy(by) - energy(-by)) / 2e-7;
                prop_assert!((force - row.force(&ju)[axis]).abs() < 1e-4, "{force}");
            }
        }

        #[test]
        fn the_residual_along_a_direction_never_grows(
            from in [-0.02..0.02, -0.02..0.02, -0.02..0.02],
            to in [-0.02..0.02, -0.02..0.02, -0.02..0.02],
            most in 0.0..1.0,
        ) {
            let (row, from, by) = (row(), Vec3::from(from), Vec3::from(to));
            let along = |a: f64| row.force_with(&(from + by * a), most).dot(&by);
            let values: Vec<f64> = (0..=20).map(|i| along(f64::from(i) / 20.0)).collect();
            prop_assert!(values.windows(2).all(|pair| pair[1] <= pair[0] + 1e-12));
        }
    }
}
