//! Taking hold: what a tool holds neither opens nor slips, and neither taking hold nor letting go is a jump.

use super::shapes::{floor, plate};
use super::turning::{TURNING, hand, rigid, turning};
use super::*;
use crate::tool::message::UNFELT;

/// The stiffness (N/m) of a device of 3 kN/m in series with a contact that is held, along its normal and across.
const ALONG: f64 = STIFFEST / (1.0 + SOFT);
const ACROSS: f64 = STIFFEST / (1.0 + SOFT_ACROSS);

/// Lets the hand of a ball of 5 mm on a floor without friction press by 1 mm and take hold there.
fn held_on_floor(patch: &Patch) -> Tool {
    let mut tool = ball(5e-3);
    tool.accept(patch).unwrap();
    for down in 0..=20 {
        tool.push(&(Vec3::z() * (6e-3 - 1e-4 * f64::from(down))));
    }
    let pressed = tool.wrench().force;
    assert!((pressed.z - 1e-3 * STIFFEST).abs() < 1e-9);
    tool.take_hold(true);
    // Nothing changes where nothing moves.
    assert!((tool.push(&(Vec3::z() * 4e-3)) - pressed).norm() < 1e-9);
    tool
}

#[test]
fn a_held_floor_draws_the_hand_back_like_a_spring() {
    let mut tool = held_on_floor(&obstacle(&floor(), 0.0));
    for tick in 0..=400 {
        // In a circle, up to 2 mm above the place where an open contact ends.
        let turn = f64::from(tick) / 100.0;
        let (to, up) = (1e-3 * turn.sin(), 1.5e-3 * (1.0 - turn.cos()));
        let force = tool.push(&Vec3::new(to, -2.0 * to, 4e-3 + up));
        let expected = Vec3::new(-to * ACROSS, 2.0 * to * ACROSS, 3.0 - up * ALONG);
        let error = (force - expected).norm();
        assert!(error < 1e-6 * STIFFEST, "{tick}: {force} {expected}");
    }
}

#[test]
fn a_hand_that_lets_go_loses_its_force_within_half_a_period() {
    let mut patch = obstacle(&floor(), 0.0);
    patch.head.period = 0.016;
    let mut tool = held_on_floor(&patch);
    let pulled = Vec3::new(1e-3, 0.0, 7e-3);
    for part in 0..=20 {
        let to = f64::from(part) / 20.0;
        tool.push(&(Vec3::z() * 4e-3).lerp(&pulled, to));
    }
    let mut before = tool.wrench().force;
    let expected = Vec3::new(-1e-3 * ACROSS, 0.0, 3.0 - 3e-3 * ALONG);
    assert!((before - expected).norm() < 1e-6 * STIFFEST, "{before}");
    let whole = before.norm();
    tool.take_hold(false);
    for tick in 1..=8 {
        let force = tool.push(&pulled);
        // What no hand feels is dropped at once.
        let most = whole / 8.0 + UNFELT;
        assert!((force - before).norm() < most, "{tick}: {force} {before}");
        before = force;
    }
    assert_eq!(before, Vec3::zeros());
    assert!(tool.contacts().iter().all(|contact| !contact.is_held));
}

#[test]
fn a_hand_takes_hold_of_what_it_presses_and_of_nothing_else() {
    let mut tool = ball(5e-3);
    tool.accept(&obstacle(&floor(), 0.0)).unwrap();
    tool.take_hold(true);
    // Above the floor there is nothing to hold, whatever the button says.
    for up in [8e-3, 5.5e-3, 5.01e-3, 6e-3, 5.2e-3] {
        assert_eq!(tool.push(&(Vec3::z() * up)), Vec3::zeros());
    }
    // A floor that comes to press is held.
    tool.push(&(Vec3::z() * 4.9e-3));
    let force = tool.push(&(Vec3::z() * 5.1e-3));
    let expected = 1e-4 * STIFFEST - 2e-4 * ALONG;
    assert!((force.z - expected).abs() < 1e-6, "{force}");
}

/// The host publishes at 60 Hz, 4 ms late, and holds the same points. In between the body is torn: its points are others.
#[test]
fn a_message_about_a_held_surface_changes_nothing() {
    for (torn, most) in [(false, 2e-3), (true, 0.02)] {
        let patch = pad(4e-3, 1.0 / 800.0, 3e-3, 0.2);
        let (mut truth, mut tool) = (ball(8e-3), ball(8e-3));
        truth.accept(&patch).unwrap();
        tool.accept(&patch).unwrap();
        let mut sent = Vec::new();
        let (mut worst, mut peak, mut pulled) = (0.0_f64, 0.0_f64, 0.0_f64);
        for tick in 0..900_u32 {
            let time = f64::from(tick) * PERIOD;
            let turn = 2.0 * core::f64::consts::PI * time;
            let down = 2e-3 * (turn.sin() + 0.8).min(8.0 * time);
            let at = Vec3::new(1e-3 * (2.0 * turn).sin(), 5e-4 * turn.sin(), 8e-3 - down);
            truth.take_hold(tick > 100);
            tool.take_hold(tick > 100);
            let exact = truth.push(&at);
            sent.push(loads(truth.contacts()));
            if tick % 16 == 0 && tick > 4 {
                let mut new = after(&patch, &sent[tick as usize - 4], 2 + u64::from(tick));
                new.head.period = 0.016;
                if torn && tick > 400 {
                    new.head.epoch = 1 + tick / 400;
                }
                tool.see_age(4.0 * PERIOD);
                tool.accept(&new).unwrap();
            }
            let force = tool.push(&at);
            worst = worst.max((force - exact).norm());
            peak = peak.max(exact.norm());
            pulled = pulled.max(-force.z);
        }
        assert!(pulled > 0.3 && peak > 1.0, "{pulled} {peak}");
        assert!(worst < most * peak, "{torn}: {worst:e} {peak}");
    }
}

#[test]
fn a_held_plate_draws_and_turns_the_hand_back() {
    let radius = 3e-3;
    let mut tool = turning(&plate(0.02, 0.015), radius);
    tool.accept(&rigid(&floor(), 0.0)).unwrap();
    let rest = Vec3::z() * radius;
    for down in 0..=20 {
        let at = rest + Vec3::z() * (1e-3 - 1e-4 * f64::from(down));
        tool.tick(&hand(at, Vec3::zeros()));
    }
    tool.take_hold(true);
    for tick in 0..=300 {
        let turn = f64::from(tick) / 50.0;
        let way = Vec3::new(turn.sin(), 1.0 - turn.cos(), 0.7 * turn.sin()) * 1e-3;
        let tilt = Vec3::new(0.5 * turn.sin(), 0.3 * turn.sin(), 1.0 - turn.cos()) * 0.005;
        let at = rest - Vec3::z() * 1e-3 * (-turn).exp() + way;
        let wrench = tool.tick(&hand(at, tilt));
        let expected = Wrench {
            force: (rest - at) * STIFFEST,
            moment: tilt * -TURNING,
        };
        // Across, the contacts themselves yield by 1 um/N: by a fiftieth of the largest turn about the normal.
        let error = (wrench.force - expected.force).norm() / STIFFEST;
        let turned = (wrench.moment - expected.moment).norm() / TURNING;
        assert!(
            error < 1e-5 && turned < 3e-4,
            "{tick}: {error:e} {turned:e}"
        );
    }
}
