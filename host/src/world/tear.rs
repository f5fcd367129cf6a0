//! The tearing of a sheet in a scene, in the form that the physics needs: the law, the material, and the tips from
//! which tears grow.

use super::material::Elements;
use super::mesh::Notched;
use super::notch::Cuts;
use crate::scene::plausible::Warning;
use crate::scene::spec::{Notch, Starts, Tear, TearLawName};
use crate::scene::{LoadedScene, SceneError};
use physics::mesh::{Mesh, TriMesh};
use physics::{HandleSpec, Material, Vec3};

/// The longest edge that shows the strength, as a multiple of Irwin's length.
const COARSE: f64 = 10.0;
/// Beyond this multiple the toughness is likely in another unit: a kJ/m^2 is a thousand J/m^2.
const OTHER_UNIT: f64 = 100.0;

/// The tearing of one body of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct TearSpec {
    /// The law of tearing.
    pub law: TearLawName,
    /// The largest principal stress that the sheet bears (Pa).
    pub strength: f64,
    /// The energy that a tear takes, per area of the cut through the thickness (J/m^2).
    pub toughness: f64,
    /// The elastic material of each triangle of the mesh. A triangle that a tear adds has the material of its parent.
    pub materials: Vec<Material>,
    /// Where tears start.
    pub starts: Starts,
    /// The vertices of the mesh at which notches end inside the sheet, ascending.
    pub tips: Vec<u32>,
    /// The largest distance of a snap, as a fraction of the edge; 0 without snapping.
    pub snapping: f64,
    /// How many vertices tears may add.
    pub room: usize,
    /// By how much the tear of a short notch starts too late at most, relative to the load; `None` without a short notch.
    pub late: Option<f64>,
}

/// The tearing of a body, `None` for a body that does not tear.
///
/// # Errors
/// [`SceneError`], naming the line and the field, if a hand holds a notch, or the material differs within the body.
pub(super) fn build(
    loaded: &LoadedScene,
    index: usize,
    notched: &Notched<'_>,
    elements: &Elements,
    handles: &[HandleSpec],
) -> Result<Option<TearSpec>, SceneError> {
    // The consistency of the scene was checked, and so was the mesh: the body is an isotropic sheet.
    let (Some(tear), Elements::Sheet(materials)) = (&loaded.scene.bodies[index].tear, elements)
    else {
        return Ok(None);
    };
    alike(loaded, index, materials)?;
    free(loaded, index, &notched.cuts, handles)?;
    let positions = notched.mesh.positions();
    let late = match &*notched.mesh {
        Mesh::Sheet(sheet) => {
            let short = short_notches(tear, sheet, &notched.cuts).into_iter();
            short.map(|short| short.late).reduce(f64::max)
        }
        _ => None,
    };
    Ok(Some(TearSpec {
        law: tear.law,
        strength: tear.strength,
        toughness: tear.toughness,
        materials: materials.clone(),
        starts: tear.starts(),
        tips: notched.cuts.tips.clone(),
        snapping: tear.snapping,
        room: tear.room(positions.len()),
        late,
    }))
}

/// Refuses triangles of different stiffness: a tear has one toughness, and its integrals are those of one material.
fn alike(loaded: &LoadedScene, index: usize, materials: &[Material]) -> Result<(), SceneError> {
    let stiffness = |m: &Material| (m.young, m.poisson, m.thickness);
    let differ = |pair: &[Material]| stiffness(&pair[0]) != stiffness(&pair[1]);
    if materials.windows(2).any(differ) {
        let field = format!("body[{index}].tear");
        let found = "the tear of a sheet of several materials";
        let allowed =
            "no such table, or `young`, `poisson` and `thickness` that are equal everywhere";
        return Err(loaded.source.error(&field, found, allowed));
    }
    Ok(())
}

/// Refuses a notch along which a handle holds vertices: the two faces of the notch could not part there.
fn free(
    loaded: &LoadedScene,
    index: usize,
    cuts: &Cuts,
    handles: &[HandleSpec],
) -> Result<(), SceneError> {
    for handle in handles {
        let held = |(vertex, _): &&(u32, usize)| handle.vertices.binary_search(vertex).is_ok();
        if let Some(&(_, number)) = cuts.along.iter().find(held) {
            let field = format!("body[{index}].tear.notch[{number}]");
            let found = format!(
                "a notch that reaches the handle about [{:.4}, {:.4}, {:.4}] m",
                handle.origin.x, handle.origin.y, handle.origin.z
            );
            let allowed = "a notch beside the handles: make the notch shorter, or the group or the box of the handle \
                           smaller";
            return Err(loaded.source.error(&field, found, allowed));
        }
    }
    Ok(())
}

/// The edge of equilateral triangles of the mean area of a sheet's triangles (m).
fn mean_edge(sheet: &TriMesh) -> f64 {
    let triangles = sheet.triangles.len() as f64;
    (sheet.area() / triangles * 4.0 / 3.0_f64.sqrt()).sqrt()
}

