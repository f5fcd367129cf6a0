//! Laws of elastic sheets: energy, stress and tangent at one deformation gradient of a surface.
//!
//! This module is the counterpart of [`crate::material::law`] for surfaces. Each law has one file. A law is a function
//! of a [`PlaneStiffness`] and the two columns of the 3 x 2 deformation gradient, in the orthonormal rest frame of the
//! warp. [`crate::element::triangle::woven`] integrates laws over triangles. All quantities are per rest area; the
//! thickness is part of the stiffness.
//!
//! - [`corotational`]: linear in the right stretch. It is stable under compression. Under tension it is stable if the
//!   moduli along the threads are not many times the shear modulus.
//! - [`stvk`]: linear in Green's strain. It is stable under any tension, for any weave, and soft under compression.

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

/// Stress and modulus of a law at one deformation gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetResponse {
    /// The two columns of the first Piola-Kirchhoff stress times the thickness (N/m).
    pub stress: [Vec3; 2],
    /// The derivative of the stress by the deformation gradient (N/m).
    pub modulus: SheetModulus,
}

/// An elastic law of a sheet.
///
/// The stress is exactly the derivative of the energy. With [`Tangent::Exact`] the modulus is exactly the derivative
/// of the stress, unless the law states a least stretch for its modulus. With [`Tangent::Clipped`] the negative
/// eigenvalues of the modulus are set to zero. Energy, stress and modulus are finite for every finite `f`: a gradient
/// with an entry beyond 1e60 is scaled so that its largest entry is 1e60.
///
/// ```
/// use physics::Vec3;
/// use physics::material::sheet_law::{
///     PlaneStiffness, SheetLaw, StVenantKirchhoffSheet, StiffnessError,
/// };
///
/// let stiffness = PlaneStiffness::orthotropic(4e5, 1e5, 0.2, 2e4, 1e-3)?;
/// // A stretch of one per cent along the warp.
/// let f = [Vec3::x() * 1.01, Vec3::y()];
/// let [warp, weft] = StVenantKirchhoffSheet.stress(&stiffness, &f);
/// assert!(warp.x > weft.y && weft.y > 0.0);
/// # Ok::<(), StiffnessError>(())
/// ```
pub trait SheetLaw: Copy + core::fmt::Debug + Default + Send + Sync + 'static {
    /// Energy per rest area (J/m^2), zero at rest.
    fn energy(&self, d: &PlaneStiffness, f: &[Vec3; 2]) -> f64;

    /// The two columns of the first Piola-Kirchhoff stress times the thickness (N/m).
    fn stress(&self, d: &PlaneStiffness, f: &[Vec3; 2]) -> [Vec3; 2];

    /// Stress and modulus (N/m).
    fn respond(&self, d: &PlaneStiffness, f: &[Vec3; 2], tangent: Tangent) -> SheetResponse;
}

/// The largest entry of a gradient that a law uses. The product of its fourth power and any stiffness is finite.
const LARGEST_ENTRY: f64 = 1e60;

/// `f`, scaled if necessary so that no entry exceeds [`LARGEST_ENTRY`].
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
