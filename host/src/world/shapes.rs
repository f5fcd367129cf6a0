//! Needles: elements so thin that the forces of a body err.
//!
//! The limits and the errors are measured on sheets and bars of known stiffness, see the section of the book on mesh
//! files and `host/tests/solve/needles.rs`. Few needles do no harm to solids, nor to sheets that do not bend. A sheet that
//! bends has a limit on the stiffness of each triangle, which a single row of thin needles reaches.

use super::kind::{Kind, bending};
use crate::scene::LoadedScene;
use crate::scene::plausible::Warning;
use physics::mesh::quality::{Shape, shapes};
use physics::mesh::{Cells, Mesh};
use std::fmt;

/// The quality below which an element is a needle. Meshes in which no element is below have errors of bending of at most
/// 4 %, by measurement.
pub const NEEDLE: f64 = 0.05;

/// The quality below which a single row of triangles may spoil the bending of a sheet: that of a right triangle with an
/// aspect ratio of 100, from which on the stiffness of bending is limited.
const LIMITED: f64 = 0.02;

/// The share of the area or the volume above which needles spoil the forces of any body.
const SHARE: f64 = 0.01;

/// The needles of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Needles {
    /// The shapes of all elements.
    pub shapes: Vec<Shape>,
    /// The numbers of the needles, worst first.
    pub worst: Vec<usize>,
    /// The part of the area or the volume that the needles take, from 0 to 1.
    pub share: f64,
    /// The directions in which the forces of the body err, and the size of the error, in words.
    pub harm: Option<String>,
    /// The name of one element.
    element: &'static str,
    /// The name of the size of an element.
    size: &'static str,
}

impl Needles {
    /// The needles of `mesh`; `bends`: whether it is that of a sheet that resists bending.
    pub fn of(mesh: &Mesh, bends: bool) -> Self {
        let shapes = shapes(mesh);
        let mut worst: Vec<_> = (0..shapes.len())
            .filter(|&number| shapes[number].quality < NEEDLE)
            .collect();
        worst.sort_by(|&a, &b| shapes[a].quality.total_cmp(&shapes[b].quality));
        let size: f64 = shapes.iter().map(|shape| shape.size).sum();
        let thin: f64 = worst.iter().map(|&number| shapes[number].size).sum();
        // The sum of no numbers is -0.
        let share = if thin > 0.0 { thin / size } else { 0.0 };
        let (many, limited) = (
            share > SHARE,
            bends
                && worst
                    .first()
                    .is_some_and(|&number| shapes[number].quality < LIMITED),
        );
        let harm = match mesh {
            Mesh::Solid(mesh) if many => Some(match mesh.cells {
                Cells::Linear(_) => "forces may be 16 times too large where the solid bends",
                Cells::Quadratic(_) => "forces may be 25 % too large where the solid bends",
            }),
            Mesh::Sheet(_) if bends && (many || limited) => Some(
                "forces may err by -95 to +100 % where the sheet bends, and be 12 times too large where it bends in its plane",
            ),
            Mesh::Sheet(_) if many => {
                Some("forces may be 12 times too large where the sheet bends in its plane")
            }
            _ => None,
        };
        let (element, size) = match mesh {
            Mesh::Solid(_) => ("tetrahedron", "volume"),
            _ => ("triangle", "area"),
        };
        Self {
            shapes,
            worst,
            share,
            harm: harm.map(str::to_owned),
            element,
            size,
        }
    }

    /// An element in words: its number, its place and its quality.
    pub fn described(&self, number: usize) -> String {
        let Shape {
            quality, centre, ..
        } = self.shapes[number];
        let [x, y, z]: [f64; 3] = centre.map(round).into();
        format!(
            "{} {number} at [{x}, {y}, {z}] with {}",
            self.element,
            round(quality)
        )
    }
}

impl fmt::Display for Needles {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let elements = match self.element {
            "tetrahedron" => "tetrahedra",
            _ => "triangles",
        };
        write!(
            to,
            "{} of {} {elements} with a quality below {NEEDLE}, over {} % of the {}",
            self.worst.len(),
            self.shapes.len(),
            round(100.0 * self.share),
            self.size
        )
    }
}

/// A number with three digits.
pub fn round(value: f64) -> f64 {
    // Text is the exact way to a number of few digits.
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// The warning about a body whose needles spoil its forces.
pub(super) fn needles(loaded: &LoadedScene, index: usize, mesh: &Mesh) -> Option<Warning> {
    let body = &loaded.scene.bodies[index];
    let kind = Kind::of(body, mesh);
    let bends = matches!(kind, Kind::Sheet | Kind::Woven) && bending(body, kind) > 0.0;
    let needles = Needles::of(mesh, bends);
    let harm = needles.harm.as_ref()?;
    let worst = needles.described(*needles.worst.first()?);
    Some(Warning {
        location: loaded.source.location(&format!("body[{index}].mesh")),
        found: format!("{needles}, the worst {worst}"),
        usual: if needles.share > SHARE {
            format!("{NEEDLE} or above")
        } else {
            format!("{LIMITED} or above")
        },
        advice: format!(
            "{harm}: mesh the shape anew with sides of similar lengths; `palpate mesh check` names the worst places"
        ),
    })
}
