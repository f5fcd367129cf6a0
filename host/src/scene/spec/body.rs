//! `[[body]]`: what is deformed, what it is made of, and what holds and pulls it.

use crate::scene::check;
use serde::Deserialize;

use super::mesh::Mesh;

/// `[[body]]`: a deformable thread, sheet or solid.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Name, unique among bodies.
    pub name: String,
    /// Where its elements come from.
    #[serde(deserialize_with = "check::table")]
    pub mesh: Mesh,
    /// What it is made of.
    #[serde(deserialize_with = "check::table")]
    pub material: Material,
    /// Parts made of something else; later ones win.
    #[serde(default, rename = "region", deserialize_with = "check::tables")]
    pub regions: Vec<Region>,
    /// Rayleigh damping.
    #[serde(default, deserialize_with = "check::table")]
    pub damping: Rayleigh,
    /// Bending stiffness of a sheet, as a multiple of the thin plate's; zero switches bending off. Not
    /// given: 1 for isotropic sheets, none for woven ones and solids, which have no such model.
    #[serde(default, deserialize_with = "check::optional_not_negative")]
    pub bending: Option<f64>,
    /// Where hands hold it; a run needs at least one.
    #[serde(default, rename = "handle", deserialize_with = "check::tables")]
    pub handles: Vec<Handle>,
    /// Where it is held or guided by nobody's hand.
    #[serde(default, rename = "support", deserialize_with = "check::tables")]
    pub supports: Vec<Support>,
    /// Forces on it beside its weight.
    #[serde(default, rename = "load", deserialize_with = "check::tables")]
    pub loads: Vec<Load>,
}

/// `[body.material]`: an elastic material. Sheets are in plane stress.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// How stress follows from strain. Not given: corotational, or St. Venant-Kirchhoff if woven.
    #[serde(default, deserialize_with = "check::optional_word")]
    pub law: Option<LawName>,
    /// Young's modulus (Pa); along the warp, if woven.
    #[serde(deserialize_with = "check::positive")]
    pub young: f64,
    /// Poisson's ratio, of which a thread makes no use; contraction along the weft for a pull along the warp, if woven.
    #[serde(deserialize_with = "check::poisson")]
    pub poisson: f64,
    /// Thickness (m): sheets have one, threads and solids do not.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub thickness: Option<f64>,
    /// Cross-section (m^2): threads have one, sheets and solids do not.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub area: Option<f64>,
    /// Whether a thread resists tension alone. Not given: it does.
    #[serde(default)]
    pub tension_only: Option<bool>,
    /// Density (kg/m^3).
    #[serde(deserialize_with = "check::positive")]
    pub density: f64,
    /// Threads in two directions at right angles.
    #[serde(default, deserialize_with = "check::optional_table")]
    pub weave: Option<WeaveFields>,
    /// Values of the mesh file, one per element, that stand in for those above.
    #[serde(default, deserialize_with = "check::table")]
    pub fields: ElementFields,
}

/// Names of the laws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LawName {
    /// Small strains and rotations; solids only.
    Linear,
    /// Small strains, any rotation.
    Corotational,
    /// Linear in the Green strain; solids and woven sheets.
    StVenantKirchhoff,
    /// Large strains, recovers from any inversion; solids only.
    StableNeoHookean,
}

/// `[body.material.weave]`: what a woven sheet has beside an isotropic one.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeaveFields {
    /// Direction of the warp threads; what of it lies in an element's plane counts.
    #[serde(default = "along_x", deserialize_with = "check::finite3")]
    pub warp: [f64; 3],
    /// Young's modulus along the weft (Pa).
    #[serde(deserialize_with = "check::positive")]
    pub young_weft: f64,
    /// Shear modulus between warp and weft (Pa).
    #[serde(deserialize_with = "check::positive")]
    pub shear: f64,
}

fn along_x() -> [f64; 3] {
    [1.0, 0.0, 0.0]
}

