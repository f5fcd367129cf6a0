//! The sheets that the study tears: their materials, and bodies and surfaces made of their meshes.

use super::patterns::Patterned;
use crate::StudyError;
use physics::mesh::TriMesh;
use physics::tear::{Driving, Intensity, Patch, RINGS, Sheet, TearLaw, TearMaterial, Tip};
use physics::topology::{Reserve, Surface};
use physics::{Body, BodyConfig, Border, Freedom, HandleSpec, Material, Starts, TearOptions, Vec3};

/// The cloth of the scene `tear_cloth`. All values are estimates. A tear takes 2 J per metre.
pub const CLOTH: Stuff = Stuff {
    young: 2e7,
    poisson: 0.3,
    thickness: 0.5e-3,
    density: 400.0,
    strength: 2e6,
    toughness: 4000.0,
};

/// Paper of a banknote; strength and toughness are estimates. A tear takes 1.6 J per metre.
pub const PAPER: Stuff = Stuff {
    young: 3e9,
    poisson: 0.3,
    thickness: 0.1e-3,
    density: 900.0,
    strength: 40e6,
    toughness: 16e3,
};

/// Rubber. All values are estimates. A tear takes 4 J per metre.
pub(super) const RUBBER: Stuff = Stuff {
    young: 1e7,
    poisson: 0.3,
    thickness: 2e-3,
    density: 1000.0,
    strength: 1e6,
    toughness: 2000.0,
};

/// The material of a sheet that tears.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stuff {
    /// Young's modulus (Pa).
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Thickness (m).
    pub thickness: f64,
    /// Density (kg/m³).
    pub density: f64,
    /// Strength (Pa).
    pub strength: f64,
    /// Toughness (J/m²).
    pub toughness: f64,
}

impl Stuff {
    /// The elastic part.
    pub(super) fn elastic(&self) -> Material {
        Material {
            young: self.young,
            poisson: self.poisson,
            thickness: self.thickness,
            density: self.density,
        }
    }

    /// What a law needs.
    pub(super) fn tear(&self, law: TearLaw) -> TearMaterial {
        TearMaterial {
            strength: self.strength,
            toughness: self.toughness,
            thickness: self.thickness,
            young: self.young,
            poisson: self.poisson,
            law,
        }
    }

    /// How a sheet tears under the law of toughness, with the snapping that scenes have.
    pub(super) fn tears(&self, starts: Starts) -> TearOptions {
        TearOptions {
            material: self.tear(TearLaw::Toughness),
            starts,
            snapping: 0.3,
            skips: true,
        }
    }

    /// The strain of a long clamped strip of this height (m) at which `E e² H / (2 (1 - nu²))` is the toughness: a crack
    /// that grows by one length takes the energy of as much strip ahead (Rivlin and Thomas, "Rupture of rubber", 1953).
    pub(super) fn strip_strain(&self, height: f64) -> f64 {
        let plane = self.young / (1.0 - self.poisson * self.poisson);
        (2.0 * self.toughness / (plane * height)).sqrt()
    }
}

/// A body without gravity, solved as far as double precision permits.
pub(super) fn exact() -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        tolerance: 1e-12,
        absolute_tolerance: 0.0,
        max_iterations: 100_000,
        ..BodyConfig::default()
    }
}

/// The surface of a flat mesh.
pub(super) fn surface(mesh: &TriMesh) -> Result<Surface, StudyError> {
    let at = |corner: u32| {
        let position = mesh.positions[corner as usize];
        [position.x, position.y]
    };
    let shapes: Vec<_> = mesh
        .triangles
        .iter()
        .map(|corners| corners.map(at))
        .collect();
    let count = mesh.positions.len();
    Ok(Surface::new(
        count,
        &mesh.triangles,
        &shapes,
        Reserve::default(),
    )?)
}

/// What drives the tear at `tip` of a sheet at positions `x` (m): energy release rate and stress intensities.
pub(super) fn driving(
    surface: &Surface,
    tip: u32,
    x: &[Vec3],
    material: &TearMaterial,
    held: impl Fn(u32) -> bool,
) -> Result<(Driving, Intensity), StudyError> {
    let ahead = surface.direction_at(tip, surface.straight_ahead(tip));
    let (triangle, along) = ahead.ok_or(StudyError::Slit)?;
    let mut patch = Patch::new(surface.vertex_count(), surface.triangle_count());
    let sheet = Sheet {
        triangles: surface.triangles(),
        neighbours: surface.neighbours(),
        shapes: surface.shapes(),
    };
    let tip = Tip {
        vertex: tip,
        triangle,
        along,
    };
    patch.find(&sheet, &tip, RINGS, held)?;
    patch.measure(x, material)?;
    Ok((patch.driving(), patch.intensity()))
}

/// The vertices of a side of a rectangle.
pub(super) fn side<'a>(made: &'a Patterned, name: &str) -> &'a [u32] {
    made.mesh.group(name).map_or(&[], |group| &group.members)
}

/// A hand that holds these vertices, and does not turn.
pub(super) fn hand(vertices: Vec<u32>) -> HandleSpec {
    HandleSpec {
        vertices,
        origin: Vec3::zeros(),
        freedom: Freedom::Translation,
        border: Border::Hinged,
    }
}

/// A sheet in these hands that is held flat elsewhere.
pub(super) fn flat_sheet(
    mesh: &TriMesh,
    stuff: &Stuff,
    config: BodyConfig,
    hands: &[HandleSpec],
) -> Result<Body, StudyError> {
    let mut body = Body::sheet(mesh, &[stuff.elastic()], config, hands)?;
    let held = hands.iter().flat_map(|hand| hand.vertices.iter().copied());
    hold_flat(&mut body, &held.collect::<Vec<_>>())?;
    Ok(body)
}

/// A sheet held flat: all vertices but `held` are guided along z.
pub(super) fn hold_flat(body: &mut Body, held: &[u32]) -> Result<(), StudyError> {
    let all: Vec<u32> = (0..body.vertex_count() as u32)
        .filter(|v| !held.contains(v))
        .collect();
    body.add_support(&all, [false, false, true])?;
    Ok(())
}
