use super::*;
use crate::report::{VERSION, axes, fault};
use proptest::prelude::*;
use std::format;
use std::vec::Vec;

const SESSION: u32 = 0xCAFE;
/// The largest force of the test device (µN).
const MOST: i32 = 5_000_000;

fn model() -> Model {
    Model {
        sensed: axes::X,
        actuated: axes::X,
        max_force: MOST as u32,
        max_moment: 100_000,
        rate: [100, 1000],
        name: *b"paddle\0\0\0\0\0\0\0\0\0\0",
        ..Model::default()
    }
}

fn pose() -> Measured {
    Measured::Pose {
        position: [1, 2, 3],
        orientation: [32767, 0, 0, 0],
        velocity: [0; 3],
        angular_velocity: [0; 3],
    }
}

fn hello(session: u32, watchdog_us: u32) -> [u8; LENGTH] {
    HelloReport {
        sequence: 0,
        session,
        newest: VERSION,
        watchdog_us,
    }
    .encode()
}

fn wrench(sequence: u16, answers: u16, force: i32) -> WrenchReport {
    WrenchReport {
        sequence,
        session: SESSION,
        answers,
        force: [force, 0, 0],
        moment: [0; 3],
        flags: flags::ENABLE,
    }
}

fn state(device: &mut Device, now_us: u32) -> StateReport {
    let report = device.report(now_us, Inputs::default(), &pose());
    StateReport::decode(&report).expect("a state")
}

/// A device in the mode `Idle`, greeted at `now_us`, whose capabilities have been sent, and whose next report is the
/// state 1.
fn greeted(now_us: u32) -> Device {
    let mut device = Device::new(model(), Geometry::default());
    assert!(device.home() && device.homed());
    assert_eq!(
        device.receive(&hello(SESSION, 0), now_us),
        Ok(Accepted::Hello)
    );
    let report = device.report(now_us, Inputs::default(), &pose());
    assert!(CapabilitiesReport::decode(&report).is_ok());
    device
}

/// A greeted device whose state 1 the wrench 10 answers, in force since `now_us`.
fn active(now_us: u32) -> Device {
    let mut device = greeted(now_us);
    assert_eq!(state(&mut device, now_us).sequence, 1);
    let result = device.receive(&wrench(10, 1, 1000).encode(), now_us);
    assert_eq!(result, Ok(Accepted::Wrench));
    assert_eq!(device.actuate(now_us).force, [1000, 0, 0]);
    device
}

#[test]
fn states_name_the_wrench_in_force_and_since_when() {
    let mut device = greeted(1000);
    let before = state(&mut device, 2000);
    assert_eq!(
        (before.condition.in_force(), before.condition.mode),
        (None, Mode::Idle)
    );
    device
        .receive(&wrench(7, before.sequence, -5).encode(), 2300)
        .expect("it is accepted");
    // A wrench is not in force before the amplifiers have it.
    assert_eq!(state(&mut device, 2400).condition.in_force(), None);
    assert_eq!(device.actuate(2500).force, [-5, 0, 0]);
    assert_eq!(device.actuate(2600).force, [-5, 0, 0]);
    let condition = state(&mut device, 3000).condition;
    assert_eq!(
        (
            condition.in_force(),
            condition.since_us,
            condition.time_us,
            condition.mode
        ),
        (Some(7), 2500, 3000, Mode::Active)
    );
    // Let go.
    let release = WrenchReport {
        flags: 0,
        ..wrench(8, 0, 0)
    };
    assert_eq!(
        device.receive(&release.encode(), 3100),
        Ok(Accepted::Release)
    );
    assert_eq!(device.actuate(3200), Wrench::default());
    let condition = state(&mut device, 4000).condition;
    assert_eq!(
        (condition.in_force(), condition.since_us, condition.mode),
        (None, 3200, Mode::Idle)
    );
}

