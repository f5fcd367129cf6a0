//! The body of the physics, at rest, from a body of a scene.

use super::grasp::{grasps, handles, held_once, holding};
use super::kind::Kind;
use super::mesh::Notched;
use super::tear::TearSpec;
use super::{contact, grasp, load, material, selection, tear};
use crate::scene::spec::{self, body::LawName};
use crate::scene::{LoadedScene, SceneError};
use nalgebra::UnitQuaternion;
use physics::mesh::Mesh;
use physics::{
    Body, BodyConfig, BodyError, Equilibrium, EquilibriumOptions, Freedom, HandlePose, HandleSpec,
    SheetLawName, SolidLaw, SupportSpec, Vec3,
};

/// A step whose residual is below this tolerance counts as solved (N): a millionth of the smallest force that any
/// device can render.
const ABSOLUTE_TOLERANCE: f64 = 1e-8;

/// One body of a scene, at rest.
#[derive(Clone, Debug)]
pub struct Built {
    /// The kind of the body.
    pub kind: Kind,
    /// The material law.
    pub law: LawName,
    /// The mesh of the body, in the order of the file.
    pub mesh: Mesh,
    /// Young's modulus by element (Pa).
    pub young: Vec<f64>,
    /// Poisson's ratio by element; empty if the scene gives a thread none.
    pub poisson: Vec<f64>,
    /// The body of the physics. Its supports are at rest and its loads act in full.
    pub body: Body,
    /// The handles of the body: its [`grasps`] in their order, then the turned supports of the scene in theirs.
    pub handles: Vec<HandleSpec>,
    /// The carrier of each support of the scene.
    pub carriers: Vec<Carrier>,
    /// The sum of the scene's loads, a force for each vertex (N).
    pub loads: Vec<Vec3>,
    /// The thickness of the body in contact (m).
    pub thickness: f64,
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

impl Built {
    /// A copy of the body at equilibrium with its handles held, if it has weight, bears loads or is cut out of a flat
    /// pattern. The energy that the body then stores need not be supplied by the hands. `None` for a body that starts
    /// undeformed: also for one for which no equilibrium is found.
    pub(super) fn settled(&self) -> Option<Body> {
        let is_cut = matches!(&self.mesh, Mesh::Sheet(mesh) if mesh.flat_pattern.is_some());
        if !is_cut && self.body.total_external_force() == Vec3::zeros() {
            return None;
        }
        let handles = self.handles.iter();
        let rest: Vec<_> = handles
            .map(|handle| HandlePose::at(handle.origin))
            .collect();
        let mut body = self.body.clone();
        let mut equilibrium = Equilibrium::new(&body, EquilibriumOptions::default()).ok()?;
        body.set_load_factor(0.0).ok()?;
        let report = equilibrium.solve(&mut body, &rest, 1.0).ok()?;
        report.last.converged.then_some(body)
    }
}

/// Builds one body, at rest, of its mesh and the vertices of its handles, `held` ([`grasp::vertices`]). `origins`: those of what
/// each device holds.
///
/// # Errors
/// [`SceneError`], naming the file, line and field that cannot be built.
pub(super) fn build(
    loaded: &LoadedScene,
    index: usize,
    notched: Notched<'_>,
    held: Vec<Vec<u32>>,
    origins: &[Option<Vec3>],
) -> Result<Built, SceneError> {
    let scene = &loaded.scene;
    let spec = &scene.bodies[index];
    let mesh = &*notched.mesh;
    let material = material::build(loaded, index, mesh)?;
    let mut handles = handles(loaded, index, mesh, held, origins);
    let constraints = supports(loaded, index, mesh, &mut handles)?;
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
            let field = field_of_handle(loaded, index, &constraints, number);
            unclamped(loaded, &field, found)
        }
        error => refuse(&error),
    })?;

    let mut carriers = Vec::new();
    // The supports of the body, and the number of each in the scene.
    let (mut added, mut numbers) = (Vec::new(), Vec::new());
    for (number, constraint) in constraints.into_iter().enumerate() {
        carriers.push(match constraint {
            Constraint::Turned(handle) => Carrier::Handle(handle),
            Constraint::Guided(vertices) if vertices.is_empty() => Carrier::Nothing,
            Constraint::Guided(vertices) => {
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
    let thickness = contact::thickness(spec.contact_thickness, &material.elements, mesh);
    let loads = load::build(loaded, index, mesh)?;
    body.set_external_forces(&loads)
        .map_err(|error| refuse(&error))?;
    Ok(Built {
        kind: Kind::of(spec, mesh),
        law: material.law,
        young: material.young,
        poisson: material.poisson,
        mesh: notched.mesh.into_owned(),
        body,
        handles,
        carriers,
        loads,
        thickness,
        tear,
    })
}

/// The constraint that a support of the scene becomes.
enum Constraint {
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
) -> Result<Vec<Constraint>, SceneError> {
    let supports = &loaded.scene.bodies[index].supports;
    let find = |(number, support): (usize, &spec::Support)| {
        let field = format!("body[{index}].support[{number}]");
        let group = support.group.as_deref();
        selection::vertices(loaded, &field, group, support.in_box, mesh)
    };
    let all: Vec<_> = supports
        .iter()
        .enumerate()
        .map(find)
        .collect::<Result<_, _>>()?;
    let mut constraints: Vec<Option<Constraint>> = Vec::new();
    let spec = &loaded.scene.bodies[index];
    let mut names: Vec<_> = grasps(&loaded.scene, spec)
        .iter()
        .map(|grasp| format!("handle {:?}", grasp.name(spec)))
        .collect();
    for (number, (support, vertices)) in supports.iter().zip(&all).enumerate() {
        if support.rotation.is_none() {
            constraints.push(None);
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
        constraints.push(Some(Constraint::Turned(handles.len() - 1)));
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
    Ok(constraints
        .into_iter()
        .zip(all)
        .map(|(constraint, vertices)| {
            constraint.unwrap_or_else(|| Constraint::Guided(free(vertices)))
        })
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
        let centre = grasp::centre(vertices, mesh);
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
fn field_of_handle(
    loaded: &LoadedScene,
    index: usize,
    constraints: &[Constraint],
    number: usize,
) -> String {
    let turned = |constraint: &Constraint| matches!(constraint, Constraint::Turned(handle) if *handle == number);
    if let Some(support) = constraints.iter().position(turned) {
        return format!("body[{index}].support[{support}]");
    }
    let grasps = grasps(&loaded.scene, &loaded.scene.bodies[index]);
    let first = grasps.get(number).map_or(number, |grasp| grasp.handles[0]);
    format!("body[{index}].handle[{first}]")
}

/// The error of a handle or a support at `field` that cannot clamp the border.
fn unclamped(loaded: &LoadedScene, field: &str, found: &str) -> SceneError {
    let found = format!("\"clamped\", but {found}");
    let allowed = "\"hinged\"";
    loaded
        .source
        .error(&format!("{field}.border"), found, allowed)
}
