//! Builds the bodies of the physics, at rest, from the bodies of a scene.
//!
//! This module makes the checks that need the mesh: groups that do not exist, empty boxes, the thickness of a
//! solid. Their errors name the line and the field of the scene file, as all errors of a scene do.

pub mod groups;
mod load;
mod material;
mod mesh;
mod mount;
mod notch;
mod places;
mod press;
pub mod shapes;
mod survey;
mod tear;
mod tool;

use crate::scene::spec::{self, body::LawName};
use crate::scene::{LoadedScene, SceneError};
use crate::stage::Stage;
use nalgebra::UnitQuaternion;
use physics::mesh::Mesh;
use physics::{
    Body, BodyConfig, BodyError, Border, CondenseError, Condenser, Equilibrium, EquilibriumOptions,
    Freedom, HandlePose, HandleSpec, SheetLawName, SolidLaw, SupportSpec, Vec3,
};

pub(crate) use mount::is_mounted;
pub use mount::{Mount, mount};
pub use survey::warnings;
pub use tear::TearSpec;
pub use tool::{Tool, bodies_held, tools};

/// A step whose residual is below this tolerance counts as solved (N): a millionth of the smallest force that any
/// device can render.
const ABSOLUTE_TOLERANCE: f64 = 1e-8;

/// The kind of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Isotropic triangles.
    Sheet,
    /// Orthotropic triangles.
    Woven,
    /// Tetrahedra.
    Solid,
    /// Bars.
    Thread,
}

/// One body of a scene, at rest.
#[derive(Clone, Debug)]
pub struct Built {
    /// The kind of the body.
    pub kind: Kind,
    /// The material law: the relation between deformation and stress.
    pub law: LawName,
    /// The mesh of the body, in the order of the file.
    pub mesh: Mesh,
    /// Young's modulus by element (Pa).
    pub young: Vec<f64>,
    /// Poisson's ratio by element; empty where the scene gives a thread none.
    pub poisson: Vec<f64>,
    /// The body of the physics. Its supports are at rest and its loads act in full.
    pub body: Body,
    /// The handles of the body: its [`tools`] in their order, then the turned supports of the scene in theirs.
    pub handles: Vec<HandleSpec>,
    /// The carrier of each support of the scene.
    pub carriers: Vec<Carrier>,
    /// The sum of the scene's loads, a force for each vertex (N).
    pub loads: Vec<Vec3>,
    /// How the body tears; `None` for a body that does not tear.
    pub tear: Option<TearSpec>,
}

/// The part of the body that holds the vertices of a scene's support.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carrier {
    /// The support of this number in the body.
    Support(usize),
    /// The handle of this number, for a support that is turned.
    Handle(usize),
    /// No part of its own: handles hold all vertices of the support.
    Nothing,
}

/// The origins of a body's handles at rest (m), in the order of its [`tools`]: the centre of the vertices of a handle, or
/// the mean of such centres over the places of a tool.
///
/// # Errors
/// [`SceneError`], naming the file, line and field that cannot be built.
pub fn handle_origins(loaded: &LoadedScene, index: usize) -> Result<Vec<Vec3>, SceneError> {
    let mesh = mesh::build(loaded, index)?;
    Ok(handles(loaded, index, &mesh)?
        .into_iter()
        .map(|handle| handle.origin)
        .collect())
}

