//! Hands that leave a body: the force on these hands until it has faded, the piece to which they belong meanwhile, and
//! the effect on the hands that stay.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use rt_core::coupling::{Coupling, CouplingConfig, Passed};
use rt_core::{
    LocalModel, MAX_DEVICES, PassivityConfig, PieceEnergy, Pose, Scheme, Twist, Vec3, Wrench,
};

const PERIOD: f64 = 1e-3;
const MS: u64 = 1_000_000;
/// Ticks in which the force of a hand that leaves fades.
const FADE: u64 = 100;
/// Ticks between two models, and of a blend.
const EVERY: u64 = 16;
const BLEND: u64 = 8;
/// Pull of the body on each hand (N).
const PULL: f64 = 0.5;
const SCHEMES: [Scheme; 2] = [Scheme::Linear, Scheme::Capped];

/// A body in these hands: the device and the piece of each. Each piece stores half a joule.
fn body(epoch: u32, hands: &[(u8, u8)]) -> LocalModel {
    let mut model = LocalModel::empty();
    (model.head.epoch, model.head.period, model.head.horizon) =
        (epoch, EVERY as f64 * PERIOD, 0.02);
    model.head.handle_count = hands.len() as u8;
    for (handle, (device, piece)) in model.handles.iter_mut().zip(hands) {
        (handle.device, handle.piece) = (*device, *piece);
        handle.pose = Pose::at(place(*device));
        handle.wrench.force.x = PULL;
        model.head.pieces[usize::from(*piece)].stored = 0.5;
    }
    model.head.energy = 0.5 * f64::from(model.piece_count());
    model.head.released = model.head.energy;
    model
}

fn place(device: u8) -> Vec3 {
    Vec3::x() * 0.1 * f64::from(device)
}

/// A coupling with three hands, which hold the rendered wrenches.
struct Hands {
    coupling: Coupling,
    now: u64,
    ticks: u64,
    /// Ticks from one model to the next.
    every: u64,
    by: [Vec3; 3],
}

impl Hands {
    fn new(scheme: Scheme, decay: f64) -> Self {
        Self {
            coupling: Coupling::new(CouplingConfig {
                scheme,
                period: PERIOD,
                blend: 0.5,
                age_limit: 0.05,
                decay,
                recovery: 0.1,
                hold_damping: [0.0; MAX_DEVICES],
                passivity: PassivityConfig::new(PERIOD),
            }),
            now: 0,
            ticks: 0,
            every: EVERY,
            by: [Vec3::zeros(); 3],
        }
    }

    /// Publishes a model now.
    fn publish(&mut self, model: &LocalModel) {
        let mut model = *model;
        self.now += MS;
        self.ticks = 0;
        (model.head.sequence, model.head.time_ns) = (self.now, self.now);
        self.coupling.accept(&model).expect("a sound model");
    }

    /// One tick. Returns the force on each device.
    fn tick(&mut self) -> [Vec3; 3] {
        let now = self.now + self.ticks * MS;
        self.ticks += 1;
        let at = [0, 1, 2].map(|i| {
            let pose = Pose::at(place(i as u8) + self.by[i]);
            (pose, Twist::zero())
        });
        let wrenches = self.coupling.tick(now, &at);
        let mut held = [Wrench::zero(); MAX_DEVICES];
        for (handle, wrench) in self.coupling.model().handles().zip(&wrenches) {
            held[usize::from(handle.device)] = *wrench;
        }
        self.coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
        [0, 1, 2].map(|i| held[i].force)
    }

    /// So many ticks with models of this kind, the first of them in the first tick. `each` sees the tick's number and the
    /// forces, and may move the hands.
    fn run(
        &mut self,
        model: &LocalModel,
        ticks: u64,
        mut each: impl FnMut(u64, [Vec3; 3], &mut Self),
    ) {
        for tick in 0..ticks {
            if tick % self.every == 0 {
                self.now += self.ticks.saturating_sub(1) * MS;
                self.publish(model);
            }
            let forces = self.tick();
            each(tick, forces, self);
        }
    }

    /// Waits until the force has come in full.
    fn settle(&mut self, model: &LocalModel) {
        self.run(model, 10 * EVERY, |_, _, _| {});
    }
}

/// The part of a force that is left after some ticks of its fade.
fn left(ticks: u64) -> f64 {
    let s = 1.0 - (ticks as f64 / FADE as f64).min(1.0);
    s * s * (3.0 - 2.0 * s)
}

/// Rounding of some newtons.
fn near(found: f64, expected: f64) -> bool {
    (found - expected).abs() < 1e-12
}

