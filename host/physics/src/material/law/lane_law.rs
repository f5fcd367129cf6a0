//! Isotropic laws in vector lanes: energy density and stress from the displacement gradient, moduli in principal axes.
//!
//! The functions have no branches and are always inlined into the loop over lanes that calls them. They take the
//! displacement gradient `H = F - I`. Terms that cancel at rest are cancelled on paper, so that small strains keep their
//! digits.

use super::Lame;
use crate::lanes::Real;
use crate::polar::lanes::Matrix;
use crate::polar::matrices::Symmetric;

/// The Lame parameters, or any multiple of both: energy, stress and moduli are proportional to them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneLame<T> {
    /// Shear modulus.
    pub(crate) mu: T,
    /// First parameter.
    pub(crate) lambda: T,
}

impl<T: Real> LaneLame<T> {
    /// The same in the wide precision.
    #[inline(always)]
    pub(crate) fn widen(self) -> LaneLame<T::Wide> {
        LaneLame {
            mu: self.mu.widen(),
            lambda: self.lambda.widen(),
        }
    }
}

impl From<Lame> for LaneLame<f64> {
    fn from(Lame { mu, lambda }: Lame) -> Self {
        Self { mu, lambda }
    }
}

/// Second derivatives of an energy density by the deformation gradient, in principal axes. See
/// [`Principal`](super::isotropic::Principal).
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneModuli<T> {
    pub(crate) stretch: Symmetric<T>,
    pub(crate) twist: [T; 3],
    pub(crate) flip: [T; 3],
}

/// An isotropic law in vector lanes.
pub(crate) trait LaneLaw: Clone + core::fmt::Debug + Send + Sync + 'static {
    /// Energy density and first Piola-Kirchhoff stress at `I + H`.
    fn respond<T: Real>(lame: LaneLame<T>, h: &Matrix<T>) -> (T, Matrix<T>);

    /// The moduli at the signed principal stretches `s`, not clipped.
    fn moduli<T: Real>(lame: LaneLame<T>, s: [T; 3]) -> LaneModuli<T>;
}