/// Builds one body, at rest.
///
/// # Errors
/// As [`handle_origins`].
pub fn build(loaded: &LoadedScene, index: usize) -> Result<Built, SceneError> {
    let scene = &loaded.scene;
    let spec = &scene.bodies[index];
    let notched = mesh::with_notches(loaded, index)?;
    let mesh = &*notched.mesh;
    let material = material::build(loaded, index, mesh)?;
    let mut handles = handles(loaded, index, mesh)?;
    let parts = supports(loaded, index, mesh, &mut handles)?;
    let tear = tear::build(loaded, index, &notched, &material.elements, &handles)?;
    let config = BodyConfig {
        gravity: Vec3::from(scene.gravity),
        mass_damping: spec.damping.mass,
        stiffness_damping: spec.damping.stiffness,
        bending: material.bending,
        tolerance: scene.host.tolerance,
        absolute_tolerance: ABSOLUTE_TOLERANCE,
        max_iterations: scene.host.max_iterations,
    };
    let refuse = |fault: &dyn std::fmt::Display| {
        let field = format!("body[{index}]");
        let allowed = "a body that can be simulated";
        loaded.source.error(&field, fault.to_string(), allowed)
    };
    let mut body = match (mesh, &material.elements) {
        (Mesh::Sheet(mesh), material::Elements::Sheet(materials)) => {
            Body::sheet(mesh, materials, config, &handles)
        }
        (Mesh::Sheet(mesh), material::Elements::Woven(weaves)) => {
            let law = match material.law {
                LawName::Corotational => SheetLawName::Corotational,
                _ => SheetLawName::StVenantKirchhoff,
            };
            Body::woven(mesh, weaves, law, config, &handles)
        }
        (Mesh::Solid(mesh), material::Elements::Solid(materials)) => {
            let law = match material.law {
                LawName::Linear => SolidLaw::Linear,
                LawName::Corotational => SolidLaw::Corotational,
                LawName::StVenantKirchhoff => SolidLaw::StVenantKirchhoff,
                LawName::StableNeoHookean => SolidLaw::StableNeoHookean,
            };
            Body::solid(mesh, materials, law, config, &handles)
        }
        (Mesh::Thread(mesh), material::Elements::Thread(materials)) => {
            Body::thread(mesh, materials, config, &handles)
        }
        // The material was made for this mesh.
        _ => return Err(refuse(&"a material for another kind of mesh")),
    }
    .map_err(|error| match error {
        BodyError::Clamp { number, found, .. } => {
            let field = field_of_handle(loaded, index, &parts, number);
            unclamped(loaded, &field, found)
        }
        error => refuse(&error),
    })?;

    let mut carriers = Vec::new();
    // The supports of the body, and the number of each in the scene.
    let (mut added, mut numbers) = (Vec::new(), Vec::new());
    for (number, part) in parts.into_iter().enumerate() {
        carriers.push(match part {
            Part::Turned(handle) => Carrier::Handle(handle),
            Part::Guided(vertices) if vertices.is_empty() => Carrier::Nothing,
            Part::Guided(vertices) => {
                added.push(SupportSpec {
                    vertices,
                    axes: spec.supports[number].axes,
                    border: spec.supports[number].border.into(),
                });
                numbers.push(number);
                Carrier::Support(added.len() - 1)
            }
        });
    }
    body.add_supports(&added).map_err(|error| {
        let (BodyError::Clamp { number, .. }
        | BodyError::Support {
            support: number, ..
        }) = error
        else {
            return refuse(&error);
        };
        let field = format!("body[{index}].support[{}]", numbers[number]);
        match error {
            BodyError::Clamp { found, .. } => unclamped(loaded, &field, found),
            error => loaded.source.error(&field, error.to_string(), "a support"),
        }
    })?;
    let loads = load::build(loaded, index, mesh)?;
    body.set_external_forces(&loads)
        .map_err(|error| refuse(&error))?;
    Ok(Built {
        kind: material::kind(spec, mesh),
        law: material.law,
        young: material.young,
        poisson: material.poisson,
        mesh: notched.mesh.into_owned(),
        body,
        handles,
        carriers,
        loads,
        tear,
    })
}

/// Builds one body, at rest under its weight and its loads while its handles are held.
///
/// # Errors
/// As [`handle_origins`].
pub fn build_settled(loaded: &LoadedScene, index: usize) -> Result<Built, SceneError> {
    let mut built = build(loaded, index)?;
    let is_cut = matches!(&built.mesh, Mesh::Sheet(mesh) if mesh.flat_pattern.is_some());
    settle(&mut built.body, &built.handles, is_cut);
    Ok(built)
}

/// Builds one body and condenses it onto its handles at their initial poses, for local models published every `period`
/// seconds.
///
/// # Errors
/// As [`handle_origins`]; also if the body cannot be condensed.
pub fn condense<E>(loaded: &LoadedScene, index: usize, period: f64) -> Result<Condenser, E>
where
    E: From<SceneError> + From<CondenseError>,
{
    let mut body = build(loaded, index)?.body;
    let mut condenser = Condenser::new(&body)?;
    body.assemble();
    condenser.condense(&body, period)?;
    Ok(condenser)
}

/// Brings a body that has weight, bears loads or is cut out of a flat pattern to equilibrium with its handles held, before
/// the run starts. The energy
/// that the body then stores need not be supplied by the hands. A body for which no equilibrium is found starts
/// undeformed.
fn settle(body: &mut Body, handles: &[HandleSpec], is_cut: bool) {
    if !is_cut && body.total_external_force() == Vec3::zeros() {
        return;
    }
    let rest: Vec<_> = handles
        .iter()
        .map(|handle| HandlePose::at(handle.origin))
        .collect();
    Stage::Settling.begin();
    let start = body.clone();
    let options = EquilibriumOptions::default();
    let found = Equilibrium::new(body, options)
        .ok()
        .and_then(|mut equilibrium| {
            body.set_load_factor(0.0).ok()?;
            equilibrium.solve(body, &rest, 1.0).ok()
        });
    if found.is_none_or(|report| !report.last.converged) {
        *body = start;
    }
}

