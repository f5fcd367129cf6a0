//! The material of a woven triangle, and its checks.

use super::sheet_law::{PlaneStiffness, StiffnessError};
use crate::error::BodyError;
use crate::{Mat3, Vec3};

/// Orthotropic linear material of one triangle of a sheet, woven of threads in two perpendicular directions.
///
/// ```
/// use physics::{BodyError, Rigidity, Vec3, Weave};
///
/// let weave = Weave {
///     warp: Vec3::x(),
///     young_warp: 4e5,
///     young_weft: 1e5,
///     poisson: 0.2,
///     shear: 2e4,
///     thickness: 1e-3,
///     density: 300.0,
///     rigidity: Rigidity { warp: 2e-6, weft: 1e-6, twist: 3e-7 },
/// };
/// weave.check(0)?;
/// // A strain along the warp alone is resisted by E1 t / (1 - nu12 nu21) (N/m).
/// let stress = weave.stiffness(0)?.apply(&[0.01, 0.0, 0.0]);
/// assert!((stress[0] - 4e5 * 1e-3 * 0.01 / (1.0 - 0.2 * 0.05)).abs() < 1e-12);
/// # Ok::<(), BodyError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weave {
    /// Direction of the warp threads in the rest shape, of any length but zero. The projection onto the plane of
    /// the triangle is used. The weft is perpendicular to that projection.
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
    /// Resistance to bending. Threads slide over each other, so that it is far below that of a plate of this thickness.
    pub rigidity: Rigidity,
}

/// The resistance of a woven sheet to bending, by direction. Zero: none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rigidity {
    /// The moment per width (N m / m) over the curvature (1/m) of the warp threads, not negative.
    pub warp: f64,
    /// The same of the weft threads.
    pub weft: f64,
    /// The twisting moment per width (N m / m) over twice the twist of the surface (1/m), not negative.
    pub twist: f64,
}

impl Rigidity {
    /// The plate's matrix (N m) between moments and curvatures (xx, yy, 2 xy) in a frame whose first axis is at the
    /// angle with this cosine and sine before the warp.
    pub(crate) fn plate(&self, [c, s]: [f64; 2]) -> Mat3 {
        let to_weave = Mat3::new(
            c * c,
            s * s,
            c * s,
            s * s,
            c * c,
            -c * s,
            -2.0 * c * s,
            2.0 * c * s,
            c * c - s * s,
        );
        let own = Mat3::from_diagonal(&Vec3::new(self.warp, self.weft, self.twist));
        to_weave.transpose() * own * to_weave
    }

    fn check(&self, triangle: usize) -> Result<(), BodyError> {
        for (field, found) in [
            ("rigidity.warp", self.warp),
            ("rigidity.weft", self.weft),
            ("rigidity.twist", self.twist),
        ] {
            if !(found >= 0.0 && found.is_finite()) {
                return Err(BodyError::Material {
                    element: triangle,
                    field,
                    found,
                    expected: "a finite number, not negative",
                });
            }
        }
        Ok(())
    }
}

impl Weave {
    /// The stiffness in the frame of warp and weft.
    ///
    /// # Errors
    ///
    /// [`BodyError::Material`]. It names `triangle`, the field, the value and the allowed values.
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
    /// [`BodyError::Material`], which names `triangle`, the field, the value and the allowed values.
    /// [`BodyError::Warp`] for a warp that is zero or not finite.
    pub fn check(&self, triangle: usize) -> Result<(), BodyError> {
        self.stiffness(triangle)?;
        self.rigidity.check(triangle)?;
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
                fraction: f64::NAN,
            }),
        }
    }
}

/// The unit vector along `vector`, or `None` if `vector` is zero or not finite.
pub(crate) fn unit(vector: &Vec3) -> Option<Vec3> {
    let largest = vector.amax();
    // The division by the largest entry keeps the squares within the range of `f64`.
    (largest > 0.0 && vector.iter().all(|x| x.is_finite())).then(|| (vector / largest).normalize())
}
