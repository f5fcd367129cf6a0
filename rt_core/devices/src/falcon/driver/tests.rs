//! The states of the driver: the velocity at any times of the packets, and what it says of the torques. `sim/tests` has
//! the driver against an emulated Falcon.

use super::super::geometry::{count_of, inverse};
use super::*;
use crate::Transport;
use proptest::prelude::*;

const PERIOD: f64 = 1e-3;
const PERIOD_NS: u64 = 1_000_000;

/// No chip.
struct Nothing;

impl Transport for Nothing {
    fn read(&mut self, _: &mut [u8], _: Duration) -> Result<usize, i32> {
        Err(NO_DEVICE)
    }
    fn write(&mut self, _: &[u8]) -> Result<(), i32> {
        Err(NO_DEVICE)
    }
}

impl Ftdi for Nothing {
    fn control(&mut self, _: Control) -> Result<(), i32> {
        Err(NO_DEVICE)
    }
}

fn falcon() -> Falcon<Nothing> {
    let firmware = Firmware::new(std::path::Path::new("none"), vec![0]).expect("an image");
    let settings = Settings {
        firmware,
        tries: Tries::default(),
        period: PERIOD,
    };
    Falcon::unopened(|| Err(NO_DEVICE), || 0, settings)
}

/// The report of a homed Falcon with the grip at `x` to the right of the centre (m), and its position in counts.
fn report(x: f64) -> Report {
    let angles = inverse(&(CENTRE + Vec3::new(x, 0.0, 0.0))).expect("in reach");
    Report {
        encoders: angles.map(|angle| count_of(angle).round() as i16),
        homed: [true; 3],
        ..Report::default()
    }
}

/// The state of the grip at `x` (m), asked for at `at_ns`.
fn state(falcon: &mut Falcon<Nothing>, at_ns: u64, x: f64) -> DeviceState {
    falcon.written_ns = at_ns;
    falcon.state(&report(x)).expect("a state")
}

/// A grip that moves steadily has its velocity after states that are missing, however many: the positions between reach
/// the new one.
#[test]
fn a_steady_motion_keeps_its_velocity_across_missing_states() {
    // 0.05 m/s for the longest time of a gap.
    for missing in [0, 1, 2, 3, 7, 20, 99] {
        let mut falcon = falcon();
        let mut at_ns = 0;
        let mut x = -0.02;
        let mut move_on = |periods: u64| {
            at_ns += periods * PERIOD_NS;
            x += 0.2 * PERIOD * periods as f64;
            state(&mut falcon, at_ns, x).twist.linear.x
        };
        for _ in 0..20 {
            move_on(1);
        }
        let steady = move_on(1);
        let after = move_on(missing + 1);
        let next = move_on(1);
        // A count over the window of four periods, at each of its ends.
        let most = 2.0 * STEP / (4.0 * PERIOD);
        for found in [steady, after, next] {
            assert!(
                (found - 0.2).abs() <= most,
                "{missing}: {steady}, {after}, {next}"
            );
        }
    }
}

/// The velocity is that up to the new position: a grip that rests and then moves has a velocity in the first state of the
/// motion, and none as soon as its window holds no motion.
#[test]
fn a_motion_shows_in_the_state_that_has_it() {
    for missing in [0, 1, 4] {
        let mut falcon = falcon();
        for k in 0..20 {
            state(&mut falcon, k * PERIOD_NS, 0.0);
        }
        let moved_ns = (20 + missing) * PERIOD_NS;
        let way = PERIOD * (missing + 1) as f64;
        let moves = state(&mut falcon, moved_ns, way).twist.linear.x;
        // A count at each end of the motion.
        let most = 2.0 * STEP / way;
        assert!((moves - 1.0).abs() <= most, "{missing}: {moves}");
        let mut rests = moves;
        for k in 1..=5 {
            rests = state(&mut falcon, moved_ns + k * PERIOD_NS, way)
                .twist
                .linear
                .x;
        }
        assert_eq!(rests, 0.0, "{missing}");
    }
}

/// After a longer silence the velocity begins anew.
#[test]
fn a_long_silence_makes_no_velocity() {
    let mut falcon = falcon();
    for k in 0..20 {
        state(&mut falcon, k * PERIOD_NS, 0.0);
    }
    let back = state(&mut falcon, 3000 * PERIOD_NS, 0.02);
    assert_eq!(back.twist.linear, Vec3::zeros());
}

/// A wrench without torques is told, once.
#[test]
fn a_wrench_without_torques_is_a_device_that_let_go() {
    let push = Wrench {
        force: Vec3::new(1.0, 0.0, 0.0),
        moment: Vec3::zeros(),
    };
    let mut falcon = falcon();
    let mut rendering = |wrench: &Wrench, stateless: u32, at: u64| {
        falcon.stateless = stateless;
        let acts = falcon.command(wrench).torques != [0; 3];
        let state = state(&mut falcon, at * PERIOD_NS, 0.0);
        falcon.stateless = 0;
        (acts, state.rendering)
    };
    // The first state comes for no force.
    assert_eq!(
        rendering(&Wrench::zero(), 0, 0),
        (false, Rendering::Commanded)
    );
    assert_eq!(rendering(&push, 0, 1), (true, Rendering::Commanded));
    // The answers stay away for so long that no torque is sent.
    assert_eq!(rendering(&push, STALE - 1, 2), (true, Rendering::Commanded));
    assert_eq!(rendering(&push, STALE, 3), (false, Rendering::LetGo));
    assert_eq!(rendering(&push, 0, 4), (true, Rendering::Commanded));
    // No force was asked for, so none was let go.
    assert_eq!(
        rendering(&Wrench::zero(), STALE, 5),
        (false, Rendering::Commanded)
    );
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever the times of the packets (early, late, lost), the estimate of a hand with a bounded speed is at most half
    /// as large again, because a gap of up to one and a half periods counts as one, and two counts in a period.
    #[test]
    fn no_time_of_a_packet_makes_a_fast_hand(
        fastest in 0.0..1.0_f64,
        steps in prop::collection::vec((200_000..6_000_000_u64, -1.0..1.0_f64, 0..6_u8, 0..400_u64), 1..200),
    ) {
        let mut falcon = falcon();
        let (mut at_ns, mut x) = (0, 0.0_f64);
        let most = 1.5 * fastest + 2.0 * STEP / PERIOD;
        for (late_ns, speed, kind, silent) in steps {
            let gap_ns = match kind {
                0 => late_ns,
                1 => silent * PERIOD_NS,
                _ => PERIOD_NS,
            };
            // The hand turns back at the end of the workspace.
            let way = fastest * speed * gap_ns as f64 * 1e-9;
            x = if (x + way).abs() < 0.03 { x + way } else { x };
            at_ns += gap_ns;
            let found = state(&mut falcon, at_ns, x).twist.linear;
            prop_assert!(found.norm() <= most, "{} m/s of {}", found, fastest);
        }
    }
}
