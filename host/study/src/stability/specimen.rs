//! The bodies of the suite: about one metre long, of every element and law.

use super::Method;
use crate::StudyError;
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::mesh::{TetMesh, TriMesh};
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Material, SheetLawName, SolidLaw,
    SolidMaterial, Vec3, Weave,
};

/// Elements and law of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Tetrahedra with four nodes.
    Linear(SolidLaw),
    /// Tetrahedra with ten nodes.
    Quadratic(SolidLaw),
    /// Corotational triangles with bending.
    Sheet,
    /// Woven triangles.
    Woven(SheetLawName),
}

const LAWS: [SolidLaw; 4] = [
    SolidLaw::Linear,
    SolidLaw::Corotational,
    SolidLaw::StVenantKirchhoff,
    SolidLaw::StableNeoHookean,
];

impl Kind {
    /// Every solid.
    pub(super) fn solids() -> impl Iterator<Item = Self> {
        LAWS.into_iter()
            .flat_map(|law| [Self::Linear(law), Self::Quadratic(law)])
    }

    /// Every sheet.
    pub(super) fn sheets() -> impl Iterator<Item = Self> {
        [
            Self::Sheet,
            Self::Woven(SheetLawName::Corotational),
            Self::Woven(SheetLawName::StVenantKirchhoff),
        ]
        .into_iter()
    }

    /// Every kind with each of its methods.
    pub(super) fn all() -> impl Iterator<Item = (Self, Method)> {
        Self::solids()
            .chain(Self::sheets())
            .flat_map(Self::with_methods)
    }

    /// Every kind with both methods that solve to a tolerance.
    pub(super) fn solved() -> impl Iterator<Item = (Self, Method)> {
        Self::all().filter(|(_, method)| !method.is_linearized())
    }

    /// This kind with each of its methods.
    pub(super) fn with_methods(self) -> impl Iterator<Item = (Self, Method)> {
        let methods: &[Method] = match self {
            Self::Linear(_) | Self::Quadratic(_) => {
                &[Method::ImplicitEuler, Method::TrBdf2, Method::Frozen]
            }
            Self::Sheet | Self::Woven(_) => &[
                Method::ImplicitEuler,
                Method::TrBdf2,
                Method::Linearized,
                Method::Frozen,
            ],
        };
        methods.iter().map(move |&method| (self, method))
    }

    pub(super) fn body(self) -> &'static str {
        match self {
            Self::Linear(_) => "linear tetrahedra",
            Self::Quadratic(_) => "quadratic tetrahedra",
            Self::Sheet => "sheet with bending",
            Self::Woven(_) => "woven sheet",
        }
    }

    pub(super) fn law(self) -> &'static str {
        match self {
            Self::Linear(law) | Self::Quadratic(law) => match law {
                SolidLaw::Linear => "linear",
                SolidLaw::Corotational => "corotational",
                SolidLaw::StVenantKirchhoff => "St. Venant-Kirchhoff",
                SolidLaw::StableNeoHookean => "stable neo-Hookean",
            },
            Self::Sheet | Self::Woven(SheetLawName::Corotational) => "corotational",
            Self::Woven(SheetLawName::StVenantKirchhoff) => "St. Venant-Kirchhoff",
        }
    }

    /// Whether its energy is a quadratic function of the positions.
    pub(super) fn is_quadratic_in_energy(self) -> bool {
        matches!(
            self,
            Self::Linear(SolidLaw::Linear) | Self::Quadratic(SolidLaw::Linear)
        )
    }

    /// Whether the body must recover from any state.
    pub(super) fn recovers(self) -> bool {
        use SolidLaw::StableNeoHookean;
        matches!(
            self,
            Self::Linear(StableNeoHookean) | Self::Quadratic(StableNeoHookean)
        )
    }

    /// Approximate time of a step, relative to the other kinds.
    pub(super) fn cost(self) -> f64 {
        match self {
            Self::Linear(_) => 1.0,
            Self::Quadratic(_) => 4.0,
            Self::Sheet | Self::Woven(_) => 0.5,
        }
    }

    /// A cube of edge 1 in `n`^3 grid cells (half as many along an edge for quadratic elements), or a square in (2
    /// n)^2. No two cells are equal.
    pub(super) fn mesh(self, n: u32) -> Result<Shape, StudyError> {
        let mut shape = match self {
            Self::Linear(_) => Shape::Solid(solid_box([1.0; 3], [n; 3])?),
            Self::Quadratic(_) => Shape::Solid(solid_box([1.0; 3], [n.div_ceil(2); 3])?),
            Self::Sheet | Self::Woven(_) => {
                Shape::Sheet(sheet(1.0, 1.0, 2 * n, 2 * n, Pattern::Alternating)?)
            }
        };
        let flat = matches!(shape, Shape::Sheet(_));
        let mut random = Random(3);
        for x in shape.positions_mut() {
            let off = random.vector() * (0.2 / f64::from(n));
            let inner = (0..if flat { 2 } else { 3 }).all(|axis| x[axis].abs() < 0.5);
            if inner {
                *x += if flat {
                    Vec3::new(0.5 * off.x, 0.5 * off.y, 0.0)
                } else {
                    off
                };
            }
        }
        Ok(self.elevated(shape))
    }

    /// The shape with nodes in the middle of the edges, for elements that have them.
    pub(super) fn elevated(self, shape: Shape) -> Shape {
        match (self, shape) {
            (Self::Quadratic(_), Shape::Solid(mesh)) => Shape::Solid(mesh.quadratic()),
            (_, shape) => shape,
        }
    }

    /// A body of this kind; `material` gives the material of each element.
    pub(super) fn build(
        self,
        shape: &Shape,
        material: impl Fn(usize) -> Isotropic,
        mut config: BodyConfig,
        handles: &[HandleSpec],
    ) -> Result<Body, StudyError> {
        let material = (0..shape.element_count()).map(material);
        let body = match (self, shape) {
            (Self::Linear(law) | Self::Quadratic(law), Shape::Solid(mesh)) => {
                let materials: Vec<_> = material.map(Isotropic::solid).collect();
                Body::solid(mesh, &materials, law, config, handles)
            }
            (Self::Woven(law), Shape::Sheet(mesh)) => {
                let materials: Vec<_> = material.map(Isotropic::weave).collect();
                Body::woven(mesh, &materials, law, config, handles)
            }
            (_, Shape::Sheet(mesh)) => {
                config.bending = 1.0;
                let materials: Vec<_> = material.map(Isotropic::sheet).collect();
                Body::sheet(mesh, &materials, config, handles)
            }
            // A shape comes from `mesh` of the same kind.
            (_, Shape::Solid(_)) => Err(physics::BodyError::Empty),
        };
        Ok(body?)
    }
}

