//! The damping that a device renders under the cap, in translation and in rotation. It never exceeds the damping that
//! the device can render, whatever the damping of the body. For each of two hands, the properties of its own device
//! count. A late spring acts as a damper, too.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use nalgebra::{Matrix3, UnitQuaternion};
use rt_core::coupling::{Coupling, CouplingConfig, Passed};
use rt_core::{
    LocalModel, MAX_DEVICES, Mat6, PassivityConfig, Port, Pose, Scheme, Twist, Vec3, Vec6, Wrench,
};

const PERIOD: f64 = 1e-3;

/// A coupling of two devices that render `delay` ticks late, and whose largest dampings (N s/m, N m s/rad) are `most`.
fn coupling(delay: usize, most: [[f64; 2]; 2]) -> Coupling {
    let mut passivity = PassivityConfig::new(PERIOD);
    passivity.delay = delay;
    for (port, [damping, turning]) in passivity.ports.iter_mut().zip(most) {
        *port = Port {
            most_damping: damping,
            most_turning_damping: turning,
            ..Port::UNKNOWN
        };
    }
    Coupling::new(config(&passivity))
}

fn config(passivity: &PassivityConfig) -> CouplingConfig {
    CouplingConfig {
        scheme: Scheme::Capped,
        period: PERIOD,
        blend: 0.5,
        age_limit: 1e3,
        decay: 0.1,
        recovery: PERIOD,
        hold_damping: [0.0; MAX_DEVICES],
        passivity: *passivity,
    }
}

/// A body with two handles. It stores so much energy of its own that the cap withholds nothing.
fn body() -> LocalModel {
    let mut model = LocalModel::empty();
    (model.head.sequence, model.head.time_ns, model.head.period) = (1, 1, PERIOD);
    model.head.handle_count = 2;
    model.handles[1].device = 1;
    model.head.energy = 100.0;
    model.head.released = model.head.energy;
    model
}

/// A block whose largest row sum is `linear` for translations and `angular` for rotations, and that reaches it along the
/// difference of the first two axes: the largest eigenvalue.
fn block(linear: f64, angular: f64) -> Mat6 {
    let part = Matrix3::new(3.0, -2.0, 0.0, -2.0, 3.0, 0.0, 0.0, 0.0, 1.0) / 5.0;
    let mut block = Mat6::zeros();
    block
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(part * linear));
    block
        .fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&(part * angular));
    block
}

/// The direction of the largest eigenvalue of a block.
fn worst() -> Vec3 {
    Vec3::new(1.0, -1.0, 0.0).normalize()
}

/// Moves both hands at steady velocities (m/s, rad/s) for `ticks`, from the references on. Returns the last wrenches, and
/// the displacements at that time.
fn moved(coupling: &mut Coupling, velocities: [Vec6; 2], ticks: u32) -> ([Vec6; 2], [Vec6; 2]) {
    let mut last = ([Vec6::zeros(); 2], [Vec6::zeros(); 2]);
    for tick in 0..=ticks {
        let gone = velocities.map(|velocity| velocity * (f64::from(tick) * PERIOD));
        let at = [0, 1].map(|i| {
            let [x, y, z, a, b, c] = gone[i].into();
            let pose = Pose {
                position: Vec3::new(x, y, z),
                rotation: UnitQuaternion::from_scaled_axis(Vec3::new(a, b, c)),
            };
            let [x, y, z, a, b, c] = velocities[i].into();
            let twist = Twist {
                linear: Vec3::new(x, y, z),
                angular: Vec3::new(a, b, c),
            };
            (pose, twist)
        });
        let wrenches = coupling.tick(1, &at);
        let mut held = [Wrench::zero(); MAX_DEVICES];
        (held[0], held[1]) = (wrenches[0], wrenches[1]);
        coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
        last = ([0, 1].map(|i| wrenches[i].stacked()), gone);
    }
    assert_eq!(coupling.energy().capped, 0);
    last
}

fn linear(v: Vec3) -> Vec6 {
    Vec6::new(v.x, v.y, v.z, 0.0, 0.0, 0.0)
}

fn angular(v: Vec3) -> Vec6 {
    Vec6::new(0.0, 0.0, 0.0, v.x, v.y, v.z)
}

