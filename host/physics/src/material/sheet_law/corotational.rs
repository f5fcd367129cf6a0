//! The corotational sheet: linear in the right stretch, `psi = 1/2 (U - I) : D : (U - I)`, `F = R U`.
//!
//! For an isotropic `D` the energy, the force and the tangent are those of
//! [`Membrane`](crate::element::triangle::membrane::Membrane). For a woven sheet the principal axes of
//! `sigma = D (U - I)` may differ from those of `U`, and the stress is not `R sigma`. With `A = R^T dF`,
//! `J = [[0, -1], [1, 0]]` and the spin
//! `omega = (A21 - A12) / tr U`, the derivative of the polar decomposition in two dimensions is
//!
//! ```text
//! R^T dR = omega J        dU = A - omega J U
//! ```
//!
//! so that `d psi = sigma : A - omega c` with `c = sigma : (J U)`, and
//!
//! ```text
//! P = R T        T = sigma - (c / tr U) J        c = u12 (s22 - s11) + s12 (u11 - u22)
//! ```
//!
//! The second derivative in the plane is (from `dA = -omega J A` and `J J = -I`):
//!
//! ```text
//! d2 psi = dU : D : dU + 2 omega (J T) : A - omega^2 sigma : U
//! ```
//!
//! Out of the plane, for `dF = n w^T`, `dU = 0` and `dR = n (U^-1 w)^T`. Hence `dP = n w^T S` with `S = U^-1 T`, the
//! second Piola-Kirchhoff stress, which is symmetric. Motions in the plane and out of it do not couple, so each part
//! of the tangent is clipped separately.
//!
//! # Limits
//!
//! `U11` is not the stretch of the warp threads: `U11` decreases, to second order, when the threads are sheared at
//! constant length. A sheet that is pulled along the warp (`E1`, shear modulus `G`) can therefore reduce its
//! tension by shearing. By the equations above it does so at a strain beyond
//!
//! ```text
//! 4 G / (E1 - 4 G)
//! ```
//!
//! There the exact tangent is indefinite although all principal stresses are tensile. An isotropic sheet
//! (`E <= 3 G`) never reaches this strain. A cloth with `E1 = 40 G` reaches it at 0.11. A cloth a hundred times
//! stiffer along its threads than in shear, which is common, reaches it at 0.04. For such cloth use
//! [`StVenantKirchhoffSheet`](crate::material::sheet_law::StVenantKirchhoffSheet). Its strain along the warp is the
//! strain of the threads, and it is stable under any tension.
//!
//! The derivation follows McAdams et al., "Efficient elasticity for character skinning with contact and
//! collisions", 2011, without its assumption that stress and stretch commute.

use super::clip::{Sym4, clip2, clip4};
use super::{PlaneStiffness, SheetLaw, SheetResponse, bounded, modulus};
use crate::Vec3;
use crate::material::Tangent;
use crate::polar::surface::Polar;
use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// The least stretch by which the tangent divides; the least sum of two stretches is twice this. A triangle that is
/// crushed to a hundredth must not make the matrix arbitrarily stiff. The stress is not bounded.
const STRETCH_FLOOR: f64 = 0.01;

/// The law with energy `1/2 (U - I) : D : (U - I)`, `U` the right stretch.
///
/// In the tangent, stretches below a hundredth count as a hundredth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CorotationalSheet;

/// Polar decomposition and stress.
struct State {
    polar: Polar,
    /// `D (U - I)`: xx, xy, yy (N/m).
    sigma: [f64; 3],
    /// `c` (N/m).
    couple: f64,
    /// `c / tr U` (N/m), bounded by `sigma`.
    skew: f64,
}

impl State {
    fn new(d: &PlaneStiffness, f: &[Vec3; 2]) -> Self {
        let [f1, f2] = bounded(f);
        let polar = Polar::new(&f1, &f2);
        let [xx, xy, yy] = polar.u;
        let [s11, s22, s12] = d.apply(&strain(&polar));
        let couple = xy * (s22 - s11) + s12 * (xx - yy);
        let skew = if polar.trace > 0.0 {
            couple / polar.trace
        } else {
            0.0
        };
        Self {
            polar,
            sigma: [s11, s12, s22],
            couple,
            skew,
        }
    }

    /// `P = R T`.
    fn stress(&self) -> [Vec3; 2] {
        let [r1, r2] = self.polar.r;
        let [xx, xy, yy] = self.sigma;
        [
            r1 * xx + r2 * (xy - self.skew),
            r1 * (xy + self.skew) + r2 * yy,
        ]
    }

