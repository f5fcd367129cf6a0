//! Numbers of single or double precision.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

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
    /// The difference between 1 and the next larger number.
    const EPSILON: Self;
    /// The square of a rotation (rad²) after which no further Newton iteration is needed. The next iteration would
    /// rotate by less than this square times the strain.
    const SMALL_TURN: Self;

    /// The nearest number of this precision.
    fn of(value: f64) -> Self;

    /// The same number in double precision.
    fn to_f64(self) -> f64;

    /// The square root.
    fn sqrt(self) -> Self;
}

macro_rules! real {
    ($type:ty, $small_turn:expr) => {
        impl Real for $type {
            const ZERO: Self = 0.0;
            const EPSILON: Self = Self::EPSILON;
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
