//! `[[body]]`: a deformable body: its mesh, its material, its handles, its supports and its loads.

use crate::check;
use serde::Deserialize;

use super::mesh::Mesh;
use super::{Rotation, Tear};

/// `[[body]]`: a deformable thread, sheet or solid.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Name, unique among bodies.
    pub name: String,
    /// The mesh of the body.
    #[serde(deserialize_with = "check::table")]
    pub mesh: Mesh,
    /// Where the origin of the mesh lies in the world (m).
    #[serde(default, deserialize_with = "check::finite3")]
    pub position: [f64; 3],
    /// How the mesh is turned about its origin, before it is moved to `position`. Default: not at all.
    #[serde(default, deserialize_with = "check::optional_table")]
    pub rotation: Option<Rotation>,
    /// The material of the body.
    #[serde(deserialize_with = "check::table")]
    pub material: Material,
    /// Parts of another material. If regions overlap, the last one applies.
    #[serde(default, rename = "region", deserialize_with = "check::tables")]
    pub regions: Vec<Region>,
    /// Rayleigh damping.
    #[serde(default, deserialize_with = "check::table")]
    pub damping: Rayleigh,
    /// Bending stiffness of a sheet, as a multiple of the stiffness of a thin plate, or of the rigidities of its weave;
    /// zero switches bending off. Default: 1. Solids and threads have no bending model.
    #[serde(default, deserialize_with = "check::optional_not_negative")]
    pub bending: Option<f64>,
    /// The handles, by which hands hold the body. A run needs at least one.
    #[serde(default, rename = "handle", deserialize_with = "check::tables")]
    pub handles: Vec<Handle>,
    /// The supports, which hold or guide vertices without a hand.
    #[serde(default, rename = "support", deserialize_with = "check::tables")]
    pub supports: Vec<Support>,
    /// Forces on the body in addition to its weight.
    #[serde(default, rename = "load", deserialize_with = "check::tables")]
    pub loads: Vec<Load>,
    /// The thickness of the body in contact (m): its surface lies half of it outside the mesh. Default: that of a sheet,
    /// the diameter of a thread, a thousandth of the side of a cube of a solid's volume.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub contact_thickness: Option<f64>,
    /// Whether the body may touch itself.
    #[serde(default)]
    pub self_contact: bool,
    /// The tearing of a sheet. Default: the body does not tear.
    #[serde(default, deserialize_with = "check::optional_table")]
    pub tear: Option<Tear>,
}

/// `[body.material]`: an elastic material. Sheets are in plane stress.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// The relation between deformation and stress. Default: St. Venant-Kirchhoff for woven sheets, otherwise
    /// corotational.
    #[serde(default, deserialize_with = "check::optional_word")]
    pub law: Option<LawName>,
    /// Young's modulus (Pa); of a woven sheet, along the warp.
    #[serde(deserialize_with = "check::positive")]
    pub young: f64,
    /// Poisson's ratio; contraction along the weft for a pull along the warp, if woven. Sheets and solids need it; a
    /// thread makes no use of it.
    #[serde(default, deserialize_with = "check::optional_poisson")]
    pub poisson: Option<f64>,
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
    /// The weave of a woven sheet: threads in two perpendicular directions.
    #[serde(default, deserialize_with = "check::optional_table")]
    pub weave: Option<WeaveFields>,
    /// Values of the mesh file, one per element, that replace the values above.
    #[serde(default, deserialize_with = "check::table")]
    pub fields: ElementFields,
}

/// Names of the material laws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LawName {
    /// Small strains and rotations; solids only.
    Linear,
    /// Small strains, arbitrary rotations.
    Corotational,
    /// Linear in the Green strain; solids and woven sheets.
    StVenantKirchhoff,
    /// Large strains; recovers from any inversion; solids only.
    StableNeoHookean,
}

/// `[body.material.weave]`: the parameters of a woven sheet that an isotropic sheet does not have.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeaveFields {
    /// Direction of the warp threads, in the axes of the mesh: it turns with the body. An element uses the projection of
    /// this direction onto its plane.
    #[serde(default = "along_x", deserialize_with = "check::finite3")]
    pub warp: [f64; 3],
    /// Young's modulus along the weft (Pa).
    #[serde(deserialize_with = "check::positive")]
    pub young_weft: f64,
    /// Shear modulus between warp and weft (Pa).
    #[serde(deserialize_with = "check::positive")]
    pub shear: f64,
    /// Rigidity against bending of the warp threads: moment per width over curvature (N m). Default: 0, none.
    #[serde(default, deserialize_with = "check::not_negative")]
    pub bending_warp: f64,
    /// Rigidity against bending of the weft threads (N m). Default: 0, none.
    #[serde(default, deserialize_with = "check::not_negative")]
    pub bending_weft: f64,
    /// Rigidity against twist: twisting moment per width over twice the twist (N m). Default: 0, none.
    #[serde(default, deserialize_with = "check::not_negative")]
    pub bending_twist: f64,
}

