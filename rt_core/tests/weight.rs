//! Weight under the cap. The weight is a potential, which gives back the work of lifting wherever it is carried. Only a
//! weight that is removed and restored higher up has to be paid for.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use rt_core::coupling::{Coupling, CouplingConfig, Passed};
use rt_core::{LocalModel, MAX_DEVICES, PassivityConfig, Pose, Scheme, Twist, Vec3, Wrench};

const MS: u64 = 1_000_000;
/// Weight of the body (N).
const WEIGHT: f64 = 2.0;

fn coupling() -> Coupling {
    Coupling::new(CouplingConfig {
        scheme: Scheme::Capped,
        period: 1e-3,
        blend: 0.5,
        age_limit: 0.05,
        decay: 0.02,
        recovery: 0.02,
        hold_damping: [0.0; MAX_DEVICES],
        passivity: PassivityConfig::new(1e-3),
    })
}

/// A body that hangs from one hand at a height (m), without stiffness.
fn hanging(sequence: u64, time_ns: u64, height: f64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.sequence = sequence;
    model.head.time_ns = time_ns;
    model.head.period = 0.004;
    model.head.handle_count = 1;
    model.handles[0].pose = Pose::at(Vec3::new(0.0, 0.0, height));
    model.handles[0].wrench.force.z = -WEIGHT;
    model.handles[0].weight.z = -WEIGHT;
    model
}

/// A hand that carries the body, on a device that holds the rendered force.
struct Hand {
    coupling: Coupling,
    now_ns: u64,
    height: f64,
}

impl Hand {
    /// Goes to a height (m) at a tenth of a metre per second, with a model every `every` ticks. Returns the last force
    /// (N).
    fn go(&mut self, height: f64, every: u64) -> f64 {
        let ticks = ((height - self.height).abs() / 1e-4).round().max(60.0) as u64;
        let from = self.height;
        let mut force = 0.0;
        for k in 1..=ticks {
            self.height = from + (height - from) * k as f64 / ticks as f64;
            let now = self.now_ns;
            if every > 0 && (now / MS).is_multiple_of(every) {
                let model = hanging(1 + now / MS, now, self.height);
                self.coupling.accept(&model).expect("a sound model");
            }
            let at = [(Pose::at(Vec3::new(0.0, 0.0, self.height)), Twist::zero())];
            let [wrench, ..] = self.coupling.tick(now, &at);
            force = wrench.force.z;
            let mut held = [Wrench::zero(); MAX_DEVICES];
            held[0] = wrench;
            self.coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
            self.now_ns += MS;
        }
        force
    }
}

fn hand() -> Hand {
    let mut hand = Hand {
        coupling: coupling(),
        now_ns: MS,
        height: 0.0,
    };
    // The force grows with the trust in the first models, at the place of the hand.
    hand.go(0.0, 4);
    hand
}

#[test]
fn a_weight_is_felt_in_full_wherever_it_is_carried() {
    let mut hand = hand();
    // A hand's length down: two hundred times the allowance comes out, all of it lifted before or since.
    for height in [-0.1, 0.1, 0.0] {
        let force = hand.go(height, 4);
        // Exact up to the rounding of sums.
        assert!((force + WEIGHT).abs() < 1e-9, "{force} at {height}");
        let energy = hand.coupling.energy();
        assert!((energy.raised - WEIGHT * height).abs() < 1e-3, "{energy:?}");
        assert!(energy.least > -1e-9 && energy.capped == 0, "{energy:?}");
    }
}

#[test]
fn a_weight_that_returns_at_a_greater_height_is_charged() {
    let mut hand = hand();
    assert_eq!(hand.coupling.trust(), 1.0);
    // The model grows too old: the weight is gone, and the hand lifts nothing.
    hand.go(0.0, 0);
    hand.go(0.1, 0);
    assert_eq!(hand.coupling.trust(), 0.0);
    hand.go(0.1, 4);
    let energy = *hand.coupling.energy();
    // The account now owes 0.2 J that no hand supplied.
    assert!((energy.raised - 0.1 * WEIGHT).abs() < 1e-3, "{energy:?}");
    assert!(energy.available < -0.19, "{energy:?}");
    assert!(energy.supplied - energy.raised < -0.19, "{energy:?}");
}
