//! The construction of a body at rest from a mesh, materials and handles.

use super::assembly::Assembly;
use super::border;
use super::constraints::Constraints;
use super::handle::{Handle, HandleSpec};
use super::model::Model;
use super::state::State;
use super::topology::Topology;
use super::{Body, BodyConfig};
use crate::Vec3;
use crate::element::bending::{BentSheet, Plate};
use crate::element::elements::Elements;
use crate::element::tet::shape::{Tet4, Tet10};
use crate::element::tet::solid::Solid;
use crate::element::triangle::frame::rest_corners;
use crate::element::triangle::membrane::Membrane;
use crate::element::triangle::woven::{Woven, warp_in_frame};
use crate::element::truss::Truss;
use crate::error::BodyError;
use crate::material::law::{Corotational, Law, Linear, StVenantKirchhoff, StableNeoHookean};
use crate::material::sheet_law::{CorotationalSheet, StVenantKirchhoffSheet};
use crate::material::weave::Weave;
use crate::material::{Material, Rigidity, SolidMaterial, ThreadMaterial};
use crate::mesh::{Cells, LineMesh, TetMesh, TriMesh};

/// The laws of solids, by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SolidLaw {
    /// [`Linear`]: small strains and rotations.
    Linear,
    /// [`Corotational`]: small strains, any rotation.
    #[default]
    Corotational,
    /// [`StVenantKirchhoff`]: for verification; it softens under compression until it collapses.
    StVenantKirchhoff,
    /// [`StableNeoHookean`]: large strains; it recovers from any inversion.
    StableNeoHookean,
}

/// The laws of woven sheets, by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SheetLawName {
    /// [`CorotationalSheet`]: linear in the stretch; for cloth that is not soft in shear.
    Corotational,
    /// [`StVenantKirchhoffSheet`]: linear in the Green strain.
    #[default]
    StVenantKirchhoff,
}

impl Body {
    /// Builds a woven sheet in the shape of `mesh`, at rest there unless `mesh` has a flat pattern. `weaves` holds one material for all triangles or one for
    /// each.
    ///
    /// # Errors
    ///
    /// As [`Body::sheet`].
    pub fn woven(
        mesh: &TriMesh,
        weaves: &[Weave],
        law: SheetLawName,
        config: BodyConfig,
        handles: &[HandleSpec],
    ) -> Result<Self, BodyError> {
        config.check()?;
        check_positions(&mesh.positions)?;
        let elements: Box<dyn Elements> = match law {
            SheetLawName::Corotational => Box::new(Woven::<CorotationalSheet>::new(mesh, weaves)?),
            SheetLawName::StVenantKirchhoff => {
                Box::new(Woven::<StVenantKirchhoffSheet>::new(mesh, weaves)?)
            }
        };
        let bends = |weave: &Weave| weave.rigidity != Rigidity::default();
        let bent = if config.bending > 0.0 && weaves.iter().any(bends) {
            Some(bent_weave(mesh, weaves, config.bending)?)
        } else {
            None
        };
        Self::build(&mesh.positions, vec![elements], bent, config, handles)
    }

    /// Builds a sheet in the shape of `mesh`, at rest there unless `mesh` has a flat pattern. The stress of a sheet that is cut
    /// out of a pattern acts from the first step on; mass follows the pattern.
    ///
    /// `materials` holds one material for all triangles or one for each. `handles` may be empty: the sheet is free
    /// then.
    ///
    /// # Errors
    ///
    /// [`BodyError`] for a mesh, material, configuration or handle that cannot be simulated, with the place and the
    /// reason.
    pub fn sheet(
        mesh: &TriMesh,
        materials: &[Material],
        config: BodyConfig,
        handles: &[HandleSpec],
    ) -> Result<Self, BodyError> {
        config.check()?;
        check_positions(&mesh.positions)?;
        let membrane = Membrane::new(mesh, materials)?;
        let plate = |material: &Material| Plate {
            matrix: material.plate() * config.bending,
            thickness: material.thickness,
        };
        let bends = config.bending > 0.0;
        let bent =
            bends.then(|| BentSheet::new(&mesh.triangles, materials.iter().map(plate).collect()));
        let bent = bent.transpose()?;
        Self::build(
            &mesh.positions,
            vec![Box::new(membrane)],
            bent.map(|sheet| sheet.cut(mesh.flat_pattern.as_ref())),
            config,
            handles,
        )
    }

