use super::*;
use proptest::prelude::*;

fn config() -> SafetyConfig {
    SafetyConfig {
        actuated: Freedom::Six,
        max_force: 8.0,
        max_moment: 0.2,
        max_speed: 1.0,
        max_reach: 0.1,
        patience: 3,
        decay: 0.01,
        recovery: 0.01,
        ..SafetyConfig::unlimited(1e-3)
    }
}

fn here() -> DeviceState {
    DeviceState::resting()
}

fn moving(speed: f64) -> DeviceState {
    let mut state = here();
    state.twist.linear.y = speed;
    state
}

fn push(x: f64) -> Wrench {
    Wrench {
        force: Vec3::new(x, 0.0, 0.0),
        moment: Vec3::zeros(),
    }
}

#[test]
fn a_wrench_that_is_not_a_number_becomes_zero_and_the_force_comes_back_smoothly() {
    let mut limiter = Limiter::new(config());
    assert_eq!(limiter.pass(&push(2.0), Some(&here())), push(2.0));
    assert_eq!(limiter.pass(&push(f64::NAN), Some(&here())), Wrench::zero());
    assert_eq!(limiter.state(), SafetyState::NotANumber);
    let mut last = 0.0;
    // Ten tenths round to just below one: the eleventh tick completes the return.
    for _ in 0..11 {
        let now = limiter.pass(&push(2.0), Some(&here())).force.x;
        // Ten ticks of a smooth step: none changes the force by more than 1.5 times the mean change.
        assert!(now >= last && now - last <= 2.0 * 0.15 + 1e-12);
        last = now;
    }
    assert_eq!(limiter.pass(&push(2.0), Some(&here())), push(2.0));
    assert_eq!(limiter.state(), SafetyState::Normal);
    assert_eq!(limiter.counters().not_a_number, 1);
}

#[test]
fn a_device_without_moments_is_not_limited_for_want_of_them() {
    let mut limiter = Limiter::new(SafetyConfig {
        actuated: Freedom::Three,
        ..config()
    });
    let wrench = Wrench {
        moment: Vec3::new(0.0, 5.0, 0.0),
        ..push(2.0)
    };
    assert_eq!(limiter.pass(&wrench, Some(&here())), push(2.0));
    assert_eq!(
        (limiter.state(), limiter.counters().limited),
        (SafetyState::Normal, 0)
    );
}

#[test]
fn a_silent_device_gets_zero_after_its_patience() {
    let mut limiter = Limiter::new(config());
    for _ in 0..3 {
        assert_eq!(limiter.pass(&push(1.0), None), push(1.0));
    }
    assert_eq!(limiter.pass(&push(1.0), None), Wrench::zero());
    assert_eq!(limiter.state(), SafetyState::Silent);
    let counters = limiter.counters();
    assert_eq!((counters.missed_reads, counters.stale), (4, 1));
}

/// The largest change between consecutive forces.
fn largest_step(forces: &[f64]) -> f64 {
    let steps = forces.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    steps.fold(0.0, f64::max)
}

#[test]
fn the_force_fades_while_the_device_is_too_fast_and_comes_back_without_a_jump() {
    let mut limiter = Limiter::new(config());
    let mut forces = [limiter.pass(&push(2.0), Some(&here())).force.x; 61];
    for k in 0..60 {
        // Between nine tenths of the limit and the limit, the state stays as it is.
        let speed = [1.5, 0.95, 0.5][k / 20];
        forces[k + 1] = limiter.pass(&push(2.0), Some(&moving(speed))).force.x;
        if k == 30 {
            assert_eq!(limiter.state(), SafetyState::TooFast);
        }
    }
    assert_eq!((forces[30], forces[60]), (0.0, 2.0));
    // Ten ticks of a smooth step in each direction: none changes the force by more than 1.5 times the mean change.
    assert!(largest_step(&forces) <= 2.0 * 0.15 + 1e-12);
    assert_eq!(limiter.counters().too_fast, 1);
    assert_eq!(
        limiter.first_trip(),
        Some(Trip {
            state: SafetyState::TooFast,
            tick: 1,
            found: 1.5,
            limit: 1.0
        })
    );
}

