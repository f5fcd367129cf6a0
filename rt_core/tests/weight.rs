//! Weight under the cap: a potential gives back what it was given, wherever it is carried; only where it is taken away
//! and comes back higher up somebody pays.
// The fence of `rt_core/clippy.toml` is around the law, not around its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use rt_core::coupling::{Coupling, CouplingConfig};
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
        hold_damping: 0.0,
        passivity: PassivityConfig::new(1e-3),
    })
}

/// A body that hangs from one hand at a height (m), on a spring that it does not stretch.
fn hanging(sequence: u64, time_ns: u64, height: f64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.sequence = sequence;
    model.time_ns = time_ns;
    model.period = 0.004;
    model.handle_count = 1;
    model.handles[0].pose = Pose::at(Vec3::new(0.0, 0.0, height));
    model.handles[0].wrench.force.z = -WEIGHT;
    model.handles[0].weight.z = -WEIGHT;
    model
}

/// A hand that carries it, and what the device holds.
struct Hand {
    coupling: Coupling,
    now_ns: u64,
    height: f64,
}

impl Hand {
    /// Goes to a height (m) at a tenth of a metre a second, with a model every `every` ticks; the force at the end.
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
            self.coupling.hold(&held, &[1.0; MAX_DEVICES]);
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
    // The force comes with the trust in the first models, where the hand is.
    hand.go(0.0, 4);
    hand
}

#[test]
fn a_weight_is_felt_in_full_wherever_it_is_carried() {
    let mut hand = hand();
    // Down by a hand's length: two hundred times the allowance comes out, all of it lifted before or since.
    for height in [-0.1, 0.1, 0.0] {
        let force = hand.go(height, 4);
        // Exact but for the rounding of sums.
        assert!((force + WEIGHT).abs() < 1e-9, "{force} at {height}");
        let energy = hand.coupling.energy();
        assert!((energy.raised - WEIGHT * height).abs() < 1e-3, "{energy:?}");
        assert!(energy.least > -1e-9 && energy.capped == 0, "{energy:?}");
    }
}

#[test]
fn a_weight_that_comes_back_higher_up_is_paid_for() {
    let mut hand = hand();
    // Too old a model: the weight is gone, and the hand lifts nothing.
    hand.go(0.0, 0);
    hand.go(0.1, 0);
    assert_eq!(hand.coupling.trust(), 0.0);
    hand.go(0.1, 4);
    let energy = *hand.coupling.energy();
    // Twenty centijoules that nobody put in are owed now.
    assert!((energy.raised - 0.1 * WEIGHT).abs() < 1e-3, "{energy:?}");
    assert!(energy.available < -0.19, "{energy:?}");
    assert!(energy.supplied - energy.raised < -0.19, "{energy:?}");
}
