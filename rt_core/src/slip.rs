//! The slip of a proxy against its hand. By a slip, the reduced force of a hold becomes the true force of the body
//! again.
//!
//! The force on a hand may be reduced: it fades, a slew limit acts, or the local models are late. A hand that presses a
//! body meanwhile supplies less energy than the body then stores. The cap on the energy ([`crate::passivity`]) reduces
//! the force of that body for as long as the hand rests, because a hand at rest supplies no energy. The force of that
//! pose cannot come back unless energy is generated. The force of another pose can come back: the proxy slips along the
//! force, against its hand, until the body stores no more energy than the hand has supplied ([`crate::coupling`] finds
//! that motion). The hand then feels the true force of the body, at the pose of the proxy. The slip goes back once the
//! hand has supplied the energy, or has moved back.
//!
//! No hand does work on a slip. The account knows the motion of the hand without the slip, so a slip neither gains nor spends
//! credit.

use crate::geometry::{Pose, Vec3, Vec6, small_turn, stack};
use nalgebra::UnitQuaternion;

/// Greatest speed of a slip, at the scale of the device (m/s): a body that yields at this speed does not jerk the hand.
const MOST_SPEED: f64 = 0.05;
/// Greatest slip, at the scale of the device (m). A model that claims energy without end must not carry the proxy away.
const FARTHEST: f64 = 0.05;
/// The lever (m) by which turns compare with translations.
pub(crate) const LEVER: f64 = 0.05;
/// Time constant (s) with which a slip goes back.
const RETURN: f64 = 0.5;
/// Least speed of a slip that goes back (m/s), so that the slip ends.
const LEAST_SPEED: f64 = 1e-3;
/// A smaller slip (m) counts as no slip.
const NONE: f64 = 1e-9;

/// The request of a body to the slip of one of its proxies, for the next tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Asked {
    /// The body does not hold the proxy, or requests nothing.
    #[default]
    Nothing,
    /// The slip may go back by a step.
    Back,
    /// The slip must stay.
    Stay,
    /// The proxy must be displaced: translation (m), then rotation (rad), in the axes of the scene.
    Away(Vec6),
}

impl Asked {
    /// The joint request of two bodies to one proxy. The proxy goes back only if no body objects.
    pub(crate) fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Away(a), Self::Away(b)) => Self::Away(a + b),
            (away @ Self::Away(_), _) | (_, away @ Self::Away(_)) => away,
            (Self::Stay, _) | (_, Self::Stay) => Self::Stay,
            (Self::Back, _) | (_, Self::Back) => Self::Back,
            (Self::Nothing, Self::Nothing) => Self::Nothing,
        }
    }
}

/// The slip of one proxy.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slip {
    /// Displacement of the proxy (m, axes of the scene).
    translation: Vec3,
    /// Rotation of the proxy; it multiplies the orientation from the right, so that the turns of the hand keep their axes.
    turn: UnitQuaternion<f64>,
    /// Angle of that rotation (rad).
    angle: f64,
}

impl Slip {
    /// No slip.
    pub(crate) fn none() -> Self {
        Self {
            translation: Vec3::zeros(),
            turn: UnitQuaternion::identity(),
            angle: 0.0,
        }
    }

    /// The rotation as a vector along its axis (rad, axes of the handle). Its length is twice the sine of half the angle, which
    /// needs no angle.
    fn turn_vector(&self) -> Vec3 {
        self.turn.coords.xyz() * (2.0 * self.turn.w.signum())
    }

    /// The pose of the proxy whose pose would be `pose` without the slip.
    pub(crate) fn carry(&self, pose: &mut Pose) {
        pose.position += self.translation;
        if self.angle > 0.0 {
            pose.rotation *= self.turn;
        }
    }

    /// Whether the proxy has slipped.
    pub(crate) fn is_some(&self) -> bool {
        self.translation != Vec3::zeros() || self.angle > 0.0
    }

    /// How far the proxy has slipped: its displacement (m, axes of the scene), and the angle of its rotation (rad).
    pub(crate) fn extent(&self) -> (Vec3, f64) {
        (self.translation, self.angle)
    }

    /// The displacement (m, rad; axes of the scene) by which the slip of a proxy of orientation
    /// `rotation` goes back in a tick of `period`
    /// (s). A metre of the device is `scale` metres of the scene.
    pub(crate) fn way_back(&self, rotation: &UnitQuaternion<f64>, period: f64, scale: f64) -> Vec6 {
        let part = |length: f64, least: f64| {
            let fraction = (period / RETURN).max(least * period / length);
            if length > 0.0 { fraction.min(1.0) } else { 0.0 }
        };
        let turn = self.turn_vector();
        let fraction = part(self.translation.norm(), LEAST_SPEED * scale);
        let turned = part(turn.norm(), LEAST_SPEED / LEVER);
        stack(
            &(self.translation * -fraction),
            &(rotation * turn * -turned),
        )
    }

    /// Bounds the displacement `by` (m, rad) away from the hand in a tick of `period` (s): its speed, and the slip that it
    /// leads to. A metre of the device is `scale` metres of the scene.
    pub(crate) fn bound(&self, by: &Vec6, period: f64, scale: f64) -> Vec6 {
        let bounded = |by: Vec3, slipped: &Vec3, unit: f64| {
            let length = by.norm();
            let most = MOST_SPEED * period * unit;
            let by = if length > most {
                by * (most / length)
            } else {
                by
            };
            let after = (slipped + by).norm();
            // False for a number that is not finite.
            let stays = after <= FARTHEST * unit || after < slipped.norm();
            if stays { by } else { Vec3::zeros() }
        };
        let [translation, turn] = [Vec3::new(by.x, by.y, by.z), Vec3::new(by.w, by.a, by.b)];
        stack(
            &bounded(translation, &self.translation, scale),
            &bounded(turn, &self.turn_vector(), 1.0 / LEVER),
        )
    }

    /// Displaces the proxy, whose orientation is `rotation`, by `by` (m, rad; axes of the scene).
    pub(crate) fn shift(&mut self, by: &Vec6, rotation: &UnitQuaternion<f64>) {
        self.translation += Vec3::new(by.x, by.y, by.z);
        let turn = Vec3::new(by.w, by.a, by.b);
        if turn != Vec3::zeros() {
            let within = small_turn(&(rotation.inverse() * turn));
            // Normalized, because rounding must not accumulate.
            self.turn = UnitQuaternion::new_normalize((self.turn * within).into_inner());
            self.angle = 2.0 * libm::asin(self.turn.coords.xyz().norm().min(1.0));
        }
        if self.translation.norm() < NONE && self.angle * LEVER < NONE {
            *self = Self::none();
        }
    }
}
