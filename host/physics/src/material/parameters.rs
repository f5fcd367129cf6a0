//! The materials of a thread's bars, of a sheet's triangles and of a solid's cells, and their checks.

use crate::Mat3;
use crate::error::BodyError;

/// Isotropic linear material of one triangle of a sheet.
///
/// ```
/// use physics::{BodyError, Material};
///
/// let rubber = Material { young: 1e6, poisson: 0.3, thickness: 1e-3, density: 1000.0 };
/// rubber.check(0)?;
/// assert!((rubber.bending_rigidity() - 1e6 * 1e-9 / (12.0 * 0.91)).abs() < 1e-18);
///
/// let error = Material { poisson: 0.5, ..rubber }.check(3).unwrap_err();
/// assert!(matches!(error, BodyError::Material { element: 3, field: "poisson", .. }));
/// # Ok::<(), BodyError>(())
/// ```
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

    /// Kirchhoff's matrix of a plate (N m), between moments and curvatures (xx, yy, 2 xy).
    pub fn plate(&self) -> Mat3 {
        let nu = self.poisson;
        let matrix = Mat3::new(1.0, nu, 0.0, nu, 1.0, 0.0, 0.0, 0.0, 0.5 * (1.0 - nu));
        matrix * self.bending_rigidity()
    }

    /// Checks the ranges that the fields document.
    ///
    /// # Errors
    ///
    /// [`BodyError::Material`]. It names `element`, the field, the value and the allowed values.
    pub fn check(&self, element: usize) -> Result<(), BodyError> {
        check_positive(element, "young", self.young)?;
        check_positive(element, "thickness", self.thickness)?;
        check_positive(element, "density", self.density)?;
        check_poisson(element, self.poisson)
    }
}

/// Isotropic material of one cell of a solid.
///
/// ```
/// use physics::{BodyError, SolidMaterial};
///
/// let tissue = SolidMaterial { young: 2e4, poisson: 0.45, density: 1050.0 };
/// tissue.check(0)?;
/// assert!(SolidMaterial { young: -1.0, ..tissue }.check(0).is_err());
/// # Ok::<(), BodyError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolidMaterial {
    /// Young's modulus at rest (Pa), positive.
    pub young: f64,
    /// Poisson's ratio at rest, between -1 and 0.5, both excluded.
    pub poisson: f64,
    /// Density (kg/m^3), positive.
    pub density: f64,
}

impl SolidMaterial {
    /// Checks the ranges that the fields document.
    ///
    /// # Errors
    ///
    /// [`BodyError::Material`]. It names `element`, the field, the value and the allowed values.
    pub fn check(&self, element: usize) -> Result<(), BodyError> {
        check_positive(element, "young", self.young)?;
        check_positive(element, "density", self.density)?;
        check_poisson(element, self.poisson)
    }
}

/// Material of one bar of a thread, and how thick the bar is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreadMaterial {
    /// Young's modulus along the axis (Pa), positive.
    pub young: f64,
    /// Cross-section at rest (m^2), positive.
    pub area: f64,
    /// Density (kg/m^3), positive.
    pub density: f64,
    /// Whether it resists tension alone, as a thread does; otherwise compression, too, as a rod that does not buckle.
    pub tension_only: bool,
}

impl ThreadMaterial {
    /// Checks the ranges that the fields document.
    ///
    /// # Errors
    ///
    /// [`BodyError::Material`], naming `element`, the field, what was found and what is allowed.
    pub fn check(&self, element: usize) -> Result<(), BodyError> {
        check_positive(element, "young", self.young)?;
        check_positive(element, "area", self.area)?;
        check_positive(element, "density", self.density)
    }
}

fn check_positive(element: usize, field: &'static str, found: f64) -> Result<(), BodyError> {
    if found > 0.0 && found.is_finite() {
        return Ok(());
    }
    Err(BodyError::Material {
        element,
        field,
        found,
        expected: "a positive, finite number",
    })
}

fn check_poisson(element: usize, found: f64) -> Result<(), BodyError> {
    if found > -1.0 && found < 0.5 {
        return Ok(());
    }
    Err(BodyError::Material {
        element,
        field: "poisson",
        found,
        expected: "a number between -1 and 0.5, both excluded",
    })
}
