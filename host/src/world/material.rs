//! The material of every element, from the base values of the scene, the fields of the mesh and the regions of the
//! scene.

use super::kind::{Kind, bending, bends};
use super::{mesh, selection};
use crate::scene::plausible::{self, Warning};
use crate::scene::spec::MeshSource;
use crate::scene::spec::body::{LawName, WeaveFields};
use crate::scene::{LoadedScene, SceneError};
use physics::mesh::{Cells, Field, Mesh};
use physics::{Material, Rigidity, SolidMaterial, ThreadMaterial, Vec3, Weave};

/// The materials of a body, by element.
pub(super) struct Materials {
    pub(super) law: LawName,
    pub(super) bending: f64,
    pub(super) elements: Elements,
    pub(super) young: Vec<f64>,
    /// Empty if the scene gives a thread none.
    pub(super) poisson: Vec<f64>,
}

/// One material for each element.
pub(super) enum Elements {
    Sheet(Vec<Material>),
    Woven(Vec<Weave>),
    Solid(Vec<SolidMaterial>),
    Thread(Vec<ThreadMaterial>),
}

/// The values of each element, one vector each.
struct Values {
    young: Vec<f64>,
    /// Empty if the scene gives a thread none.
    poisson: Vec<f64>,
    density: Vec<f64>,
    thickness: Vec<f64>,
    area: Vec<f64>,
}

pub(super) fn build(
    loaded: &LoadedScene,
    index: usize,
    mesh: &Mesh,
) -> Result<Materials, SceneError> {
    let body = &loaded.scene.bodies[index];
    let kind = Kind::of(body, mesh);
    check(loaded, index, kind)?;
    let mut values = from_mesh(loaded, index, mesh)?;
    overwrite(loaded, index, mesh, &mut values)?;
    let Values {
        young,
        poisson,
        density,
        thickness,
        area,
    } = values;
    let each = 0..young.len();
    let warp = |weave: WeaveFields| mesh::turned(body, mesh, Vec3::from(weave.warp));
    let elements = match (kind, body.material.weave) {
        (Kind::Thread, _) => Elements::Thread(
            each.map(|e| ThreadMaterial {
                young: young[e],
                area: area[e],
                density: density[e],
                tension_only: body.material.tension_only.unwrap_or(true),
            })
            .collect(),
        ),
        (Kind::Solid, _) => Elements::Solid(
            each.map(|e| SolidMaterial {
                young: young[e],
                poisson: poisson[e],
                density: density[e],
            })
            .collect(),
        ),
        (_, Some(weave)) => Elements::Woven(
            each.map(|e| Weave {
                warp: warp(weave),
                young_warp: young[e],
                // A region or a field scales all moduli alike: the ratios of the weave stay.
                young_weft: weave.young_weft * (young[e] / body.material.young),
                poisson: poisson[e],
                shear: weave.shear * (young[e] / body.material.young),
                thickness: thickness[e],
                density: density[e],
                rigidity: Rigidity {
                    warp: weave.bending_warp,
                    weft: weave.bending_weft,
                    twist: weave.bending_twist,
                },
            })
            .collect(),
        ),
        (_, None) => Elements::Sheet(
            each.map(|e| Material {
                young: young[e],
                poisson: poisson[e],
                thickness: thickness[e],
                density: density[e],
            })
            .collect(),
        ),
    };
    Ok(Materials {
        law: body.material.law.unwrap_or(match kind {
            Kind::Woven => LawName::StVenantKirchhoff,
            Kind::Sheet | Kind::Solid | Kind::Thread => LawName::Corotational,
        }),
        bending: bending(body, kind),
        elements,
        young,
        poisson,
    })
}

/// The allowed value of a field that a body of this kind does not have.
fn none(kind: Kind) -> &'static str {
    match kind {
        Kind::Sheet | Kind::Woven => "no such field, because the mesh is a sheet",
        Kind::Solid => "no such field, because the mesh is a solid",
        Kind::Thread => "no such field, because the mesh is a thread",
    }
}

/// Refuses a thickness or a cross-section that `field` gives a body whose kind has none.
fn check_kind(
    loaded: &LoadedScene,
    field: &str,
    kind: Kind,
    (thickness, area): (bool, bool),
) -> Result<(), SceneError> {
    let is_sheet = matches!(kind, Kind::Sheet | Kind::Woven);
    let (name, found) = if thickness && !is_sheet {
        ("thickness", "a thickness")
    } else if area && kind != Kind::Thread {
        ("area", "a cross-section")
    } else {
        return Ok(());
    };
    Err(loaded
        .source
        .error(&format!("{field}.{name}"), found, none(kind)))
}

