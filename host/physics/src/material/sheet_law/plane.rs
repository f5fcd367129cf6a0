//! The stiffness of a thin sheet in its own plane: Hooke's law in plane stress, times the thickness.
//!
//! The orthotropic law and its limits are those of R. M. Jones, "Mechanics of composite materials", 2nd
//! edition, 1999: section 2.5 (`Q11 = E1 / (1 - nu12 nu21)`), section 2.4 (the limits that a positive
//! energy puts on the constants) and section 2.6 (the turned stiffness).

use thiserror::Error;

/// Why a stiffness was refused.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("sheet stiffness: `{field}` is {found}, expected {expected}")]
pub struct StiffnessError {
    /// The argument that is out of range.
    pub field: &'static str,
    /// Its value.
    pub found: f64,
    /// What is allowed.
    pub expected: &'static str,
}

/// What Poisson's ratio of an orthotropic sheet is told to be.
const DEFINITE: &str =
    "a number between -sqrt(young_warp / young_weft) and its opposite, both excluded";

/// Symmetric, positive definite relation between strain and stress resultant in a plane (N/m).
///
/// It takes the strain `(e11, e22, 2 e12)` to the stress times the thickness, `(s11, s22, s12)`, both in
/// an orthonormal frame whose first axis is the warp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneStiffness {
    matrix: [[f64; 3]; 3],
}

impl PlaneStiffness {
    /// Of an isotropic sheet: Young's modulus (Pa), Poisson's ratio, thickness (m).
    ///
    /// # Errors
    ///
    /// [`StiffnessError`] where the modulus or the thickness is not positive, or Poisson's ratio not
    /// between -1 and 0.5 (in a plane 1 would do, but no isotropic solid has it).
    pub fn isotropic(young: f64, poisson: f64, thickness: f64) -> Result<Self, StiffnessError> {
        positive("young", young)?;
        positive("thickness", thickness)?;
        if !(poisson > -1.0 && poisson < 0.5) {
            return Err(StiffnessError {
                field: "poisson",
                found: poisson,
                expected: "a number between -1 and 0.5, both excluded",
            });
        }
        let direct = young * thickness / (1.0 - poisson * poisson);
        let shear = 0.5 * young * thickness / (1.0 + poisson);
        Self::from_entries(direct, poisson * direct, direct, shear)
    }

    /// Of an orthotropic sheet in the frame of its warp and weft.
    ///
    /// The moduli along the warp and the weft and the shear modulus between them are in Pa, the thickness
    /// in m. `poisson_warp_weft` is the contraction along the weft for a pull along the warp; the other
    /// one follows from symmetry, `nu21 = nu12 E2 / E1`.
    ///
    /// # Errors
    ///
    /// [`StiffnessError`] where a modulus or the thickness is not positive, or where the square of
    /// Poisson's ratio is not below `E1 / E2`: some strain would then cost no energy, or give some.
    pub fn orthotropic(
        young_warp: f64,
        young_weft: f64,
        poisson_warp_weft: f64,
        shear: f64,
        thickness: f64,
    ) -> Result<Self, StiffnessError> {
        positive("young_warp", young_warp)?;
        positive("young_weft", young_weft)?;
        positive("shear", shear)?;
        positive("thickness", thickness)?;
        let coupling = poisson_warp_weft * (young_weft / young_warp);
        let definite = 1.0 - poisson_warp_weft * coupling;
        if definite.is_nan() || definite <= 0.0 {
            return Err(StiffnessError {
                field: "poisson",
                found: poisson_warp_weft,
                expected: DEFINITE,
            });
        }
        let weft = young_weft * thickness / definite;
        Self::from_entries(
            young_warp * thickness / definite,
            poisson_warp_weft * weft,
            weft,
            shear * thickness,
        )
    }

    /// From entries of which each factor was in range; their products may still have left it.
    fn from_entries(d11: f64, d12: f64, d22: f64, d33: f64) -> Result<Self, StiffnessError> {
        for (field, found) in [
            ("stiffness along the warp (N/m)", d11),
            ("stiffness along the weft (N/m)", d22),
            ("stiffness in shear (N/m)", d33),
        ] {
            positive(field, found)?;
        }
        Ok(Self {
            matrix: [[d11, d12, 0.0], [d12, d22, 0.0], [0.0, 0.0, d33]],
        })
    }

    /// The same sheet in a frame turned by `angle` (rad), counterclockwise, from the present one.
    ///
    /// A pull along the first axis of the result is one at `angle` from the warp.
    pub fn rotated(&self, angle: f64) -> Self {
        let (s, c) = libm::sincos(angle);
        let (ss, sc, cc) = (s * s, s * c, c * c);
        // Strain in the present frame by that in the turned one; the energy is the same number in both.
        let turn = [[cc, ss, -sc], [ss, cc, sc], [2.0 * sc, -2.0 * sc, cc - ss]];
        let column = |k: usize| [turn[0][k], turn[1][k], turn[2][k]];
        let entry = |i: usize, j: usize| dot3(&column(i), &self.apply(&column(j)));
        let (d12, d13, d23) = (entry(0, 1), entry(0, 2), entry(1, 2));
        Self {
            matrix: [
                [entry(0, 0), d12, d13],
                [d12, entry(1, 1), d23],
                [d13, d23, entry(2, 2)],
            ],
        }
    }

    /// The matrix (N/m), by rows.
    pub fn matrix(&self) -> &[[f64; 3]; 3] {
        &self.matrix
    }

    /// Stress resultant `(s11, s22, s12)` (N/m) of a strain `(e11, e22, 2 e12)`.
    pub fn apply(&self, strain: &[f64; 3]) -> [f64; 3] {
        self.matrix.map(|row| dot3(&row, strain))
    }

    /// Energy per area (J/m^2) of a strain `(e11, e22, 2 e12)`.
    pub fn energy(&self, strain: &[f64; 3]) -> f64 {
        0.5 * dot3(strain, &self.apply(strain))
    }
}

fn dot3(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn positive(field: &'static str, found: f64) -> Result<(), StiffnessError> {
    if found > 0.0 && found.is_finite() {
        Ok(())
    } else {
        Err(StiffnessError {
            field,
            found,
            expected: "a positive, finite number",
        })
    }
}
