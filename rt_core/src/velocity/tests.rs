use super::*;

const PERIOD: f64 = 1e-3;
const STEP: f64 = 38e-6;
const METHODS: [Method; 5] = [
    Method::LowPass { cutoff: 80.0 },
    Method::EndFit { window: 8 },
    Method::BestFit { window: 8 },
    Method::ConstantVelocity { acceleration: 5.0 },
    Method::ConstantAcceleration { jerk: 1000.0 },
];

fn last(method: Method, position: impl Fn(f64) -> f64) -> f64 {
    let mut estimator = VelocityEstimator::with_method(method, PERIOD, STEP);
    let mut v = Vec3::zeros();
    for k in 0..1000 {
        let x = position(f64::from(k) * PERIOD);
        v = estimator.update(&Vec3::new(x, -x, 0.0));
    }
    assert_eq!((v.y, v.z), (-v.x, 0.0));
    v.x
}

#[test]
fn every_method_recovers_a_ramp() {
    for method in METHODS {
        // A second is at least 30 time constants of each filter. Windows are exact up to the rounding of 0.1 m over 1
        // ms.
        let v = last(method, |t| 0.1 * t);
        assert!((v - 0.1).abs() < 1e-9, "{method:?}: {v}");
    }
}

#[test]
fn a_steady_acceleration_is_late_by_the_stated_delay() {
    // The acceleration is so small that every window is full.
    let a = 0.1;
    for method in METHODS {
        let v = last(method, |t| 0.5 * a * t * t);
        let late = 0.999 - v / a;
        let stated = VelocityEstimator::with_method(method, PERIOD, STEP).delay();
        // Rounding of positions of 0.05 m over a tick.
        assert!((late - stated).abs() < 1e-9, "{method:?}: {late} {stated}");
    }
}

#[test]
fn a_lone_count_is_attenuated() {
    let mut estimator = VelocityEstimator::new(1e-3, VelocityEstimator::DEFAULT_CUTOFF);
    estimator.update(&Vec3::zeros());
    let v = estimator.update(&Vec3::new(38e-6, 0.0, 0.0));
    // g = 1 - exp(-2 pi 80 / 1000) = 0.3951.
    assert!((v.x / 0.038 - 0.3951).abs() < 1e-4, "{}", v.x);
}

#[test]
fn windows_are_long_where_a_line_describes_and_short_where_none_does() {
    for best in [false, true] {
        let mut window = Window::new(8, 1.0, best);
        let mut length = 0.0;
        // Counts of a slow motion.
        for k in 0..40_i32 {
            (_, length) = window.update(f64::from(k / 5));
        }
        assert_eq!(length, 8.0);
        // A reversal at ten counts a tick: the line reaches back no farther than the band hides the reversal.
        let mut window = Window::new(8, 1.0, best);
        for k in 0..20_i32 {
            (_, length) = window.update(-10.0 * f64::from((k - 15).abs()));
        }
        assert_eq!(length, 4.0);
    }
}

#[test]
fn the_fitted_line_is_that_of_least_squares() {
    let mut window = Window::new(4, 1.0, true);
    let positions = [0.0, 0.0, 1.0, 1.0, 2.0];
    let mut slope = 0.0;
    for y in positions {
        (slope, _) = window.update(y);
    }
    // sum (k - 2) y_k / sum (k - 2)^2 = (0 - 0 + 0 + 1 + 4) / 10.
    assert!((slope - 0.5).abs() < 1e-15, "{slope}");
}

#[test]
fn settled_gains_are_kalatas() {
    // Relations between the gains and the index that hold for any derivation of the gains.
    for index in [0.02, 0.5, 4.0] {
        let Gains { alpha, beta, .. } = Gains::constant_velocity(index);
        // Constant velocity, from a closed form: index^2 = beta^2 / (1 - alpha).
        assert!((beta * beta / (1.0 - alpha) / (index * index) - 1.0).abs() < 1e-9);
        // Constant acceleration, from the Riccati equation: gamma = beta^2 / (2 alpha) = index
        // sqrt(1 - alpha).
        let Gains { alpha, beta, gamma } = Gains::constant_acceleration(index);
        assert!((gamma / (beta * beta / (2.0 * alpha)) - 1.0).abs() < 1e-9);
        let wanted = index * libm::sqrt(1.0 - alpha);
        assert!((gamma / wanted - 1.0).abs() < 1e-9, "{gamma} {wanted}");
    }
}

#[test]
fn drivers_look_back_four_milliseconds() {
    let delay = |period| VelocityEstimator::for_encoder(period, STEP).delay();
    assert!((delay(1e-3) - 2e-3).abs() < 1e-15);
    assert!((delay(2.5e-4) - 2e-3).abs() < 1e-15);
    // The longest window is the upper bound, the last position the lower one.
    assert!((delay(1e-4) - 0.8e-3).abs() < 1e-15);
    assert!((delay(1e-2) - 5e-3).abs() < 1e-15);
}

/// A sequence of numbers between zero and one (xorshift, G. Marsaglia 2003).
fn numbers() -> impl FnMut() -> f64 {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[test]
fn a_window_is_as_long_as_the_checks_of_the_paper_allow() {
    let mut number = numbers();
    for band in [0.7, 1.1, 3.3] {
        let mut window = Window::new(8, band, false);
        let mut past: [f64; 400] = [0.0; 400];
        let (mut x, mut v) = (0.0, 0.0);
        for tick in 0..400 {
            v += 0.4 * (number() - 0.5);
            x += v;
            let y = libm::round(x);
            past[tick] = y;
            let (slope, length) = window.update(y);
            // For each length, all points between must lie within the band about the line through the ends.
            let mut wanted = 0;
            for n in 1..=tick.min(8) {
                let steep = (y - past[tick - n]) / n as f64;
                // Positions are whole numbers: no point lies on the edge of the band.
                let off = |i: usize| (y - steep * i as f64 - past[tick - i]).abs();
                if (1..n).any(|i| off(i) > band) {
                    break;
                }
                wanted = n;
            }
            assert_eq!(length, wanted as f64, "{band} {tick}");
            if wanted > 0 {
                let steep = (y - past[tick - wanted]) / wanted as f64;
                assert!((slope - steep).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn a_filter_takes_counts_for_noise_of_the_deviation_of_a_uniform_error() {
    let deviation = STEP / libm::sqrt(12.0);
    let (acceleration, jerk) = (5.0, 1000.0);
    let methods = [
        (
            Method::ConstantVelocity { acceleration },
            Gains::constant_velocity(acceleration * PERIOD * PERIOD / deviation),
        ),
        (
            Method::ConstantAcceleration { jerk },
            Gains::constant_acceleration(jerk * PERIOD * PERIOD * PERIOD / deviation),
        ),
    ];
    for (method, gains) in methods {
        let mut estimator = VelocityEstimator::with_method(method, PERIOD, STEP);
        assert!((estimator.delay() - gains.lag() * PERIOD).abs() < 1e-15);
        estimator.update(&Vec3::zeros());
        let v = estimator.update(&(Vec3::z() * STEP)).z;
        let wanted = gains.beta * STEP / PERIOD;
        assert!((v / wanted - 1.0).abs() < 1e-9, "{method:?} {v} {wanted}");
    }
}