#[test]
fn the_force_fades_out_of_reach() {
    let mut limiter = Limiter::new(config());
    let mut far = here();
    far.pose.position.z = 0.11;
    for _ in 0..11 {
        limiter.pass(&push(2.0), Some(&far));
    }
    assert_eq!(limiter.pass(&push(2.0), Some(&far)), Wrench::zero());
    assert_eq!(limiter.state(), SafetyState::OutOfReach);
    assert_eq!(limiter.counters().out_of_reach, 1);
}

#[test]
fn a_force_follows_at_the_slew_limit_and_a_fault_does_not_wait_for_it() {
    let mut limiter = Limiter::new(SafetyConfig {
        max_slew: 100.0,
        ..config()
    });
    let mut pass = |x: f64| limiter.pass(&push(x), Some(&here())).force.x;
    for k in 1..=20 {
        // A tenth of a newton a tick; sums of tenths round.
        assert!((pass(2.0) - 0.1 * f64::from(k)).abs() < 1e-12);
    }
    assert_eq!(pass(2.0), 2.0);
    assert_eq!(limiter.counters().slewed, 19);
    // The whole force in the first tick would be 2000 N/s.
    let trip = limiter.first_trip().expect("a trip");
    assert_eq!((trip.found, trip.limit), (2000.0, 100.0));
    let stopped = limiter.pass(&push(f64::NAN), Some(&here()));
    assert_eq!(stopped, Wrench::zero());
}

proptest! {
    #[test]
    fn nothing_beyond_the_limits_ever_leaves(
        fx in proptest::num::f64::ANY, fy in proptest::num::f64::ANY,
        mz in proptest::num::f64::ANY, fresh in any::<bool>(),
    ) {
        let mut limiter = Limiter::new(config());
        let resting = here();
        let wrench = Wrench {
            force: Vec3::new(fx, fy, 1.0),
            moment: Vec3::new(0.0, 0.0, mz),
        };
        let out = limiter.pass(&wrench, fresh.then_some(&resting));
        // One rounding of a product and a norm.
        prop_assert!(out.force.norm() <= 8.0 * (1.0 + 1e-14));
        prop_assert!(out.moment.norm() <= 0.2 * (1.0 + 1e-14));
    }
}

#[test]
fn after_a_standstill_of_the_loop_the_force_comes_back_smoothly() {
    // Four fifths of the watchdog of a device: a gap of 8 ms is no standstill, a longer gap is.
    let ms = 1_000_000;
    for (gap_ms, away) in [(8, false), (9, true), (1000, true)] {
        for state in [Some(here()), None] {
            let mut limiter = Limiter::new(SafetyConfig {
                max_slew: 100.0,
                ..config()
            });
            let mut now = 0;
            let mut tick = |limiter: &mut Limiter, gap_ms: u64, state: Option<&DeviceState>| {
                now += gap_ms * ms;
                limiter.begin(now);
                limiter.pass(&push(2.0), state).force.x
            };
            // The slew limit allows 0.1 N a tick.
            for _ in 0..30 {
                tick(&mut limiter, 1, Some(&here()));
            }
            let force = tick(&mut limiter, gap_ms, state.as_ref());
            assert_eq!(force, if away { 0.0 } else { 2.0 }, "{gap_ms} ms");
            assert_eq!(limiter.counters().stale, u64::from(away));
            assert_eq!(
                limiter.first_trip().is_some(),
                away || limiter.counters().slewed > 0
            );
            if !away {
                continue;
            }
            assert_eq!(limiter.state(), SafetyState::Silent);
            let mut last = 0.0;
            for _ in 0..60 {
                let now = tick(&mut limiter, 1, Some(&here()));
                assert!(now >= last && now - last <= 0.1 + 1e-12, "{last} {now}");
                last = now;
            }
            assert_eq!((last, limiter.state()), (2.0, SafetyState::Normal));
        }
    }
}

/// Passes a push of 2 N in each of some ticks of a resting device. Returns the forces.
fn pushes<const TICKS: usize>(limiter: &mut Limiter) -> [f64; TICKS] {
    [(); TICKS].map(|()| limiter.pass(&push(2.0), Some(&here())).force.x)
}

