//! Tools that turn with the hand: moments against the statics of plates and balls on floors, and on surfaces that yield.

use super::shapes::plate;
use super::*;
use nalgebra::UnitQuaternion;

/// The stiffest rotational spring of the device (N m/rad).
pub(super) const TURNING: f64 = 20.0;
/// Feet on a floor that are nearer to each other than this fraction of the radius are one: by this angle (rad) the normal of a round edge that
/// rolls may lag behind.
const ONE: f64 = 3e-3;

/// A tool that turns, on a device of 3 kN/m and 20 N m/rad.
pub(super) fn turning(hull: &Hull, radius: f64) -> Tool {
    let mut config = rounded(hull, radius).config;
    config.turns = true;
    Tool::new(config)
}

pub(super) fn rigid(triangles: &[[[f64; 3]; 3]], friction: f64) -> Patch {
    let mut patch = obstacle(triangles, friction);
    patch.head.turning_floor.fill_diagonal(1.0 / TURNING);
    patch
}

pub(super) fn hand(place: Vec3, turn: Vec3) -> Pose {
    Pose {
        position: place,
        rotation: UnitQuaternion::from_scaled_axis(turn),
    }
}

/// Leads a tool from one pose of the hand to another in 0.1 s, and waits as long. Returns the wrench.
fn lead(tool: &mut Tool, [from, to]: [(Vec3, Vec3); 2]) -> Wrench {
    let mut wrench = Wrench::zero();
    for tick in 0..200 {
        let part = (f64::from(tick) / 100.0).min(1.0);
        let place = from.0 + (to.0 - from.0) * part;
        wrench = tool.tick(&hand(place, from.1 + (to.1 - from.1) * part));
    }
    wrench
}

#[test]
fn a_tilted_plate_lies_flat_on_a_floor_or_stands_on_its_edge() {
    let (half, radius, depth) = (0.02, 3e-3, 1e-3);
    for tilt in [0.0, 0.001, -0.002, 0.01, -0.05, 0.3] {
        let mut tool = turning(&plate(half, 0.015), radius);
        tool.accept(&rigid(&shapes::floor(), 0.0)).unwrap();
        let above = Vec3::z() * (radius + 2.0 * half);
        let pressed = Vec3::z() * (radius - depth);
        let turn = Vec3::y() * tilt;
        let wrench = lead(&mut tool, [(above, turn), (pressed, turn)]);
        // Flat: the springs of the device give all of it. On an edge: the angle of the plate balances the moment about its centre.
        let (mut force, mut moment) = (STIFFEST * depth, -TURNING * tilt);
        if moment.abs() > half * force {
            let mut angle = tilt.abs();
            for _ in 0..100 {
                force = STIFFEST * (depth + half * angle.sin());
                angle = tilt.abs() - half * angle.cos() * force / TURNING;
            }
            moment = -tilt.signum() * half * angle.cos() * force;
        }
        let expected = Wrench {
            force: Vec3::z() * force,
            moment: Vec3::y() * moment,
        };
        let error = (wrench.stacked() - expected.stacked()).norm();
        assert!(error < 2.0 * ONE * force, "{tilt}: {wrench:?} {expected:?}");
        let lowest = tool
            .config
            .hull
            .turned(&tool.proxy().rotation)
            .lowest(&Vec3::z());
        assert!(
            tool.proxy().position.z + lowest.z > radius - 1e-6 - SOFT * force / STIFFEST,
            "{tilt}"
        );
    }
}