#[test]
fn a_hand_that_leaves_feels_its_last_force_fade_and_nothing_else() {
    for scheme in SCHEMES {
        let mut hands = Hands::new(scheme, FADE as f64 * PERIOD);
        // Springs between the two hands, and from each to the world.
        let mut both = body(0, &[(0, 0), (1, 0)]);
        for i in 0..2 {
            both.stiffness[i][i][(0, 0)] = 500.0;
            both.stiffness[i][1 - i][(0, 0)] = -300.0;
            both.damping[i][i][(0, 0)] = 2.0;
        }
        hands.settle(&both);
        // The first hand stays, on a spring of its own.
        let mut alone = body(1, &[(0, 0)]);
        alone.stiffness[0][0][(0, 0)] = 200.0;
        hands.run(&alone, FADE + 40, |tick, forces, hands| {
            if tick >= BLEND {
                let fading = PULL * left(tick);
                assert!(near(forces[1].x, fading), "{scheme:?} {tick} {forces:?}");
                // The cap's lead answers the step of the first hand for a tick.
                let held = PULL - 200.0 * hands.by[0].x;
                let steps = tick == BLEND + 1 && scheme == Scheme::Capped;
                assert!(steps || near(forces[0].x, held), "{scheme:?} {tick}");
            }
            hands.by[0].x = if tick >= BLEND { 1e-3 } else { 0.0 };
            // The second hand goes far away meanwhile.
            hands.by[1].x += 2e-4;
        });
        assert_eq!(hands.coupling.model().handles().count(), 1);
    }
}

#[test]
fn the_weight_of_a_hand_that_leaves_lowers_with_its_force() {
    for scheme in SCHEMES {
        let mut hands = Hands::new(scheme, FADE as f64 * PERIOD);
        let weigh = |mut model: LocalModel| {
            let used = usize::from(model.head.handle_count);
            for handle in &mut model.handles[..used] {
                handle.weight.z = -2.0;
                handle.wrench.force.z = -2.0;
            }
            model
        };
        let (both, alone) = (weigh(body(0, &[(0, 0), (1, 0)])), weigh(body(1, &[(0, 0)])));
        hands.settle(&both);
        // The second hand lifts its part by 10 mm, and leaves.
        let lifted = 0.01;
        hands.run(&both, 100, |_, _, hands| {
            hands.by[1].z = f64::min(hands.by[1].z + 1e-4, lifted);
        });
        let mut last = 2.0;
        hands.run(&alone, FADE + 40, |tick, forces, hands| {
            let weight = -forces[1].z;
            assert!(near(weight, 2.0 * left(tick)), "{scheme:?} {tick} {weight}");
            // The raised energy is that of the weight that is held at that height.
            let raised = hands.coupling.energy().raised;
            assert!(near(raised, weight * lifted), "{scheme:?} {tick} {raised}");
            assert!(near(forces[0].z, -2.0), "{scheme:?} {tick}");
            last = weight;
        });
        assert_eq!(last, 0.0);
    }
}

#[test]
fn a_hand_without_force_or_with_one_that_overflowed_is_gone_at_once() {
    for scheme in SCHEMES {
        for overflows in [false, true] {
            let mut hands = Hands::new(scheme, FADE as f64 * PERIOD);
            let mut both = body(0, &[(0, 0), (1, 0)]);
            both.handles[1].wrench.force.x = 0.0;
            both.stiffness[1][1][(0, 0)] = 300.0;
            hands.settle(&both);
            if overflows {
                hands.by[1].x = f64::MAX;
                assert!(!hands.tick()[1].x.is_finite());
            }
            hands.run(&body(1, &[(0, 0)]), 2, |_, forces, hands| {
                assert_eq!(hands.coupling.model().handles().count(), 1);
                assert_eq!(forces[1], Vec3::zeros());
            });
        }
    }
}

#[test]
fn a_spring_that_outlasts_the_fade_passes_with_the_blend() {
    // The force fades in 5 ms. The stiffness of the hand passes with a blend of 20 ticks, and the hand moves on.
    for scheme in SCHEMES {
        let mut hands = Hands::new(scheme, 5.0 * PERIOD);
        let mut both = body(0, &[(0, 0), (1, 0)]);
        both.stiffness[1][1][(0, 0)] = 300.0;
        let mut alone = body(1, &[(0, 0)]);
        for model in [&mut both, &mut alone] {
            model.head.period = 0.04;
        }
        hands.settle(&both);
        hands.run(&alone, 10, |_, _, hands| hands.by[1].x += 1e-4);
        let before = hands.tick()[1].x;
        // The hand is half a millimetre or more from the place at which it left.
        assert!(before < -0.1, "{before}");
        // Another model comes during the blend. The force continues from its last value.
        let mut last = before;
        hands.run(&alone, 15, |tick, forces, _| {
            let step = forces[1].x - last;
            // The rest of the blend is even.
            assert!(
                (-1e-12..=before.abs() / 8.0).contains(&step),
                "{scheme:?} {tick} {step}"
            );
            last = forces[1].x;
        });
        // Each model finds a fifth of the force that was left at the one before.
        hands.run(&alone, 300, |_, forces, _| last = forces[1].x);
        assert_eq!(last, 0.0);
        assert_eq!(hands.coupling.model().handles().count(), 1);
    }
}

