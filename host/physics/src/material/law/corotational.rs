//! Corotational elasticity: small strains measured in a frame that turns with the element.
//!
//! With the polar decomposition `F = R S`, `R` a proper rotation even if the element is inverted,
//! `psi = mu |S - I|^2 + lambda / 2 tr(S - I)^2` and `P = 2 mu (F - R) + lambda tr(S - I) R` (Müller and
//! Gross, "Interactive virtual materials", 2004; McAdams et al., "Efficient elasticity for character
//! skinning with contact and collisions", 2011, for the exact tangent). The least singular value carries
//! the sign of the determinant, so the stress pushes an inverted element back along its shortest axis.

use super::isotropic::{self, PAIRS, Principal};
use super::{Frame, Lame, Law, Response};
use crate::material::Tangent;
use crate::polar::svd::svd;
use crate::{Mat3, Vec3};

/// The least sum of two stretches by which the twist of their axes divides. The exact twist is unbounded if an
/// element degenerates to a line. Only below this bound does the tangent differ from the exact one.
const STRETCH_FLOOR: f64 = 0.02;

/// Corotational elasticity.
#[derive(Clone, Copy, Debug, Default)]
pub struct Corotational;

impl Law for Corotational {
    const FRAME: Option<Frame> = Some(Frame::Turning);

    fn energy(&self, lame: Lame, f: &Mat3) -> f64 {
        let strain = svd(f).s - Vec3::repeat(1.0);
        let trace = strain.sum();
        lame.mu * strain.norm_squared() + 0.5 * lame.lambda * trace * trace
    }

    fn stress(&self, lame: Lame, f: &Mat3) -> Mat3 {
        let svd = svd(f);
        let r = svd.u * svd.v.transpose();
        (f - r) * (2.0 * lame.mu) + r * (lame.lambda * (svd.s.sum() - 3.0))
    }

    fn respond(&self, lame: Lame, f: &Mat3, tangent: Tangent) -> Response {
        let (mu, lambda) = (lame.mu, lame.lambda);
        isotropic::respond(f, tangent, |s| {
            let pressure = lambda * (s.sum() - 3.0);
            let mut twist = Vec3::zeros();
            for (k, [i, j]) in PAIRS.into_iter().enumerate() {
                let sum = (s[i] + s[j]).max(STRETCH_FLOOR);
                twist[k] = 2.0 * mu + 2.0 * (pressure - 2.0 * mu) / sum;
            }
            Principal {
                stress: (s - Vec3::repeat(1.0)) * (2.0 * mu) + Vec3::repeat(pressure),
                stretch: Mat3::from_diagonal_element(2.0 * mu) + Mat3::repeat(lambda),
                twist,
                flip: Vec3::repeat(2.0 * mu),
            }
        })
    }
}