/// Checks that the scene gives exactly the values that a body of this kind has.
fn check(loaded: &LoadedScene, index: usize, kind: Kind) -> Result<(), SceneError> {
    let body = &loaded.scene.bodies[index];
    let material = &body.material;
    let refuse = |field: &str, found: &str, allowed: &str| {
        let field = format!("body[{index}].{field}");
        Err(loaded.source.error(&field, found, allowed))
    };
    if kind != Kind::Thread && material.poisson.is_none() {
        let field = format!("body[{index}].material");
        return Err(loaded.source.missing(&field, "poisson"));
    }
    match (kind, material.thickness) {
        (Kind::Sheet | Kind::Woven, None) => {
            // The mesh of a solid that was exported without its inside.
            let MeshSource::File(file) = &body.mesh.source else {
                return refuse("material", "no thickness", "`thickness`: sheets have one");
            };
            let found = format!("no tetrahedra in {file}, and no thickness");
            let allowed = "`thickness`: a mesh of triangles is a sheet; a solid needs a file with tetrahedra (Gmsh writes \
                           them by `-3`, and with physical groups only those in a physical volume)";
            return refuse("material", &found, allowed);
        }
        (Kind::Solid | Kind::Thread, Some(_)) => {
            return refuse("material.thickness", "a thickness", none(kind));
        }
        _ => {}
    }
    match (kind, material.area) {
        (Kind::Thread, None) => {
            return refuse(
                "material",
                "no area",
                "`area`: threads have a cross-section",
            );
        }
        (Kind::Sheet | Kind::Woven | Kind::Solid, Some(_)) => {
            return refuse("material.area", "a cross-section", none(kind));
        }
        _ => {}
    }
    if kind != Kind::Thread && material.tension_only.is_some() {
        return refuse("material.tension_only", "a thread's property", none(kind));
    }
    if matches!(kind, Kind::Solid | Kind::Thread) && material.weave.is_some() {
        return refuse("material.weave", "a weave", none(kind));
    }
    let laws: &[LawName] = match kind {
        Kind::Solid => &[
            LawName::Linear,
            LawName::Corotational,
            LawName::StVenantKirchhoff,
            LawName::StableNeoHookean,
        ],
        Kind::Woven => &[LawName::StVenantKirchhoff, LawName::Corotational],
        Kind::Sheet | Kind::Thread => &[LawName::Corotational],
    };
    if material.law.is_some_and(|law| !laws.contains(&law)) {
        let (found, allowed) = match kind {
            Kind::Woven => (
                "a law of solids",
                "\"st_venant_kirchhoff\" or \"corotational\" for a woven sheet",
            ),
            Kind::Thread => (
                "a law of solids or woven sheets",
                "\"corotational\" for a thread",
            ),
            _ => (
                "a law of solids or woven sheets",
                "\"corotational\" for an isotropic sheet",
            ),
        };
        return refuse("material.law", found, allowed);
    }
    match (kind, body.bending) {
        (Kind::Solid | Kind::Thread, Some(factor)) if factor > 0.0 => refuse(
            "bending",
            &format!("{factor:?}"),
            "0: only sheets have a bending model",
        ),
        (Kind::Woven, Some(factor)) if factor > 0.0 && !material.weave.is_some_and(bends) => {
            refuse(
                "bending",
                &format!("{factor:?}"),
                "0 without `bending_warp`, `bending_weft` or `bending_twist` in the weave",
            )
        }
        _ => Ok(()),
    }
}

/// The values of each element: those of the mesh's fields if the scene names fields, otherwise the base values.
fn from_mesh(loaded: &LoadedScene, index: usize, mesh: &Mesh) -> Result<Values, SceneError> {
    let material = &loaded.scene.bodies[index].material;
    let fields = mesh.fields();
    let count = mesh.element_count();
    let take = |quantity: &str, name: &Option<String>, base: f64| match name {
        None => Ok(vec![base; count]),
        Some(name) => values(loaded, index, quantity, name, fields),
    };
    let names = &material.fields;
    let given = (names.thickness.is_some(), names.area.is_some());
    let kind = Kind::of(&loaded.scene.bodies[index], mesh);
    let field = format!("body[{index}].material.fields");
    check_kind(loaded, &field, kind, given)?;
    Ok(Values {
        young: take("young", &names.young, material.young)?,
        poisson: match (material.poisson, &names.poisson) {
            (None, None) => Vec::new(),
            (base, name) => take("poisson", name, base.unwrap_or(0.0))?,
        },
        density: take("density", &names.density, material.density)?,
        thickness: take(
            "thickness",
            &names.thickness,
            material.thickness.unwrap_or(0.0),
        )?,
        area: take("area", &names.area, material.area.unwrap_or(0.0))?,
    })
}

