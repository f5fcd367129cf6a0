//! St. Venant-Kirchhoff: linear in the Green strain.
//!
//! `E = (F^T F - I) / 2`, `P = F (2 mu E + lambda tr(E) I)`. The law has analytic solutions and other programs
//! implement it, so it serves verification. It softens under compression. Below a stretch of `1 / sqrt 3` its
//! stiffness is negative, and an element may come to rest inverted.

use super::isotropic::{self, PAIRS, PointLaw, Principal};
use super::{Lame, Law, Response};
use crate::material::Tangent;
use crate::{Mat3, Vec3};

/// St. Venant-Kirchhoff elasticity.
#[derive(Clone, Copy, Debug, Default)]
pub struct StVenantKirchhoff;

/// Derivatives of the energy density by the principal stretches `s`.
fn principal(lame: Lame, s: &Vec3) -> Principal {
    let (mu, lambda) = (lame.mu, lame.lambda);
    let trace = 0.5 * (s.norm_squared() - 3.0);
    // psi_i = s_i (mu (s_i^2 - 1) + lambda tr E) is a cubic, so the quotients are polynomials.
    let base = lambda * trace - mu;
    let mut twist = Vec3::zeros();
    let mut flip = Vec3::zeros();
    for (k, [i, j]) in PAIRS.into_iter().enumerate() {
        let squares = s[i] * s[i] + s[j] * s[j];
        twist[k] = base + mu * (squares - s[i] * s[j]);
        flip[k] = base + mu * (squares + s[i] * s[j]);
    }
    let diagonal = s.map(|s| base + 3.0 * mu * s * s);
    Principal {
        stress: s.map(|s| s * (base + mu * s * s)),
        stretch: Mat3::from_diagonal(&diagonal) + s * s.transpose() * lambda,
        twist,
        flip,
    }
}

impl Law for StVenantKirchhoff {
    const POINT: Option<PointLaw> =
        Some(|lame, f, start| isotropic::point(&Self, lame, f, start, |s| principal(lame, s)));

    fn energy(&self, lame: Lame, f: &Mat3) -> f64 {
        let strain = (f.transpose() * f - Mat3::identity()) * 0.5;
        let trace = strain.trace();
        lame.mu * strain.norm_squared() + 0.5 * lame.lambda * trace * trace
    }

    fn stress(&self, lame: Lame, f: &Mat3) -> Mat3 {
        let strain = (f.transpose() * f - Mat3::identity()) * 0.5;
        let second =
            strain * (2.0 * lame.mu) + Mat3::from_diagonal_element(lame.lambda * strain.trace());
        f * second
    }

    fn respond(&self, lame: Lame, f: &Mat3, tangent: Tangent) -> Response {
        let mut response = isotropic::respond(f, tangent, |s| principal(lame, s));
        response.stress = self.stress(lame, f);
        response
    }
}