#[test]
fn an_engagement_during_the_return_from_a_fault_has_the_ramp_of_an_engagement() {
    let mut limiter = Limiter::new(SafetyConfig {
        engage: EngageConfig {
            ramp: 0.1,
            ..EngageConfig::default()
        },
        ..config()
    });
    // Engaged for long, and a fault.
    assert_eq!(pushes::<200>(&mut limiter)[199], 2.0);
    limiter.pass(&push(f64::NAN), Some(&here()));
    pushes::<3>(&mut limiter);
    assert_eq!(limiter.state(), SafetyState::Recovering);
    limiter.engage(Engaged::Stopped);
    assert_eq!(pushes::<3>(&mut limiter), [0.0; 3]);
    assert_eq!(limiter.state(), SafetyState::Stopped);
    limiter.engage(Engaged::Yes);
    let returns = pushes::<90>(&mut limiter);
    assert_eq!(limiter.state(), SafetyState::Engaging);
    // A smooth step of 100 ticks; the last tick may round to just below one.
    assert!(largest_step(&returns) <= 2.0 * 1.5 / 100.0 + 1e-12);
    pushes::<10>(&mut limiter);
    assert_eq!(pushes::<2>(&mut limiter)[1], 2.0);
    // After the next fault, the force comes back as after a fault.
    limiter.pass(&push(f64::NAN), Some(&here()));
    pushes::<3>(&mut limiter);
    assert_eq!(limiter.state(), SafetyState::Recovering);
    let counters = limiter.counters();
    assert_eq!((counters.engaged, counters.stopped), (1, 1));
}

#[test]
fn an_engagement_without_a_ramp_of_its_own_is_as_smooth_as_a_recovery() {
    // Engaged again after a stop, and for the first time.
    for armed in [true, false] {
        let mut limiter = Limiter::new(SafetyConfig {
            engage: EngageConfig {
                armed,
                ..EngageConfig::default()
            },
            ..config()
        });
        let start = if armed { 2.0 } else { 0.0 };
        assert_eq!(pushes::<1>(&mut limiter), [start]);
        limiter.engage(Engaged::Stopped);
        pushes::<1>(&mut limiter);
        limiter.engage(Engaged::Yes);
        let mut forces = [0.0; 12];
        forces[1..].copy_from_slice(&pushes::<11>(&mut limiter));
        assert!(largest_step(&forces) <= 2.0 * 0.15 + 1e-12, "{forces:?}");
        assert_eq!(pushes::<1>(&mut limiter), [2.0]);
    }
}

#[test]
fn the_heat_counts_the_weight_of_the_grip() {
    let mut limiter = Limiter::new(SafetyConfig {
        engage: EngageConfig {
            grip_force: Vec3::new(0.5, 0.0, 0.0),
            ..EngageConfig::default()
        },
        heat: HeatConfig {
            continuous_force: 1.5,
            time: 0.05,
        },
        ..config()
    });
    assert_eq!(pushes::<1>(&mut limiter), [2.0]);
    let forces = pushes::<2000>(&mut limiter);
    assert_eq!(limiter.state(), SafetyState::Hot);
    // The motors withstand 1.5 N: 0.5 N for the grip, and 1 N for the scene.
    assert!((forces[1999] - 1.0).abs() < 1e-6, "{}", forces[1999]);
    assert_eq!(limiter.grip_force(), Vec3::new(0.5, 0.0, 0.0));
    // Ticks that were hot, and the first of them.
    assert!(limiter.counters().hot > 1900);
    assert_eq!(
        limiter.first_trip().map(|trip| trip.state),
        Some(SafetyState::Hot)
    );
}

#[test]
fn each_fault_of_the_device_is_counted_once_and_the_first_is_kept() {
    let mut limiter = Limiter::new(config());
    let hears = [
        Rendering::Commanded,
        Rendering::Fault(3),
        Rendering::Fault(3),
        Rendering::Fault(5),
        Rendering::LetGo,
        Rendering::LetGo,
        Rendering::Commanded,
        Rendering::LetGo,
    ];
    for rendering in hears {
        limiter.hear(rendering);
        let passed = limiter.pass(&push(2.0), Some(&here()));
        let (state, apart) = match rendering {
            Rendering::Commanded => (limiter.state(), false),
            Rendering::LetGo => (SafetyState::LetGo, true),
            Rendering::Fault(_) => (SafetyState::DeviceFault, true),
        };
        assert_eq!((limiter.state(), limiter.is_apart()), (state, apart));
        assert_eq!(passed == Wrench::zero(), apart, "{rendering:?}");
    }
    let counters = limiter.counters();
    assert_eq!((counters.device_faults, counters.let_go), (2, 2));
    assert_eq!(limiter.first_device_fault(), Some((1, 3)));
    let trip = limiter.first_trip().expect("a trip");
    assert_eq!(
        (trip.state, trip.tick, trip.found),
        (SafetyState::DeviceFault, 1, 3.0)
    );
}

