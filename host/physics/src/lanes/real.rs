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
    /// The precision of differences of large numbers, at least this one.
    type Wide: Real;

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

    /// The same number in the wide precision.
    fn widen(self) -> Self::Wide;

    /// The nearest number of this precision.
    fn narrow(value: Self::Wide) -> Self;

    /// The square root.
    fn sqrt(self) -> Self;

    /// The exponent `k` and the factor `m` of a positive normal number `2^k m`, with `m` from `sqrt(1/2)` to `sqrt 2`. Of
    /// other numbers the result is arbitrary.
    fn split(self) -> (Self, Self);
}

macro_rules! real {
    ($type:ty, $bits:ty, $half_root:expr, $small_turn:expr) => {
        impl Real for $type {
            type Wide = f64;

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
            fn widen(self) -> f64 {
                self.into()
            }

            #[inline(always)]
            fn narrow(value: f64) -> Self {
                value as Self
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                Self::sqrt(self)
            }

            // Integers of the width of the number and logical shifts alone, which all vector instructions have.
            #[inline(always)]
            fn split(self) -> (Self, Self) {
                const DIGITS: u32 = <$type>::MANTISSA_DIGITS - 1;
                const BIAS: $bits = <$type>::MAX_EXP as $bits - 1;
                let least: $bits = $half_root;
                let raised = self.to_bits().wrapping_add((BIAS << DIGITS) - least);
                let mantissa = (raised & ((1 << DIGITS) - 1)) + least;
                // An integer below `2^DIGITS` in the last digits of the number `2^DIGITS`.
                let whole = ((BIAS + DIGITS as $bits) << DIGITS) | (raised >> DIGITS);
                let offset = ((1 as $bits) << DIGITS) + BIAS;
                (
                    Self::from_bits(whole) - offset as Self,
                    Self::from_bits(mantissa),
                )
            }
        }
    };
}

real!(f32, u32, 0x3f35_04f3, 1e-7);
real!(f64, u64, 0x3fe6_a09e_667f_3bcd, 1e-13);