#[test]
fn the_watchdog_lets_go_on_time_over_a_wrap_of_the_clock() {
    for start in [0, 77, u32::MAX - 5000, u32::MAX] {
        let mut device = active(start);
        let at = |after: u32| start.wrapping_add(after);
        assert_eq!(device.actuate(at(9_999)).force, [1000, 0, 0]);
        assert_eq!(device.actuate(at(10_000)), Wrench::default());
        assert_eq!((device.mode(), device.counters().watchdog), (Mode::Idle, 1));
        let condition = state(&mut device, at(10_500)).condition;
        assert_eq!(condition.status & status::WATCHDOG, status::WATCHDOG);
        assert_eq!(
            (condition.in_force(), condition.since_us),
            (None, at(10_000))
        );
        // The next wrench in force clears the bit.
        let next = wrench(11, 2, 1).encode();
        assert_eq!(device.receive(&next, at(10_600)), Ok(Accepted::Wrench));
        device.actuate(at(10_700));
        let condition = state(&mut device, at(11_000)).condition;
        assert_eq!(condition.status & status::WATCHDOG, 0);
    }
}

#[test]
fn the_host_negotiates_the_watchdog() {
    let mut device = greeted(0);
    device
        .receive(&hello(SESSION, 2_000), 0)
        .expect("it is accepted");
    let report = device.report(0, Inputs::default(), &pose());
    let capabilities = CapabilitiesReport::decode(&report).expect("capabilities");
    assert_eq!(capabilities.watchdog_us, 2_000);
    let answers = state(&mut device, 100).sequence;
    device
        .receive(&wrench(0, answers, 9).encode(), 200)
        .expect("it is accepted");
    assert_eq!(device.actuate(2_199).force, [9, 0, 0]);
    assert_eq!(device.actuate(2_200), Wrench::default());
    // A watchdog out of range is refused, and the old watchdog stays.
    let refused = device.receive(&hello(SESSION, 1_999), 3_000);
    assert!(matches!(
        refused,
        Err(Refusal::Report(ReportError::OutOfRange { .. }))
    ));
}

#[test]
fn the_answer_to_a_hello_has_all_parts_in_order() {
    let model = Model {
        sends: Sends::Counts { encoders: 2 },
        ..model()
    };
    let mut geometry = Geometry::default();
    geometry.joints[1].scale = -77;
    let mut device = Device::new(model, geometry);
    let counts = Measured::Counts {
        counts: [5, 6, 0, 0, 0, 0, 0, 0],
        number: 2,
    };
    let next = |device: &mut Device| {
        Report::decode(&device.report(0, Inputs::default(), &counts)).expect("a valid report")
    };
    // Before a hello, states of no session: an older host finds the version in them.
    assert!(matches!(next(&mut device), Report::Encoders(state) if state.session == 0));
    device
        .receive(&hello(SESSION, 0), 5)
        .expect("it is accepted");
    assert!(matches!(next(&mut device), Report::Capabilities(report) if report.hello_time_us == 5));
    assert!(matches!(next(&mut device), Report::Geometry(_)));
    assert!(matches!(next(&mut device), Report::Joint(joint) if joint.encoder == 0));
    // The host has not seen the end, and repeats its hello.
    device
        .receive(&hello(SESSION, 0), 9)
        .expect("it is accepted");
    assert!(
        matches!(next(&mut device), Report::Joint(joint) if (joint.encoder, joint.scale) == (1, -77))
    );
    assert!(
        matches!(next(&mut device), Report::Encoders(state) if (state.session, state.sequence) == (SESSION, 5))
    );
}