/// The handles of a scene's body: one for each tool.
fn handles(loaded: &LoadedScene, index: usize, mesh: &Mesh) -> Result<Vec<HandleSpec>, SceneError> {
    let spec = &loaded.scene.bodies[index];
    let mut all: Vec<Vec<u32>> = Vec::new();
    for (number, handle) in spec.handles.iter().enumerate() {
        let vertices = tool::vertices(loaded, index, number, mesh)?;
        let field = format!("body[{index}].handle[{number}]");
        for (other, earlier) in spec.handles.iter().zip(&all) {
            let [this, other] = [&handle.name, &other.name].map(|name| format!("handle {name:?}"));
            held_once(loaded, &field, &this, &vertices, &other, earlier)?;
        }
        all.push(vertices);
    }
    let bodies = bodies_held(&loaded.scene);
    let each = tools(&loaded.scene, spec).into_iter().map(|tool| {
        let handle = tool.first(spec);
        let mut vertices: Vec<u32> = Vec::new();
        for &place in &tool.places {
            vertices.append(&mut all[place]);
        }
        vertices.sort_unstable();
        let held = holding(
            vertices,
            mesh,
            freedom(loaded, handle),
            handle.border.into(),
        );
        let alone = tool.places.len() == 1 && bodies[tool.device] == 1;
        let origin = if alone {
            None
        } else {
            tool::origin(loaded, tool.device)?
        };
        Ok(HandleSpec {
            origin: origin.unwrap_or(held.origin),
            ..held
        })
    });
    each.collect()
}

/// Refuses `vertices`, which `this` holds rigidly by the scene's `field`, if `other` holds some of them, too.
fn held_once(
    loaded: &LoadedScene,
    field: &str,
    this: &str,
    vertices: &[u32],
    other: &str,
    held: &[u32],
) -> Result<(), SceneError> {
    let shared = places::shared(vertices, held);
    if shared == 0 {
        return Ok(());
    }
    let (of, others) = (vertices.len(), held.len());
    let found =
        format!("{shared} vertices in both {this} ({of} vertices) and {other} ({others} vertices)");
    let allowed = "vertices that only one of the two holds: make the group or the box of one of the two smaller";
    Err(loaded.source.error(field, found, allowed))
}

/// The degrees of freedom of a handle: those that its device actuates. Without an actuated rotation, only the
/// translations of the handle are condensed.
pub fn freedom(loaded: &LoadedScene, handle: &spec::Handle) -> Freedom {
    let device = loaded.scene.device_of(handle);
    match loaded.models.get(device).and_then(|model| model.rotation) {
        Some(_) => Freedom::Rigid,
        None => Freedom::Translation,
    }
}

/// A handle about the centre of `vertices`.
fn holding(vertices: Vec<u32>, mesh: &Mesh, freedom: Freedom, border: Border) -> HandleSpec {
    HandleSpec {
        origin: tool::centre(&vertices, mesh),
        vertices,
        freedom,
        border,
    }
}

/// The part of the body that will carry a support.
enum Part {
    /// The handle of this number.
    Turned(usize),
    /// A support of these vertices.
    Guided(Vec<u32>),
}