#[test]
fn a_hand_is_forgotten_though_models_always_come_during_a_blend() {
    for scheme in SCHEMES {
        let mut hands = Hands::new(scheme, FADE as f64 * PERIOD);
        let mut both = body(0, &[(0, 0), (1, 0)]);
        both.stiffness[1][1][(0, 0)] = 300.0;
        hands.settle(&both);
        hands.every = 2;
        hands.by[1].x = 1e-3;
        hands.run(&body(1, &[(0, 0)]), FADE + 400, |_, _, _| {});
        assert_eq!(hands.coupling.model().handles().count(), 1, "{scheme:?}");
    }
}

#[test]
fn a_hand_that_leaves_is_on_the_piece_that_continues_its_own_or_on_one_of_its_own() {
    // The hands (device, piece) before and after, and the piece of each device after the first tick of the second model.
    type Case<'a> = (&'a [(u8, u8)], &'a [(u8, u8)], &'a [(u8, u8)]);
    let cases: [Case; 7] = [
        // A whole body stays whole.
        (&[(0, 0), (1, 0)], &[(0, 0)], &[(0, 0), (1, 0)]),
        (&[(0, 0), (1, 0)], &[(1, 0)], &[(1, 0), (0, 0)]),
        // Another hand takes hold of it.
        (&[(0, 0)], &[(2, 0)], &[(2, 0), (0, 0)]),
        // The piece of the hand is held by another hand, too, and may have another number now.
        (
            &[(0, 0), (1, 1), (2, 1)],
            &[(0, 1), (1, 0)],
            &[(0, 1), (1, 0), (2, 0)],
        ),
        (
            &[(0, 0), (1, 1), (2, 0)],
            &[(1, 1), (2, 0)],
            &[(1, 1), (2, 0), (0, 0)],
        ),
        // No hand holds the piece any more.
        (&[(0, 0), (1, 1)], &[(0, 0)], &[(0, 0), (1, 1)]),
        (
            &[(0, 0), (1, 1), (2, 2)],
            &[(1, 0)],
            &[(1, 0), (0, 1), (2, 2)],
        ),
    ];
    for (before, after, expected) in cases {
        let mut hands = Hands::new(Scheme::Capped, FADE as f64 * PERIOD);
        hands.settle(&body(0, before));
        let mut model = body(1, after);
        // The numbers of pieces that do not exist do not matter; a whole body has no pieces.
        let used = match model.piece_count() {
            1 => 0,
            several => usize::from(several),
        };
        for piece in &mut model.head.pieces[used..] {
            *piece = PieceEnergy {
                stored: f64::NAN,
                released: f64::NAN,
            };
        }
        hands.run(&model, FADE + 40, |tick, forces, hands| {
            let case = format!("{before:?} {after:?} {tick}");
            if tick == 0 {
                let handles = hands.coupling.model().handles();
                let found: Vec<_> = handles
                    .map(|handle| (handle.device, handle.piece))
                    .collect();
                assert_eq!(found, expected, "{case}");
            }
            for (device, force) in (0..).zip(forces) {
                let held = |hands: &[(u8, u8)]| hands.iter().any(|hand| hand.0 == device);
                let wanted = match (held(before), held(after)) {
                    (true, true) => PULL,
                    (true, false) => PULL * left(tick),
                    // The force of a hand that joins comes with the blend.
                    (false, true) => PULL * (tick as f64 / BLEND as f64).min(1.0),
                    (false, false) => 0.0,
                };
                assert!(near(force.x, wanted), "{case} {device} {force}");
            }
            if tick > BLEND {
                let stored = hands.coupling.energy().stored;
                assert!(near(stored, model.head.energy), "{case} {stored}");
            }
        });
        let left: Vec<_> = hands.coupling.model().handles().map(|h| h.device).collect();
        let named: Vec<_> = after.iter().map(|hand| hand.0).collect();
        assert_eq!(left, named);
        assert_eq!(hands.coupling.energy().capped, 0);
    }
}
