//! The results of `palpate bench velocity` for the estimate of the drivers, compared with the other estimates.

use rt_core::velocity::{Method, VelocityEstimator, most_damping};
use std::sync::LazyLock;
use study::velocity::{CANDIDATES, Mean, Motion, VelocityStudy, run};

static FOUND: LazyLock<VelocityStudy> = LazyLock::new(|| run(&mut |_| {}));

fn of(method: &str) -> &'static Mean {
    let mut means = FOUND.means.iter();
    means
        .find(|mean| mean.method == method)
        .expect("it was tried")
}

#[test]
fn the_drivers_estimate_errs_least_among_the_equally_fast() {
    let used = CANDIDATES[1];
    assert_eq!((used.at)(1e-3), Method::BestFit { window: 4 });
    let ours = of(used.name);
    // The limit is two milliseconds, the delay of the low-pass of 80 Hz.
    assert!((ours.delay - 2e-3).abs() < 1e-12);
    for mean in &FOUND.means {
        let quick = mean.delay < 1.05 * ours.delay;
        // Filters with a state of acceleration have no lag for a velocity that grows steadily, but they overshoot: only
        // little damping is stable.
        let bears = mean.stable > 0.75 * ours.stable;
        if quick && bears {
            assert!(mean.all >= ours.all, "{mean:?}");
        }
    }
}

#[test]
fn the_drivers_estimate_is_better_than_the_filter_before_it() {
    let (old, ours) = (of("low-pass, 80 Hz"), of("best fit, 4 ms"));
    // For press, rub, hand and tap, the error is 18, 29, 25 and 47 % smaller.
    for (k, least) in [0.15, 0.25, 0.2, 0.4].into_iter().enumerate() {
        let gain = 1.0 - ours.rms[k] / old.rms[k];
        assert!(gain > least, "{:?}: {gain}", Motion::ALL[k]);
    }
    // In a hold at a boundary of counts, the error is a twentieth larger.
    assert!(ours.rms[4] < 1.1 * old.rms[4]);
    assert!(ours.chatter < 0.9 * old.chatter);
}

#[test]
fn the_allowed_damping_is_stable_on_every_device() {
    for (device, model) in sim::DeviceModel::spatial() {
        for row in FOUND.rows.iter().filter(|row| row.device == device) {
            if row.method != "best fit, 4 ms" {
                continue;
            }
            let period = 1.0 / row.rate;
            let delay = VelocityEstimator::for_encoder(period, model.position_step).delay();
            assert_eq!(row.delay, delay);
            let allowed = most_damping(model.mass, period, delay);
            let times = row.stable / allowed;
            assert!(times > 2.5, "{device} {}: {times}", row.rate);
        }
    }
}
