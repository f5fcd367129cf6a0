//! A contact that closes before the next model comes: the limit that stiffens a model; and one that parts.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_types)]

use rt_core::coupling::{Coupling, CouplingConfig, Passed};
use rt_core::geometry::Twist;
use rt_core::{LocalModel, MAX_DEVICES, PassivityConfig, Pose, Scheme, TearLimit, Vec3, Vec6};

const GAP: f64 = 1e-3;
const TIME: f64 = 0.01;

/// A handle on a spring of 100 N/m along x, which meets another one of 300 N/m after the gap.
fn model() -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.sequence = 1;
    model.head.handle_count = 1;
    model.head.energy = 1.0;
    model.stiffness[0][0][(0, 0)] = 100.0;
    model.head.tear_limit = TearLimit {
        root: -TIME,
        critical: GAP,
        area: -300.0,
    };
    model.handles[0].tear_slope = Vec6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    model
}

fn force(model: &LocalModel, x: f64, v: f64) -> f64 {
    let twist = Twist {
        linear: Vec3::new(v, 0.0, 0.0),
        ..Twist::zero()
    };
    let device = (Pose::at(Vec3::new(x, 0.0, 0.0)), twist);
    let deviations = model.deviations(&[device]);
    model.wrenches(&deviations, 0.0)[0].force.x
}

#[test]
fn a_model_stiffens_where_the_gap_closes() {
    let model = model();
    assert_eq!(model.check(), Ok(()));
    for (x, expected) in [(0.5e-3, -0.05), (GAP, -0.1), (3e-3, -0.9), (-3e-3, 0.3)] {
        assert!((force(&model, x, 0.0) - expected).abs() < 1e-12, "{x}");
    }
}

#[test]
fn the_damper_of_a_touch_comes_in_without_a_step_and_never_pulls() {
    let model = model();
    let damper = |x, v| force(&model, x, v) - force(&model, x, 0.0);
    assert_eq!(damper(GAP, 0.02), 0.0);
    assert!(damper(GAP + 1e-9, 0.02).abs() < 1e-5);
    // Deep in the contact it is the whole damper, 300 N/m times 10 ms.
    assert!((damper(2.0 * GAP, 0.02) + 300.0 * TIME * 0.02).abs() < 1e-12);
    for x in [0.0, 1.01e-3, 1.1e-3, 3e-3_f64] {
        let spring = 300.0 * (x - GAP).max(0.0);
        for v in [-0.1, -0.01, 0.01, 0.1] {
            assert!(damper(x, v) * v <= 0.0, "{x} {v}");
            assert!(damper(x, v).abs() <= spring + 1e-12, "{x} {v}");
        }
    }
}

#[test]
fn the_spring_of_a_touch_stores_what_the_hand_supplies() {
    let model = model();
    let stored = |x: f64| {
        let device = (Pose::at(Vec3::new(x, 0.0, 0.0)), Twist::zero());
        let still = [rt_core::local_model::Lead::none(); rt_core::MAX_HANDLES];
        model
            .parts(&model.deviations(&[device]), &still, 0.0)
            .stored
    };
    for x in [0.5e-3, 2e-3, 4e-3_f64] {
        let beyond = (x - GAP).max(0.0);
        let supplied = 0.5 * (100.0 * x * x + 300.0 * beyond * beyond);
        assert!((stored(x) - 1.0 - supplied).abs() < 1e-12, "{x}");
    }
}

#[test]
fn a_limit_that_stiffens_needs_a_gap_and_a_damper_that_does_not_push() {
    for (root, critical) in [(TIME, GAP), (-TIME, 0.0), (-TIME, -GAP)] {
        let mut model = model();
        (model.head.tear_limit.root, model.head.tear_limit.critical) = (root, critical);
        assert!(model.check().is_err(), "{root} {critical}");
    }
}

/// A hand lifts a body off at a newton. The model after the parting has no stiffness; until it is blended in, the former one
/// yields as it did.
#[test]
fn the_force_after_a_contact_has_parted_does_not_fall_with_its_stiffness() {
    const MS: u64 = 1_000_000;
    let mut coupling = Coupling::new(CouplingConfig {
        scheme: Scheme::Linear,
        period: 1e-3,
        blend: 0.5,
        age_limit: 1.0,
        decay: 0.1,
        recovery: 0.1,
        hold_damping: [0.0; MAX_DEVICES],
        passivity: PassivityConfig::new(1e-3),
    });
    let mut pressed = LocalModel::empty();
    pressed.head.sequence = 1;
    pressed.head.period = 0.016;
    pressed.head.horizon = 0.016;
    pressed.head.handle_count = 1;
    pressed.stiffness[0][0][(0, 0)] = 1000.0;
    let mut parted = pressed;
    pressed.head.tear_limit = TearLimit {
        root: 0.0,
        critical: 1.0,
        area: 1e-3,
    };
    pressed.handles[0].tear_slope[0] = 1000.0;
    // From 320 ms on, when the whole force is rendered, the hand moves by 0.25 mm in a tick.
    let x = |tick: u64| 0.25e-3 * tick.saturating_sub(320) as f64;
    let mut forces = Vec::new();
    for tick in 0..352 {
        if tick <= 320 && tick % 16 == 0 {
            pressed.head.sequence = tick / 16 + 1;
            pressed.head.time_ns = tick * MS;
            coupling.accept(&pressed).expect("a sound model");
        }
        if tick == 336 {
            parted.head.sequence = 22;
            parted.head.time_ns = tick * MS;
            parted.stiffness[0][0][(0, 0)] = 0.0;
            parted.handles[0].pose = Pose::at(Vec3::new(x(tick), 0.0, 0.0));
            parted.handles[0].wrench.force.x = -1.0;
            coupling.accept(&parted).expect("a sound model");
        }
        let hand = (Pose::at(Vec3::new(x(tick), 0.0, 0.0)), Twist::zero());
        let wrenches = coupling.tick(tick * MS, &[hand]);
        coupling.hold(&wrenches, &[Passed::WHOLE; MAX_DEVICES]);
        forces.push(wrenches[0].force.x);
    }
    let most = forces.iter().copied().fold(0.0, f64::min);
    assert!(most > -1.0 - 1e-9, "{most}");
    assert!(
        forces[326..].iter().all(|force| *force < -0.9),
        "{forces:?}"
    );
}