#[test]
fn each_device_renders_no_more_damping_than_it_can() {
    // Dampings of the body at each handle, and between the handles.
    let (own, turning) = ([8.0, 3.0], [0.08, 0.02]);
    let between = block(0.5, 0.005);
    let none = f64::INFINITY;
    for most in [
        [[none, none], [none, none]],
        // As much as the body has.
        [[8.0, 0.08], [3.0, 0.02]],
        [[2.0, none], [none, none]],
        [[none, 0.01], [none, none]],
        [[none, none], [1.0, 0.002]],
        [[2.0, 0.01], [1.0, 0.002]],
    ] {
        let mut model = body();
        for i in 0..2 {
            model.damping[i][i] = block(own[i], turning[i]);
            model.damping[i][1 - i] = between;
        }
        for hand in 0..2 {
            let rendered = [
                own[hand].min(most[hand][0]),
                turning[hand].min(most[hand][1]),
            ];
            // One hand goes along the direction that the body damps most, or turns about it.
            let motions = [linear(worst()) * 0.1, angular(worst())];
            for (kind, motion) in motions.into_iter().enumerate() {
                let mut coupling = coupling(0, most);
                coupling.accept(&model).expect("a sound model");
                let mut velocities = [Vec6::zeros(); 2];
                velocities[hand] = motion;
                let (wrenches, _) = moved(&mut coupling, velocities, 20);
                // Rounding of forces of order one.
                let near = |found: Vec6, expected: Vec6| {
                    let off = (found - expected).amax();
                    assert!(off < 1e-12, "{most:?} {hand} {kind}: {found} {expected}");
                };
                near(wrenches[hand], -motion * rendered[kind]);
                // The other hand feels the damper between the two, reduced by the geometric means of both reductions:
                // the damping matrix stays positive semidefinite.
                let reduced = [0, 1].map(|i| {
                    let all = [own[i], turning[i]][kind];
                    all.min(most[i][kind]) / all
                });
                let factor = (reduced[0] * reduced[1]).sqrt();
                near(wrenches[1 - hand], -between * motion * factor);
            }
        }
    }
}

#[test]
fn a_spring_leads_by_its_lag_as_far_as_the_device_can_damp() {
    let (k, turning) = ([1000.0, 400.0], [2.0, 1.0]);
    for (delay, most) in [
        (0, [[f64::INFINITY; 2]; 2]),
        (2, [[f64::INFINITY; 2]; 2]),
        // Half a step of a spring of 1,000 N/m is a damper of 0.5 N s/m at ticks of a millisecond.
        (0, [[0.1, 0.0002], [0.1, 0.0002]]),
        (0, [[0.1, 0.1], [10.0, 0.0001]]),
        (3, [[1.0, 0.001], [0.3, 10.0]]),
    ] {
        let mut model = body();
        for i in 0..2 {
            model.stiffness[i][i] = block(k[i], turning[i]);
        }
        let mut coupling = coupling(delay, most);
        coupling.accept(&model).expect("a sound model");
        for hand in 0..2 {
            let motions = [linear(worst()) * 0.01, angular(worst()) * 0.1];
            for (kind, motion) in motions.into_iter().enumerate() {
                let mut coupling = coupling.clone();
                let mut velocities = [Vec6::zeros(); 2];
                velocities[hand] = motion;
                let (wrenches, gone) = moved(&mut coupling, velocities, 20);
                let stiffness = [k[hand], turning[hand]][kind];
                let late = (0.5 + delay as f64) * PERIOD;
                let damping = (stiffness * late).min(most[hand][kind]);
                let expected = -gone[hand] * stiffness - motion * damping;
                // Rounding of a rotation's logarithm.
                let off = (wrenches[hand] - expected).amax();
                assert!(off < 1e-12, "{delay} {hand} {kind}: {off}");
                assert_eq!(wrenches[1 - hand], Vec6::zeros());
            }
        }
    }
}

#[test]
fn a_count_after_a_rest_leads_by_the_part_of_its_tick_in_the_rest() {
    let (k, count) = (5000.0, 4e-5);
    // Ticks from each step to the next, and counts of each step.
    for (every, counts, part) in [
        (1, 1.0, 1.0),
        (2, 1.0, 0.5),
        (10, 1.0, 0.1),
        // The hand made several counts in a tick: it moves.
        (10, 2.0, 1.0),
    ] {
        let mut passivity = PassivityConfig::new(PERIOD);
        for port in &mut passivity.ports {
            port.count = count;
        }
        let mut coupling = Coupling::new(config(&passivity));
        let mut model = body();
        model.stiffness[0][0] = block(k, 0.0);
        coupling.accept(&model).expect("a sound model");
        let step = Vec3::x() * (counts * count);
        for tick in 0..=10 * every {
            let place = step * f64::from(tick / every);
            let hands = [place, Vec3::zeros()].map(|place| (Pose::at(place), Twist::zero()));
            let force = coupling.tick(1, &hands)[0].force;
            let stepped = tick > every && tick % every == 0;
            let lead = if stepped { 0.5 * part } else { 0.0 };
            let fall = block(k, 0.0).fixed_view::<3, 3>(0, 0) * (place + step * lead);
            if tick > every {
                // Rounding of some newtons.
                assert!((force + fall).norm() < 1e-12, "{every} {counts} {tick}");
            }
        }
    }
}