#[test]
fn a_slow_loop_waits_four_periods() {
    // The device of a loop of 100 Hz is asked for a watchdog of 40 ms.
    for (gap_ms, away) in [(32, false), (33, true)] {
        let mut limiter = Limiter::new(SafetyConfig {
            period: 0.01,
            ..config()
        });
        limiter.begin(0);
        limiter.pass(&push(2.0), Some(&here()));
        limiter.begin(gap_ms * 1_000_000);
        let force = limiter.pass(&push(2.0), Some(&here())).force.x;
        assert_eq!(force == 0.0, away, "{gap_ms} ms");
    }
}

#[test]
fn after_a_delay_within_a_tick_no_slew_limit_holds_the_force_up() {
    let mut limiter = Limiter::new(SafetyConfig {
        max_slew: 100.0,
        ..config()
    });
    let mut now_ns = 0;
    for _ in 0..30 {
        now_ns += 1_000_000;
        limiter.begin(now_ns);
        limiter.pass(&push(2.0), Some(&here()));
        assert!(!limiter.end(100_000));
    }
    limiter.begin(now_ns + 1_000_000);
    assert_eq!(limiter.pass(&push(2.0), Some(&here())).force.x, 2.0);
    // Zero left in place of the two newtons, so the force begins at zero.
    assert!(limiter.end(9_000_000));
    assert!(limiter.is_apart() && limiter.fraction() == 0.0);
    limiter.begin(now_ns + 11_000_000);
    let first = limiter.pass(&push(2.0), Some(&here())).force.x;
    // A smooth step of ten ticks, and the slew limit.
    assert!(first > 0.0 && first < 0.1, "{first}");
    assert_eq!(limiter.counters().stale, 1);
    assert_eq!(limiter.state(), SafetyState::Recovering);
}

#[test]
fn a_standstill_is_one_event_of_a_device_that_was_there() {
    // A silent device has been away before the pause. In the tick after the pause, a delay is an event of its own.
    for (silent, took_ns, stale) in [(0, 0, 1), (2, 0, 1), (9, 0, 1), (0, 9_000_000, 2)] {
        let mut limiter = Limiter::new(config());
        limiter.begin(0);
        limiter.pass(&push(2.0), Some(&here()));
        for k in 1..=silent {
            limiter.begin(k * 1_000_000);
            limiter.pass(&push(2.0), None);
        }
        limiter.begin(100_000_000);
        assert!(limiter.is_stale());
        assert_eq!(limiter.pass(&push(2.0), Some(&here())), Wrench::zero());
        assert_eq!(limiter.end(took_ns), took_ns > 0);
        assert_eq!(limiter.counters().stale, stale, "{silent} {took_ns}");
        limiter.begin(101_000_000 + took_ns);
        let back = limiter.pass(&push(2.0), Some(&here())).force.x;
        assert!(back > 0.0 && back < 0.1, "{back}");
    }
}

#[test]
fn a_silent_device_comes_back_along_the_ramp() {
    let mut limiter = Limiter::new(config());
    for _ in 0..9 {
        limiter.pass(&push(2.0), None);
    }
    let trip = limiter.first_trip().expect("a trip");
    assert_eq!((trip.tick, trip.found, trip.limit), (3, 4.0, 3.0));
    let mut forces = [0.0; 12];
    forces[1..].copy_from_slice(&pushes::<11>(&mut limiter));
    assert!(largest_step(&forces) <= 2.0 * 0.15 + 1e-12, "{forces:?}");
    assert_eq!((forces[11], limiter.counters().stale), (2.0, 1));
    // Each silence has the whole patience.
    for _ in 0..3 {
        assert_eq!(limiter.pass(&push(1.0), None), push(1.0));
    }
}