#[test]
fn wrenches_that_may_not_be_applied_are_refused_and_counted() {
    let mut device = active(0);
    let sent = |device: &mut Device, report: WrenchReport, now_us| {
        device.receive(&report.encode(), now_us)
    };
    // Again, and older.
    for sequence in [10, 9, 10_u16.wrapping_sub(0x7FFF), 10 + 0x8000] {
        let refused = sent(&mut device, wrench(sequence, 1, 2000), 100);
        assert_eq!(refused, Err(Refusal::Sequence), "{sequence}");
    }
    // A state that was never sent, the capabilities, and states of another turn of the counter.
    for answers in [0, 2, 33, 65535] {
        let refused = sent(&mut device, wrench(11, answers, 2000), 100);
        assert_eq!(refused, Err(Refusal::Age), "{answers}");
    }
    let other = WrenchReport {
        session: SESSION + 1,
        ..wrench(11, 1, 2000)
    };
    assert_eq!(sent(&mut device, other, 100), Err(Refusal::Session));
    // Too large by two units; one unit is left to rounding.
    let large = sent(&mut device, wrench(11, 1, -MOST - 2), 100);
    assert_eq!(large, Err(Refusal::Limit));
    let moment = WrenchReport {
        moment: [i32::MIN; 3],
        ..wrench(11, 1, 0)
    };
    assert_eq!(sent(&mut device, moment, 100), Err(Refusal::Limit));
    assert_eq!(
        device.receive(&hello(SESSION + 1, 0), 100),
        Err(Refusal::Busy)
    );
    assert_eq!(
        device.receive(&[1; 3], 100),
        Err(Refusal::Report(ReportError::Length { found: 3 }))
    );
    let own = state(&mut device, 100);
    assert_eq!(
        device.receive(&own.encode(), 100),
        Err(Refusal::Report(ReportError::UnexpectedKind { found: 1 }))
    );
    let counters = Counters {
        accepted: 2,
        length: 1,
        kind: 1,
        busy: 1,
        session: 1,
        sequence: 4,
        age: 4,
        limit: 2,
        ..Counters::default()
    };
    assert_eq!(*device.counters(), counters);
    assert_eq!(state(&mut device, 100).condition.refused, 14);
    // None of them fed the watchdog, or changed the force.
    assert_eq!(device.actuate(9_999).force, [1000, 0, 0]);
    assert_eq!(device.actuate(10_000), Wrench::default());
    assert_eq!(
        sent(&mut greeted(0), wrench(0, 1, 0), 0),
        Err(Refusal::Age),
        "no state was sent"
    );
    let accepted = sent(&mut active(0), wrench(11, 1, MOST + 1), 0);
    assert_eq!(accepted, Ok(Accepted::Wrench));
}

#[test]
fn a_wrench_answers_a_recent_state() {
    let late = |now_us, states| {
        let mut device = greeted(0);
        for _ in 0..states {
            state(&mut device, 0);
        }
        device.receive(&wrench(0, 1, 7).encode(), now_us)
    };
    assert_eq!(late(10_000, 1), Ok(Accepted::Wrench));
    assert_eq!(late(10_001, 1), Err(Refusal::Age));
    // The number of states since then does not matter.
    assert_eq!(late(10_000, 1000), Ok(Accepted::Wrench));
}

/// The window of answers is a time at every rate: a state of the age of the watchdog may be answered, less the 31st part
/// of the watchdog if the states of this part share a time.
#[test]
fn the_window_of_answers_is_a_time_at_every_rate() {
    for rate in [1, 30, 500, 1000, 2000, 4000, 8000, 50_000] {
        for watchdog_us in [2_000, 10_000, 26_667, 40_000, 80_000, 100_000] {
            // The clock wraps on the way.
            let start = u32::MAX - 150_000;
            let mut device = greeted(start);
            device
                .receive(&hello(SESSION, watchdog_us), start)
                .expect("it is accepted");
            assert!(
                CapabilitiesReport::decode(&device.report(start, Inputs::default(), &pose()))
                    .is_ok()
            );
            let period_us = 1_000_000 / rate;
            let count = (400_000 / period_us).max(3);
            let sent: Vec<_> = (0..count)
                .map(|k| start.wrapping_add(k * period_us))
                .map(|at_us| (state(&mut device, at_us).sequence, at_us))
                .collect();
            let now_us = start.wrapping_add((count - 1) * period_us);
            for (sequence, at_us) in sent {
                let age_us = now_us.wrapping_sub(at_us);
                let taken = device
                    .clone()
                    .receive(&wrench(0, sequence, 1).encode(), now_us);
                let expected = if age_us <= watchdog_us - watchdog_us / 31 {
                    Some(Ok(Accepted::Wrench))
                } else {
                    (age_us > watchdog_us).then_some(Err(Refusal::Age))
                };
                let at = format!("{rate} Hz, watchdog {watchdog_us} us, age {age_us} us");
                assert!(
                    expected.is_none_or(|expected| expected == taken),
                    "{at}: {taken:?}"
                );
                // A device that is slower than 31 states in a watchdog knows the time of each state.
                if period_us > watchdog_us / 31 {
                    assert_eq!(taken.is_ok(), age_us <= watchdog_us, "{at}");
                }
            }
        }
    }
}