#[test]
fn the_first_count_of_a_run_is_a_motion_in_either_direction() {
    let (b, count, speed) = (5.0, 4e-5, 0.01);
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let mut passivity = PassivityConfig::new(PERIOD);
            passivity.ports[0].count = count;
            let mut coupling = Coupling::new(config(&passivity));
            let mut model = body();
            model.damping[0][0] = Mat6::identity() * b;
            coupling.accept(&model).expect("a sound model");
            let way = Vec3::from_fn(|i, _| if i == axis { sign } else { 0.0 });
            let mut at = |counts: f64| {
                let twist = Twist {
                    linear: way * (speed * counts),
                    ..Twist::zero()
                };
                coupling.tick(1, &[(Pose::at(way * (counts * count)), twist)])[0].force
            };
            for _ in 0..10 {
                at(0.0);
            }
            assert!((at(1.0) + way * (b * speed)).norm() < 1e-12, "{way}");
            // A count back is none.
            at(0.0);
            assert_eq!(at(0.0), Vec3::zeros());
        }
    }
}

/// A body that claims more energy than any hand has supplied, from its second model on: the cap damps its hands.
fn claiming(most: [[f64; 2]; 2]) -> Coupling {
    let mut coupling = coupling(0, most);
    let mut model = body();
    for (time, energy) in [(1, 10e-3), (2, 40e-3)] {
        (model.head.sequence, model.head.time_ns, model.head.energy) = (time, time, energy);
        coupling.accept(&model).expect("a sound model");
        for _ in 0..20 {
            coupling.tick(2, &[(Pose::identity(), Twist::zero()); 2]);
        }
    }
    coupling
}

/// Ticks in which the damper that takes out missing energy grows to the largest damping of a device.
const EASE: f64 = 20.0;

#[test]
fn missing_energy_is_taken_out_of_each_hand_whose_velocity_agrees_with_its_motion() {
    let most = [[3.0, 0.02], [5.0, 0.01]];
    let coupling = claiming(most);
    // Numbers between minus one and one (xorshift, G. Marsaglia 2003).
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut number = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let mut seen = [0; 2];
    for case in 0..400 {
        let mut coupling = coupling.clone();
        let mut vector = |scale: f64| Vec3::from_fn(|_, _| scale * number());
        let steps = [0, 1].map(|_| [vector(1e-4), vector(1e-3)]);
        let mut twists = [0, 1].map(|_| Twist {
            linear: vector(0.1),
            angular: vector(1.0),
        });
        match case % 7 {
            // A hand that creeps.
            0 => {
                twists[0].linear = vector(1.0).normalize() * 0.99e-3;
                twists[0].angular = vector(1.0).normalize() * 0.019;
            }
            // Hands that only turn.
            3 => twists[0].linear = vector(1.0).normalize() * 0.99e-3,
            4 => {
                twists[1].linear = Vec3::zeros();
                twists[1].angular = vector(1.0).normalize() * 0.021;
            }
            1 => twists[1].linear = vector(1.0).normalize() * 1.01e-3,
            // A rotation that outweighs the translation.
            2 => twists[0].angular *= 10.0,
            _ => {}
        }
        let at = [0, 1].map(|i| {
            let [by, turn] = steps[i];
            let rotation = UnitQuaternion::from_scaled_axis(turn);
            let pose = Pose {
                position: by,
                rotation,
            };
            (pose, twists[i])
        });
        let wrenches = coupling.tick(2, &at);
        for i in 0..2 {
            let [by, turn] = steps[i];
            let along = by.dot(&twists[i].linear) + turn.dot(&twists[i].angular);
            let clear = twists[i].linear.norm() > 1e-3 || twists[i].angular.norm() > 0.02;
            let agrees = along > 0.0 && clear;
            seen[usize::from(agrees)] += 1;
            let part = if agrees { 1.0 / EASE } else { 0.0 };
            let [linear, angular] = most[i];
            let wanted = [twists[i].linear * -linear, twists[i].angular * -angular];
            for (found, wanted) in [wrenches[i].force, wrenches[i].moment].iter().zip(wanted) {
                assert!((found - wanted * part).norm() < 1e-12, "{case} {i}");
            }
        }
    }
    assert!(seen.iter().all(|&times| times > 100), "{seen:?}");
}