fn along_x() -> [f64; 3] {
    [1.0, 0.0, 0.0]
}

/// `[body.material.fields]`: names of fields of the mesh that hold a value for each element.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ElementFields {
    /// The field of Young's modulus (Pa).
    pub young: Option<String>,
    /// The field of Poisson's ratio.
    pub poisson: Option<String>,
    /// The field of the density (kg/m^3).
    pub density: Option<String>,
    /// The field of the thickness (m).
    pub thickness: Option<String>,
    /// Holds the cross-section (m^2).
    pub area: Option<String>,
}

/// `[[body.region]]`: elements of another material.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// The elements of the region, as a group of the mesh.
    #[serde(default)]
    pub group: Option<String>,
    /// Instead of a group: lowest and highest corner of a box (m), for the elements with their barycentre inside.
    #[serde(default, rename = "box", deserialize_with = "check::optional_box")]
    pub in_box: Option<[[f64; 3]; 2]>,
    /// Young's modulus in the region (Pa), if it differs from the body's.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub young: Option<f64>,
    /// Poisson's ratio in the region, if it differs from the body's.
    #[serde(default, deserialize_with = "check::optional_poisson")]
    pub poisson: Option<f64>,
    /// Density in the region (kg/m^3), if it differs from the body's.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub density: Option<f64>,
    /// Thickness in the region (m), if it differs from the body's; sheets only.
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

/// `[[body.handle]]`: vertices that move rigidly with a device. `palpate solve` holds them at rest.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Handle {
    /// Name, for summaries.
    pub name: String,
    /// The vertices of the handle, as a group of the mesh.
    #[serde(default)]
    pub group: Option<String>,
    /// Instead of a group: lowest and highest corner of a box (m), for the vertices inside.
    #[serde(default, rename = "box", deserialize_with = "check::optional_box")]
    pub in_box: Option<[[f64; 3]; 2]>,
    /// Name of the device that holds the handle.
    pub device: String,
    /// Whether a sheet turns freely about the edges of its border that the handle holds.
    #[serde(default, deserialize_with = "check::word")]
    pub border: BorderName,
}

/// The effect of a handle or a support on the border of a sheet that bends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BorderName {
    /// The sheet turns freely about the edge.
    #[default]
    Hinged,
    /// The sheet keeps its direction at the edge.
    Clamped,
}

impl From<BorderName> for physics::Border {
    fn from(name: BorderName) -> Self {
        match name {
            BorderName::Hinged => Self::Hinged,
            BorderName::Clamped => Self::Clamped,
        }
    }
}

/// `[[body.support]]`: vertices that are held, guided or moved. Vertices that a handle or a turned support holds
/// belong to that handle or turned support.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Support {
    /// Name, unique among the supports of the body.
    pub name: String,
    /// The vertices of the support, as a group of the mesh.
    #[serde(default)]
    pub group: Option<String>,
    /// Instead of a group: lowest and highest corner of a box (m), for the vertices inside.
    #[serde(default, rename = "box", deserialize_with = "check::optional_box")]
    pub in_box: Option<[[f64; 3]; 2]>,
    /// The axes of the world along which the support holds its vertices. They slide freely along the other axes.
    #[serde(default = "every_axis", deserialize_with = "check::axes")]
    pub axes: [bool; 3],
    /// Whether a sheet turns freely about the edges of its border that the support holds.
    #[serde(default, deserialize_with = "check::word")]
    pub border: BorderName,
    /// `palpate solve`: displacement of the support (m).
    #[serde(default, deserialize_with = "check::finite3")]
    pub displacement: [f64; 3],
    /// `palpate solve`: rotation of the support about the centre of its vertices, as a rotation vector (rad).
    #[serde(default, deserialize_with = "check::optional_finite3")]
    pub rotation: Option<[f64; 3]>,
}

fn every_axis() -> [bool; 3] {
    [true; 3]
}

/// `[[body.load]]`: a force of constant direction.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Name, unique among the body's loads.
    pub name: String,
    /// The vertices that bear the load, as a group of the mesh.
    #[serde(default)]
    pub group: Option<String>,
    /// Instead of a group: lowest and highest corner of a box (m), for the vertices inside.
    #[serde(default, rename = "box", deserialize_with = "check::optional_box")]
    pub in_box: Option<[[f64; 3]; 2]>,
    /// Total force (N). It is spread over the area of the faces there; without faces, over the length of the
    /// boundary there; without either, over the vertices.
    #[serde(default, deserialize_with = "check::optional_finite3")]
    pub force: Option<[f64; 3]>,
    /// Instead of a force: force per area of the body at rest (Pa).
    #[serde(default, deserialize_with = "check::optional_finite3")]
    pub traction: Option<[f64; 3]>,
}