/// A number between the states of a run that no state had: the capabilities are no state.
#[test]
fn only_states_can_be_answered() {
    let mut device = greeted(0);
    state(&mut device, 0);
    device
        .receive(&hello(SESSION, 0), 0)
        .expect("it is accepted");
    let report = device.report(0, Inputs::default(), &pose());
    let capabilities = CapabilitiesReport::decode(&report).expect("capabilities");
    state(&mut device, 0);
    let taken = [0, 1, 2, 3, 4].map(|answers| {
        let mut device = device;
        device.receive(&wrench(0, answers, 7).encode(), 0).is_ok()
    });
    assert_eq!(
        (taken, capabilities.sequence),
        ([false, true, false, true, false], 2)
    );
}

/// The force cannot come back by a wrench that was computed before the host could know that the watchdog let go.
#[test]
fn the_first_wrench_after_the_watchdog_answers_a_state_that_says_so() {
    for late_us in [0, 1, 5_000] {
        let mut device = active(0);
        assert_eq!(state(&mut device, 9_999).sequence, 2);
        let now_us = 10_000 + late_us;
        // It answers a state of the time of the force, 1 us before the watchdog.
        let refused = device.receive(&wrench(11, 2, 1000).encode(), now_us);
        assert_eq!(
            (refused, device.actuate(now_us)),
            (Err(Refusal::Age), Wrench::default())
        );
        let told = state(&mut device, now_us);
        assert_eq!(told.condition.status & status::WATCHDOG, status::WATCHDOG);
        let taken = device.receive(&wrench(12, told.sequence, 0).encode(), now_us);
        assert_eq!(taken, Ok(Accepted::Wrench));
    }
}

#[test]
fn letting_go_needs_no_more_than_the_session() {
    let release = WrenchReport {
        flags: 0,
        ..wrench(3, 999, 0)
    };
    let mut device = active(0);
    assert_eq!(
        device.receive(&release.encode(), 100),
        Ok(Accepted::Release)
    );
    assert_eq!(
        (device.actuate(100), device.mode()),
        (Wrench::default(), Mode::Idle)
    );
    // The number 10 stays the last.
    assert_eq!(
        device.receive(&wrench(10, 1, 1).encode(), 100),
        Err(Refusal::Sequence)
    );
    let other = WrenchReport {
        session: 1,
        ..release
    };
    let mut device = active(0);
    assert_eq!(device.receive(&other.encode(), 100), Err(Refusal::Session));
    assert_eq!(device.mode(), Mode::Active);
}

#[test]
fn a_session_begins_without_wrench_and_states() {
    let mut device = active(0);
    device.actuate(10_000);
    let accepted = device.receive(&hello(SESSION + 1, 0), 10_000);
    assert_eq!(
        (accepted, device.session()),
        (Ok(Accepted::Hello), SESSION + 1)
    );
    device.report(10_000, Inputs::default(), &pose());
    let of_it = |sequence, answers| WrenchReport {
        session: SESSION + 1,
        ..wrench(sequence, answers, 3)
    };
    // The state 1 was of the old session; the number 10 is new in this one.
    let refused = device.receive(&of_it(10, 1).encode(), 10_000);
    assert_eq!(refused, Err(Refusal::Age));
    let answers = state(&mut device, 10_000).sequence;
    let accepted = device.receive(&of_it(10, answers).encode(), 10_000);
    assert_eq!(accepted, Ok(Accepted::Wrench));
    device.actuate(10_050);
    assert_eq!(state(&mut device, 11_000).condition.since_us, 10_050);
}

