//! Laws of elastic solids: energy density, stress and tangent at one deformation gradient.
//!
//! A law is one file. It knows a deformation gradient `F` and the Lame parameters, nothing of elements,
//! meshes or time; [`crate::element::tet::solid`] integrates it over tetrahedra.

use super::Tangent;
use crate::Mat3;

mod corotational;
pub mod isotropic;
mod linear;
mod neo_hookean;
mod stvk;

pub use corotational::Corotational;
pub use linear::Linear;
pub use neo_hookean::StableNeoHookean;
pub use stvk::StVenantKirchhoff;

/// The Lame parameters of an isotropic linear-elastic solid (Pa).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lame {
    /// Shear modulus.
    pub mu: f64,
    /// First parameter.
    pub lambda: f64,
}

impl Lame {
    /// From Young's modulus (Pa) and Poisson's ratio, in three dimensions.
    pub fn new(young: f64, poisson: f64) -> Self {
        Self {
            mu: young / (2.0 * (1.0 + poisson)),
            lambda: young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
        }
    }
}

/// The frame in which small strains are measured: stresses are those of Hooke's law there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// That of space.
    Fixed,
    /// That which turns with the deformation gradient.
    Turning,
}

/// Derivative of the stress `P` by the deformation gradient `F` (Pa).
///
/// Block `[j][l]` holds at row `i`, column `k` the derivative of `P_ij` by `F_kl`, so that an element's
/// stiffness between nodes with rest gradients `g_a` and `g_b` is the sum of `g_a[j] g_b[l] [j][l]`.
pub type Modulus = [[Mat3; 3]; 3];

/// What a law says at one deformation gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// First Piola-Kirchhoff stress `P` (Pa).
    pub stress: Mat3,
    /// Its derivative.
    pub modulus: Modulus,
}

/// An elastic law.
///
/// The stress is exactly the derivative of the energy density, and with [`Tangent::Exact`] the modulus
/// exactly that of the stress. With [`Tangent::Clipped`] its negative eigenvalues are replaced by zero.
/// None of the three may return a value that is not finite for a finite `F`, whatever its determinant.
pub trait Law: Copy + core::fmt::Debug + Default + Send + Sync + 'static {
    /// The frame in which this is Hooke's law, where there is one: [`fast`](crate::lanes) has kernels for it.
    const FRAME: Option<Frame> = None;

    /// The law in principal axes, where it is isotropic and [`fast`](crate::lanes) is to step it by them.
    const POINT: Option<isotropic::PointLaw> = None;

    /// Energy per rest volume (J/m^3), zero at rest.
    fn energy(&self, lame: Lame, f: &Mat3) -> f64;

    /// First Piola-Kirchhoff stress (Pa).
    fn stress(&self, lame: Lame, f: &Mat3) -> Mat3;

    /// Stress and modulus.
    fn respond(&self, lame: Lame, f: &Mat3, tangent: Tangent) -> Response;
}
