use super::*;
use crate::device::Rendering;
use crate::engage::EngageConfig;
use crate::geometry::{Vec3, Wrench};
use nalgebra::{Quaternion, UnitQuaternion};

const MS: u64 = 1_000_000;
const PATIENCE: u32 = 3;

fn channel() -> Channel {
    let safety = SafetyConfig {
        patience: PATIENCE,
        recovery: 0.01,
        ..SafetyConfig::unlimited(1e-3)
    };
    Channel::new(0, DeviceFrame::at(Vec3::zeros()), safety)
}

fn at(x: f64) -> DeviceState {
    DeviceState {
        pose: Pose::at(Vec3::x() * x),
        ..DeviceState::resting()
    }
}

/// One tick with a reading. Returns whether the reading was believed.
fn tick(channel: &mut Channel, now_ns: u64, state: &DeviceState) -> bool {
    channel.limiter.begin(now_ns);
    let fresh = channel.follow(now_ns, state);
    let state = fresh.then_some(channel.state);
    channel.limiter.pass(&Wrench::zero(), state.as_ref());
    fresh
}

#[test]
fn a_reading_is_believed_where_a_device_can_be_in_that_state() {
    let turned = |length: f64| {
        let turned = Quaternion::new(0.6, 0.0, 0.8, 0.0) * length;
        UnitQuaternion::new_unchecked(turned)
    };
    // What the reading says, and whether a device can be in this state: at each limit, and beyond.
    let pose = |position: Vec3, length: f64| DeviceState {
        pose: Pose {
            position,
            rotation: turned(length),
        },
        ..DeviceState::resting()
    };
    let twist = |linear: f64, angular: f64| {
        let mut state = DeviceState::resting();
        state.twist.linear.y = linear;
        state.twist.angular.z = angular;
        state
    };
    let readings = [
        (pose(Vec3::zeros(), 1.0), true),
        (pose(Vec3::new(0.0, -10.0, 0.0), 1.0), true),
        (pose(Vec3::new(0.0, -10.001, 0.0), 1.0), false),
        (pose(Vec3::new(8.0, 8.0, 0.0), 1.0), false),
        (pose(Vec3::zeros(), 1.009), true),
        (pose(Vec3::zeros(), 0.991), true),
        (pose(Vec3::zeros(), 1.011), false),
        (pose(Vec3::zeros(), 0.989), false),
        (pose(Vec3::zeros(), 0.0), false),
        (pose(Vec3::new(f64::NAN, 0.0, 0.0), 1.0), false),
        (pose(Vec3::zeros(), f64::NAN), false),
        (twist(200.0, -2000.0), true),
        (twist(200.1, 0.0), false),
        (twist(0.0, -2001.0), false),
        (twist(f64::NAN, 0.0), false),
        (twist(0.0, f64::INFINITY), false),
    ];
    for (state, believed) in readings {
        let mut channel = channel();
        assert_eq!(tick(&mut channel, MS, &state), believed, "{state:?}");
        // The channel keeps the last state that it believes.
        let kept = if believed {
            state
        } else {
            DeviceState::resting()
        };
        assert_eq!(channel.state, kept);
    }
}

#[test]
fn a_motion_that_no_hand_can_make_is_not_believed_until_the_device_counts_as_away() {
    // Time since the last state that was believed, and the motion since (m): a hand moves 20 m/s at most. Readings that
    // follow each other at once get the time of a tick.
    for (gap_ns, moved, believed) in [
        (MS, 0.019, true),
        (MS, 0.021, false),
        (MS / 4, 0.019, true),
        (3 * MS, 0.059, true),
        (3 * MS, 0.061, false),
    ] {
        let mut channel = channel();
        assert!(tick(&mut channel, MS, &at(5.0)));
        let now_ns = MS + gap_ns;
        let believes = tick(&mut channel, now_ns, &at(5.0 + moved));
        assert_eq!(believes, believed, "{gap_ns} {moved}");
    }
    let mut channel = channel();
    assert!(tick(&mut channel, MS, &at(0.0)));
    for k in 1..=u64::from(PATIENCE) + 1 {
        assert!(!tick(&mut channel, MS + k * MS, &at(1.0)), "{k}");
    }
    // The device counts as away, and the proxy continues from where the device left it.
    assert!(tick(&mut channel, 6 * MS, &at(1.0)));
    assert_eq!(channel.on_scene().0.position.x, 0.0);
    assert!(!tick(&mut channel, 7 * MS, &at(0.0)));
}

#[test]
fn the_motion_of_the_proxy_and_the_force_on_it_have_the_fraction_of_the_clutch() {
    let mut channel = channel();
    let mut moving = at(0.0);
    moving.twist.linear = Vec3::new(0.1, 0.2, 0.3);
    moving.twist.angular = Vec3::new(1.0, 2.0, 3.0);
    assert!(tick(&mut channel, MS, &moving));
    assert_eq!((channel.on_scene().1, channel.lever()), (moving.twist, 1.0));
    let mut away = moving;
    away.rendering = Rendering::LetGo;
    assert!(tick(&mut channel, 2 * MS, &away));
    // While the proxy holds still, no force on it belongs to the hand.
    assert_eq!(
        (channel.on_scene().1, channel.lever()),
        (Twist::zero(), 0.0)
    );
    for k in 3..7 {
        assert!(tick(&mut channel, k * MS, &moving));
    }
    let fraction = channel.limiter.fraction();
    assert!(fraction > 0.2 && fraction < 0.8, "{fraction}");
    let twist = channel.on_scene().1;
    assert_eq!(twist.linear, moving.twist.linear * fraction);
    assert_eq!(twist.angular, moving.twist.angular * fraction);
    assert_eq!(channel.lever(), 1.0 / fraction);
}

#[test]
fn what_the_limits_let_pass_does_not_depend_on_the_ramp_of_the_force() {
    let mut channel = channel();
    let state = at(0.0);
    for (k, passed) in [1.0, 0.25, 0.75].into_iter().enumerate() {
        assert!(tick(&mut channel, k as u64 * MS, &state));
        assert_eq!(channel.allow(passed), passed);
    }
    let mut away = state;
    away.rendering = Rendering::LetGo;
    assert!(tick(&mut channel, 3 * MS, &away));
    for passed in [0.0, 1.0] {
        assert_eq!(channel.allow(passed), 0.75);
    }
    for k in 4..9 {
        assert!(tick(&mut channel, k * MS, &state));
        let fraction = channel.limiter.fraction();
        assert!(fraction < 1.0);
        // Rounding of a quotient.
        assert!((channel.allow(0.5 * fraction) - 0.5).abs() < 1e-15);
        // No force was asked for.
        assert_eq!(channel.allow(1.0), 1.0);
    }
}

#[test]
fn the_proxy_of_a_device_that_waits_is_where_its_handle_rests() {
    for armed in [true, false] {
        let waits_at = Vec3::new(0.1, -0.2, 0.3);
        let safety = SafetyConfig {
            engage: EngageConfig {
                armed,
                waits_at,
                ..EngageConfig::default()
            },
            ..SafetyConfig::unlimited(1e-3)
        };
        let mut channel = Channel::new(0, DeviceFrame::at(Vec3::zeros()), safety);
        let waits = if armed { Vec3::zeros() } else { waits_at };
        assert_eq!(channel.on_scene().0.position, waits);
        // The hand holds the device elsewhere.
        assert!(tick(&mut channel, MS, &at(0.05)));
        let place = if armed { Vec3::x() * 0.05 } else { waits_at };
        // Rounding of a sum of places.
        assert!((channel.on_scene().0.position - place).norm() < 1e-15);
    }
}