#[test]
fn modes_change_as_the_table_says() {
    let mut device = Device::new(model(), Geometry::default());
    assert!(!device.homed() && !device.reset() && device.home() && !device.home());
    assert_eq!(device.mode(), Mode::Homing);
    device
        .receive(&hello(SESSION, 0), 0)
        .expect("it is accepted");
    device.report(0, Inputs::default(), &pose());
    state(&mut device, 0);
    let force = wrench(0, 1, 1).encode();
    assert_eq!(device.receive(&force, 0), Err(Refusal::Mode));
    assert!(device.homed() && device.home() && device.homed());
    assert_eq!(device.receive(&force, 0), Ok(Accepted::Wrench));
    // Not out of a force.
    assert!(!device.home() && !device.homed() && !device.reset());
    assert_eq!(device.mode(), Mode::Active);
    device.fault(fault::EMERGENCY_STOP);
    device.fault(fault::SUPPLY);
    assert_eq!(device.actuate(0), Wrench::default());
    let condition = state(&mut device, 0).condition;
    assert_eq!((condition.mode, condition.fault), (Mode::Fault, 1));
    assert_eq!(
        device.receive(&wrench(1, 1, 1).encode(), 0),
        Err(Refusal::Mode)
    );
    assert!(!device.home() && !device.homed() && device.reset());
    let report = state(&mut device, 0);
    assert_eq!(
        (
            report.session,
            report.condition.mode,
            report.condition.status
        ),
        (0, Mode::Boot, 0)
    );
}

/// Everything that can happen to a device.
#[derive(Clone, Copy, Debug)]
enum Input {
    Home,
    Homed,
    Fault,
    Reset,
    Hello {
        session: u8,
        watchdog_us: u32,
    },
    /// Relative to the newest accepted number and to the newest state.
    Wrench {
        session: u8,
        step: i8,
        state: i8,
        force: i32,
        flags: u8,
        damage: u8,
    },
    Bytes([u8; 7]),
    Report,
    Actuate,
}

