use super::*;
use core::f64::consts::PI;

const PERIOD: f64 = 1e-3;
const DAMPING: f64 = 0.5;
/// Budget of a search in these tests (ticks).
const BUDGET: u64 = 300_000;

/// A sampled spring and damper on one side of zero, which sees whole `count`s if there are any.
struct Wall {
    stiffness: f64,
    damping: f64,
    count: f64,
    last: f64,
}

impl Wall {
    fn new(stiffness: f64, damping: f64) -> Self {
        Self {
            stiffness,
            damping,
            count: 0.0,
            last: 0.0,
        }
    }
}

impl Rendering for Wall {
    fn reset(&mut self) {
        self.last = 0.0;
    }

    fn tick(&mut self, position: f64) -> f64 {
        let shown = if self.count > 0.0 {
            (position / self.count).round() * self.count
        } else {
            position
        };
        let velocity = (shown - self.last) / PERIOD;
        self.last = shown;
        (-self.stiffness * shown - self.damping * velocity).max(0.0)
    }
}

fn adversary(delay: usize) -> Adversary {
    Adversary {
        port: Mechanism {
            period: PERIOD,
            damping: DAMPING,
            friction: 0.0,
            delay,
        },
        limits: Limits {
            period: PERIOD,
            deepest: 5e-3,
            speed: 1.0,
            acceleration: f64::INFINITY,
            longest: 2000,
            count: 0.0,
        },
        budget: BUDGET,
        seed: 1,
    }
}

/// The largest passive stiffness: the minimum over frequency of the stiffness that `b > K T / 2 s - B c` allows.
fn exact(damping: f64, delay: usize) -> f64 {
    let n = (2 * delay + 1) as f64;
    let bound = |k: i32| {
        let theta = PI * f64::from(k) / 20_000.0;
        let s = (n * theta / 2.0).sin() / (theta / 2.0).sin();
        let left = DAMPING + damping * ((delay + 1) as f64 * theta).cos();
        if s > 0.0 {
            2.0 * left / (PERIOD * s)
        } else {
            f64::INFINITY
        }
    };
    (1..=20_000).map(bound).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_violation_two_percent_outside_is_found_within_the_budget() {
    for delay in [0, 1, 3] {
        for fraction in [0.0, 0.3, 0.5, 0.7] {
            let stiffness = 1.02 * exact(fraction * DAMPING, delay);
            let mut wall = Wall::new(stiffness, fraction * DAMPING);
            let found = adversary(delay).search(&mut wall, Goal::MoreThan(0.0), &[]);
            assert!(found.outcome.energy > 0.0, "{delay} {fraction} {found:?}");
            // The last motion may exceed the budget by its own length.
            assert!(found.spent <= BUDGET + 2001, "{}", found.spent);
            // The returned motion gets the energy out again.
            let again = adversary(delay).port.play(&mut wall, &found.motion);
            assert_eq!(again.energy, found.outcome.energy);
            assert_eq!(found.motion.len(), found.outcome.at);
        }
    }
}

#[test]
fn nothing_is_found_two_percent_inside() {
    for delay in [0, 1, 3] {
        for fraction in [0.0, 0.5] {
            let stiffness = 0.98 * exact(fraction * DAMPING, delay);
            let mut wall = Wall::new(stiffness, fraction * DAMPING);
            let found = adversary(delay).search(&mut wall, Goal::Most, &[]);
            // Rounding of sums over thousands of steps of a few millijoules.
            assert!(found.outcome.energy < 1e-15, "{delay} {fraction} {found:?}");
            // The search came near the boundary, but not beyond.
            assert!(found.outcome.fraction > -0.1, "{}", found.outcome.fraction);
            assert!(found.spent >= BUDGET);
        }
    }
}

#[test]
fn the_account_is_the_work_less_the_losses_and_knows_the_delay() {
    // Pushes with 1 N from the third tick on, at every position.
    struct Late(u32);
    impl Rendering for Late {
        fn reset(&mut self) {
            self.0 = 0;
        }
        fn tick(&mut self, _: f64) -> f64 {
            self.0 += 1;
            if self.0 >= 3 { 1.0 } else { 0.0 }
        }
    }
    let motion: Vec<f64> = (1..=10).map(|k| 1e-4 * f64::from(k)).collect();
    for delay in [0, 1, 3] {
        let port = Mechanism {
            friction: 0.2,
            ..adversary(delay).port
        };
        let outcome = port.play(&mut Late(0), &motion);
        // Ticks 0 and 1 command nothing: of ten steps 8 - d are pushed, and all lose b D^2 / T + f_c D.
        let expected = (8 - delay) as f64 * 1e-4 - 10.0 * (0.5 * 1e-8 / 1e-3 + 0.2 * 1e-4);
        assert!((outcome.energy - expected).abs() < 1e-18, "{outcome:?}");
        assert_eq!(outcome.at, 10);
    }
}

#[test]
fn motions_keep_to_the_limits() {
    for acceleration in [f64::INFINITY, 50.0] {
        let mut adversary = adversary(0);
        adversary.limits.speed = 0.2;
        adversary.limits.acceleration = acceleration;
        adversary.limits.count = 3e-5;
        adversary.budget = 50_000;
        let mut wall = Wall::new(5000.0, 0.0);
        let found = adversary.search(&mut wall, Goal::Most, &[]);
        assert!(found.outcome.energy > 0.0 && found.motion.len() <= 2000);
        let (mut last, mut last_by) = (0.0, 0.0);
        for position in &found.motion {
            let by = position - last;
            assert!(by.abs() <= 0.2 * PERIOD * (1.0 + 1e-9));
            assert!((by - last_by).abs() <= acceleration * PERIOD * PERIOD * (1.0 + 1e-9));
            (last, last_by) = (*position, by);
        }
    }
}

#[test]
fn a_search_is_a_function_of_its_seed() {
    let search = |seed| {
        let adversary = Adversary {
            seed,
            budget: 60_000,
            ..adversary(1)
        };
        let found = adversary.search(&mut Wall::new(800.0, 0.1), Goal::Most, &[]);
        (found.outcome, found.motion)
    };
    assert_eq!(search(4), search(4));
    assert_ne!(search(4), search(5));
}

#[test]
fn dynamic_programming_finds_the_boundary_of_a_quantized_wall() {
    let (count, friction, step) = (4e-5, 0.2, 0.5e-3);
    let port = Mechanism {
        friction,
        ..adversary(0).port
    };
    // Strokes from edge to edge, n counts a step: 12 at most.
    let bound = |n: i32| {
        let n = f64::from(n);
        (2.0 * DAMPING * n * count / PERIOD + 2.0 * friction) / ((n + 1.0) * count)
    };
    let exact = (1..=12).map(bound).fold(f64::INFINITY, f64::min);
    let mut places = vec![0.0];
    for k in 0..60 {
        let edge = (f64::from(k) + 0.5) * count;
        places.extend([-(edge - 1e-9), -(edge + 1e-9)]);
    }
    for (times, out) in [(0.99, false), (1.01, true)] {
        let mut wall = Wall {
            count,
            ..Wall::new(times * exact, 0.0)
        };
        let forces: Vec<f64> = places
            .iter()
            .map(|place| {
                wall.reset();
                wall.tick(*place)
            })
            .collect();
        let (value, motion) = best_among(&port, &places, &forces, step, 60);
        assert_eq!(value > 1e-12, out, "{times} {value}");
        // The motion gets the energy that the method promises.
        let outcome = port.play(&mut wall, &motion);
        assert!(
            (outcome.energy - value).abs() < 1e-15,
            "{outcome:?} {value}"
        );
    }
}
