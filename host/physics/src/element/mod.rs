//! Elements: forces, energies and stiffness of sets of elements. Each set has an exact form; some sets also have a form
//! for vector instructions.
//!
//! - [`Elements`]: the interface of any set of elements to a body, exact.
//! - `kernel`: the interface of a set to the realtime step, on padded nodes. `placed` and `assembled` are its two
//!   kinds.
//! - `parts`: a large set as several kernels, for several cores.
//! - [`torn`]: how sets follow the edits of a torn surface.
//! - [`tet`]: linear and quadratic tetrahedra: any law in exact form, any isotropic law and Hooke's law in vectors.
//! - [`triangle`]: membranes, with or without a grain.
//! - [`truss`]: bars of a thread, a suture or a net.
//! - [`bending`]: the resistance of a sheet to bending.
//!
//! This file alone registers elements. Each kind needs a line that names its folder. A kind with a kernel for vector
//! instructions also needs a variant of [`VectorForm`] and the arm that makes the kernel.

mod assembled;
pub mod bending;
pub mod elements;
pub(crate) mod kernel;
pub(crate) mod parts;
pub(crate) mod placed;
pub mod precision;
pub mod tet;
pub mod torn;
pub mod triangle;
pub mod truss;

pub use elements::Elements;
pub use torn::{Strained, Tearable, Torn};
pub use triangle::membrane::Element;

use crate::Vec3;
use crate::lanes::Real;
use crate::linear::block_matrix::BlockMatrix;
use crate::material::law::{Frame, IsotropicLaw};
use assembled::Assembled;
use kernel::Kernel;
use parts::{Divided, Listed, cut};
use precision::Precision;
use tet::cell::{Four, QuadraticTet, Ten, Tet};
use tet::{hooke, principal};
use triangle::triangles::{self, Triangle};

/// A set of elements as the list from which a kernel for vector instructions is made. Nodes are in the set's numbering.
#[derive(Clone, Debug)]
pub enum VectorForm {
    /// Linear tetrahedra under Hooke's law in a frame.
    HookeanTets(Frame, Vec<Tet>),
    /// Quadratic tetrahedra under Hooke's law in a frame.
    HookeanQuadraticTets(Frame, Vec<QuadraticTet>),
    /// Linear tetrahedra of a law in principal axes.
    IsotropicTets(IsotropicLaw, Vec<Tet>),
    /// Quadratic tetrahedra of a law in principal axes.
    IsotropicQuadraticTets(IsotropicLaw, Vec<QuadraticTet>),
    /// Corotational membrane triangles.
    CorotationalTriangles(Vec<Triangle>),
}

/// Lists of elements that can be cut into parts.
macro_rules! listed {
    ($($element:ty),*) => {$(
        impl Listed for $element {
            fn nodes(&self) -> &[u32] {
                &self.nodes
            }

            fn nodes_mut(&mut self) -> &mut [u32] {
                &mut self.nodes
            }
        }
    )*};
}

listed!(Tet, QuadraticTet, Triangle);

impl VectorForm {
    /// The kernel of the elements, with the slots of their blocks in `matrix`.
    fn generic_kernel<T: Real>(self, matrix: &BlockMatrix) -> Box<dyn Kernel<T>> {
        match self {
            Self::HookeanTets(frame, tets) => hooke::kernel::<T, Four, _, _>(frame, &tets, matrix),
            Self::HookeanQuadraticTets(frame, tets) => {
                hooke::kernel::<T, Ten, _, _>(frame, &tets, matrix)
            }
            Self::IsotropicTets(law, tets) => {
                principal::kernel::<T, Four, _, _>(law, &tets, matrix)
            }
            Self::IsotropicQuadraticTets(law, tets) => {
                principal::kernel::<T, Ten, _, _>(law, &tets, matrix)
            }
            Self::CorotationalTriangles(triangles) => triangles::kernel(&triangles, matrix),
        }
    }

    /// The kernel of the elements, compiled in this crate.
    fn kernel<T: Precision>(self, matrix: &BlockMatrix) -> Box<dyn Kernel<T>> {
        T::kernel(self, matrix).0
    }

    /// The parts of a large set, each with the places of its nodes; none for a small set. The nodes are at `rest` (m).
    fn in_parts(&self, rest: &[Vec3]) -> Vec<(Self, Vec<u32>)> {
        match self {
            Self::HookeanTets(frame, tets) => {
                forms(tets, rest, |tets| Self::HookeanTets(*frame, tets))
            }
            Self::HookeanQuadraticTets(frame, tets) => {
                forms(tets, rest, |tets| Self::HookeanQuadraticTets(*frame, tets))
            }
            Self::IsotropicTets(law, tets) => {
                forms(tets, rest, |tets| Self::IsotropicTets(*law, tets))
            }
            Self::IsotropicQuadraticTets(law, tets) => {
                forms(tets, rest, |tets| Self::IsotropicQuadraticTets(*law, tets))
            }
            Self::CorotationalTriangles(triangles) => {
                forms(triangles, rest, Self::CorotationalTriangles)
            }
        }
    }
}

fn forms<E: Listed>(
    elements: &[E],
    rest: &[Vec3],
    form: impl Fn(Vec<E>) -> VectorForm,
) -> Vec<(VectorForm, Vec<u32>)> {
    let cuts = cut(elements, rest).into_iter();
    cuts.map(|cut| cut.form(&form)).collect()
}

/// The kernel of `elements`, whose nodes are in the solver's order: the kernel of their vector form if they have one,
/// otherwise their assembled matrix. `matrix` has the pattern of the body's stiffness, and `rest` contains the rest
/// positions of the nodes (m).
pub(crate) fn kernel<T: Precision>(
    mut elements: Box<dyn Elements>,
    matrix: &BlockMatrix,
    rest: &[Vec3],
) -> Box<dyn Kernel<T>> {
    if let Some(form) = elements.vector_form() {
        return form.kernel(matrix);
    }
    let places: Vec<u32> = (0..matrix.nodes() as u32).collect();
    elements.bind(matrix, &places);
    Box::new(Assembled::new(elements, matrix, rest))
}

/// The elements as a stepper computes them: the [`kernel`] in parts if the set is large.
pub(crate) fn divided<T: Precision>(
    elements: Box<dyn Elements>,
    matrix: &BlockMatrix,
    rest: &[Vec3],
) -> Divided<T> {
    let form = elements.vector_form();
    let parts = form.map_or_else(Vec::new, |form| form.in_parts(rest));
    if parts.is_empty() {
        Divided::Whole(kernel(elements, matrix, rest))
    } else {
        Divided::parts(parts, rest.len())
    }
}
