//! The stable neo-Hookean law for large strains. It is finite everywhere, and an element recovers from any inversion.
//!
//! Smith, de Goes and Kim, "Stable neo-Hookean flesh simulation", 2018, equation 14:
//!
//! ```text
//! psi = m / 2 (I_C - 3) + l / 2 (J - a)^2 - m / 2 log(I_C + 1),    a = 1 + (3/4) m / l
//! ```
//!
//! with `m = 4 mu / 3` and `l = lambda + 5 mu / 6`, so that the law agrees with linear elasticity at rest
//! (section 3.4). `J` enters as a polynomial, without a logarithm, so the energy of an inverted element is finite.

use super::isotropic::{self, PAIRS, PointLaw, Principal};
use super::{Lame, Law, Response};
use crate::material::Tangent;
use crate::{Mat3, Vec3};

/// Stable neo-Hookean elasticity.
#[derive(Clone, Copy, Debug, Default)]
pub struct StableNeoHookean;

/// `m`, `l` and `a` of the energy.
fn constants(lame: Lame) -> (f64, f64, f64) {
    let m = 4.0 / 3.0 * lame.mu;
    let l = lame.lambda + 5.0 / 6.0 * lame.mu;
    (m, l, 1.0 + 0.75 * m / l)
}

/// The cofactor matrix of `f`: the derivative of the determinant by `f`.
fn cofactor(f: &Mat3) -> Mat3 {
    let (a, b, c): (Vec3, Vec3, Vec3) =
        (f.column(0).into(), f.column(1).into(), f.column(2).into());
    Mat3::from_columns(&[b.cross(&c), c.cross(&a), a.cross(&b)])
}

/// Derivatives of the energy density by the principal stretches `s`.
fn principal(lame: Lame, s: &Vec3) -> Principal {
    let (m, l, a) = constants(lame);
    let squares = s.norm_squared();
    let shear = m * squares / (squares + 1.0);
    let slope = 2.0 * m / ((squares + 1.0) * (squares + 1.0));
    let others = Vec3::new(s.y * s.z, s.x * s.z, s.x * s.y);
    let pressure = l * (s.x * s.y * s.z - a);
    let mut stretch = Mat3::from_diagonal_element(shear)
        + s * s.transpose() * slope
        + others * others.transpose() * l;
    let mut twist = Vec3::zeros();
    let mut flip = Vec3::zeros();
    for (k, [i, j]) in PAIRS.into_iter().enumerate() {
        stretch[(i, j)] += pressure * s[k];
        stretch[(j, i)] += pressure * s[k];
        twist[k] = shear + pressure * s[k];
        flip[k] = shear - pressure * s[k];
    }
    Principal {
        stress: s * shear + others * pressure,
        stretch,
        twist,
        flip,
    }
}

impl Law for StableNeoHookean {
    const POINT: Option<PointLaw> =
        Some(|lame, f, start| isotropic::point(&Self, lame, f, start, |s| principal(lame, s)));

    fn energy(&self, lame: Lame, f: &Mat3) -> f64 {
        let (m, l, a) = constants(lame);
        let squares = f.norm_squared();
        let volume = f.determinant();
        // The value at rest is subtracted. The factored difference of squares loses no digits near rest.
        0.5 * m * (squares - 3.0) + 0.5 * l * (volume - 1.0) * (volume + 1.0 - 2.0 * a)
            - 0.5 * m * libm::log1p((squares - 3.0) / 4.0)
    }

    fn stress(&self, lame: Lame, f: &Mat3) -> Mat3 {
        let (m, l, a) = constants(lame);
        let squares = f.norm_squared();
        f * (m * squares / (squares + 1.0)) + cofactor(f) * (l * (f.determinant() - a))
    }

    fn respond(&self, lame: Lame, f: &Mat3, tangent: Tangent) -> Response {
        let mut response = isotropic::respond(f, tangent, |s| principal(lame, s));
        response.stress = self.stress(lame, f);
        response
    }
}
