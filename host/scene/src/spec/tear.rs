//! `[body.tear]`: what tears a sheet, and the notches from which tears grow.

use crate::check;
use serde::{Deserialize, Serialize};

/// Distance of a snap, as a fraction of the edge, if the scene gives none.
const SNAPPING: f64 = 0.3;

/// `[body.tear]`: the tearing of an isotropic sheet. A body without this table does not tear.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tear {
    /// The law of tearing.
    #[serde(default, deserialize_with = "check::word")]
    pub law: TearLawName,
    /// The largest principal stress that the sheet bears (Pa). A larger stress starts a tear; under `thesis` it also
    /// drives the tear.
    #[serde(deserialize_with = "check::positive")]
    pub strength: f64,
    /// The energy that a tear takes, per area of the cut through the thickness (J/m^2). The law `thesis` makes no use of
    /// it.
    #[serde(deserialize_with = "check::positive")]
    pub toughness: f64,
    /// Where tears start. Default: at the tips of notches if there are notches, otherwise anywhere.
    #[serde(default, deserialize_with = "check::optional_word")]
    pub starts: Option<Starts>,
    /// The largest distance by which a vertex moves at rest onto the path of a tear, as a fraction of the edge between
    /// the vertex and the path's crossing; 0 switches snapping off.
    #[serde(default = "snapping", deserialize_with = "check::snapping")]
    pub snapping: f64,
    /// How many vertices tears may add. Default: see [`Tear::room`].
    #[serde(default, deserialize_with = "check::optional_room")]
    pub room: Option<usize>,
    /// Straight cuts that the sheet has at the start.
    #[serde(default, rename = "notch", deserialize_with = "check::tables")]
    pub notches: Vec<Notch>,
}

fn snapping() -> f64 {
    SNAPPING
}

impl Tear {
    /// Where tears start, with the default for a scene that does not say so.
    pub fn starts(&self) -> Starts {
        self.starts.unwrap_or(if self.notches.is_empty() {
            Starts::Anywhere
        } else {
            Starts::Tips
        })
    }

    /// How many vertices tears may add to a sheet of `vertices` vertices.
    ///
    /// A square sheet has about `sqrt(vertices)` edges across it, and an edge of a tear adds three vertices at most: the
    /// default has room for two tears from border to border, and 64 vertices more.
    pub fn room(&self, vertices: usize) -> usize {
        self.room.unwrap_or(64 + 6 * vertices.isqrt())
    }
}

/// `body.tear.law`: the law of tearing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TearLawName {
    /// A tear grows if it releases `toughness` of energy per area, in the direction of the largest hoop stress.
    #[default]
    Toughness,
    /// A tear grows where the principal stress at a vertex exceeds `strength` (thesis, chapter 4).
    Thesis,
}

/// `body.tear.starts`: where tears start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Starts {
    /// Only at the tips of notches.
    Tips,
    /// Also wherever the stress exceeds the strength.
    Anywhere,
}

/// `[[body.tear.notch]]`: a straight cut through a plane sheet, or a row of equal cuts.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Notch {
    /// One end (m), in the axes of the mesh after `mesh.scale`: on the border or inside the sheet.
    #[serde(deserialize_with = "check::finite3")]
    pub from: [f64; 3],
    /// The other end (m), inside the sheet.
    #[serde(deserialize_with = "check::finite3")]
    pub to: [f64; 3],
    /// How many equal cuts there are: a perforation has many.
    #[serde(default = "one", deserialize_with = "check::cuts")]
    pub count: usize,
    /// The step from each cut of the row to the next one (m).
    #[serde(default, deserialize_with = "check::optional_finite3")]
    pub step: Option<[f64; 3]>,
}

fn one() -> usize {
    1
}

impl Notch {
    /// The ends of each cut of the row (m).
    pub fn cuts(&self) -> impl Iterator<Item = [[f64; 3]; 2]> + '_ {
        let step = self.step.unwrap_or_default();
        (0..self.count).map(move |number| {
            let shift = step.map(|x| x * number as f64);
            [self.from, self.to].map(|end| [0, 1, 2].map(|axis| end[axis] + shift[axis]))
        })
    }
}
