//! The coupling: the wrench of each scheme; a change of model that never makes the force jump; a force that fades and
//! returns smoothly when models stop coming.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use nalgebra::UnitQuaternion;
use proptest::prelude::*;
use rt_core::coupling::{Coupling, CouplingConfig, HostState, Passed};
use rt_core::local_model::{Lead, ModelFault};
use rt_core::{
    HandleReference, LocalModel, MAX_DEVICES, MAX_HANDLES, Mat6, PassivityConfig, Pose, Scheme,
    Twist, Vec3, Vec6, Wrench,
};

const MS: u64 = 1_000_000;

fn config(scheme: Scheme) -> CouplingConfig {
    CouplingConfig {
        scheme,
        period: 1e-3,
        blend: 0.5,
        age_limit: 0.05,
        decay: 0.2,
        recovery: 0.1,
        hold_damping: [2.0; MAX_DEVICES],
        passivity: PassivityConfig::new(1e-3),
    }
}

/// Two handles on a spring of `k` N/m along x and a damper of `b` N s/m, held apart with `pull` N.
fn spring(sequence: u64, time_ns: u64, k: f64, b: f64, pull: f64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.sequence = sequence;
    model.head.time_ns = time_ns;
    model.head.period = 0.016;
    model.head.handle_count = 2;
    for (i, handle) in model.handles.iter_mut().take(2).enumerate() {
        let side = if i == 0 { -1.0 } else { 1.0 };
        handle.device = i as u8;
        handle.pose = Pose::at(Vec3::new(0.1 * side, 0.0, 0.0));
        handle.wrench.force = Vec3::new(-side * pull, 0.0, 0.0);
    }
    for i in 0..2 {
        for j in 0..2 {
            let sign = if i == j { 1.0 } else { -1.0 };
            model.stiffness[i][j][(0, 0)] = sign * k;
            model.damping[i][j][(0, 0)] = sign * b;
        }
    }
    model
}

fn hands(left: Vec3, right: Vec3, velocity: f64) -> [(Pose, Twist); 2] {
    let twist = |v: f64| Twist {
        linear: Vec3::new(v, 0.0, 0.0),
        angular: Vec3::zeros(),
    };
    [
        (Pose::at(left), twist(-velocity)),
        (Pose::at(right), twist(velocity)),
    ]
}

/// Ticks until the model is fully trusted and blended in; a model is published every 20 ms. Returns the time of the
/// last tick (ns).
fn settle(coupling: &mut Coupling, model: &LocalModel, at: &[(Pose, Twist)]) -> u64 {
    let mut now = model.head.time_ns;
    let mut newer = *model;
    for tick in 0..200 {
        now += MS;
        if tick % 20 == 0 {
            newer.head.time_ns = now;
            coupling.accept(&newer).unwrap();
        }
        coupling.tick(now, at);
    }
    now
}

#[test]
fn linear_renders_the_spring_between_two_hands() {
    let mut coupling = Coupling::new(config(Scheme::Linear));
    let rest = hands(Vec3::new(-0.1, 0.0, 0.0), Vec3::new(0.1, 0.0, 0.0), 0.0);
    let now = settle(&mut coupling, &spring(1, 0, 300.0, 2.0, 1.5), &rest);
    let apart = hands(Vec3::new(-0.11, 0.0, 0.0), Vec3::new(0.13, 0.0, 0.0), 0.05);
    let wrenches = coupling.tick(now + MS, &apart);
    // 1.5 N, 40 mm of stretch at 300 N/m, 0.1 m/s of opening at 2 N s/m. Rounding only.
    let expected = 1.5 + 300.0 * 0.04 + 2.0 * 0.1;
    assert!(
        (wrenches[0].force.x - expected).abs() < 1e-12,
        "{}",
        wrenches[0].force.x
    );
    assert!(
        (wrenches[1].force.x + expected).abs() < 1e-12,
        "{}",
        wrenches[1].force.x
    );
    // Hands that move together feel no change at all.
    let together = hands(Vec3::new(-0.08, 0.0, 0.0), Vec3::new(0.12, 0.0, 0.0), 0.0);
    let wrenches = coupling.tick(now + 2 * MS, &together);
    assert!((wrenches[0].force.x - 1.5).abs() < 1e-12);
}