    /// Builds a solid at rest in the shape of `mesh`.
    ///
    /// `materials` holds one material for all cells or one for each. `handles` may be empty: the solid is free then.
    ///
    /// # Errors
    ///
    /// As [`Body::sheet`].
    pub fn solid(
        mesh: &TetMesh,
        materials: &[SolidMaterial],
        law: SolidLaw,
        config: BodyConfig,
        handles: &[HandleSpec],
    ) -> Result<Self, BodyError> {
        check_positions(&mesh.positions)?;
        let elements = match law {
            SolidLaw::Linear => cells(Linear, mesh, materials),
            SolidLaw::Corotational => cells(Corotational, mesh, materials),
            SolidLaw::StVenantKirchhoff => cells(StVenantKirchhoff, mesh, materials),
            SolidLaw::StableNeoHookean => cells(StableNeoHookean, mesh, materials),
        }?;
        Self::from_elements(&mesh.positions, vec![elements], config, handles)
    }

    /// Builds a thread at rest in the shape of `mesh`.
    ///
    /// `materials` holds one material for all lines or one for each. `handles` may be empty: the thread is free then.
    ///
    /// # Errors
    ///
    /// As [`Body::sheet`].
    pub fn thread(
        mesh: &LineMesh,
        materials: &[ThreadMaterial],
        config: BodyConfig,
        handles: &[HandleSpec],
    ) -> Result<Self, BodyError> {
        check_positions(&mesh.positions)?;
        let truss = Truss::new(mesh, materials)?;
        Self::from_elements(&mesh.positions, vec![Box::new(truss)], config, handles)
    }

    /// Builds a body at rest of any elements over vertices at `positions` (m).
    ///
    /// # Errors
    ///
    /// As [`Body::sheet`].
    pub fn from_elements(
        positions: &[Vec3],
        elements: Vec<Box<dyn Elements>>,
        config: BodyConfig,
        handles: &[HandleSpec],
    ) -> Result<Self, BodyError> {
        Self::build(positions, elements, None, config, handles)
    }

    fn build(
        positions: &[Vec3],
        elements: Vec<Box<dyn Elements>>,
        bent: Option<BentSheet>,
        config: BodyConfig,
        handles: &[HandleSpec],
    ) -> Result<Self, BodyError> {
        config.check()?;
        check_positions(positions)?;
        let count = positions.len();
        check_elements(&elements, count)?;
        let mut holder = vec![None; count];
        for (handle, spec) in handles.iter().enumerate() {
            check_handle(handle, spec, &mut holder)?;
        }
        let mut mass = vec![0.0; count];
        let mut load = vec![0.0; count];
        for set in &elements {
            set.add_mass(&mut mass, &mut load);
        }
        if let Some(vertex) = mass.iter().position(|&mass| mass == 0.0) {
            return Err(BodyError::Unreferenced { vertex });
        }
        let numbered = handles.iter().enumerate();
        let handles = numbered.map(|(handle, spec)| {
            let clamps = clamps_of_handle(handle, spec, bent.as_ref())?;
            Ok(Handle::new(positions, spec, clamps))
        });
        let mut constraints = Constraints::new(handles.collect::<Result<_, BodyError>>()?);
        let mut model = Model {
            config,
            elements,
            bent,
            bending: None,
            rest: positions.to_vec(),
            external: load.iter().map(|&load| config.gravity * load).collect(),
            load_factor: 1.0,
            mass,
            load,
        };
        let mut state = State::at_rest(positions);
        border::lay(count, &mut constraints, &mut model, &mut state);
        Ok(Self {
            assembly: Assembly::new(&mut model, &constraints),
            topology: Topology {
                vertex_count: count,
                epoch: 0,
            },
            state,
            constraints,
            model,
            sheet: None,
        })
    }
}

