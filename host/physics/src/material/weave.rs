//! The material of a woven triangle, and its checks.

use super::sheet_law::{PlaneStiffness, StiffnessError};
use crate::Vec3;
use crate::error::BodyError;

/// Orthotropic linear material of one triangle of a sheet: threads in two directions at right angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weave {
    /// Direction of the warp threads in the rest shape, of any length but zero. What of it lies in the
    /// plane of the triangle counts; the weft is perpendicular to that.
    pub warp: Vec3,
    /// Young's modulus along the warp (Pa), positive.
    pub young_warp: f64,
    /// Young's modulus along the weft (Pa), positive.
    pub young_weft: f64,
    /// Poisson's ratio: contraction along the weft for a pull along the warp. Its square is below
    /// `young_warp / young_weft`.
    pub poisson: f64,
    /// Shear modulus between warp and weft (Pa), positive.
    pub shear: f64,
    /// Thickness (m), positive.
    pub thickness: f64,
    /// Density (kg/m^3), positive.
    pub density: f64,
}

impl Weave {
    /// The stiffness in the frame of warp and weft.
    ///
    /// # Errors
    ///
    /// [`BodyError::Material`], naming `triangle`, the field, what was found and what is allowed.
    pub fn stiffness(&self, triangle: usize) -> Result<PlaneStiffness, BodyError> {
        PlaneStiffness::orthotropic(
            self.young_warp,
            self.young_weft,
            self.poisson,
            self.shear,
            self.thickness,
        )
        .map_err(
            |StiffnessError {
                 field,
                 found,
                 expected,
             }| BodyError::Material {
                element: triangle,
                field,
                found,
                expected,
            },
        )
    }

    /// Checks the ranges that the fields document.
    ///
    /// # Errors
    ///
    /// [`BodyError::Material`], naming `triangle`, the field, what was found and what is allowed;
    /// [`BodyError::Warp`] for a warp that is zero or not finite.
    pub fn check(&self, triangle: usize) -> Result<(), BodyError> {
        self.stiffness(triangle)?;
        if !(self.density > 0.0 && self.density.is_finite()) {
            return Err(BodyError::Material {
                element: triangle,
                field: "density",
                found: self.density,
                expected: "a positive, finite number",
            });
        }
        match unit(&self.warp) {
            Some(_) => Ok(()),
            None => Err(BodyError::Warp {
                triangle,
                share: f64::NAN,
            }),
        }
    }
}

/// `vector` at length one, or `None` where it has no direction.
pub(crate) fn unit(vector: &Vec3) -> Option<Vec3> {
    let largest = vector.amax();
    // Divided by its largest entry first, so that no square leaves the range of numbers.
    (largest > 0.0 && vector.iter().all(|x| x.is_finite())).then(|| (vector / largest).normalize())
}
