use super::*;
use std::collections::BTreeSet;

#[test]
fn draws_repeat_and_stay_in_what_the_study_states() {
    let mut met = BTreeSet::new();
    let mut stiff = 0;
    for cell in 0..2000 {
        let draw = Draw::new(3, cell);
        assert_eq!(draw, Draw::new(3, cell));
        // A number between two bounds is a power of their ratio, which rounds.
        let within = |x: f64, [low, high]: [f64; 2]| {
            assert!(x >= low * (1.0 - 1e-12) && x <= high * (1.0 + 1e-12), "{x}");
        };
        within(draw.rate, RATES);
        within(draw.ratio, [RATIOS[0][0], RATIOS[1][1]]);
        within(draw.latency * draw.rate, [0.0, MOST_LATENCY]);
        let steps = draw.step_rate / draw.rate;
        assert!((steps - steps.round()).abs() < 1e-9 * steps, "{steps}");
        assert!((1..=3).contains(&draw.hands.len()));
        for hand in &draw.hands {
            let length: f64 = hand.direction.iter().map(|x| x * x).sum();
            assert!((length - 1.0).abs() < 1e-12);
            within(hand.scale, SCALES);
        }
        stiff += u64::from(draw.ratio > 1.0);
        met.insert((draw.kind, draw.hands[0].device.clone()));
    }
    assert_eq!(met.len(), Kind::ALL.len() * DeviceModel::spatial().count());
    // Half of the bodies, within four standard deviations.
    assert!((1000_u64).abs_diff(stiff) < 90, "{stiff}");
}

#[test]
fn the_body_is_as_stiff_as_drawn_and_no_hand_exceeds_its_force() {
    let kinds = Kind::ALL.len() as u64;
    for cell in 0..kinds {
        let draw = Draw::new(5, cell);
        let loaded = draw.scene("test").expect("it is sound");
        let world = World::new(&loaded).expect("it is sound");
        let mut body = world.bodies[0].body.clone();
        let devices: Vec<_> = (0..draw.hands.len()).collect();
        let found = Rendered::new(&world, &devices, &mut body, SLOW).expect("it condenses");
        // The inertia of a body over the long period, whose density does not follow the modulus.
        let ratio = found.ratio() / draw.ratio;
        assert!((ratio - 1.0).abs() < 1e-3, "cell {cell}: {ratio} {draw:?}");
    }
}