#[test]
fn hold_keeps_the_wrench_and_thesis_adds_a_spring_and_a_damper() {
    let rest = hands(Vec3::new(-0.1, 0.0, 0.0), Vec3::new(0.1, 0.0, 0.0), 0.0);
    let apart = hands(Vec3::new(-0.11, 0.0, 0.0), Vec3::new(0.13, 0.0, 0.0), 0.05);
    let mut hold = Coupling::new(config(Scheme::Hold));
    let now = settle(&mut hold, &spring(1, 0, 300.0, 2.0, 1.5), &rest);
    assert!((hold.tick(now + MS, &apart)[0].force.x - 1.5).abs() < 1e-12);

    let mut thesis = Coupling::new(config(Scheme::Thesis {
        stiffness: 100.0,
        damping: 3.0,
    }));
    let now = settle(&mut thesis, &spring(1, 0, 300.0, 2.0, 1.5), &rest);
    let w = thesis.tick(now + MS, &apart);
    // The intended equation 4.5: held + k (x_handle - x_proxy) - k_v v, for each hand alone.
    assert!((w[0].force.x - (1.5 + 100.0 * 0.01 + 3.0 * 0.05)).abs() < 1e-12);
    assert!((w[1].force.x - (-1.5 - 100.0 * 0.03 - 3.0 * 0.05)).abs() < 1e-12);
}

#[test]
fn a_rotated_handle_answers_in_its_own_moment() {
    let mut model = LocalModel::empty();
    model.head.sequence = 1;
    model.head.period = 0.01;
    model.head.handle_count = 1;
    model.stiffness[0][0] = Mat6::from_diagonal_element(0.5);
    let mut coupling = Coupling::new(config(Scheme::Linear));
    let at = [(Pose::identity(), Twist::zero())];
    let now = settle(&mut coupling, &model, &at);
    let turn = Vec3::new(0.1, -0.2, 0.05);
    let pose = Pose {
        rotation: UnitQuaternion::from_scaled_axis(turn),
        ..Pose::identity()
    };
    let w = coupling.tick(now + MS, &[(pose, Twist::zero())]);
    assert!((w[0].moment + turn * 0.5).norm() < 1e-12, "{}", w[0].moment);
}

#[test]
fn invalid_models_are_refused_and_counted() {
    let mut coupling = Coupling::new(config(Scheme::Linear));
    let good = spring(1, 10 * MS, 300.0, 2.0, 1.0);
    let mut nan = good;
    nan.stiffness[0][1][(2, 2)] = f64::NAN;
    assert_eq!(coupling.accept(&nan), Err(ModelFault::NotFinite));
    let mut crowd = good;
    crowd.head.handle_count = MAX_HANDLES as u8 + 1;
    assert_eq!(coupling.accept(&crowd), Err(ModelFault::Handles));
    assert_eq!(coupling.accept(&good), Ok(()));
    assert_eq!(coupling.accept(&good), Err(ModelFault::Outdated));
    // One hand less, although the topology did not change: these are not the handles of this body.
    let mut torn = spring(2, 11 * MS, 300.0, 2.0, 1.0);
    torn.head.handle_count = 1;
    assert_eq!(coupling.accept(&torn), Err(ModelFault::Handles));
    torn.head.epoch = 1;
    assert_eq!(coupling.accept(&torn), Ok(()));
    let counters = coupling.counters();
    assert_eq!(
        (
            counters.not_finite,
            counters.wrong_handles,
            counters.outdated
        ),
        (1, 2, 1)
    );
}