/// Divides the supports into turned and guided ones. A turned support becomes a handle, which is added to `handles`. A
/// guided support keeps the vertices that no handle holds.
fn supports(
    loaded: &LoadedScene,
    index: usize,
    mesh: &Mesh,
    handles: &mut Vec<HandleSpec>,
) -> Result<Vec<Part>, SceneError> {
    let supports = &loaded.scene.bodies[index].supports;
    let find = |(number, support): (usize, &spec::Support)| {
        let field = format!("body[{index}].support[{number}]");
        let group = support.group.as_deref();
        places::vertices(loaded, &field, group, support.in_box, mesh)
    };
    let all: Vec<_> = supports
        .iter()
        .enumerate()
        .map(find)
        .collect::<Result<_, _>>()?;
    let mut parts: Vec<Option<Part>> = Vec::new();
    let spec = &loaded.scene.bodies[index];
    let mut names: Vec<_> = tools(&loaded.scene, spec)
        .iter()
        .map(|tool| format!("handle {:?}", tool.name(spec)))
        .collect();
    for (number, (support, vertices)) in supports.iter().zip(&all).enumerate() {
        if support.rotation.is_none() {
            parts.push(None);
            continue;
        }
        let field = format!("body[{index}].support[{number}]");
        let this = format!("support {:?}, which turns,", support.name);
        for (other, earlier) in names.iter().zip(&*handles) {
            held_once(loaded, &field, &this, vertices, other, &earlier.vertices)?;
        }
        let border = support.border.into();
        handles.push(holding(vertices.clone(), mesh, Freedom::Rigid, border));
        names.push(this);
        parts.push(Some(Part::Turned(handles.len() - 1)));
    }
    placed_once(loaded, index, mesh, &all)?;
    let mut held = vec![false; mesh.positions().len()];
    for &vertex in handles.iter().flat_map(|handle| &handle.vertices) {
        held[vertex as usize] = true;
    }
    let free = |vertices: Vec<u32>| {
        vertices
            .into_iter()
            .filter(|&v| !held[v as usize])
            .collect()
    };
    Ok(parts
        .into_iter()
        .zip(all)
        .map(|(part, vertices)| part.unwrap_or_else(|| Part::Guided(free(vertices))))
        .collect())
}

/// Refuses supports that hold one vertex at two places at the end of a solve. `all`: the vertices of each support.
fn placed_once(
    loaded: &LoadedScene,
    index: usize,
    mesh: &Mesh,
    all: &[Vec<u32>],
) -> Result<(), SceneError> {
    let supports = &loaded.scene.bodies[index].supports;
    // Turned places of one vertex differ by rounding.
    let slack = 1e-9 * mesh.positions().iter().map(Vec3::amax).fold(0.0, f64::max);
    // By vertex and axis: the support, counted from 1, and the displacement (m).
    let mut placed = vec![[(0, 0.0); 3]; mesh.positions().len()];
    for (number, (support, vertices)) in supports.iter().zip(all).enumerate() {
        let centre = tool::centre(vertices, mesh);
        let turn =
            UnitQuaternion::from_scaled_axis(Vec3::from(support.rotation.unwrap_or_default()));
        // A turned support holds its vertices along all axes.
        let axes = support.rotation.map_or(support.axes, |_| [true; 3]);
        for &vertex in vertices {
            let arm = mesh.positions()[vertex as usize] - centre;
            let moved = Vec3::from(support.displacement) + (turn * arm - arm);
            for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                let (other, there) = &mut placed[vertex as usize][axis];
                if !axes[axis] {
                    continue;
                }
                if *other > 0 && (moved[axis] - *there).abs() > slack {
                    let found = format!(
                        "vertex {vertex} moved by {:e} m along {name}, but support {:?} moves it by {there:e} m",
                        moved[axis],
                        supports[*other - 1].name,
                    );
                    let allowed = "one place for each vertex: give both supports the same displacement, leave the axis \
                                   to one of them, or make the group or the box of one smaller";
                    let field = format!("body[{index}].support[{number}]");
                    return Err(loaded.source.error(&field, found, allowed));
                }
                (*other, *there) = (number + 1, moved[axis]);
            }
        }
    }
    Ok(())
}

/// The field of the scene from which the handle `number` of the body comes.
fn field_of_handle(loaded: &LoadedScene, index: usize, parts: &[Part], number: usize) -> String {
    let turned = |part: &Part| matches!(part, Part::Turned(handle) if *handle == number);
    if let Some(support) = parts.iter().position(turned) {
        return format!("body[{index}].support[{support}]");
    }
    let tools = tools(&loaded.scene, &loaded.scene.bodies[index]);
    let place = tools.get(number).map_or(number, |tool| tool.places[0]);
    format!("body[{index}].handle[{place}]")
}

/// The error of a handle or a support at `field` that cannot clamp the border.
fn unclamped(loaded: &LoadedScene, field: &str, found: &str) -> SceneError {
    let found = format!("\"clamped\", but {found}");
    let allowed = "\"hinged\"";
    loaded
        .source
        .error(&format!("{field}.border"), found, allowed)
}

/// Factor on the bending stiffness of a body; 0 for a body without a bending model.
pub fn bending(body: &spec::Body, kind: Kind) -> f64 {
    match kind {
        Kind::Woven if !body.material.weave.is_some_and(material::bends) => 0.0,
        Kind::Sheet | Kind::Woven => body.bending.unwrap_or(1.0),
        Kind::Solid | Kind::Thread => 0.0,
    }
}
