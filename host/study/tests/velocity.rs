//! What `palpate bench velocity` says for the estimate that drivers use, and against the others.

use rt_core::velocity::{Method, VelocityEstimator, most_damping};
use std::sync::LazyLock;
use study::velocity::{CANDIDATES, Mean, Motion, VelocityStudy, run};

static FOUND: LazyLock<VelocityStudy> = LazyLock::new(|| run(|_| {}));

fn of(method: &str) -> &'static Mean {
    let mut means = FOUND.means.iter();
    means
        .find(|mean| mean.method == method)
        .expect("it was tried")
}

#[test]
fn drivers_use_what_errs_least_among_those_as_quick() {
    let used = CANDIDATES[1];
    assert_eq!((used.at)(1e-3), Method::BestFit { window: 4 });
    let ours = of(used.name);
    // Two milliseconds, as the low-pass of 80 Hz.
    assert!((ours.delay - 2e-3).abs() < 1e-12);
    for mean in &FOUND.means {
        let quick = mean.delay < 1.05 * ours.delay;
        // Filters of acceleration have no lag where velocity grows steadily, and overshoot: little
        // damping is stable.
        let bears = mean.stable > 0.75 * ours.stable;
        if quick && bears {
            assert!(mean.all >= ours.all, "{mean:?}");
        }
    }
}

#[test]
fn the_estimate_in_use_is_better_than_the_filter_it_replaced() {
    let (old, ours) = (of("low-pass, 80 Hz"), of("best fit, 4 ms"));
    // Press, rub, hand, tap: 18, 29, 25, 47 % less.
    for (k, least) in [0.15, 0.25, 0.2, 0.4].into_iter().enumerate() {
        let gain = 1.0 - ours.rms[k] / old.rms[k];
        assert!(gain > least, "{:?}: {gain}", Motion::ALL[k]);
    }
    // Held at a boundary of counts: a twentieth more.
    assert!(ours.rms[4] < 1.1 * old.rms[4]);
    assert!(ours.chatter < 0.9 * old.chatter);
}

#[test]
fn every_device_stands_the_damping_that_is_allowed() {
    for (device, model) in sim::DeviceModel::all() {
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
