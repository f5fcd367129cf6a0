//! The errors of a body, a step and a condensation.

use crate::mesh::PatternError;
use crate::topology::{EditError, SurfaceError};
use thiserror::Error;

/// The reason why a body could not be built, or an input to a body was refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum BodyError {
    /// The mesh has no element.
    #[error("the mesh has no elements; a body needs at least one")]
    Empty,
    /// A vertex position is not a finite number.
    #[error("vertex {vertex} has a position that is not finite")]
    Position {
        /// The vertex.
        vertex: usize,
    },
    /// An element names a vertex that does not exist.
    #[error("element {element} names vertex {vertex}, but the mesh has {count} vertices")]
    ElementVertex {
        /// The triangle or cell.
        element: usize,
        /// The vertex that it names.
        vertex: u32,
        /// Number of vertices in the mesh.
        count: usize,
    },
    /// A triangle has no area at rest.
    #[error(
        "triangle {triangle} has no area at rest ({area:e} m^2 for edges of {edge:e} m); \
         remove this triangle or move its vertices apart"
    )]
    Degenerate {
        /// The triangle.
        triangle: usize,
        /// Its area (m^2).
        area: f64,
        /// Its longest edge (m).
        edge: f64,
    },
    /// The flat pattern of a sheet is wrong.
    #[error(transparent)]
    Pattern(#[from] PatternError),
    /// A line has no length at rest, or so little that its stiffness is infinite.
    #[error(
        "line {line} has no length at rest ({length:e} m); remove this line or move its vertices apart"
    )]
    NoLength {
        /// The line.
        line: usize,
        /// Its length (m).
        length: f64,
    },
    /// A cell is flat or inverted at rest.
    #[error(
        "cell {cell} is flat or inverted at rest; remove this cell, move its vertices apart, or \
         exchange two of its vertices"
    )]
    FlatCell {
        /// The cell.
        cell: usize,
    },
    /// There is no such handle.
    #[error("handle {handle} does not exist: the body has {count} handles, counted from 0")]
    NoHandle {
        /// The number of the requested handle.
        handle: usize,
        /// Number of handles.
        count: usize,
    },
    /// A vertex belongs to no element, so that it has no mass.
    #[error(
        "vertex {vertex} belongs to no element and so has no mass; remove this vertex from the mesh"
    )]
    Unreferenced {
        /// The vertex.
        vertex: usize,
    },
    /// A material parameter is out of range.
    #[error("material of element {element}: `{field}` is {found}, expected {expected}")]
    Material {
        /// The triangle or cell.
        element: usize,
        /// The field of [`Material`](crate::material::Material).
        field: &'static str,
        /// Its value.
        found: f64,
        /// What is allowed.
        expected: &'static str,
    },
    /// The warp of a woven material has no direction in the plane of a triangle.
    #[error(
        "the warp of triangle {triangle} is normal to the triangle: {fraction:e} of its length lies in the triangle's \
         plane; give a direction along the cloth"
    )]
    Warp {
        /// The triangle.
        triangle: usize,
        /// Sine of the angle between the warp and the triangle's normal; not a number for a warp without a direction.
        fraction: f64,
    },
    /// The number of materials is neither one nor the number of elements.
    #[error(
        "{found} materials are given; expected one material for all elements, or one for each of the \
         {elements} elements"
    )]
    MaterialCount {
        /// The number of materials given.
        found: usize,
        /// Number of triangles or cells.
        elements: usize,
    },
    /// A field of the configuration is out of range.
    #[error("configuration: `{field}` is {found}, expected {expected}")]
    Config {
        /// The field of [`BodyConfig`](crate::body::BodyConfig).
        field: &'static str,
        /// Its value.
        found: f64,
        /// What is allowed.
        expected: &'static str,
    },
    /// A handle holds no vertex.
    #[error("handle {handle} holds no vertices; give the handle at least one vertex")]
    EmptyHandle {
        /// The handle.
        handle: usize,
    },
    /// A handle names a vertex that does not exist.
    #[error("handle {handle} names vertex {vertex}, but the mesh has {count} vertices")]
    HandleVertex {
        /// The handle.
        handle: usize,
        /// The vertex that it names.
        vertex: u32,
        /// Number of vertices in the mesh.
        count: usize,
    },
    /// A vertex belongs to two handles, or twice to one handle.
    #[error(
        "vertex {vertex} is held by handle {first} and again by handle {second}; a vertex may be held once"
    )]
    SharedVertex {
        /// The vertex.
        vertex: u32,
        /// The handle that holds the vertex first.
        first: usize,
        /// The handle that names the vertex again; the same handle if it lists the vertex twice.
        second: usize,
    },
    /// A support has no vertex, no axis, or a vertex that does not exist.
    #[error(
        "support {support}: {found}; give the support at least one vertex of the mesh and one axis"
    )]
    Support {
        /// The support.
        support: usize,
        /// What is wrong with it.
        found: &'static str,
    },
    /// A vertex belongs to a handle and to a support.
    #[error(
        "vertex {vertex} is held by handle {handle} and guided by support {support}; choose one of the two"
    )]
    HeldAndGuided {
        /// The vertex.
        vertex: u32,
        /// The handle.
        handle: usize,
        /// The support.
        support: usize,
    },
    /// A handle or a support cannot clamp the border of the body.
    #[error(
        "{part} {number} cannot clamp the border of the body: {found}; make this border hinged"
    )]
    Clamp {
        /// `handle` or `support`.
        part: &'static str,
        /// Its number.
        number: usize,
        /// The reason.
        found: &'static str,
    },
    /// The pose at which a handle is to hold its vertices is not finite.
    #[error("handle {handle} is to hold its vertices at a pose that is not finite")]
    Pose {
        /// The handle.
        handle: usize,
    },
    /// A map leads from a vertex, handle or support that the old body does not have.
    #[error(
        "the {part} leads from number {found}, but the old body has {count} of them, counted from 0"
    )]
    Map {
        /// The part of the map.
        part: &'static str,
        /// The number that does not exist.
        found: usize,
        /// How many the old body has.
        count: usize,
    },
    /// A vertex of a new body continues one that has left the scene.
    #[error(
        "vertex {vertex} continues vertex {from}, which has left the scene with its piece; let it continue a vertex that \
         is still there"
    )]
    Left {
        /// The vertex of the new body.
        vertex: u32,
        /// The vertex of the old body.
        from: u32,
    },
    /// The origin of a handle is not a finite number.
    #[error("handle {handle} has an origin that is not finite")]
    HandleOrigin {
        /// The handle.
        handle: usize,
    },
    /// Bending is on, but more than two triangles meet at an edge.
    #[error(
        "{count} triangles meet at the edge between vertices {a} and {b}, and the bending model allows \
         two; repair the mesh or set `bending` to 0"
    )]
    NonManifold {
        /// One end of the edge.
        a: u32,
        /// The other end.
        b: u32,
        /// The number of triangles at the edge.
        count: usize,
    },
    /// An array that should hold one entry per vertex has another length.
    #[error("`{quantity}` has {found} entries, expected one for each of {expected} vertices")]
    Length {
        /// The name of the array.
        quantity: &'static str,
        /// Its length.
        found: usize,
        /// Number of vertices.
        expected: usize,
    },
    /// An array holds a number that is not finite.
    #[error("`{quantity}` of vertex {vertex} is not finite")]
    NotFinite {
        /// The name of the array.
        quantity: &'static str,
        /// The vertex.
        vertex: usize,
    },
}