#[test]
fn friction_turns_a_ball_until_it_slides() {
    let (radius, depth, friction) = (8e-3, 1e-3, 0.4);
    for turn in [0.05, -0.2, 1.5] {
        let mut tool = turning(&Hull::POINT, radius);
        tool.accept(&rigid(&shapes::floor(), friction)).unwrap();
        let above = (Vec3::z() * (radius + 1e-3), Vec3::zeros());
        let pressed = Vec3::z() * (radius - depth);
        lead(&mut tool, [above, (pressed, Vec3::zeros())]);
        let wrench = lead(
            &mut tool,
            [(pressed, Vec3::zeros()), (pressed, Vec3::x() * turn)],
        );
        let most = friction * STIFFEST * depth;
        let sticks = radius * turn / (1.0 / STIFFEST + radius * radius / TURNING);
        // The lowest point goes along +y by a turn about +x, and the floor holds it back.
        let expected = sticks.clamp(-most, most);
        assert!(
            (wrench.force.y + expected).abs() < 2.0 * ONE * wrench.force.norm(),
            "{turn}: {wrench:?} {expected}"
        );
        assert!(
            (wrench.moment.x + radius * expected).abs() < ONE * STIFFEST * depth * radius,
            "{turn} {wrench:?} {expected}"
        );
    }
}

/// The hand presses a plate and rocks it, after it has come down from above.
fn rocked(tick: u32, height: f64) -> Pose {
    let above = 0.05 * (0.1 - f64::from(tick) * PERIOD).max(0.0);
    let turn = 2.0 * core::f64::consts::PI * f64::from(tick) * PERIOD;
    let place = Vec3::new(
        1e-3 * turn.sin(),
        0.5e-3 * (2.0 * turn).sin(),
        height + 1e-3 - 2e-3 * (0.5 * turn).sin().abs() + above,
    );
    let tilt = Vec3::new(
        0.1 * (3.0 * turn).sin(),
        0.08 * (2.3 * turn).cos(),
        0.05 * turn.sin(),
    );
    hand(place, tilt)
}

/// A flat plate is turned about the normal of a floor until it slides. Its corners bear it, so the moment of friction is nearly that of all
/// friction at the corners.
#[test]
fn friction_at_its_corners_turns_a_flat_plate() {
    for [half, other] in [[0.027, 0.017], [0.02, 0.02]] {
        let (radius, depth, friction) = (3e-3, 2e-3, 0.5);
        let mut tool = turning(&plate(half, other), radius);
        tool.accept(&rigid(&shapes::floor(), friction)).unwrap();
        let pose = |above: f64, turn: f64| hand(Vec3::z() * (radius + above), Vec3::z() * turn);
        lead(
            &mut tool,
            [
                (Vec3::z() * 2.0 * radius, Vec3::zeros()),
                (Vec3::z() * (radius - depth), Vec3::zeros()),
            ],
        );
        let most = friction * STIFFEST * depth * half.hypot(other);
        let slides_at = most / TURNING;
        for tick in 0..100 {
            let turn = 2.0 * slides_at * f64::from(tick) * 0.01;
            let moment = -tool.tick(&pose(-depth, turn)).moment.z;
            let stuck = TURNING * turn;
            if stuck < 0.8 * most {
                // The compliance of the contacts gives way a little.
                assert!(
                    (moment - stuck).abs() < 0.01 * most,
                    "{turn}: {moment} {stuck}"
                );
            } else if stuck > 1.1 * most {
                assert!(
                    moment > 0.85 * most && moment < 1.001 * most,
                    "{turn}: {moment} {most}"
                );
            }
        }
    }
}

#[test]
fn messages_that_tell_nothing_new_change_no_moment() {
    for friction in [0.0, 0.4] {
        let patch = pad(4e-3, 1.0 / 800.0, 3e-3, friction);
        let hull = plate(5e-3, 4e-3);
        let (mut truth, mut tool) = (turning(&hull, 2e-3), turning(&hull, 2e-3));
        truth.accept(&patch).unwrap();
        tool.accept(&patch).unwrap();
        let mut sent = Vec::new();
        let (mut worst, mut peak) = ([0.0_f64; 2], [0.0_f64; 2]);
        for tick in 0..1000_u32 {
            let pose = rocked(tick, 2e-3);
            let exact = truth.tick(&pose);
            sent.push(loads(truth.contacts()));
            if tick % 16 == 0 && tick > 4 {
                let mut new = after(&patch, &sent[tick as usize - 4], 2 + u64::from(tick));
                new.head.period = 0.016;
                tool.see_age(4.0 * PERIOD);
                tool.accept(&new).unwrap();
            }
            let wrench = tool.tick(&pose);
            let pairs = [(wrench.force, exact.force), (wrench.moment, exact.moment)];
            for ((worst, peak), (found, right)) in worst.iter_mut().zip(&mut peak).zip(pairs) {
                *worst = worst.max((found - right).norm());
                *peak = peak.max(right.norm());
            }
        }
        for (worst, peak) in worst.into_iter().zip(peak) {
            // What linearizations leave that start elsewhere.
            assert!(worst < 5e-3 * peak, "{friction}: {worst:e} {peak}");
        }
        assert!(peak[0] > 1.0 && peak[1] > 2e-3, "{peak:?}");
    }
}