#[test]
fn a_device_at_a_limit_is_within_it_and_is_released_below_nine_tenths() {
    for (found, tripped) in [(2.0, false), (2.001, true), (1e300, true)] {
        let mut is = false;
        assert_eq!(trips(&mut is, found, 2.0), tripped);
        assert_eq!(is, tripped);
    }
    for (found, stays) in [(3.0, true), (1.9, true), (1.8, true), (1.799, false)] {
        let mut is = true;
        assert!(!trips(&mut is, found, 2.0), "no new event");
        assert_eq!(is, stays, "{found}");
    }
    // An infinite limit never trips, and a speed that overflowed exceeds every finite one.
    for (limit, tripped) in [(f64::INFINITY, false), (1.0, true)] {
        assert_eq!(trips(&mut false, f64::INFINITY, limit), tripped);
    }
}

#[test]
fn a_force_and_a_moment_are_limited_each_by_its_own_limit() {
    let moment = Vec3::new(0.0, 0.3, 0.4);
    for (force, moment, expected) in [
        (9.0, Vec3::zeros(), Some((9.0, 8.0))),
        (8.0, moment * 0.4, None),
        (1.0, moment, Some((0.5, 0.2))),
        (9.0, moment, Some((9.0, 8.0))),
    ] {
        let mut limiter = Limiter::new(config());
        let wrench = Wrench {
            moment,
            ..push(force)
        };
        let passed = limiter.pass(&wrench, Some(&here()));
        // Rounding of a product.
        assert!((passed.force.x - force.min(8.0)).abs() < 1e-14);
        let least = moment * (0.2 / moment.norm()).min(1.0);
        assert!(moment == Vec3::zeros() || (passed.moment - least).norm() < 1e-15);
        let trip = limiter.first_trip();
        let found = trip.map(|trip| (trip.found, trip.limit));
        assert_eq!(found, expected);
        assert_eq!(limiter.counters().limited, u64::from(expected.is_some()));
        let state = [SafetyState::Normal, SafetyState::Limited][usize::from(expected.is_some())];
        assert_eq!(limiter.state(), state);
    }
}

#[test]
fn cool_motors_bear_the_grip_beside_the_largest_force() {
    let mut limiter = Limiter::new(SafetyConfig {
        engage: EngageConfig {
            grip_force: Vec3::new(0.0, 0.0, -0.5),
            ..EngageConfig::default()
        },
        heat: HeatConfig {
            continuous_force: 1.5,
            time: 10.0,
        },
        ..config()
    });
    for _ in 0..10 {
        assert_eq!(limiter.pass(&push(7.9), Some(&here())), push(7.9));
        assert_eq!(limiter.state(), SafetyState::Normal);
    }
}

#[test]
fn a_graver_state_is_told_before_a_limit() {
    // A force that returns is limited as well. The state names the limit, unless a motion of the device makes the force
    // fade.
    for (state, told) in [
        (here(), SafetyState::Limited),
        (moving(1.5), SafetyState::TooFast),
    ] {
        let mut limiter = Limiter::new(config());
        limiter.pass(&push(f64::NAN), Some(&here()));
        pushes::<5>(&mut limiter);
        assert_eq!(limiter.state(), SafetyState::Recovering);
        limiter.pass(&push(100.0), Some(&state));
        assert_eq!(limiter.state(), told);
        assert_eq!(limiter.counters().limited, 1);
    }
}

#[test]
fn only_an_engaged_hand_lets_go_of_the_dead_man_button() {
    use Engaged::{Disarmed, HandsOff, Stopped, Yes};
    let mut limiter = Limiter::new(config());
    for engaged in [HandsOff, HandsOff, Stopped, HandsOff, Disarmed, Yes, Yes] {
        limiter.engage(engaged);
        assert_eq!(limiter.is_disengaged(), engaged != Yes);
        assert_eq!(limiter.is_apart(), engaged != Yes);
    }
    let counters = limiter.counters();
    let counts = (counters.hands_off, counters.stopped, counters.engaged);
    assert_eq!(counts, (1, 1, 1));
}

#[test]
fn a_force_along_an_axis_that_the_device_does_not_actuate_is_left_out() {
    let axes = crate::Axes::new([true, false, true]).expect("two axes");
    let mut limiter = Limiter::new(SafetyConfig {
        actuated: Freedom::Along(axes),
        ..config()
    });
    let mut wrench = push(2.0);
    wrench.force.y = 100.0;
    assert_eq!(limiter.pass(&wrench, Some(&here())), push(2.0));
    assert_eq!(limiter.state(), SafetyState::Normal);
}
