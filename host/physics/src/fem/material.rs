//! The material of a triangle, and its checks.

use super::error::SheetError;

/// Isotropic linear material of one triangle of a sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Young's modulus (Pa), positive.
    pub young: f64,
    /// Poisson's ratio, between -1 and 0.5, both excluded.
    pub poisson: f64,
    /// Thickness (m), positive.
    pub thickness: f64,
    /// Density (kg/m^3), positive.
    pub density: f64,
}

impl Material {
    /// Shear modulus (Pa).
    pub fn shear(&self) -> f64 {
        0.5 * self.young / (1.0 + self.poisson)
    }

    /// First Lame parameter in plane stress (Pa): `E nu / (1 - nu^2)`.
    pub fn lambda_plane_stress(&self) -> f64 {
        self.young * self.poisson / (1.0 - self.poisson * self.poisson)
    }

    /// Bending rigidity of a plate (N m): `E t^3 / (12 (1 - nu^2))`.
    pub fn bending_rigidity(&self) -> f64 {
        self.young * self.thickness * self.thickness * self.thickness
            / (12.0 * (1.0 - self.poisson * self.poisson))
    }

    /// Checks the ranges that the fields document.
    ///
    /// # Errors
    ///
    /// [`SheetError::Material`], naming `triangle`, the field, what was found and what is allowed.
    pub fn check(&self, triangle: usize) -> Result<(), SheetError> {
        let positive = "a positive, finite number";
        let fail = |field, found, expected| {
            Err(SheetError::Material {
                triangle,
                field,
                found,
                expected,
            })
        };
        let is_positive = |value: f64| value > 0.0 && value.is_finite();
        if !is_positive(self.young) {
            return fail("young", self.young, positive);
        }
        if !is_positive(self.thickness) {
            return fail("thickness", self.thickness, positive);
        }
        if !is_positive(self.density) {
            return fail("density", self.density, positive);
        }
        if !(self.poisson > -1.0 && self.poisson < 0.5) {
            return fail(
                "poisson",
                self.poisson,
                "a number between -1 and 0.5, both excluded",
            );
        }
        Ok(())
    }
}
