//! Meshes, finite elements and condensation: pure computation.
//!
//! Every item is a plain function or struct over state and time step. There are no threads, clocks, files or printing,
//! and no knowledge of devices. A mesh is given as arrays, time as the length of a step, and every budget as a number
//! of iterations. For this reason a run repeats to the byte.
//!
//! Each folder is a room. Rooms import downwards only, as `tests/tests/rooms.rs` checks:
//!
//! - [`condense`]: the condensation of a body onto its handles.
//! - [`motion`]: steps and equilibria of a body.
//! - [`contact`]: which surfaces may touch, and the law of a contact.
//! - [`body`]: a deformable body with handles and supports.
//! - [`element`]: sets of elements, in exact form and in a form for vector instructions.
//! - [`tear`]: when and where a sheet tears, and how it lets go.
//! - [`material`]: laws. [`polar`]: rotations and stretches.
//! - [`linear`]: systems of linear equations.
//! - [`lanes`]: numbers laid out for vector instructions. [`cost`]: the cost of a pass over arrays.
//! - [`mesh`]: line, triangle and tetrahedral meshes, their checks and generators.
//! - [`topology`]: a triangle surface that can be torn.
//! - [`error`]: the errors of a body, a step and a condensation.
//!
//! The main types are exported here under their own names.
//!
//! A block of rubber between two handles is compressed by a tenth:
//!
//! ```
//! use physics::mesh::generate_box::solid_box;
//! use physics::{
//!     Body, BodyConfig, Border, Equilibrium, EquilibriumOptions, Freedom, HandlePose, HandleSpec, SolidLaw,
//!     SolidMaterial, Vec3,
//! };
//!
//! let mesh = solid_box([0.1; 3], [2; 3])?;
//! let handles = ["bottom", "top"].map(|name| {
//!     let group = mesh.vertex_groups.iter().find(|group| group.name == name);
//!     HandleSpec {
//!         vertices: group.map_or(Vec::new(), |group| group.members.clone()),
//!         origin: Vec3::zeros(),
//!         freedom: Freedom::Fixed,
//!         border: Border::Hinged,
//!     }
//! });
//! let rubber = SolidMaterial { young: 1e5, poisson: 0.3, density: 1000.0 };
//! let config = BodyConfig { gravity: Vec3::zeros(), ..BodyConfig::default() };
//! let mut body = Body::solid(&mesh, &[rubber], SolidLaw::StableNeoHookean, config, &handles)?;
//!
//! let poses = [0.0, -0.01].map(|z| HandlePose::at(Vec3::new(0.0, 0.0, z)));
//! Equilibrium::new(&body, EquilibriumOptions::default())?.solve(&mut body, &poses, 1.0)?;
//! // The upper face pushes the hand up with about E A times the strain, 100 N.
//! let force = body.handle_report(1).expect("the second handle").wrench_on_hand.force;
//! assert!((90.0..130.0).contains(&force.z));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub mod body;
#[doc(hidden)]
pub mod compiled;
pub mod condense;
pub mod contact;
pub mod cost;
pub mod element;
pub mod error;
pub mod lanes;
pub mod linear;
pub mod material;
pub mod mesh;
pub mod motion;
pub mod polar;
pub mod team;
pub mod tear;
pub mod topology;

pub use body::border::Border;
pub use body::handle::{Freedom, HandlePose, HandleReport, HandleSpec, Wrench};
pub use body::support::SupportSpec;
pub use body::{Body, BodyConfig, BodyEdit, BodyMap, PieceSums, SheetLawName, SolidLaw};
pub use condense::{
    Around, Beside, Condensed, Condenser, Footprint, Held, ShapeOptions, ShapeReport, Shapes,
    SiteCompliance, resultant,
};
pub use cost::Cost;
pub use element::Elements;
pub use element::precision::Precision;
pub use error::{BodyError, CondenseError, StepError, TearingError};
pub use lanes::{Node, Real};
pub use linear::block_matrix::BlockMatrix;
pub use linear::pcg::{Budget, SolveReport};
pub use linear::places::Places;
pub use linear::precondition::Preconditioner;
pub use linear::sparse_cholesky::FactorCode;
pub use material::{Material, Rigidity, SolidMaterial, Tangent, ThreadMaterial, Weave};
pub use motion::{
    Cohesion, Course, Equation, Equilibrium, EquilibriumOptions, EquilibriumReport, Grown, Guess,
    Integrator, IntegratorOptions, IsClear, Ledger, NewtonOptions, NewtonReport, Phase, Refresher,
    Starts, StepReport, Stepper, StepperOptions, StepperReport, TearLimit, TearOptions, TearReport,
    Tearing, TimeScheme, complete_bytes,
};
pub use team::{Alone, Team};

/// A vector in three dimensions (m, m/s or N, as its name says).
pub type Vec3 = nalgebra::Vector3<f64>;
/// A 3 x 3 matrix.
pub type Mat3 = nalgebra::Matrix3<f64>;
/// A stiffness against translations and rotations, stacked.
pub type Mat6 = nalgebra::Matrix6<f64>;