#[test]
fn a_model_of_the_future_is_refused_and_a_clock_set_back_is_survived() {
    let mut coupling = Coupling::new(config(Scheme::Linear));
    let at = hands(Vec3::new(-0.1, 0.0, 0.0), Vec3::new(0.1, 0.0, 0.0), 0.0);
    coupling.tick(1000 * MS, &at);
    let early = spring(1, 1051 * MS, 300.0, 0.0, 2.0);
    assert_eq!(coupling.accept(&early), Err(ModelFault::ToCome));
    assert_eq!(coupling.counters().to_come, 1);
    assert_eq!(
        coupling.accept(&spring(2, 999 * MS, 300.0, 0.0, 2.0)),
        Ok(())
    );
    coupling.tick(1001 * MS, &at);
    // The clock is set back by nearly a second. A model of the new time is not outdated.
    coupling.tick(10 * MS, &at);
    assert_eq!(coupling.accept(&spring(3, 9 * MS, 300.0, 0.0, 2.0)), Ok(()));
}

#[test]
fn a_model_may_lie_as_far_ahead_as_it_may_lie_behind() {
    // Half a second, which is exact in seconds and in nanoseconds.
    let mut coupling = Coupling::new(CouplingConfig {
        age_limit: 0.5,
        ..config(Scheme::Linear)
    });
    coupling.tick(1000 * MS, &[]);
    let model = |time_ns| spring(1, time_ns, 300.0, 0.0, 2.0);
    let late = model(1500 * MS + 1);
    assert_eq!(coupling.accept(&late), Err(ModelFault::ToCome));
    assert_eq!(coupling.accept(&model(1500 * MS)), Ok(()));
}

#[test]
fn force_fades_without_a_jump_and_comes_back_without_one() {
    let mut coupling = Coupling::new(config(Scheme::Linear));
    let at = hands(Vec3::new(-0.1, 0.0, 0.0), Vec3::new(0.1, 0.0, 0.0), 0.0);
    let mut now = settle(&mut coupling, &spring(1, 0, 300.0, 0.0, 2.0), &at);
    let mut last = 2.0;
    let mut seen = [false; 4];
    for k in 0..1000 {
        now += MS;
        if k >= 500 {
            let mut model = spring(500, now, 300.0, 0.0, 2.0);
            model.head.sequence += k;
            coupling.accept(&model).unwrap();
        }
        let force = coupling.tick(now, &at)[0].force.x;
        // The steepest part of a smooth step is 1.5 times the mean slope: 2 N x 1.5 / (0.1 s / 1 ms).
        assert!(
            (force - last).abs() <= 2.0 * 1.5 / 100.0 + 1e-12,
            "tick {k}: {last} -> {force}"
        );
        last = force;
        seen[match coupling.state() {
            HostState::Waiting => 0,
            HostState::Live => 1,
            HostState::Fading => 2,
            HostState::Held => 3,
        }] = true;
        if k == 400 {
            assert_eq!((force, coupling.state()), (0.0, HostState::Held));
        }
    }
    assert!((last - 2.0).abs() < 1e-12);
    assert_eq!(seen, [false, true, true, true]);
    assert_eq!(coupling.counters().faded, 1);
}

fn vector(scale: f64) -> impl Strategy<Value = Vec3> {
    [-1.0..1.0, -1.0..1.0, -1.0..1.0].prop_map(move |v: [f64; 3]| Vec3::from(v) * scale)
}

fn handle(device: u8) -> impl Strategy<Value = HandleReference> {
    (
        vector(0.1),
        vector(0.5),
        vector(0.2),
        vector(1.0),
        vector(3.0),
        vector(0.1),
        (vector(30.0), vector(1.0)),
    )
        .prop_map(
            move |(position, turn, linear, angular, force, moment, drift)| HandleReference {
                device,
                piece: 0,
                tear_slope: Vec6::zeros(),
                pose: Pose {
                    position,
                    rotation: UnitQuaternion::from_scaled_axis(turn),
                },
                twist: Twist { linear, angular },
                wrench: Wrench { force, moment },
                contact: Vec3::zeros(),
                weight: Vec3::zeros(),
                drift: Wrench {
                    force: drift.0,
                    moment: drift.1,
                },
            },
        )
}

/// Time for which drifts act in tests of a single model (s).
const AHEAD: f64 = 0.01;

