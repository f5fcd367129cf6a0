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

use super::isotropic::{self, PAIRS, Principal};
use super::lane_law::{LaneLame, LaneLaw, LaneModuli};
use super::{IsotropicLaw, Lame, Law, Response};
use crate::lanes::Real;
use crate::lanes::logarithm::less_log_1p;
use crate::material::Tangent;
use crate::polar::lanes::Matrix;
use crate::{Mat3, Vec3};

/// Stable neo-Hookean elasticity.
#[derive(Clone, Copy, Debug, Default)]
pub struct StableNeoHookean;

/// `m` and `l` of the energy.
#[inline(always)]
fn parameters<T: Real>(lame: LaneLame<T>) -> (T, T) {
    let m = T::of(4.0 / 3.0) * lame.mu;
    (m, lame.lambda + T::of(5.0 / 6.0) * lame.mu)
}

/// `m`, `l` and `a` of the energy.
fn constants(lame: Lame) -> (f64, f64, f64) {
    let (m, l) = parameters(lame.into());
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
    let others = Vec3::new(s.y * s.z, s.x * s.z, s.x * s.y);
    let pressure = l * (s.x * s.y * s.z - a);
    let moduli = StableNeoHookean::moduli(lame.into(), (*s).into());
    Principal::new(s * shear + others * pressure, &moduli)
}

impl LaneLaw for StableNeoHookean {
    #[inline(always)]
    fn respond<T: Real>(lame: LaneLame<T>, h: &Matrix<T>) -> (T, Matrix<T>) {
        let (m, l) = parameters(lame);
        let (one, quarter) = (T::of(1.0), T::of(0.25));
        // cof F = (1 + tr H) I - H^T + cof H.
        let cofactor = cofactor_lanes(h);
        let trace = h[0][0] + h[1][1] + h[2][2];
        let minors = cofactor[0][0] + cofactor[1][1] + cofactor[2][2];
        let determinant =
            h[0][0] * cofactor[0][0] + h[0][1] * cofactor[0][1] + h[0][2] * cofactor[0][2];
        let mut norm = T::ZERO;
        for row in h {
            norm += row[0] * row[0] + row[1] * row[1] + row[2] * row[2];
        }
        // J - 1, and (I_C - 3) / 4.
        let growth = trace + minors + determinant;
        let y = quarter * (trace + trace + norm);
        // The terms of the energy that are linear in H cancel.
        let (half, part) = (T::of(0.5), T::of(0.75) * m);
        let energy = part * (half * norm - (minors + determinant))
            + half * (m * less_log_1p(y) + l * (growth * growth));
        // P = 3/4 m (F - cof F) + m (1/4 - 1 / (I_C + 1)) F + l (J - 1) cof F.
        let shear = m * (quarter * y / (one + y));
        let pressure = l * growth;
        let mut stress = [[T::ZERO; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                let (mut f, mut minor) = (h[i][j], cofactor[i][j] - h[j][i]);
                let mut difference = f - minor;
                if i == j {
                    difference -= trace;
                    minor += one + trace;
                    f += one;
                }
                stress[i][j] = part * difference + shear * f + pressure * minor;
            }
        }
        (energy, stress)
    }

    #[inline(always)]
    fn moduli<T: Real>(lame: LaneLame<T>, s: [T; 3]) -> LaneModuli<T> {
        let (m, l) = parameters(lame);
        let (one, two) = (T::of(1.0), T::of(2.0));
        let a = one + T::of(0.75) * m / l;
        let squares = s[0] * s[0] + s[1] * s[1] + s[2] * s[2];
        let shear = m * squares / (squares + one);
        let slope = two * m / ((squares + one) * (squares + one));
        let others = [s[1] * s[2], s[0] * s[2], s[0] * s[1]];
        let pressure = l * (s[0] * s[1] * s[2] - a);
        let direct = |i: usize| shear + s[i] * s[i] * slope + others[i] * others[i] * l;
        let beside = |k: usize| {
            let [i, j] = PAIRS[k];
            s[i] * s[j] * slope + others[i] * others[j] * l + pressure * s[k]
        };
        LaneModuli {
            stretch: [
                direct(0),
                direct(1),
                direct(2),
                beside(0),
                beside(1),
                beside(2),
            ],
            twist: s.map(|s| shear + pressure * s),
            flip: s.map(|s| shear - pressure * s),
        }
    }
}

/// The cofactor matrix of `m`.
#[inline(always)]
fn cofactor_lanes<T: Real>(m: &Matrix<T>) -> Matrix<T> {
    let mut cofactor = [[T::ZERO; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            let (k, l) = ((i + 1) % 3, (i + 2) % 3);
            let (p, q) = ((j + 1) % 3, (j + 2) % 3);
            cofactor[i][j] = m[k][p] * m[l][q] - m[k][q] * m[l][p];
        }
    }
    cofactor
}

impl Law for StableNeoHookean {
    const ISOTROPIC: Option<IsotropicLaw> = Some(IsotropicLaw::StableNeoHookean);

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
