//! The laws of tearing, by name, and the parameters of a sheet that can tear.
//!
//! Both laws start a tear if the largest principal stress reaches the strength. They differ in what drives a tip that
//! exists. [`TearLaw::Toughness`] compares the energy release rate with the toughness (Griffith 1921); its result does
//! not depend on the size of the triangles. [`TearLaw::Thesis`] compares the stress at the tip with the strength, as
//! Le Gouis et al. 2017 do. The stress at a tip grows with finer triangles, and with it the result of this law.

use thiserror::Error;

/// What drives a tip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TearLaw {
    /// The tip advances while the energy release rate is at least the toughness. Opened edges let go gradually.
    #[default]
    Toughness,
    /// The tip advances while the principal stress at it is at least the strength. Opened edges let go at once.
    Thesis,
}

/// Why an input of this room was refused.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum TearError {
    /// A parameter is out of range.
    #[error("`{field}` is {found}, expected {expected}")]
    Field {
        /// The parameter.
        field: &'static str,
        /// Its value.
        found: f64,
        /// The allowed values.
        expected: &'static str,
    },
    /// The sheet is larger than the memory that was reserved for it.
    #[error("the patch has room for {room} {what}, but the sheet has {found}")]
    Room {
        /// `vertices` or `triangles`.
        what: &'static str,
        /// Number for which there is room.
        room: usize,
        /// Number in the sheet.
        found: usize,
    },
    /// There are fewer positions than vertices.
    #[error("{found} positions are given, but {needed} are needed")]
    Positions {
        /// Number of positions that are needed.
        needed: usize,
        /// Number of positions that were given.
        found: usize,
    },
    /// The given triangle has no corner at the tip.
    #[error("triangle {triangle} has no corner at vertex {vertex}")]
    NoCorner {
        /// The triangle.
        triangle: u32,
        /// The vertex.
        vertex: u32,
    },
    /// The tip itself is held. It ends there.
    #[error("the tip at vertex {vertex} is held")]
    Held {
        /// The vertex.
        vertex: u32,
    },
    /// The given direction is no unit vector.
    #[error("the direction at the tip has the length {length}, expected 1")]
    Direction {
        /// Its length.
        length: f64,
    },
}

/// Parameters of a sheet that can tear. The elastic ones are those of its material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TearMaterial {
    /// The largest principal stress at which a tear starts (Pa), positive.
    pub strength: f64,
    /// The energy that a new unit of torn area takes, `G_c` (J/m^2), positive. The area is length times thickness.
    pub toughness: f64,
    /// Thickness (m), positive.
    pub thickness: f64,
    /// Young's modulus (Pa), positive.
    pub young: f64,
    /// Poisson's ratio, between -1 and 0.5, both excluded.
    pub poisson: f64,
    /// What drives a tip.
    pub law: TearLaw,
}

impl TearMaterial {
    /// Checks the ranges that the fields document.
    ///
    /// # Errors
    ///
    /// [`TearError::Field`] names the first field that is out of range.
    pub fn check(&self) -> Result<(), TearError> {
        let fields = [
            ("strength", self.strength),
            ("toughness", self.toughness),
            ("thickness", self.thickness),
            ("young", self.young),
        ];
        for (field, found) in fields {
            check_positive(field, found)?;
        }
        if self.poisson > -1.0 && self.poisson < 0.5 {
            return Ok(());
        }
        Err(TearError::Field {
            field: "poisson",
            found: self.poisson,
            expected: "a number between -1 and 0.5, both excluded",
        })
    }

    /// Shear modulus (Pa).
    pub fn shear(&self) -> f64 {
        0.5 * self.young / (1.0 + self.poisson)
    }

    /// First Lame parameter in plane stress (Pa).
    pub fn lambda_plane_stress(&self) -> f64 {
        self.young * self.poisson / (1.0 - self.poisson * self.poisson)
    }

    /// Irwin's length `E G_c / strength^2` (m). A notch that is much shorter does not weaken the sheet.
    pub fn irwin_length(&self) -> f64 {
        self.young * self.toughness / (self.strength * self.strength)
    }

    /// The energy density (J/m^3) below which no stress in the sheet reaches the strength: see
    /// [`cannot_start`](super::strength::cannot_start).
    pub fn safe_density(&self) -> f64 {
        0.5 * self.strength * self.strength * (1.0 - self.poisson * self.poisson) / self.young
    }
}

/// Refuses what is not a positive, finite number.
pub(super) fn check_positive(field: &'static str, found: f64) -> Result<(), TearError> {
    if found > 0.0 && found.is_finite() {
        return Ok(());
    }
    Err(TearError::Field {
        field,
        found,
        expected: "a positive, finite number",
    })
}