/// Any model of two handles: the blend must not rely on symmetry or size.
fn any_model() -> impl Strategy<Value = LocalModel> {
    (
        handle(0),
        handle(1),
        proptest::collection::vec(-1.0..1.0, 288),
        0.001..0.05,
    )
        .prop_map(|(a, b, numbers, period)| {
            let mut model = LocalModel::empty();
            model.head.handle_count = 2;
            model.head.period = period;
            model.head.horizon = 1.5 * period;
            model.handles[0] = a;
            model.handles[1] = b;
            for i in 0..2 {
                for j in 0..2 {
                    let at = (2 * i + j) * 72;
                    model.stiffness[i][j] = Mat6::from_row_slice(&numbers[at..at + 36]) * 300.0;
                    model.damping[i][j] = Mat6::from_row_slice(&numbers[at + 36..at + 72]) * 3.0;
                }
            }
            model
        })
}

proptest! {
    /// The elastic and viscous parts add up to the whole wrench, and the energy falls by the work of the springs on any
    /// path.
    #[test]
    fn the_parts_of_a_model_add_up(model in any_model(), left in vector(0.1), right in vector(0.1)) {
        let mut model = model;
        model.head.energy = 1e3;
        // Only a symmetric stiffness has an energy.
        let k = model.stiffness;
        for i in 0..MAX_HANDLES {
            for j in 0..MAX_HANDLES {
                model.stiffness[i][j] = (k[i][j] + k[j][i].transpose()) * 0.5;
            }
        }
        let at = |s: f64| hands(left * s, right * s, 0.1);
        let still = [Lead::none(); MAX_HANDLES];
        let parts = |s: f64| model.parts(&model.deviations(&at(s)), &still, AHEAD);
        let whole = model.wrenches(&model.deviations(&at(1.0)), AHEAD);
        let end = parts(1.0);
        for i in 0..2 {
            let sum = end.elastic[i] + end.viscous[i];
            // Forces of order 100 N, sums of some tens of terms.
            prop_assert!((sum - whole[i].stacked()).amax() < 1e-10);
        }
        // The force is linear along the path, so the trapezoidal rule is exact; the hands do not turn.
        let begin = parts(0.0);
        let mut work = 0.0;
        for (i, displacement) in [left, right].iter().enumerate() {
            let mean = (begin.elastic[i] + end.elastic[i]) * 0.5;
            work += mean.fixed_rows::<3>(0).dot(displacement);
        }
        prop_assert!((begin.stored - end.stored - work).abs() < 1e-9);
    }

    /// At the tick that takes a new model, even during a blend, the force on resting hands stays as rendered
    /// before. After the blend, it is the force of the new model.
    #[test]
    fn a_change_of_model_never_makes_the_force_jump(
        models in proptest::collection::vec(any_model(), 2..5),
        left in vector(0.1), right in vector(0.1), turn in vector(0.5),
        wait in 0_u64..12,
        late in 0_u64..12,
        scheme in prop_oneof![
            Just(Scheme::Hold), Just(Scheme::Linear),
            Just(Scheme::Thesis { stiffness: 400.0, damping: 5.0 }),
        ],
    ) {
        let mut coupling = Coupling::new(config(scheme));
        let mut at = hands(left, right, 0.1);
        at[1].0.rotation = UnitQuaternion::from_scaled_axis(turn);
        let mut now = settle(&mut coupling, &models[0], &at);
        let mut newest = models[0];
        newest.head.time_ns = now - 20 * MS;
        for (k, model) in models.iter().enumerate().skip(1) {
            let before = coupling.tick(now, &at);
            // One blending step may follow before the model comes: a copy tells the force after that step.
            let expected = coupling.clone().tick(now, &at);
            let mut model = *model;
            model.head.sequence = 1000 + k as u64;
            // The host needed some time to compute it: its drift has acted already.
            model.head.time_ns = (now - late * MS).max(newest.head.time_ns + 1);
            coupling.accept(&model).unwrap();
            newest = model;
            let after = coupling.tick(now, &at);
            for ((expected, after), before) in expected.iter().zip(&after).zip(&before) {
                // Forces of order 100 N, sums of some tens of terms.
                prop_assert!((expected.stacked() - after.stacked()).amax() < 1e-9);
                prop_assert!(before.is_finite());
            }
            for _ in 0..wait {
                now += MS;
                coupling.tick(now, &at);
            }
        }
        // 26 ms exceed half of the longest period, 25 ms, and stay below the age limit, 50 ms: the model is fully
        // blended and still trusted.
        for _ in 0..26 {
            now += MS;
            coupling.tick(now, &at);
        }
        scheme.shape(&mut newest);
        let expected = newest.wrenches(&newest.deviations(&at), newest.ahead(now));
        let rendered = coupling.tick(now, &at);
        for (a, b) in expected.iter().zip(&rendered).take(2) {
            prop_assert!((a.stacked() - b.stacked()).amax() < 1e-9);
        }
    }
}