/// The reason why a step was refused. The body keeps its last good state.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum StepError {
    /// The step length is not positive.
    #[error("the step length is {found} s, expected a positive, finite number")]
    StepLength {
        /// The length (s).
        found: f64,
    },
    /// The load factor is not finite.
    #[error("the load factor is {found}, expected a finite number")]
    Load {
        /// The factor.
        found: f64,
    },
    /// The number of target poses differs from the number of handles.
    #[error("{found} target poses are given for {expected} handles")]
    Targets {
        /// The number of target poses given.
        found: usize,
        /// Number of handles.
        expected: usize,
    },
    /// A target pose is not finite.
    #[error("the target pose of handle {handle} is not finite")]
    Target {
        /// The handle.
        handle: usize,
    },
    /// The forces for the end of the step were refused.
    #[error(transparent)]
    Forces(BodyError),
    /// The calls of a step were not made in their order, or the topology epoch of the body changed between two calls.
    #[error("`{call}` was called on a step before `{first}` was called")]
    Order {
        /// The call that was made.
        call: &'static str,
        /// The call that has to come first.
        first: &'static str,
    },
    /// `solve` was called without `assemble` since the state last changed.
    #[error(
        "forces and stiffness are not those of the present state; call `assemble` before `solve`"
    )]
    NotAssembled,
    /// The solution is not finite: a target is too far away, or the state had already diverged.
    #[error(
        "the step gave a motion that is not finite after {iterations} iterations; the last state is kept"
    )]
    Diverged {
        /// Iterations spent.
        iterations: usize,
    },
    /// Newton's method did not reach its tolerance, even with the smallest step.
    #[error(
        "no balance of forces was found: a residual of {residual:e} N among forces of {reference:e} N is left after \
         {iterations} iterations of the smallest step; the last state is kept. Is the body held, and can \
         the body reach the prescribed displacements?"
    )]
    NotConverged {
        /// Iterations of the last attempt.
        iterations: usize,
        /// Norm of the residual (N).
        residual: f64,
        /// Norm of the forces that should balance (N).
        reference: f64,
    },
    /// Rounding leaves so much of the motion undetermined that it is not solved.
    #[error(
        "too few digits: the body moves by {moved:e} m, of which rounding leaves {open:e} m undetermined, because its \
         coordinates go up to {place:e} m, and numbers of that size are {:.1e} m apart; the last state is kept. {}",
        place * f64::EPSILON,
        rounding_advice(*place, *size)
    )]
    Rounding {
        /// The largest motion of a node that was not solved, or that its coordinates cannot resolve (m).
        open: f64,
        /// The largest motion of a node from rest (m).
        moved: f64,
        /// The largest coordinate (m).
        place: f64,
        /// Longest edge of the box around the body at rest (m).
        size: f64,
    },
    /// Even with the smallest step, every balance that was found inverts further elements.
    #[error(
        "{count} elements would be inverted by the smallest step; the last state is kept. Use a law that allows \
         inverted elements (stable neo-Hookean), or prescribe smaller displacements and loads"
    )]
    Inverted {
        /// Inverted elements after the last attempt.
        count: usize,
    },
    /// The matrix could not be factorized.
    #[error(transparent)]
    Matrix(#[from] CondenseError),
}

