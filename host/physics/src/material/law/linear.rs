//! Geometrically linear elasticity: small strains and small rotations.
//!
//! `epsilon = sym(F) - I`, `P = 2 mu epsilon + lambda tr(epsilon) I`. The law is wrong for large rotations. The
//! analytic solutions of linear elasticity hold for this law, so it serves verification.

use super::{Frame, Lame, Law, Modulus, Response};
use crate::Mat3;
use crate::material::Tangent;

/// Geometrically linear elasticity.
#[derive(Clone, Copy, Debug, Default)]
pub struct Linear;

/// The modulus of every isotropic law at rest: `mu (I + transpose) + lambda I (x) I`.
pub(crate) fn modulus(lame: Lame) -> Modulus {
    core::array::from_fn(|j| {
        core::array::from_fn(|l| {
            let mut block = Mat3::zeros();
            block[(l, j)] += lame.mu;
            block[(j, l)] += lame.lambda;
            if j == l {
                block += Mat3::from_diagonal_element(lame.mu);
            }
            block
        })
    })
}

impl Law for Linear {
    const FRAME: Option<Frame> = Some(Frame::Fixed);

    fn energy(&self, lame: Lame, f: &Mat3) -> f64 {
        let strain = (f + f.transpose()) * 0.5 - Mat3::identity();
        let trace = strain.trace();
        lame.mu * strain.norm_squared() + 0.5 * lame.lambda * trace * trace
    }

    fn stress(&self, lame: Lame, f: &Mat3) -> Mat3 {
        let strain = (f + f.transpose()) * 0.5 - Mat3::identity();
        strain * (2.0 * lame.mu) + Mat3::from_diagonal_element(lame.lambda * strain.trace())
    }

    fn respond(&self, lame: Lame, f: &Mat3, _: Tangent) -> Response {
        Response {
            stress: self.stress(lame, f),
            modulus: modulus(lame),
        }
    }
}