/// The bending of a woven sheet, whose rigidities are multiplied by `scale`.
fn bent_weave(mesh: &TriMesh, weaves: &[Weave], scale: f64) -> Result<BentSheet, BodyError> {
    let weave = |element: usize| &weaves[if weaves.len() == 1 { 0 } else { element }];
    let plates = mesh
        .triangles
        .iter()
        .enumerate()
        .map(|(element, vertices)| {
            let corners = match rest_corners(mesh, element) {
                Some(flat) => flat,
                None => vertices.map(|vertex| mesh.positions[vertex as usize]),
            };
            let weave = weave(element);
            Ok(Plate {
                matrix: weave.rigidity.plate(warp_in_frame(
                    element,
                    corners.each_ref(),
                    &weave.warp,
                )?) * scale,
                thickness: weave.thickness,
            })
        });
    let sheet = BentSheet::new(&mesh.triangles, plates.collect::<Result<_, BodyError>>()?)?;
    Ok(sheet.cut(mesh.flat_pattern.as_ref()))
}

/// The cells of `mesh` as elements of one law.
fn cells<L: Law>(
    law: L,
    mesh: &TetMesh,
    materials: &[SolidMaterial],
) -> Result<Box<dyn Elements>, BodyError> {
    let x = &mesh.positions;
    Ok(match &mesh.cells {
        Cells::Linear(cells) => Box::new(Solid::<4, 1, Tet4, L>::new(law, x, cells, materials)?),
        Cells::Quadratic(cells) => {
            Box::new(Solid::<10, 4, Tet10, L>::new(law, x, cells, materials)?)
        }
    })
}

fn check_positions(positions: &[Vec3]) -> Result<(), BodyError> {
    let finite = |position: &Vec3| position.iter().all(|c| c.is_finite());
    match positions.iter().position(|position| !finite(position)) {
        Some(vertex) => Err(BodyError::Position { vertex }),
        None => Ok(()),
    }
}

fn check_elements(elements: &[Box<dyn Elements>], count: usize) -> Result<(), BodyError> {
    if elements.iter().all(|set| set.count() == 0) {
        return Err(BodyError::Empty);
    }
    for set in elements {
        for element in 0..set.count() {
            let beyond = |vertex: &&u32| **vertex as usize >= count;
            if let Some(&vertex) = set.nodes(element).iter().find(beyond) {
                return Err(BodyError::ElementVertex {
                    element,
                    vertex,
                    count,
                });
            }
        }
    }
    Ok(())
}

/// The clamps of a handle.
///
/// # Errors
/// [`BodyError::Clamp`].
pub(super) fn clamps_of_handle(
    handle: usize,
    spec: &HandleSpec,
    sheet: Option<&BentSheet>,
) -> Result<Vec<border::Clamp>, BodyError> {
    border::clamps(spec.border, &spec.vertices, sheet).map_err(|found| BodyError::Clamp {
        part: "handle",
        number: handle,
        found,
    })
}

/// Checks that a handle can be made of `spec`. `holder` gives the handle of each vertex, if there is one; the vertices
/// of `spec` are entered as held by `handle`.
pub(super) fn check_handle(
    handle: usize,
    spec: &HandleSpec,
    holder: &mut [Option<usize>],
) -> Result<(), BodyError> {
    if spec.vertices.is_empty() {
        return Err(BodyError::EmptyHandle { handle });
    }
    if !spec.origin.iter().all(|c| c.is_finite()) {
        return Err(BodyError::HandleOrigin { handle });
    }
    let count = holder.len();
    for &vertex in &spec.vertices {
        let Some(entry) = holder.get_mut(vertex as usize) else {
            return Err(BodyError::HandleVertex {
                handle,
                vertex,
                count,
            });
        };
        if let Some(first) = entry.replace(handle) {
            return Err(BodyError::SharedVertex {
                vertex,
                first,
                second: handle,
            });
        }
    }
    Ok(())
}