fn inputs() -> impl Strategy<Value = Vec<(u32, Input)>> {
    let session = prop_oneof![8 => Just(1_u8), 1 => Just(2)];
    let watchdog = prop_oneof![Just(0), 2_000..=20_000_u32, any::<u32>()];
    let wrench = (
        session.clone(),
        prop_oneof![8 => Just(1_i8), 1 => any::<i8>()],
        prop_oneof![8 => -3..=0_i8, 1 => any::<i8>()],
        prop_oneof![8 => -MOST..=MOST, 1 => any::<i32>()],
        prop_oneof![8 => Just(1_u8), 1 => 0..4_u8],
        prop_oneof![9 => Just(0_u8), 1 => any::<u8>()],
    )
        .prop_map(
            |(session, step, state, force, flags, damage)| Input::Wrench {
                session,
                step,
                state,
                force,
                flags,
                damage,
            },
        );
    let hello = (session, watchdog).prop_map(|(session, watchdog_us)| Input::Hello {
        session,
        watchdog_us,
    });
    let input = prop_oneof![
        2 => Just(Input::Home),
        4 => Just(Input::Homed),
        1 => Just(Input::Fault),
        1 => Just(Input::Reset),
        2 => hello,
        20 => wrench,
        1 => any::<[u8; 7]>().prop_map(Input::Bytes),
        20 => Just(Input::Report),
        20 => Just(Input::Actuate),
    ];
    let elapsed = prop_oneof![20 => 0..1_500_u32, 1 => 0..30_000_u32];
    prop::collection::vec((elapsed, input), 1..300)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// A plain restatement of the rules runs beside the device, and decides whether a force is allowed.
    #[test]
    fn a_force_is_fresh_in_range_of_the_session_and_in_the_mode_active(
        start: u32, inputs in inputs(),
    ) {
        let mut device = Device::new(model(), Geometry::default());
        let mut now_us = start;
        let (mut last, mut newest) = (0_u16, 0_u16);
        let mut states: Vec<(u16, u32, u32)> = Vec::new();
        // The last accepted wrench: force, and when it came.
        let mut accepted: Option<(i32, u32)> = None;
        let mut watchdog_us = WATCHDOG_US;
        for (elapsed_us, input) in inputs {
            now_us = now_us.wrapping_add(elapsed_us);
            let before = device.session();
            match input {
                Input::Home => { device.home(); }
                Input::Homed => { device.homed(); }
                Input::Fault => device.fault(fault::AMPLIFIER),
                Input::Reset => { device.reset(); }
                Input::Hello { session, watchdog_us: wanted } => {
                    if device.receive(&hello(session.into(), wanted), now_us).is_ok() {
                        watchdog_us = if wanted == 0 { WATCHDOG_US } else { wanted };
                        prop_assert!((2_000..=100_000).contains(&watchdog_us));
                        if u32::from(session) != before {
                            accepted = None;
                        }
                    }
                }
                Input::Wrench { session, step, state, force, flags, damage } => {
                    let sequence = last.wrapping_add_signed(step.into());
                    let answers = newest.wrapping_add_signed(state.into());
                    let report = WrenchReport {
                        session: session.into(), flags, ..wrench(sequence, answers, force)
                    };
                    let mut bytes = report.encode();
                    bytes[usize::from(damage) % LENGTH] ^= damage;
                    match device.receive(&bytes, now_us) {
                        Ok(Accepted::Wrench) => {
                            prop_assert_eq!(damage, 0);
                            prop_assert!(flags & 1 == 1 && device.session() == u32::from(session));
                            prop_assert!(accepted.is_none() || step > 0, "stale");
                            prop_assert!(force.unsigned_abs() <= MOST as u32 + 1);
                            let of = |&&(number, at, of): &&(u16, u32, u32)| {
                                number == answers
                                    && of == device.session()
                                    && now_us.wrapping_sub(at) <= watchdog_us
                            };
                            prop_assert!(states.iter().any(|state| of(&state)));
                            accepted = Some((force, now_us));
                            last = sequence;
                        }
                        Ok(Accepted::Release) => accepted = None,
                        Ok(Accepted::Hello) => prop_assert!(false, "no hello was sent"),
                        Err(_) => {}
                    }
                }
                Input::Bytes(bytes) => prop_assert!(device.receive(&bytes, now_us).is_err()),
                Input::Report => {
                    let bytes = device.report(now_us, Inputs::default(), &pose());
                    match Report::decode(&bytes).expect("what a device sends is valid") {
                        Report::State(state) => {
                            newest = state.sequence;
                            states.push((newest, now_us, state.session));
                        }
                        other => prop_assert!(matches!(other, Report::Capabilities(_))),
                    }
                }
                Input::Actuate => {}
            }
            // The amplifiers are asked after each input, on a copy, so that other orders are met, too.
            let mut copy = device;
            let force = if matches!(input, Input::Actuate) {
                device.actuate(now_us)
            } else {
                copy.actuate(now_us)
            }
            .force[0];
            if device.mode() != Mode::Active {
                prop_assert_eq!(force, 0);
            }
            if force != 0 {
                let (expected, at) = accepted.expect("a force has been accepted");
                prop_assert_eq!(force, expected);
                prop_assert!(now_us.wrapping_sub(at) < watchdog_us);
            }
        }
    }

    #[test]
    fn a_silent_host_leaves_no_force_at_any_later_time(
        start: u32, steps in prop::collection::vec(0..5_000_u32, 1..50),
    ) {
        let mut device = active(start);
        let mut elapsed_us = 0;
        for step in steps {
            elapsed_us += step;
            let force = device.actuate(start.wrapping_add(elapsed_us)).force[0];
            prop_assert_eq!(force != 0, elapsed_us < WATCHDOG_US);
        }
    }
}
