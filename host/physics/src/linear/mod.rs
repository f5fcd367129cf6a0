//! Systems of linear equations: matrices, orderings, factors and iterations, each once.
//!
//! - [`block_matrix`]: symmetric matrices in 3 x 3 blocks on a fixed pattern.
//! - `step_matrix`: the matrix of a step, as every solver reads it.
//! - [`dense`]: the small dense matrices between handles.
//! - [`pcg`]: conjugate gradients on an assembled matrix; `vectors`: the same on padded nodes, pass by pass.
//! - [`order`], [`supernodes`]: in which order nodes are eliminated, and which columns of the factor go together.
//! - `sparse_cholesky`: a sparse factorization; [`cholesky`]: that of a body's matrix, for dense right-hand sides.
//! - [`factor`], [`panel`], `sweep`: a frozen factor as a preconditioner.
//! - [`incomplete`]: an incomplete one with a coarse space, for bodies whose complete one is too large.
//! - [`precondition`]: which of the two preconditions a step.

pub mod block_matrix;
pub mod cholesky;
pub mod dense;
pub mod factor;
pub mod incomplete;
pub mod order;
pub mod panel;
pub mod pcg;
pub mod precondition;
pub(crate) mod sparse_cholesky;
pub(crate) mod step_matrix;
pub mod supernodes;
mod sweep;
pub(crate) mod vectors;
