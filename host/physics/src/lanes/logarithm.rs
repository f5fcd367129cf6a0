//! The logarithm in lanes.

use super::Real;

/// Coefficients of the logarithm: `log((1 + s) / (1 - s)) = 2 s + s R(s^2)`, with an error below 2^-58 for arguments of
/// the logarithm between `sqrt(1/2)` and `sqrt 2` (FreeBSD's `msun`, `e_log.c`, after Sun Microsystems, 1993).
const SERIES: [f64; 7] = [
    0.666_666_666_666_673_5,
    0.399_999_999_994_094_2,
    0.285_714_287_436_623_9,
    0.222_221_984_321_497_84,
    0.181_835_721_616_180_5,
    0.153_138_376_992_093_73,
    0.147_981_986_051_165_86,
];

const LN_2: f64 = core::f64::consts::LN_2;

/// `y - log(1 + y)` for `y > -1`. The digits are kept if `y` is small and the result is near `y^2 / 2`.
#[inline(always)]
pub(crate) fn less_log_1p<T: Real>(y: T) -> T {
    let (one, two) = (T::of(1.0), T::of(2.0));
    let (exponent, mantissa) = (one + y).split();
    // `1 + y = 2^k (1 + f)`. For `k = 0` the number `f` is `y` itself, without the rounding of the sum.
    let rest = mantissa - one;
    let f = if exponent == T::ZERO { y } else { rest };
    let s = f / (two + f);
    let z = s * s;
    let mut series = T::of(SERIES[6]);
    for k in [5, 4, 3, 2, 1, 0] {
        series = T::of(SERIES[k]) + z * series;
    }
    let half = T::of(0.5) * (f * f);
    // log(1 + f) = f - (half - s (half + z R)).
    (y - f) - exponent * T::of(LN_2) + (half - s * (half + z * series))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_is_that_of_the_library() {
        let arguments = (-40..=60).flat_map(|k| {
            let size = libm::exp2(f64::from(k));
            [0.9, -0.74]
                .map(|sign| sign * size)
                .into_iter()
                .filter(|y| *y > -0.75)
        });
        for y in arguments {
            let expected = if y.abs() > 1e-3 {
                y - libm::log1p(y)
            } else {
                // The error of the series is its next term, a fraction of y^4.
                y * y * (0.5 - y * (1.0 / 3.0 - y * (0.25 - y * (0.2 - y / 6.0))))
            };
            // The subtraction of the reference loses up to ten bits.
            let error = (less_log_1p(y) - expected).abs();
            assert!(error < 2e-13 * expected, "{y}: {error:e} {expected:e}");
            let single = f64::from(less_log_1p(y as f32));
            let error = (single - expected).abs();
            assert!(error < 1e-6 * expected, "{y}: {error:e} {expected:e}");
        }
    }
}