/// A mesh of either dimension.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    Solid(TetMesh),
    Sheet(TriMesh),
}

impl Shape {
    pub(super) fn positions(&self) -> &[Vec3] {
        match self {
            Self::Solid(mesh) => &mesh.positions,
            Self::Sheet(mesh) => &mesh.positions,
        }
    }

    pub(super) fn positions_mut(&mut self) -> &mut [Vec3] {
        match self {
            Self::Solid(mesh) => &mut mesh.positions,
            Self::Sheet(mesh) => &mut mesh.positions,
        }
    }

    fn element_count(&self) -> usize {
        match self {
            Self::Solid(mesh) => mesh.cells.len(),
            Self::Sheet(mesh) => mesh.triangles.len(),
        }
    }

    /// A handle at the end at `side` (-1 or 1) of the x axis.
    pub(super) fn end(&self, side: f64) -> HandleSpec {
        let numbered = (0_u32..).zip(self.positions());
        HandleSpec {
            vertices: numbered
                .filter(|(_, x)| x.x * side > 0.5 - 1e-9)
                .map(|(vertex, _)| vertex)
                .collect(),
            origin: Vec3::x() * (0.5 * side),
            freedom: Freedom::Rigid,
            border: Border::Hinged,
        }
    }

    /// Velocities in waves about as long as the body, of up to `speed` along each axis. The strains in small elements
    /// are no larger than in large ones.
    pub(super) fn waves(&self, speed: f64) -> Vec<Vec3> {
        let wave = |x: &Vec3| {
            let along = |a: f64, b: f64, c: f64| libm::sin(a * x.x + b * x.y + c * x.z + a);
            Vec3::new(
                along(3.0, 1.0, -2.0),
                along(1.0, -3.0, 2.0),
                along(-2.0, 2.0, 3.0),
            ) * speed
        };
        self.positions().iter().map(wave).collect()
    }

    /// A random velocity of every vertex, of up to `speed` along each axis.
    pub(super) fn kick(&self, speed: f64) -> Vec<Vec3> {
        let mut random = Random(11);
        self.positions()
            .iter()
            .map(|_| random.vector() * speed)
            .collect()
    }
}

/// The rest poses of the handles.
pub(super) fn rest_poses(handles: &[HandleSpec]) -> Vec<HandlePose> {
    handles
        .iter()
        .map(|handle| HandlePose::at(handle.origin))
        .collect()
}

/// The material of a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Isotropic {
    /// Young's modulus (Pa).
    pub(super) young: f64,
    /// Poisson's ratio.
    pub(super) poisson: f64,
    /// Density (kg/m^3).
    pub(super) density: f64,
}

/// Thickness of sheets (m).
pub(super) const THICKNESS: f64 = 0.01;

impl Isotropic {
    /// A material with the density of water.
    pub(super) fn new(young: f64, poisson: f64) -> Self {
        Self {
            young,
            poisson,
            density: 1000.0,
        }
    }

    /// Speed of sound in a bar (m/s).
    pub(super) fn sound(self) -> f64 {
        (self.young / self.density).sqrt()
    }

    fn solid(self) -> SolidMaterial {
        SolidMaterial {
            young: self.young,
            poisson: self.poisson,
            density: self.density,
        }
    }

    fn sheet(self) -> Material {
        Material {
            young: self.young,
            poisson: self.poisson,
            thickness: THICKNESS,
            density: self.density,
        }
    }

    /// Twice as stiff along the warp as along the weft, and softer in shear than an isotropic sheet.
    fn weave(self) -> Weave {
        Weave {
            warp: Vec3::new(1.0, 0.4, 0.0),
            young_warp: self.young,
            young_weft: 0.5 * self.young,
            poisson: self.poisson,
            shear: 0.2 * self.young,
            thickness: THICKNESS,
            density: self.density,
            rigidity: physics::Rigidity::default(),
        }
    }
}

/// No gravity, no damping.
pub(super) fn quiet() -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    }
}

/// A linear congruential generator (Knuth's constants), the same on every machine.
pub(super) struct Random(pub(super) u64);

impl Random {
    /// A number between -1 and 1.
    fn signed(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    pub(super) fn vector(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
}
