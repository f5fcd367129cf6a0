//! Laws of elastic solids: energy density, stress and tangent at one deformation gradient.
//!
//! Each law has one file. A law is a function of a deformation gradient `F` and the Lame parameters.
//! [`crate::element::tet::solid`] integrates laws over tetrahedra.

use super::Tangent;
use crate::Mat3;

mod corotational;
pub mod isotropic;
pub(crate) mod lane_law;
mod linear;
mod neo_hookean;
mod stvk;

pub use corotational::Corotational;
pub use linear::Linear;
pub use neo_hookean::StableNeoHookean;
pub use stvk::StVenantKirchhoff;

/// The Lame parameters of an isotropic linear-elastic solid (Pa).
///
/// ```
/// use physics::{Mat3, Tangent};
/// use physics::material::law::{Lame, Law, StableNeoHookean};
///
/// let lame = Lame::new(1e5, 0.3);
/// let law = StableNeoHookean;
/// let f = Mat3::from_diagonal_element(1.01);
/// let response = law.respond(lame, &f, Tangent::Clipped);
/// assert!(law.energy(lame, &f) > 0.0);
/// assert!(response.stress[(0, 0)] > 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lame {
    /// Shear modulus.
    pub mu: f64,
    /// First parameter.
    pub lambda: f64,
}

impl Lame {
    /// The parameters of a solid with Young's modulus `young` (Pa) and Poisson's ratio `poisson`.
    pub fn new(young: f64, poisson: f64) -> Self {
        Self {
            mu: young / (2.0 * (1.0 + poisson)),
            lambda: young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
        }
    }
}

/// The frame in which a law measures small strains and applies Hooke's law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// The frame of the world.
    Fixed,
    /// The frame that turns with the rotation of the deformation gradient.
    Turning,
}

/// The laws that the vector kernels compute in principal axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IsotropicLaw {
    /// [`StVenantKirchhoff`].
    StVenantKirchhoff,
    /// [`StableNeoHookean`].
    StableNeoHookean,
}

/// Derivative of the stress `P` by the deformation gradient `F` (Pa).
///
/// Block `[j][l]` holds at row `i`, column `k` the derivative of `P_ij` by `F_kl`, so that an element's
/// stiffness between nodes with rest gradients `g_a` and `g_b` is the sum of `g_a[j] g_b[l] [j][l]`.
pub type Modulus = [[Mat3; 3]; 3];

/// Stress and modulus of a law at one deformation gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// First Piola-Kirchhoff stress `P` (Pa).
    pub stress: Mat3,
    /// The derivative of the stress by the deformation gradient (Pa).
    pub modulus: Modulus,
}

/// An elastic law.
///
/// The stress is exactly the derivative of the energy density. With [`Tangent::Exact`] the modulus is exactly the
/// derivative of the stress. With [`Tangent::Clipped`] the negative eigenvalues of the modulus are set to zero.
/// Energy, stress and modulus must be finite for every finite `F`, whatever its determinant.
pub trait Law: Copy + core::fmt::Debug + Default + Send + Sync + 'static {
    /// The frame in which the law is Hooke's law, if there is one. The vector kernels
    /// ([`hooke`](crate::element::tet::hooke)) handle such a law directly.
    const FRAME: Option<Frame> = None;

    /// The name of the law, if the law is isotropic and the vector kernels compute it in principal axes.
    const ISOTROPIC: Option<IsotropicLaw> = None;

    /// Energy per rest volume (J/m^3), zero at rest.
    fn energy(&self, lame: Lame, f: &Mat3) -> f64;

    /// First Piola-Kirchhoff stress (Pa).
    fn stress(&self, lame: Lame, f: &Mat3) -> Mat3;

    /// Stress and modulus (Pa).
    fn respond(&self, lame: Lame, f: &Mat3, tangent: Tangent) -> Response;
}
