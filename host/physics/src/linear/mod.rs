//! Systems of linear equations: matrices, orderings, factors and iterations.
//!
//! - [`block_matrix`]: symmetric matrices in 3 x 3 blocks on a fixed pattern.
//! - `step_matrix`: the matrix of a step, as every solver reads it.
//! - [`places`]: the rows of the nodes in a matrix.
//! - [`dense`]: the small dense matrices between handles.
//! - [`pcg`]: conjugate gradients on an assembled matrix; `vectors`: the same on padded nodes, pass by pass.
//! - [`order`], [`supernodes`]: in which order nodes are eliminated, and which columns of the factor go together.
//! - `sparse_cholesky`: a sparse factorization; [`cholesky`]: that of a body's matrix, for dense right-hand sides.
//! - [`factor`], [`panel`], `sweep`: a frozen factor as a preconditioner; `packed`, `subtrees`: a large one, in 16 bits and
//!   on several cores.
//! - [`incomplete`]: an incomplete factor with a coarse space, for bodies whose complete factor is too large.
//! - [`torn`]: nodes that a tear adds beside an old factor.
//! - [`precondition`]: the choice between the two preconditioners of a step.

pub mod block_matrix;
pub mod cholesky;
pub mod dense;
pub mod factor;
pub mod incomplete;
pub mod order;
mod packed;
pub mod panel;
pub mod pcg;
pub mod places;
pub mod precondition;
pub(crate) mod read_ahead;
pub(crate) mod sparse_cholesky;
pub(crate) mod step_matrix;
mod subtrees;
pub mod supernodes;
mod sweep;
pub mod torn;
pub(crate) mod vectors;
