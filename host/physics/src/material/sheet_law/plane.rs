//! The stiffness of a thin sheet in its own plane: Hooke's law in plane stress, times the thickness.
//!
//! The orthotropic law and its limits are those of R. M. Jones, "Mechanics of composite materials", 2nd
//! edition, 1999: section 2.5 (`Q11 = E1 / (1 - nu12 nu21)`), section 2.4 (the limits that a positive
//! energy puts on the constants) and section 2.6 (the turned stiffness).

use thiserror::Error;

/// Why the constants of a sheet give no valid stiffness.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("sheet stiffness: `{field}` is {found}, expected {expected}")]
pub struct StiffnessError {
    /// The argument that is out of range.
    pub field: &'static str,
    /// Its value.
    pub found: f64,
    /// The allowed values.
    pub expected: &'static str,
}

/// The allowed values of Poisson's ratio of an orthotropic sheet, for messages.
const DEFINITE: &str =
    "a number between -sqrt(young_warp / young_weft) and its opposite, both excluded";

/// Symmetric, positive definite relation between strain and stress resultant in a plane (N/m).
///
/// It maps the strain `(e11, e22, 2 e12)` to the stress times the thickness, `(s11, s22, s12)`. Both are in an
/// orthonormal frame whose first axis is the warp.
///
/// ```
/// use physics::material::sheet_law::{PlaneStiffness, StiffnessError};
///
/// let cloth = PlaneStiffness::orthotropic(4e5, 1e5, 0.2, 2e4, 1e-3)?;
/// // Seen from the weft, the stiffness along the first axis is that along the weft.
/// let turned = cloth.rotated(core::f64::consts::FRAC_PI_2);
/// let [along, of_weft] = [turned.matrix()[0][0], cloth.matrix()[1][1]];
/// assert!((along - of_weft).abs() < 1e-12 * of_weft);
/// # Ok::<(), StiffnessError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneStiffness {
    matrix: [[f64; 3]; 3],
}

impl PlaneStiffness {
    /// The stiffness of an orthotropic sheet in the frame of its warp and weft.
    ///
    /// The moduli along the warp and the weft and the shear modulus between them are in Pa, the thickness
    /// in m. `poisson_warp_weft` is the contraction along the weft for a pull along the warp. The other ratio
    /// follows from symmetry, `nu21 = nu12 E2 / E1`.
    ///
    /// # Errors
    ///
    /// [`StiffnessError`] if a modulus or the thickness is not positive, or if the square of Poisson's ratio is not
    /// below `E1 / E2`. The energy of some strain would then be zero or negative.
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

    /// The stiffness with these entries (N/m). The constants were in range, but a product of them may have overflowed
    /// or vanished.
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
    /// A pull along the first axis of the turned frame is a pull at `angle` from the warp.
    pub fn rotated(&self, angle: f64) -> Self {
        let (s, c) = libm::sincos(angle);
        let (ss, sc, cc) = (s * s, s * c, c * c);
        // The strain in the present frame as a function of the strain in the turned frame. The energy is the same.
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
