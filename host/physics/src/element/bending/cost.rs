//! The operations and bytes of the kernel of bending, counted by hand.

use super::scalar::ScalarMatrix;
use crate::cost::Cost;
use crate::element::kernel::Counted;
use crate::lanes::Real;

impl<T: Real> ScalarMatrix<T> {
    /// The cost of the products of all rows and a vector.
    fn read_cost(&self) -> Cost {
        Cost::read(size_of_val(self.row_start.as_slice()))
            + Cost::read(size_of_val(self.columns.as_slice()))
            + Cost::read(size_of_val(self.weights.as_slice()))
            + Cost::flops(6 * self.weights.len())
    }
}

impl<T: Real> Counted for ScalarMatrix<T> {
    fn linearize_cost(&self) -> Option<Cost> {
        // Three sums of the force and six operations of the energy for each row.
        Some(self.read_cost() + Cost::flops(9 * (self.row_start.len() - 1)))
    }

    fn product_cost(&self) -> Option<Cost> {
        Some(self.read_cost() + Cost::flops(6 * (self.row_start.len() - 1)))
    }
}