/// A coupling whose force never fades, with models of this period (s), one in each tick for a while. They pull the hands
/// with 1 N. Returns the time of the last model (ns), after the first tick that used it.
fn steady(recovery: f64, period: f64) -> (Coupling, u64) {
    let mut coupling = Coupling::new(CouplingConfig {
        decay: f64::INFINITY,
        recovery,
        ..config(Scheme::Linear)
    });
    for tick in 1..=150 {
        let mut model = spring(tick, tick * MS, 0.0, 0.0, 1.0);
        model.head.period = period;
        coupling.accept(&model).unwrap();
        coupling.tick(tick * MS, &[]);
    }
    (coupling, 150 * MS)
}

#[test]
fn a_force_passes_in_half_a_period_or_half_a_gap_up_to_the_time_of_recovery() {
    for (recovery, period, gap, ticks) in [
        // Half a period; no more ticks than begin in it, and at least two.
        (0.1, 0.016, 16, 8),
        (0.1, 0.005, 5, 3),
        (0.1, 0.001, 1, 2),
        // Half a gap, in which no more than the age limit of 50 ms counts.
        (0.1, 0.016, 40, 20),
        (0.1, 0.016, 80, 25),
        // The blend after a gap takes at most the time of recovery. The blend after a usual period still takes half the
        // period.
        (0.01, 0.016, 40, 10),
        (0.001, 0.016, 40, 8),
    ] {
        let (mut coupling, last) = steady(recovery, period);
        let now = last + gap * MS;
        for tick in 1..gap {
            coupling.tick(last + tick * MS, &[]);
        }
        let mut model = spring(1000, now, 0.0, 0.0, 2.0);
        model.head.period = period;
        coupling.accept(&model).unwrap();
        for tick in 0..ticks + 5 {
            let force = coupling.tick(now + tick * MS, &[])[0].force.x;
            let wanted = 1.0 + (tick as f64 / ticks as f64).min(1.0);
            // Rounding of some newtons.
            assert!(
                (force - wanted).abs() < 1e-12,
                "{period} {gap} {tick}: {force} {wanted}"
            );
        }
    }
}

#[test]
fn the_next_model_does_not_shorten_a_blend_that_is_under_way() {
    // A blend of twenty ticks after a gap of 40 ms. Another model comes after some ticks; its own blend takes eight.
    for (after, ticks) in [(5, 15), (15, 8)] {
        let (mut coupling, last) = steady(0.1, 0.016);
        for tick in 1..40 {
            coupling.tick(last + tick * MS, &[]);
        }
        let now = last + 40 * MS;
        coupling.accept(&spring(1000, now, 0.0, 0.0, 3.0)).unwrap();
        for tick in 0..after {
            coupling.tick(now + tick * MS, &[]);
        }
        let now = now + after * MS;
        coupling.accept(&spring(1001, now, 0.0, 0.0, 3.0)).unwrap();
        let begin = 1.0 + 0.1 * after as f64;
        for tick in 0..ticks + 5 {
            let force = coupling.tick(now + tick * MS, &[])[0].force.x;
            let wanted = begin + (3.0 - begin) * (tick as f64 / ticks as f64).min(1.0);
            // Rounding of some newtons.
            assert!(
                (force - wanted).abs() < 1e-12,
                "{after} {tick}: {force} {wanted}"
            );
        }
    }
}

