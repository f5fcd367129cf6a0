//! Laws of elastic sheets: energy, stress and tangent at one deformation gradient of a surface.
//!
//! The counterpart of [`crate::material::law`] for surfaces. A law is one file. It knows the two columns of the 3 x 2
//! deformation gradient in the orthonormal rest frame of the warp and a [`PlaneStiffness`], nothing of
//! triangles, meshes or time; [`crate::element::triangle::woven`] integrates it over triangles. All quantities are per rest
//! area, the thickness being part of the stiffness.
//!
//! - [`corotational`]: linear in the right stretch. Well behaved when crushed; under tension for sheets
//!   whose moduli along the threads are not many times that in shear.
//! - [`stvk`]: linear in Green's strain. Stable under any tension, for any weave; soft when crushed.

use super::Tangent;
use crate::{Mat3, Vec3};

mod clip;
pub mod corotational;
mod plane;
pub mod stvk;

pub use corotational::CorotationalSheet;
pub use plane::{PlaneStiffness, StiffnessError};
pub use stvk::StVenantKirchhoffSheet;

/// Derivative of the stress `P` by the deformation gradient `F` (N/m).
///
/// Block `[j][l]` holds at row `i`, column `k` the derivative of `P_ij` by `F_kl`, so that an element's
/// stiffness between nodes with rest gradients `g_a` and `g_b` is the sum of `g_a[j] g_b[l] [j][l]`, times
/// the element's rest area.
pub type SheetModulus = [[Mat3; 2]; 2];

/// What a law says at one deformation gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetResponse {
    /// The two columns of the first Piola-Kirchhoff stress times the thickness (N/m).
    pub stress: [Vec3; 2],
    /// Its derivative.
    pub modulus: SheetModulus,
}

/// An elastic law of a sheet.
///
/// The stress is exactly the derivative of the energy, and with [`Tangent::Exact`] the modulus exactly
/// that of the stress, save where a law says that it bounds a triangle crushed to nearly nothing. With
/// [`Tangent::Clipped`] its negative eigenvalues are replaced by zero. None of the three returns a value
/// that is not finite for a finite `f`: a gradient with an entry beyond 1e60 is taken for its multiple that
/// ends there.
pub trait SheetLaw: Copy + core::fmt::Debug + Default + Send + Sync + 'static {
    /// Energy per rest area (J/m^2), zero at rest.
    fn energy(&self, d: &PlaneStiffness, f: &[Vec3; 2]) -> f64;

    /// The two columns of the first Piola-Kirchhoff stress times the thickness (N/m).
    fn stress(&self, d: &PlaneStiffness, f: &[Vec3; 2]) -> [Vec3; 2];

    /// Stress and modulus.
    fn respond(&self, d: &PlaneStiffness, f: &[Vec3; 2], tangent: Tangent) -> SheetResponse;
}

/// Largest entry of a gradient that a law looks at: its fourth power, times any stiffness, is a number.
const LARGEST_ENTRY: f64 = 1e60;

/// `f`, shortened where its entries are beyond all use.
fn bounded(f: &[Vec3; 2]) -> [Vec3; 2] {
    let largest = f[0].amax().max(f[1].amax());
    if largest <= LARGEST_ENTRY {
        *f
    } else {
        f.map(|column| column * (LARGEST_ENTRY / largest))
    }
}

/// The modulus `sum r_p r_q^T h[(p, j)][(q, l)] + around s_jl`.
///
/// The pairs `(p, j)` are numbered (0, 0), (1, 0), (0, 1), (1, 1); `s` holds xx, xy, yy.
fn modulus(r: &[Vec3; 2], h: &clip::Sym4, around: &Mat3, s: &[f64; 3]) -> SheetModulus {
    let (r0, r1) = (r[0].transpose(), r[1].transpose());
    let block = |j: usize, l: usize| {
        let column = |c: usize| r[0] * h[2 * j][c] + r[1] * h[2 * j + 1][c];
        column(2 * l) * r0 + column(2 * l + 1) * r1 + around * s[j + l]
    };
    let k01 = block(0, 1);
    [[block(0, 0), k01], [k01.transpose(), block(1, 1)]]
}
