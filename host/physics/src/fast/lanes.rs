//! Numbers of either precision, and node vectors to and from arrays over elements.
//!
//! Elements come in blocks of [`LANES`]. What belongs to a block is stored by component: the same component
//! of all its elements side by side. Work on a block is a loop over its lanes whose body is plain arithmetic
//! on one element: the compiler makes vector instructions of it, of whatever width the machine has, and
//! since it may neither reorder sums nor fuse a product into a sum, every width gives the same bytes.

use super::Node;
use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Elements in a block: two or four of the widest vectors.
pub const LANES: usize = 32;

/// One number for each element of a block.
pub type Lanes<T> = [T; LANES];

/// `f32` or `f64`.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + Send
    + Sync
    + 'static
{
    /// Zero.
    const ZERO: Self;
    /// The square of a turn (rad) after which no further Newton iteration of a rotation is needed: the next
    /// would turn by less than its square times the strain.
    const SMALL_TURN: Self;

    /// The nearest number of this precision.
    fn of(value: f64) -> Self;

    /// In double precision.
    fn to_f64(self) -> f64;

    /// The square root.
    fn sqrt(self) -> Self;
}

macro_rules! real {
    ($type:ty, $small_turn:expr) => {
        impl Real for $type {
            const ZERO: Self = 0.0;
            const SMALL_TURN: Self = $small_turn;

            #[inline(always)]
            fn of(value: f64) -> Self {
                value as Self
            }

            #[inline(always)]
            fn to_f64(self) -> f64 {
                self.into()
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                Self::sqrt(self)
            }
        }
    };
}

real!(f32, 1e-7);
real!(f64, 1e-13);

/// Differences of the vectors `of` at each element's last three nodes from that at its first: component `i`
/// of difference `a` in row `3 a + i`.
#[inline(always)]
pub fn gather<T: Real>(nodes: &[[u32; 4]; LANES], of: &[Node<T>], rows: &mut [Lanes<T>; 9]) {
    for (lane, &[first, others @ ..]) in nodes.iter().enumerate() {
        let first = of[first as usize];
        for (a, other) in others.into_iter().enumerate() {
            let other = of[other as usize];
            for i in 0..3 {
                rows[3 * a + i][lane] = other[i] - first[i];
            }
        }
    }
}

/// Adds `rows`, laid out as in [`gather`], to the vectors `to` at each element's last three nodes, and
/// subtracts their sum at its first.
#[inline(always)]
pub fn scatter<T: Real>(nodes: &[[u32; 4]; LANES], rows: &[Lanes<T>; 9], to: &mut [Node<T>]) {
    for (lane, &[first, others @ ..]) in nodes.iter().enumerate() {
        let mut sum = [T::ZERO; 4];
        for (a, other) in others.into_iter().enumerate() {
            let row = |i: usize| rows[3 * a + i][lane];
            let value = [row(0), row(1), row(2), T::ZERO];
            let other = &mut to[other as usize];
            for i in 0..4 {
                other[i] += value[i];
                sum[i] += value[i];
            }
        }
        let first = &mut to[first as usize];
        for i in 0..4 {
            first[i] -= sum[i];
        }
    }
}