#[test]
fn a_model_that_comes_during_a_blend_starts_from_the_blended_one() {
    // Stiffness (N/m), damping (N s/m) and drift (N/s) of the first model and of the models that follow.
    let models = [(100.0, 1.0, 20.0), (300.0, 5.0, -60.0)];
    let model = |which: usize, sequence: u64, time_ns: u64| {
        let (k, b, drift) = models[which];
        let mut model = spring(sequence, time_ns, k, b, 1.0);
        model.head.horizon = 0.05;
        for (handle, sign) in model.handles.iter_mut().zip([1.0, -1.0]) {
            handle.drift.force.x = sign * drift;
            handle.drift.moment.y = sign * drift;
        }
        model
    };
    let at = |by: f64, v: f64| {
        hands(
            Vec3::new(-0.1 - by, 0.0, 0.0),
            Vec3::new(0.1 + by, 0.0, 0.0),
            v,
        )
    };
    for after in [0, 3, 8] {
        let mut coupling = Coupling::new(config(Scheme::Linear));
        let mut now = 0;
        for tick in 1..=150 {
            now = tick * MS;
            coupling.accept(&model(0, tick, now)).unwrap();
            coupling.tick(now, &at(0.0, 0.0));
        }
        // The blend to the second model takes eight ticks. The third comes after some of them.
        let second = now + 10 * MS;
        coupling.accept(&model(1, 1000, second)).unwrap();
        for tick in 0..after {
            coupling.tick(second + tick * MS, &at(0.0, 0.0));
        }
        now = second + after * MS;
        let third = model(1, 1001, now + 1);
        coupling.accept(&third).unwrap();
        let before = coupling.tick(now + 1, &at(0.0, 0.0))[0];
        let passed = (after as f64 / 8.0).min(1.0);
        let mixed = |old: f64, new: f64| old + (new - old) * passed;
        let [(k0, b0, p0), (k1, b1, p1)] = models;
        let (k, b, drift) = (mixed(k0, k1), mixed(b0, b1), mixed(p0, p1));
        // From here on, the hands go apart; the blend takes eight ticks, and no fewer than are left of the one before.
        for tick in 1..8 {
            let (by, v) = (1e-4 * tick as f64, 0.02);
            let rendered = coupling.tick(now + 1 + tick * MS, &at(by, v))[0];
            let (blend, age) = (tick as f64 / 8.0, tick as f64 * 1e-3);
            // Each hand goes this way, so the spring between them is stretched by twice as much.
            let old = before.force.x + drift * age + k * 2.0 * by + b * 2.0 * v;
            let new = 1.0 + p1 * age + k1 * 2.0 * by + b1 * 2.0 * v;
            let wanted = old * (1.0 - blend) + new * blend;
            // Rounding of some newtons.
            assert!(
                (rendered.force.x - wanted).abs() < 1e-12,
                "{after} {tick}: {rendered:?} {wanted}"
            );
            let old = before.moment.y + drift * age;
            let wanted = old * (1.0 - blend) + p1 * age * blend;
            assert!((rendered.moment.y - wanted).abs() < 1e-12, "{after} {tick}");
        }
    }
}

/// One tick, after which the devices hold the wrenches. Returns the force along x by device.
fn held_tick(coupling: &mut Coupling, now: u64, at: &[(Pose, Twist)]) -> [f64; MAX_DEVICES] {
    let wrenches = coupling.tick(now, at);
    let mut held = [Wrench::zero(); MAX_DEVICES];
    for (handle, wrench) in coupling.model().handles().zip(&wrenches) {
        held[usize::from(handle.device)] = *wrench;
    }
    coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
    held.map(|wrench| wrench.force.x)
}