#[test]
fn the_damper_for_missing_energy_comes_and_goes_in_20_ms() {
    let (most, speed) = (3.0, 0.1);
    let mut coupling = claiming([[most, 0.0]; 2]);
    let mut model = body();
    let mut last = 0.0;
    for tick in 1..=80_u64 {
        if tick == 41 {
            // The claim ends.
            (model.head.sequence, model.head.time_ns, model.head.energy) = (3, 3, 0.0);
            coupling.accept(&model).expect("a sound model");
        }
        let x = speed * PERIOD * tick as f64;
        let twist = Twist {
            linear: Vec3::x() * speed,
            ..Twist::zero()
        };
        let hands = [(Pose::at(Vec3::x() * x), twist); 2];
        let wrenches = coupling.tick(3, &hands);
        assert_eq!(wrenches[0], wrenches[1]);
        let force = -wrenches[0].force.x;
        let wanted = match tick {
            ..=40 => most * speed * (tick as f64 / EASE).min(1.0),
            // A change of model takes two ticks, in which the claim vanishes.
            41..=43 => force,
            _ => (last - most * speed / EASE).max(0.0),
        };
        // Rounding of a sum of twenty parts.
        assert!((force - wanted).abs() < 1e-12, "{tick} {force} {wanted}");
        assert!((force - last).abs() < most * speed / EASE * (1.0 + 1e-9));
        last = force;
    }
    assert_eq!(last, 0.0);
}

#[test]
fn the_damper_goes_on_in_the_parts_of_a_piece_and_in_no_other_piece() {
    // Three hands. The first holds a piece, and the others hold another, which parts. One of the two claims too much.
    let most = [3.0, 0.0];
    let speed = 0.1;
    for claims in [0, 1] {
        let mut coupling = coupling(0, [most; 2]);
        let model = |time: u64, pieces: [u8; 3], much: f64| {
            let mut model = body();
            model.head.handle_count = 3;
            model.handles[2].device = 2;
            (model.head.sequence, model.head.time_ns) = (time, time);
            model.head.epoch = u32::from(pieces[2] == 2);
            for (handle, piece) in model.handles.iter_mut().zip(pieces) {
                handle.piece = piece;
            }
            let parts = f64::from(pieces[2]);
            model.head.pieces[0].stored = 10e-3 * if claims == 0 { much } else { 1.0 };
            for piece in &mut model.head.pieces[1..=usize::from(pieces[2])] {
                piece.stored = 10e-3 * if claims == 1 { much } else { 1.0 } / parts;
            }
            model.head.energy = model.head.pieces.iter().map(|piece| piece.stored).sum();
            model.head.released = model.head.energy;
            model
        };
        let mut place = 0.0;
        let mut tick = |coupling: &mut Coupling| {
            place += speed * PERIOD;
            let twist = Twist {
                linear: Vec3::x() * speed,
                ..Twist::zero()
            };
            let wrenches = coupling.tick(3, &[(Pose::at(Vec3::x() * place), twist); 3]);
            [0, 1, 2].map(|i| -wrenches[i].force.x)
        };
        for (time, pieces, much) in [
            (1, [0, 1, 1], 1.0),
            (2, [0, 1, 1], 10.0),
            (3, [0, 1, 2], 10.0),
        ] {
            let accepted = coupling.accept(&model(time, pieces, much));
            accepted.expect("a sound model");
            for _ in 0..40 {
                let forces = tick(&mut coupling);
                if time == 3 {
                    // The third device is of unknown properties, so its damper is larger.
                    let damped = |i: usize| if claims == 0 { i == 0 } else { i > 0 };
                    for (i, force) in forces.into_iter().enumerate() {
                        assert_eq!(force > 0.2, damped(i), "{claims} {i} {forces:?}");
                        assert!(force > 0.2 || force == 0.0, "{claims} {i} {forces:?}");
                    }
                }
            }
        }
    }
}