#[test]
fn no_loop_of_the_hand_gives_it_energy() {
    for (hull, radius) in [(plate(0.02, 0.015), 3e-3), (Hull::POINT, 8e-3)] {
        for (patch, friction) in [(true, 0.0), (true, 0.5), (false, 0.5)] {
            let mut tool = turning(&hull, radius);
            tool.accept(&if patch {
                rigid(&shapes::floor(), friction)
            } else {
                pad(4e-3, 1.0 / 800.0, 3e-3, friction)
            })
            .unwrap();
            let (mut work, mut least, mut last) = (0.0, 0.0_f64, None::<(Pose, Wrench)>);
            let mut allowed = 1e-5;
            for tick in 0..4000_u32 {
                let pose = rocked(tick, radius);
                let wrench = tool.tick(&pose);
                if let Some((before, felt)) = last {
                    let mean = (felt.stacked() + wrench.stacked()) * 0.5;
                    let moved = pose.displacement_from(&before);
                    work -= mean.dot(&moved);
                    let way =
                        moved.fixed_rows::<3>(0).norm() + radius * moved.fixed_rows::<3>(3).norm();
                    allowed += ONE * mean.fixed_rows::<3>(0).norm() * way;
                    least = least.min(work - tool.stored() + allowed);
                }
                last = Some((pose, wrench));
            }
            assert!(least >= 0.0, "{radius} {patch} {friction}: {least:e}");
            assert!(friction == 0.0 || work > 1e-4, "{work:e}");
        }
    }
}

#[test]
fn a_plate_held_with_tremor_does_not_creep() {
    let mut tool = turning(&plate(0.02, 0.015), 3e-3);
    tool.accept(&rigid(&shapes::floor(), 0.5)).unwrap();
    let pressed = Vec3::z() * 2e-3;
    let lean = Vec3::new(5e-4, -3e-4, 1e-4);
    lead(&mut tool, [(pressed * 3.0, lean), (pressed, lean)]);
    lead(
        &mut tool,
        [(pressed, lean), (pressed + Vec3::x() * 2e-4, lean)],
    );
    let start = tool.proxy();
    let mut most = 0.0_f64;
    for tick in 0..60_000_u32 {
        let time = f64::from(tick) * PERIOD;
        let at = |rate: f64| (2.0 * core::f64::consts::PI * rate * time).sin();
        let place = pressed + Vec3::new(2e-4 + 2e-5 * at(9.0), 2e-5 * at(8.3), 2e-5 * at(10.1));
        let turn = lean + Vec3::new(at(9.7), at(8.9), 0.1 * at(11.3)) * 2e-4;
        tool.tick(&hand(place, turn));
        let moved = tool.proxy().displacement_from(&start);
        most = most.max(moved.fixed_rows::<2>(0).norm());
    }
    let held = lead(
        &mut tool,
        [
            (pressed + Vec3::x() * 2e-4, lean),
            (pressed + Vec3::x() * 2e-4, lean),
        ],
    );
    assert!(held.force.z > 2.9, "{held:?}");
    let moved = tool.proxy().displacement_from(&start);
    assert!(
        moved.fixed_rows::<2>(0).norm() < 1e-6 && moved.fixed_rows::<3>(3).norm() < 1e-5,
        "{moved} {most:e}"
    );
}