/// `[body.material.fields]`: names of the mesh's values.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ElementFields {
    /// Holds Young's modulus (Pa).
    pub young: Option<String>,
    /// Holds Poisson's ratio.
    pub poisson: Option<String>,
    /// Holds the density (kg/m^3).
    pub density: Option<String>,
    /// Holds the thickness (m).
    pub thickness: Option<String>,
    /// Holds the cross-section (m^2).
    pub area: Option<String>,
}

/// `[[body.region]]`: elements of another material.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Which elements: a group of the mesh, or those whose barycentre lies in the box.
    #[serde(default)]
    pub group: Option<String>,
    /// Instead of a group: lowest and highest corner of a box (m).
    #[serde(default, rename = "box", deserialize_with = "check::optional_box")]
    pub in_box: Option<[[f64; 3]; 2]>,
    /// Young's modulus there (Pa), if another.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub young: Option<f64>,
    /// Poisson's ratio there, if another.
    #[serde(default, deserialize_with = "check::optional_poisson")]
    pub poisson: Option<f64>,
    /// Density there (kg/m^3), if another.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub density: Option<f64>,
    /// Thickness there (m), if another; sheets only.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub thickness: Option<f64>,
    /// Cross-section there (m^2), if another; threads only.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub area: Option<f64>,
}

/// Rayleigh damping `C = mass M + stiffness K`.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rayleigh {
    /// Mass coefficient (1/s).
    #[serde(deserialize_with = "check::not_negative")]
    pub mass: f64,
    /// Stiffness coefficient (s).
    #[serde(deserialize_with = "check::not_negative")]
    pub stiffness: f64,
}

/// `[[body.handle]]`: vertices that move with a device. `palpate solve` holds them where they rest.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Handle {
    /// Name, for summaries.
    pub name: String,
    /// Which vertices: a group of the mesh, or all inside the box.
    #[serde(default)]
    pub group: Option<String>,
    /// Instead of a group: lowest and highest corner of a box (m).
    #[serde(default, rename = "box", deserialize_with = "check::optional_box")]
    pub in_box: Option<[[f64; 3]; 2]>,
    /// Name of the device that holds it.
    pub device: String,
}

/// `[[body.support]]`: vertices that are held, guided or moved. What a handle or a turned support holds is
/// left to that.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Support {
    /// Name, unique among the body's handles and supports.
    pub name: String,
    /// Which vertices: a group of the mesh, or all inside the box.
    #[serde(default)]
    pub group: Option<String>,
    /// Instead of a group: lowest and highest corner of a box (m).
    #[serde(default, rename = "box", deserialize_with = "check::optional_box")]
    pub in_box: Option<[[f64; 3]; 2]>,
    /// Along which of the world's axes; along the others it slides freely.
    #[serde(default = "every_axis", deserialize_with = "check::axes")]
    pub axes: [bool; 3],
    /// `palpate solve`: how far it is moved (m).
    #[serde(default, deserialize_with = "check::finite3")]
    pub displacement: [f64; 3],
    /// `palpate solve`: how it is turned about the centre of its vertices, a rotation vector (rad).
    #[serde(default, deserialize_with = "check::optional_finite3")]
    pub rotation: Option<[f64; 3]>,
}

fn every_axis() -> [bool; 3] {
    [true; 3]
}

/// `[[body.load]]`: a force that keeps its direction.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Name, unique among the body's loads.
    pub name: String,
    /// Where: a group of the mesh, or all vertices inside the box.
    #[serde(default)]
    pub group: Option<String>,
    /// Instead of a group: lowest and highest corner of a box (m).
    #[serde(default, rename = "box", deserialize_with = "check::optional_box")]
    pub in_box: Option<[[f64; 3]; 2]>,
    /// Altogether (N), spread over the area there, else over the boundary's length, else over the vertices.
    #[serde(default, deserialize_with = "check::optional_finite3")]
    pub force: Option<[f64; 3]>,
    /// Instead of a force: per area at rest (Pa).
    #[serde(default, deserialize_with = "check::optional_finite3")]
    pub traction: Option<[f64; 3]>,
}
