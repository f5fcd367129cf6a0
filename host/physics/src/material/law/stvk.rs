//! St. Venant-Kirchhoff: linear in the Green strain.
//!
//! `E = (F^T F - I) / 2`, `P = F (2 mu E + lambda tr(E) I)`. The law has analytic solutions and other programs
//! implement it, so it serves verification. It softens under compression. Below a stretch of `1 / sqrt 3` its
//! stiffness is negative, and an element may come to rest inverted.

use super::isotropic::{self, PAIRS, Principal};
use super::lane_law::{LaneLame, LaneLaw, LaneModuli};
use super::{IsotropicLaw, Lame, Law, Response};
use crate::lanes::Real;
use crate::material::Tangent;
use crate::polar::axes::green;
use crate::polar::lanes::Matrix;
use crate::polar::matrices::{matrix, product_of};
use crate::{Mat3, Vec3};

/// St. Venant-Kirchhoff elasticity.
#[derive(Clone, Copy, Debug, Default)]
pub struct StVenantKirchhoff;

/// Derivatives of the energy density by the principal stretches `s`.
fn principal(lame: Lame, s: &Vec3) -> Principal {
    let (mu, lambda) = (lame.mu, lame.lambda);
    let base = lambda * (0.5 * (s.norm_squared() - 3.0)) - mu;
    let moduli = StVenantKirchhoff::moduli(lame.into(), (*s).into());
    Principal::new(s.map(|s| s * (base + mu * s * s)), &moduli)
}

impl LaneLaw for StVenantKirchhoff {
    #[inline(always)]
    fn respond<T: Real>(lame: LaneLame<T>, h: &Matrix<T>) -> (T, Matrix<T>) {
        let LaneLame { mu, lambda } = lame;
        // Twice the Green strain.
        let e = green(h);
        let trace = e[0] + e[1] + e[2];
        let pressure = T::of(0.5) * lambda * trace;
        let second = matrix(&[
            mu * e[0] + pressure,
            mu * e[1] + pressure,
            mu * e[2] + pressure,
            mu * e[3],
            mu * e[4],
            mu * e[5],
        ]);
        let along = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
        let across = e[3] * e[3] + e[4] * e[4] + e[5] * e[5];
        let energy = T::of(0.25) * (mu * (along + (across + across)) + pressure * trace);
        let mut stress = product_of(h, &second);
        for i in 0..3 {
            for j in 0..3 {
                stress[i][j] += second[i][j];
            }
        }
        (energy, stress)
    }

    #[inline(always)]
    fn moduli<T: Real>(lame: LaneLame<T>, s: [T; 3]) -> LaneModuli<T> {
        let LaneLame { mu, lambda } = lame;
        let squares = s.map(|s| s * s);
        let trace = T::of(0.5) * (squares[0] + squares[1] + squares[2] - T::of(3.0));
        // psi_i = s_i (mu (s_i^2 - 1) + lambda tr E) is a cubic, so the quotients are polynomials.
        let base = lambda * trace - mu;
        let threefold = T::of(3.0) * mu;
        let direct = |i: usize| base + threefold * s[i] * s[i] + squares[i] * lambda;
        let pairs = PAIRS.map(|[i, j]| (squares[i] + squares[j], s[i] * s[j]));
        LaneModuli {
            stretch: [
                direct(0),
                direct(1),
                direct(2),
                pairs[0].1 * lambda,
                pairs[1].1 * lambda,
                pairs[2].1 * lambda,
            ],
            twist: pairs.map(|(squares, product)| base + mu * (squares - product)),
            flip: pairs.map(|(squares, product)| base + mu * (squares + product)),
        }
    }
}

impl Law for StVenantKirchhoff {
    const ISOTROPIC: Option<IsotropicLaw> = Some(IsotropicLaw::StVenantKirchhoff);

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
