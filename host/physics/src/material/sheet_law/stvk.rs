//! The St. Venant-Kirchhoff sheet: linear in Green's strain, `psi = 1/2 E : D : E`, `E = (F^T F - I) / 2`.
//!
//! With the second Piola-Kirchhoff stress `S = D E`,
//!
//! ```text
//! P = F S        dP = dF S + F D sym(F^T dF)
//! ```
//!
//! (Bonet and Wood, "Nonlinear continuum mechanics for finite element analysis", chapter Hyperelasticity;
//! for triangles of cloth, Volino, Magnenat-Thalmann and Faure, "A simple approach to nonlinear tensile
//! stiffness for accurate cloth simulation", 2009). No decomposition is needed. The second part of the tangent is
//! positive semidefinite, so under tension the tangent needs no clipping.
//!
//! If a principal stress is negative, `dF = R A + n w^T` with the rotation `R` of the polar decomposition splits the
//! tangent into `A S + U D sym(U A)` in the plane and `S w` out of it. Each part is clipped separately.
//!
//! Below a stretch of `1 / sqrt 3` the stress of a sheet decreases under further compression, and at zero length it
//! vanishes. This is a property of the law. The corotational law does not have it.

use super::clip::{Sym4, clip2, clip4};
use super::{PlaneStiffness, SheetLaw, SheetResponse, bounded, modulus};
use crate::material::Tangent;
use crate::polar::surface::Polar;
use crate::{Mat3, Vec3};

/// The law with energy `1/2 E : D : E`, `E` Green's strain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StVenantKirchhoffSheet;

/// For each pair `(p, j)` of [`modulus`], its component of the strain.
const COMPONENT: [usize; 4] = [0, 2, 2, 1];

/// Green's strain as (e11, e22, 2 e12).
fn strain(f: &[Vec3; 2]) -> [f64; 3] {
    let [f1, f2] = f;
    [
        0.5 * (f1.dot(f1) - 1.0),
        0.5 * (f2.dot(f2) - 1.0),
        f1.dot(f2),
    ]
}

/// `F S` for `S` given as (s11, s22, s12).
fn piola(f: &[Vec3; 2], s: &[f64; 3]) -> [Vec3; 2] {
    [f[0] * s[0] + f[1] * s[2], f[0] * s[2] + f[1] * s[1]]
}

/// The part of the tangent in the plane of the triangle, in the frame of `R`.
fn in_plane(d: &Sym4, u: &[f64; 3], s: &[f64; 3]) -> Sym4 {
    let [xx, xy, yy] = *u;
    // U acts on the first index of each pair.
    let turn = |h: [f64; 4]| {
        [
            xx * h[0] + xy * h[1],
            xy * h[0] + yy * h[1],
            xx * h[2] + xy * h[3],
            xy * h[2] + yy * h[3],
        ]
    };
    let rows = d.map(turn);
    let column = |k: usize| turn([rows[0][k], rows[1][k], rows[2][k], rows[3][k]]);
    let mut h = [column(0), column(1), column(2), column(3)];
    for p in 0..2 {
        h[p][p] += s[0];
        h[p][p + 2] += s[1];
        h[p + 2][p] += s[1];
        h[p + 2][p + 2] += s[2];
    }
    h
}

impl SheetLaw for StVenantKirchhoffSheet {
    fn energy(&self, d: &PlaneStiffness, f: &[Vec3; 2]) -> f64 {
        d.energy(&strain(&bounded(f)))
    }

    fn stress(&self, d: &PlaneStiffness, f: &[Vec3; 2]) -> [Vec3; 2] {
        let f = bounded(f);
        piola(&f, &d.apply(&strain(&f)))
    }

    fn respond(&self, d: &PlaneStiffness, f: &[Vec3; 2], tangent: Tangent) -> SheetResponse {
        let f = bounded(f);
        let voigt = d.apply(&strain(&f));
        let s = [voigt[0], voigt[2], voigt[1]];
        let entries = COMPONENT.map(|i| COMPONENT.map(|j| d.matrix()[i][j]));
        let taut = clip2(s);
        let modulus = if tangent == Tangent::Exact || taut == s {
            modulus(&f, &entries, &Mat3::identity(), &s)
        } else {
            let polar = Polar::new(&f[0], &f[1]);
            let h = clip4(&in_plane(&entries, &polar.u, &s));
            modulus(&polar.r, &h, &(polar.n * polar.n.transpose()), &taut)
        };
        SheetResponse {
            stress: piola(&f, &voigt),
            modulus,
        }
    }
}
