//! Numbers of either precision.

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
    /// The gap between 1 and the next number.
    const EPSILON: Self;
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