#[test]
fn the_force_of_a_hand_that_leaves_passes_to_zero_without_a_jump() {
    for scheme in [
        Scheme::Hold,
        Scheme::Linear,
        Scheme::Classic,
        Scheme::Capped,
    ] {
        let mut coupling = Coupling::new(config(scheme));
        let at = |x: f64| hands(Vec3::new(-0.1, 0.0, 0.0), Vec3::new(0.1 + x, 0.0, 0.0), 0.0);
        let mut model = spring(1, 0, 300.0, 0.0, 1.5);
        // The pull is stored, so no scheme limits it.
        model.head.energy = 1.0;
        model.head.released = model.head.energy;
        let mut now = 0;
        for _ in 0..10 {
            now += 20 * MS;
            model.head.time_ns = now;
            coupling.accept(&model).unwrap();
            for tick in 0..20 {
                held_tick(&mut coupling, now + tick * MS, &at(0.0));
            }
        }
        now += 20 * MS;
        let [_, before, ..] = held_tick(&mut coupling, now, &at(0.0));
        assert!((before + 1.5).abs() < 1e-9, "{scheme:?} {before}");
        // The second hand leaves.
        let mut alone = model;
        (alone.head.epoch, alone.head.handle_count, alone.head.energy) = (1, 1, 0.0);
        let supplied = coupling.energy().supplied;
        let (mut last, mut work, mut ticks) = (before, 0.0, 0);
        while coupling.model().head.epoch == 0 || last != 0.0 {
            if ticks == 0 || ticks % 16 == 5 {
                // The second model comes during the blend, the others during the fade. They are models of the same
                // handle.
                alone.head.time_ns = now + ticks * MS;
                assert_eq!(coupling.accept(&alone), Ok(()), "{scheme:?}");
            }
            // The hand goes along with its force.
            let x = -1e-6 * ticks as f64;
            let [_, force, ..] = held_tick(&mut coupling, now + ticks * MS, &at(x));
            work += if ticks == 0 { 0.0 } else { last * -1e-6 };
            // The force fades along a smooth step of 200 ticks, which is one and a half times as steep as a line. The
            // spring of 300 N/m, which passes to zero with a blend of ten ticks, answers the hand: by its step, and by a
            // tenth of the hand's way at that time.
            let most =
                1.5 * before.abs() / 200.0 + 300.0 * 1e-6 * (1.0 + 0.1 * ticks.min(30) as f64);
            assert!(
                (force - last).abs() <= most,
                "{scheme:?} {ticks}: {last} -> {force}"
            );
            assert!(ticks > 0 || (force - before).abs() < 1e-9, "{scheme:?}");
            (last, ticks) = (force, ticks + 1);
            assert!(ticks < 250, "{scheme:?}: the force never ends");
        }
        assert!(ticks >= 195, "{scheme:?} {ticks}");
        for more in 0..16 {
            let x = -1e-6 * (ticks - 1) as f64;
            held_tick(&mut coupling, now + (ticks + more) * MS, &at(x));
        }
        assert_eq!(coupling.model().handles().count(), 1);
        assert_eq!(coupling.model().piece_count(), 1);
        // The energy that the force gave to the hand is in the account. The first hand stood still.
        let given = supplied - coupling.energy().supplied;
        assert!(
            (given - work).abs() < 1e-12 && work > 0.0,
            "{scheme:?} {given} {work}"
        );
        assert_eq!(coupling.counters().wrong_handles, 0);
    }
}

#[test]
fn a_force_that_overflowed_is_gone_with_its_cause() {
    let mut coupling = Coupling::new(config(Scheme::Linear));
    let mut model = spring(1, 0, 300.0, 2.0, 1.5);
    let near = hands(Vec3::new(-0.1, 0.0, 0.0), Vec3::new(0.1, 0.0, 0.0), 0.0);
    let far = hands(Vec3::new(-f64::MAX, 0.0, 0.0), Vec3::zeros(), 0.0);
    // A model comes every fourth tick, before the blend to the previous one has ended.
    let mut now = 0;
    let mut tick = |coupling: &mut Coupling, at: &[(Pose, Twist)]| {
        if now % (4 * MS) == 0 {
            model.head.time_ns = now + MS;
            coupling.accept(&model).unwrap();
        }
        now += MS;
        coupling.tick(now, at)[0]
    };
    for _ in 0..20 {
        tick(&mut coupling, &near);
    }
    assert!(!tick(&mut coupling, &far).is_finite());
    for _ in 0..4 {
        tick(&mut coupling, &far);
    }
    // At the latest with the next model, the force is finite again.
    for _ in 0..4 {
        tick(&mut coupling, &near);
    }
    assert!(tick(&mut coupling, &near).is_finite());
}
