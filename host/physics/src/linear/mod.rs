//! Systems of linear equations: matrices, orderings, factors and iterations.
//!
//! - [`block_matrix`]: symmetric matrices in 3 x 3 blocks on a fixed pattern.
//! - [`dense`]: the small dense matrices between handles.
//! - [`pcg`]: conjugate gradients on an assembled matrix; `vectors`: their vector operations on padded nodes.
//! - [`order`], [`supernodes`]: the order in which nodes are eliminated, and the grouping of the factor's columns.
//! - `sparse_cholesky`: a sparse factorization; [`cholesky`]: the factorization of a body's matrix.
//! - [`factor`], [`panel`], `sweep`: a frozen factor as a preconditioner.
//! - [`incomplete`]: an incomplete factor with a coarse space, for bodies whose complete factor is too large.
//! - [`precondition`]: the choice between the two preconditioners of a step.

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
pub mod supernodes;
mod sweep;
pub(crate) mod vectors;