/// Advice for a body whose coordinates have too few digits.
fn rounding_advice(place: f64, size: f64) -> &'static str {
    if place > 10.0 * size {
        "Move the body nearer to the origin"
    } else {
        "Prescribe larger loads or displacements: the body is too stiff for these"
    }
}

/// The reason why a condensation was refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CondenseError {
    /// The publication period is not positive.
    #[error("the publication period is {found} s, expected a positive, finite number")]
    Period {
        /// The period (s).
        found: f64,
    },
    /// The body was never assembled.
    #[error("the body has no stiffness yet; call `assemble` before `condense`")]
    NotAssembled,
    /// The body is not the one for which the condenser was made.
    #[error("the body's topology is not the one for which this condenser was made")]
    Topology,
    /// The symbolic factorization failed: out of memory, or too many entries for its index type.
    #[error("the symbolic factorization of {unknowns} unknowns failed: {reason}")]
    Symbolic {
        /// Number of scalar unknowns.
        unknowns: usize,
        /// The message of the linear algebra library.
        reason: String,
    },
    /// The matrix of the free vertices is not positive definite, or not finite.
    #[error(
        "the matrix of the free vertices is not positive definite (pivot {pivot}); the state is not usable"
    )]
    NotPositiveDefinite {
        /// The pivot at which the factorization stopped, in elimination order.
        pivot: usize,
    },
}

/// The reason why a sheet could not be made tearable, or was not torn.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TearingError {
    /// The body is of a kind that cannot tear.
    #[error("a body with {found} cannot tear; only a sheet of triangles with hinged borders can")]
    Kind {
        /// The property that excludes tearing.
        found: &'static str,
    },
    /// The triangles form no surface.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// A handle holds both sides.
    #[error("a handle holds vertex {vertex}, so no tear can part it")]
    Held {
        /// The vertex.
        vertex: u32,
    },
    /// The surface refused the edit.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// A tear cannot begin at the tip.
    #[error("vertex {vertex} is no tip: it is not on a border of the sheet")]
    Tip {
        /// The vertex.
        vertex: u32,
    },
    /// A parameter of the law is out of range.
    #[error(transparent)]
    Law(#[from] crate::tear::TearError),
}

impl TearingError {
    /// Whether the reserve of vertices or triangles is used up.
    pub fn is_full(&self) -> bool {
        matches!(self, Self::Edit(EditError::Full { .. }))
    }
}