    /// Second derivative in the plane, in the orthonormal basis e11, e22, (e12 + e21) / sqrt 2,
    /// (e21 - e12) / sqrt 2. The spin comes last, so that elimination meets the definite part first.
    fn in_plane(&self, d: &PlaneStiffness) -> Sym4 {
        let d = d.matrix();
        let [uxx, uxy, uyy] = self.polar.u;
        let [sxx, sxy, syy] = self.sigma;
        let trace = self.polar.trace.max(2.0 * STRETCH_FLOOR);
        // omega and dU of the last basis vector. For the others, omega = 0 and dU = A.
        let omega = SQRT_2 / trace;
        let spun = [omega * uxy, -omega * uxy, omega * (uyy - uxx)];
        let pull = d.map(|row| row[0] * spun[0] + row[1] * spun[1] + row[2] * spun[2]);
        let skew = self.couple / trace;
        let h03 = pull[0] + omega * (skew - sxy);
        let h13 = pull[1] + omega * (skew + sxy);
        let h23 = SQRT_2 * pull[2] + omega * FRAC_1_SQRT_2 * (sxx - syy);
        let h33 = spun[0] * pull[0]
            + spun[1] * pull[1]
            + spun[2] * pull[2]
            + omega * SQRT_2 * (sxx + syy)
            - omega * omega * (sxx * uxx + 2.0 * sxy * uxy + syy * uyy);
        let (h02, h12) = (SQRT_2 * d[0][2], SQRT_2 * d[1][2]);
        [
            [d[0][0], d[0][1], h02, h03],
            [d[0][1], d[1][1], h12, h13],
            [h02, h12, 2.0 * d[2][2], h23],
            [h03, h13, h23, h33],
        ]
    }

    /// `S = U^-1 T` (xx, xy, yy).
    fn out_of_plane(&self) -> [f64; 3] {
        let [xx, xy, yy] = inverse_stretch(&self.polar);
        let [s11, s12, s22] = self.sigma;
        let (t12, t21) = (s12 + self.skew, s12 - self.skew);
        [
            xx * s11 + xy * t21,
            // The mean of two entries that are equal if no stretch is below its floor.
            0.5 * (xx * t12 + xy * s22 + xy * s11 + yy * t21),
            xy * t12 + yy * s22,
        ]
    }
}

/// `U - I` as (e11, e22, 2 e12).
fn strain(polar: &Polar) -> [f64; 3] {
    let [xx, xy, yy] = polar.u;
    [xx - 1.0, yy - 1.0, 2.0 * xy]
}

/// `U^-1` with the stretches bounded below (xx, xy, yy).
fn inverse_stretch(polar: &Polar) -> [f64; 3] {
    let stretch = polar.stretches();
    let value = stretch.map(|stretch| 1.0 / stretch.max(STRETCH_FLOOR));
    polar.with_principal(stretch, value)
}

/// The change from the basis of [`State::in_plane`] to the pairs of [`modulus`].
fn by_entries(h: &Sym4) -> Sym4 {
    let turn = |h: [f64; 4]| {
        [
            h[0],
            FRAC_1_SQRT_2 * (h[2] + h[3]),
            FRAC_1_SQRT_2 * (h[2] - h[3]),
            h[1],
        ]
    };
    let rows = h.map(turn);
    // The basis of the columns has changed. The matrix is symmetric, so the same change of its columns does the rest.
    let column = |k: usize| turn([rows[0][k], rows[1][k], rows[2][k], rows[3][k]]);
    [column(0), column(1), column(2), column(3)]
}

impl SheetLaw for CorotationalSheet {
    fn energy(&self, d: &PlaneStiffness, f: &[Vec3; 2]) -> f64 {
        let [f1, f2] = bounded(f);
        d.energy(&strain(&Polar::new(&f1, &f2)))
    }

    fn stress(&self, d: &PlaneStiffness, f: &[Vec3; 2]) -> [Vec3; 2] {
        State::new(d, f).stress()
    }

    fn respond(&self, d: &PlaneStiffness, f: &[Vec3; 2], tangent: Tangent) -> SheetResponse {
        let state = State::new(d, f);
        let mut in_plane = state.in_plane(d);
        let mut out_of_plane = state.out_of_plane();
        if tangent == Tangent::Clipped {
            in_plane = clip4(&in_plane);
            out_of_plane = clip2(out_of_plane);
        }
        let Polar { r, n, .. } = &state.polar;
        SheetResponse {
            stress: state.stress(),
            modulus: modulus(
                r,
                &by_entries(&in_plane),
                &(n * n.transpose()),
                &out_of_plane,
            ),
        }
    }
}