/// Warnings about the values that a mesh's fields give the material. A field that does not exist has none.
pub(super) fn warnings(loaded: &LoadedScene, index: usize, mesh: &Mesh) -> Vec<Warning> {
    let names = &loaded.scene.bodies[index].material.fields;
    let mut warnings = Vec::new();
    for (quantity, name) in [
        ("young", &names.young),
        ("density", &names.density),
        ("thickness", &names.thickness),
        ("area", &names.area),
    ] {
        let field = name
            .as_ref()
            .and_then(|name| mesh.fields().iter().find(|field| field.name == *name));
        if let Some(field) = field {
            let judged = judge(loaded, index, quantity, &field.values);
            warnings.extend(judged.unwrap_or_default());
        }
    }
    warnings
}

/// The ratio of Poisson above which linear tetrahedra are much too stiff. At 0.45 the force of a press is near twice as
/// large as with quadratic ones, at 0.499 more than twenty times.
const LOCKS: f64 = 0.4;

/// The warning about linear tetrahedra of a material that hardly changes its volume.
pub(super) fn locks(loaded: &LoadedScene, index: usize, mesh: &Mesh) -> Option<Warning> {
    let Mesh::Solid(solid) = mesh else {
        return None;
    };
    if matches!(solid.cells, Cells::Quadratic(_)) {
        return None;
    }
    let poisson = build(loaded, index, mesh).ok()?.poisson;
    let most = poisson.iter().copied().fold(f64::MIN, f64::max);
    (most > LOCKS).then(|| Warning {
        location: loaded.source.location(&format!("body[{index}].mesh")),
        found: format!("linear tetrahedra with a Poisson's ratio of {most}"),
        usual: format!("up to {LOCKS} for linear tetrahedra"),
        advice: "linear tetrahedra lock where the volume hardly changes, and forces are far too large: set mesh.order = 2"
            .to_owned(),
    })
}

/// Judges the smallest and the largest value that a mesh's field gives the material's `quantity`.
fn judge(
    loaded: &LoadedScene,
    index: usize,
    quantity: &str,
    values: &[f64],
) -> Result<Vec<Warning>, SceneError> {
    let Some(range) = plausible::of_material(&loaded.scene.bodies[index], quantity) else {
        return Ok(Vec::new());
    };
    let field = format!("body[{index}].material.fields.{quantity}");
    let numbered = || values.iter().copied().enumerate();
    let least = numbered().min_by(|a, b| a.1.total_cmp(&b.1));
    let most = numbered().max_by(|a, b| a.1.total_cmp(&b.1));
    let mut warnings = Vec::new();
    for (element, value) in least.into_iter().chain(most) {
        let what = format!(" in element {element} of the mesh");
        warnings.extend(range.judge(&loaded.source, &field, &what, value)?);
    }
    // A field of one value alone gives one warning.
    warnings.dedup();
    Ok(warnings)
}

/// The values of the mesh's field `name`, checked against the range of the material's `quantity`.
fn values(
    loaded: &LoadedScene,
    index: usize,
    quantity: &str,
    name: &str,
    fields: &[Field],
) -> Result<Vec<f64>, SceneError> {
    let field = format!("body[{index}].material.fields.{quantity}");
    let names = fields.iter().map(|f| &f.name);
    let nothing = "nothing (the mesh has no values by element that are finite numbers)";
    let found = selection::named(loaded, &field, name, names, "field", nothing)?;
    let values = fields[found].values.clone();
    let (allowed, fits): (_, fn(f64) -> bool) = if quantity == "poisson" {
        ("numbers above -1 and below 0.5", |v| v > -1.0 && v < 0.5)
    } else {
        ("numbers above 0", |v| v > 0.0)
    };
    if let Some(element) = values.iter().position(|&v| !(v.is_finite() && fits(v))) {
        let found = format!("{:?} in element {element} of the mesh", values[element]);
        return Err(loaded.source.error(&field, found, allowed));
    }
    judge(loaded, index, quantity, &values)?;
    Ok(values)
}

/// Replaces the values of the elements in the scene's regions.
fn overwrite(
    loaded: &LoadedScene,
    index: usize,
    mesh: &Mesh,
    values: &mut Values,
) -> Result<(), SceneError> {
    for (number, region) in loaded.scene.bodies[index].regions.iter().enumerate() {
        let field = format!("body[{index}].region[{number}]");
        let given = (region.thickness.is_some(), region.area.is_some());
        check_kind(
            loaded,
            &field,
            Kind::of(&loaded.scene.bodies[index], mesh),
            given,
        )?;
        let group = region.group.as_deref();
        for element in selection::elements(loaded, &field, group, region.in_box, mesh)? {
            let element = element as usize;
            // A thread may have no Poisson's ratio: then a region's has no element to write to.
            let write = |all: &mut Vec<f64>, value: Option<f64>| {
                if let (Some(own), Some(value)) = (all.get_mut(element), value) {
                    *own = value;
                }
            };
            write(&mut values.young, region.young);
            write(&mut values.poisson, region.poisson);
            write(&mut values.density, region.density);
            write(&mut values.thickness, region.thickness);
            write(&mut values.area, region.area);
        }
    }
    Ok(())
}