/// The error of the load at which a tear starts, by the length of an edge notch (edges): the measured load at the first edge
/// over the load of the handbook, less one, in a plate of 40 edges under even tractions (`palpate bench tearing --part
/// notches`). Triangles of constant strain act like a tip 0.4 edge behind its vertex. At longer notches the load is at most
/// 5 % too large.
const LATE_NOTCH: [(f64, f64); 6] = [
    (1.4, 0.33),
    (2.4, 0.14),
    (3.4, 0.10),
    (4.5, 0.08),
    (5.5, 0.07),
    (7.0, 0.06),
];
/// The error at a slit. The three rings about a tip reach to the other tip of a slit of four edges.
const LATE_SLIT: [(f64, f64); 5] = [
    (2.4, 0.54),
    (3.4, 0.34),
    (5.0, 0.26),
    (7.0, 0.10),
    (10.0, 0.07),
];
/// A short notch with this error or more gives a warning. `plan` tells a smaller error.
const WARNED: f64 = 0.08;

/// A notch that is too short for its mesh.
struct Short {
    /// The number of the notch in the scene.
    number: usize,
    /// `notch` or `slit`.
    name: &'static str,
    /// The length in edges, and the least length without an error above 5 %.
    edges: f64,
    least: f64,
    /// By how much its tear starts too late.
    late: f64,
}

/// The notches that are too short for the mesh of a sheet. The slits of a perforation are not judged: a tear goes from one to
/// the next.
fn short_notches(tear: &Tear, sheet: &TriMesh, cuts: &Cuts) -> Vec<Short> {
    let edge = mean_edge(sheet);
    let short = |(number, notch): (usize, &Notch)| {
        let [from, to] = notch.cuts().next()?.map(Vec3::from);
        let edges = (to - from).norm() / edge;
        let (name, all) = if cuts.tips_of(number) > 1 {
            ("slit", &LATE_SLIT[..])
        } else {
            ("notch", &LATE_NOTCH[..])
        };
        let late = all.iter().find(|(most, _)| edges < *most);
        let &(_, late) = late.filter(|_| notch.count == 1 && tear.law == TearLawName::Toughness)?;
        let &(least, _) = all.last()?;
        Some(Short {
            number,
            name,
            edges,
            least,
            late,
        })
    };
    let all = tear.notches.iter().enumerate();
    all.filter_map(short).collect()
}

/// Warnings about notches of the body number `index` that are much too short for their mesh.
pub(super) fn short(loaded: &LoadedScene, index: usize, mesh: &Mesh, cuts: &Cuts) -> Vec<Warning> {
    let body = &loaded.scene.bodies[index];
    let (Some(tear), Mesh::Sheet(sheet)) = (&body.tear, mesh) else {
        return Vec::new();
    };
    let warning = |short: Short| Warning {
        location: loaded
            .source
            .location(&format!("body[{index}].tear.notch[{}]", short.number)),
        found: format!("a {} of {:.1} edges", short.name, short.edges),
        usual: format!("{} edges or more", short.least),
        advice: format!(
            "its tear starts at a load that is up to {:.0} % too large where the sheet is pulled evenly: make the mesh finer",
            100.0 * short.late
        ),
    };
    let all = short_notches(tear, sheet, cuts).into_iter();
    all.filter(|short| short.late >= WARNED)
        .map(warning)
        .collect()
}

/// A warning about a mesh that is too coarse to show the strength of its material.
///
/// A mesh bears the stress `sqrt(E G / h)` about a tip that releases `G`, with edges of the length `h`. Edges that are
/// much longer than Irwin's length `E G_c / strength^2` therefore release more than the toughness before their stress
/// reaches the strength, and a tear starts too late.
pub(super) fn coarse(loaded: &LoadedScene, index: usize, mesh: &Mesh) -> Option<Warning> {
    let body = &loaded.scene.bodies[index];
    let (Some(tear), Mesh::Sheet(sheet)) = (&body.tear, mesh) else {
        return None;
    };
    let irwin = body.material.young * tear.toughness / (tear.strength * tear.strength);
    let edge = mean_edge(sheet);
    let other_unit = tear.law == TearLawName::Toughness && edge > OTHER_UNIT * irwin;
    let late = tear.starts() == Starts::Anywhere && edge > COARSE * irwin;
    let (field, advice) = if other_unit {
        (
            "toughness",
            "is the value in kJ/m^2? toughness is in J/m^2: 1 kJ/m^2 is 1000; otherwise make the mesh finer, or the \
             strength smaller",
        )
    } else if late {
        (
            "strength",
            "tears start later than the material's: make the mesh finer, or the strength smaller",
        )
    } else {
        return None;
    };
    Some(Warning {
        location: loaded
            .source
            .location(&format!("body[{index}].tear.{field}")),
        found: format!("edges of {edge:.2e} m for an Irwin length of {irwin:.2e} m"),
        usual: format!("edges up to {COARSE} times young * toughness / strength^2"),
        advice: advice.to_owned(),
    })
}
