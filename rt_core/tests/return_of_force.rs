//! The return of the force. After every loss of the force and every pause of the ticks, the force returns along a ramp,
//! on both of two devices that hold one heavy body.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use proptest::prelude::*;
use rt_core::Reading;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::engage::{ARM_ORDER, EngageConfig, STOP_ORDER};
use rt_core::safety::{SafetyConfig, SafetyState};
use rt_core::{
    Controller, ControllerConfig, DeviceError, DeviceState, Freedom, LocalModel, MAX_DEVICES,
    PassivityConfig, Pose, Rendering, Scheme, Telemetry, TickTime, Vec3, Wrench,
};

const MS: u64 = 1_000_000;
const PERIOD: f64 = 1e-3;
/// Time in which the force returns after a fault (s).
const RECOVERY: f64 = 0.1;
/// Stiffness of the spring from each handle to the world, and between the handles (N/m).
const SPRINGS: [f64; 2] = [200.0, 100.0];
/// Weight on each handle, along x (N).
const WEIGHT: f64 = -1.5;
/// Time in which the cap forgets how quick a hand was (s).
const MEMORY: f64 = 0.02;
/// Largest rise of a capped force by the motion of the hands (N/m, of the longer of their steps). The cap passes the
/// fraction `G / (0.3 V)` of the springs. Hands that move by `D_j` under the force `k F_j` change this fraction by at most
/// `k (1 / 0.3 - 1) sum |F_j| |D_j| / V`. No force of a spring is larger than `sqrt(2 K V)`, where `K` is the stiffness at
/// its own handle, so two hands raise a force by up to `4 (1 / 0.3 - 1) K D`. The springs themselves add the rest.
const CAPPED: f64 =
    4.0 * (1.0 / 0.3 - 1.0) * (SPRINGS[0] + SPRINGS[1]) + SPRINGS[0] + 2.0 * SPRINGS[1];
const DEAD_MAN: u32 = 1;
/// Ticks between two publications.
const PUBLISHED: u64 = 10;

/// Two devices on one body.
fn controller(scheme: Scheme, ramp: f64) -> Controller {
    let mut config = ControllerConfig::default();
    let safety = SafetyConfig {
        actuated: Freedom::Three,
        max_force: 50.0,
        max_speed: 1.0,
        max_reach: 0.1,
        patience: 5,
        decay: 0.1,
        recovery: RECOVERY,
        engage: EngageConfig {
            armed: true,
            dead_man: DEAD_MAN,
            ramp,
            ..EngageConfig::default()
        },
        ..SafetyConfig::unlimited(PERIOD)
    };
    for _ in 0..2 {
        let frame = DeviceFrame::at(Vec3::zeros());
        let _ = config.devices.push(DeviceConfig { frame, safety });
    }
    let _ = config.bodies.push(CouplingConfig {
        scheme,
        period: PERIOD,
        blend: 0.5,
        age_limit: 0.05,
        decay: 0.1,
        recovery: RECOVERY,
        hold_damping: [0.0; MAX_DEVICES],
        passivity: PassivityConfig::new(PERIOD),
    });
    Controller::new(&config)
}

/// The force (N) on each handle at these places along x, relative to the places at which the springs rest, for a model
/// that is rendered in full.
fn springs([a, b]: [f64; 2]) -> [f64; 2] {
    let [world, between] = SPRINGS;
    let pull = between * (b - a);
    [WEIGHT - world * a + pull, WEIGHT - world * b - pull]
}

/// The model of the body, whose springs rest at the place `rest` along x.
fn model(now_ns: u64, rest: f64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.sequence = 1 + now_ns / MS;
    model.head.time_ns = now_ns;
    model.head.period = PUBLISHED as f64 * PERIOD;
    model.head.handle_count = 2;
    let [world, between] = SPRINGS;
    for i in 0..2 {
        model.handles[i].device = i as u8;
        model.handles[i].pose.position.x = rest;
        model.handles[i].wrench.force.x = WEIGHT;
        model.handles[i].weight.x = WEIGHT;
        for axis in 0..3 {
            model.stiffness[i][i][(axis, axis)] = world + between;
            model.stiffness[i][1 - i][(axis, axis)] = -between;
        }
    }
    model
}

/// The cause that takes the force away.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cause {
    /// Nothing: the hands only move.
    Nothing,
    /// The first device gives no state.
    Silent,
    /// The first device reports that it renders nothing.
    LetGo,
    /// The first device reports a fault.
    Fault,
    /// An order stops both devices, and another one arms them.
    Stopped,
    /// The hand on the first device lets go of its dead-man button.
    HandsOff,
    /// The first device moves too fast.
    TooFast,
    /// The first device is out of its reach.
    OutOfReach,
    /// The host publishes nothing.
    StaleHost,
    /// The loop stands still before a tick.
    Late,
    /// The loop stands still within a tick.
    Long,
}

const CAUSES: [Cause; 11] = [
    Cause::Nothing,
    Cause::Silent,
    Cause::LetGo,
    Cause::Fault,
    Cause::Stopped,
    Cause::HandsOff,
    Cause::TooFast,
    Cause::OutOfReach,
    Cause::StaleHost,
    Cause::Late,
    Cause::Long,
];

/// A run of the controller.
struct Run {
    scheme: Scheme,
    controller: Controller,
    now_ns: u64,
    /// The bit of the orders to arm, and whether such an order is due.
    arm: u32,
    stopped: bool,
    places: [f64; 2],
    /// The place at which the springs rest.
    rest: f64,
    /// Places of the proxies in the last tick along x, and the largest of their motions in that tick (m).
    proxies: [f64; 2],
    farthest: f64,
    /// Largest motion of each proxy in a tick, with the memory of the cap (m).
    reaches: [f64; 2],
    /// Time of the last tick (ns): the host knows of no later one.
    told_ns: u64,
    /// Force of each device in the last tick, and the force of the springs at its proxy then (N).
    last: [(f64, f64); 2],
    last_states: [SafetyState; 2],
}

impl Run {
    fn new(scheme: Scheme, ramp: f64) -> Self {
        Self {
            scheme,
            controller: controller(scheme, ramp),
            now_ns: MS,
            arm: 0,
            stopped: false,
            places: [0.0; 2],
            rest: 0.0,
            proxies: [0.0; 2],
            farthest: 0.0,
            reaches: [0.0; 2],
            told_ns: 0,
            last: [(0.0, 0.0); 2],
            last_states: [SafetyState::HandsOff; 2],
        }
    }

    /// One tick under `cause`, which is in its tick number `k`. Returns commands and record.
    fn tick(&mut self, cause: Cause, k: u64, away_ns: u64) -> ([Wrench; MAX_DEVICES], Telemetry) {
        if (self.now_ns / MS).is_multiple_of(PUBLISHED) && cause != Cause::StaleHost {
            let accepted = self.controller.accept(0, &model(self.told_ns, self.rest));
            accepted.expect("a sound model");
        }
        if self.stopped && cause != Cause::Stopped {
            self.arm ^= ARM_ORDER;
        }
        self.stopped = cause == Cause::Stopped;
        let orders = self.arm | if self.stopped { STOP_ORDER } else { 0 };
        let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
        for (device, (reading, x)) in readings.iter_mut().zip(self.places).enumerate() {
            let mut state = DeviceState {
                pose: Pose::at(Vec3::x() * x),
                buttons: DEAD_MAN | orders,
                ..DeviceState::resting()
            };
            if device == 0 {
                match cause {
                    Cause::Silent => continue,
                    Cause::LetGo => state.rendering = Rendering::LetGo,
                    Cause::Fault => state.rendering = Rendering::Fault(1),
                    Cause::HandsOff => state.buttons &= !DEAD_MAN,
                    Cause::TooFast => state.twist.linear.y = 2.0,
                    Cause::OutOfReach => state.pose.position.y = 0.2,
                    _ => {}
                }
            }
            *reading = Ok(state);
        }
        let lateness_ns = if cause == Cause::Late && k == 0 {
            away_ns
        } else {
            0
        };
        let time = TickTime {
            now_ns: self.now_ns,
            lateness_ns,
        };
        let (mut commands, mut telemetry) = self.controller.tick(time, &readings);
        let took_ns = if cause == Cause::Long && k == 0 {
            away_ns
        } else {
            0
        };
        self.controller.end(took_ns, &mut commands, &mut telemetry);
        self.told_ns = self.now_ns;
        // Deadlines that have passed are skipped.
        self.now_ns += (lateness_ns + took_ns).next_multiple_of(MS).max(MS);
        (commands, telemetry)
    }

    /// Both hands, which have carried the weight, carry the body to the place `rest` along x.
    fn carry(&mut self, rest: f64) {
        for k in 0..600 {
            self.rest = rest * f64::from(k.min(500)) / 500.0;
            self.places = [self.rest; 2];
            self.tick(Cause::Nothing, 0, 0);
        }
        // Hands that rest at the rest place of the springs carry the weight alone.
        self.last = [(WEIGHT, WEIGHT); 2];
        self.proxies = self.places;
    }

    /// One tick. Its forces may rise by no more than the rise of the springs and of the ramp together.
    fn step(&mut self, cause: Cause, k: u64, away_ns: u64) -> Result<(), TestCaseError> {
        let (commands, telemetry) = self.tick(cause, k, away_ns);
        let [a, b, ..] = telemetry.devices;
        let whole = match self.scheme {
            Scheme::Hold => [WEIGHT; 2],
            _ => springs([a, b].map(|device| device.pose.position.x - self.rest)),
        };
        let places = [a, b].map(|device| device.pose.position.x);
        let motions = [0, 1].map(|device: usize| (places[device] - self.proxies[device]).abs());
        let farthest = motions[0].max(motions[1]);
        self.proxies = places;
        let fade = (-PERIOD / MEMORY).exp();
        let mut spent = 0.0;
        for device in 0..2 {
            let reach = &mut self.reaches[device];
            *reach = motions[device].max(*reach * fade);
            spent += (whole[device] - WEIGHT).abs() * *reach;
        }
        // The certificate of the cap acts, or did in the last tick.
        let certified = spent > fade * telemetry.bodies[0].energy.available;
        for device in 0..2 {
            let force = commands[device].force.x;
            prop_assert_eq!(
                commands[device].force,
                telemetry.devices[device].wrench.force
            );
            let (before, whole_before) = self.last[device];
            let spring = (whole[device] - WEIGHT).abs();
            // Under the cap, the springs may carry less of the weight than without the cap. After a quick motion, their
            // force returns as the cap forgets the motion.
            let (moved, most, returned) = if self.scheme == Scheme::Capped {
                let moved = CAPPED * farthest.max(self.farthest);
                let part = if certified { 1.0 / fade - 1.0 } else { 0.0 };
                (moved, WEIGHT.abs() + spring, spring * part)
            } else {
                let moved = (whole[device] - whole_before).abs();
                (moved, whole[device].abs().max(whole_before.abs()), 0.0)
            };
            // No smooth step rises faster than 1.5 times its mean. The trust in a model that returns has a ramp of its own.
            let ramp = 2.0 * 1.5 * most * PERIOD / RECOVERY + returned;
            let rise = force.abs() - before.abs();
            let states = (self.last_states[device], telemetry.devices[device].safety);
            prop_assert!(
                rise <= moved + ramp + 1e-9,
                "{:?} {}: {} to {} N in tick {}, the springs moved by {} N: {:?}",
                cause,
                device,
                before,
                force,
                k,
                moved,
                states
            );
            self.last[device] = (force, whole[device]);
            self.last_states[device] = telemetry.devices[device].safety;
        }
        self.farthest = farthest;
        Ok(())
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn no_force_comes_in_a_step(
        events in prop::collection::vec(
            (0..CAUSES.len(), 1..150_u64, 0..400_u64, [-0.02..0.02_f64, -0.02..0.02_f64]), 1..8,
        ),
        scheme in prop::sample::select(vec![Scheme::Linear, Scheme::Hold, Scheme::Classic, Scheme::Capped]),
        ramp in prop::sample::select(vec![0.0, 0.3]),
        carried in prop::sample::select(vec![0.0, -0.06, 0.06]),
    ) {
        let mut run = Run::new(scheme, ramp);
        for k in 0..500 {
            run.step(Cause::Nothing, k, 0)?;
        }
        run.carry(carried);
        for (cause, length, quiet, places) in events {
            let cause = CAUSES[cause];
            let from = run.places;
            let ticks = length + quiet;
            for k in 0..ticks {
                // A smooth stroke over the cause and the time after it.
                let part = (k + 1) as f64 / ticks as f64;
                let part = part * part * (3.0 - 2.0 * part);
                for ((place, from), to) in run.places.iter_mut().zip(from).zip(places) {
                    *place = from + (carried + to - from) * part;
                }
                let now = if k < length { cause } else { Cause::Nothing };
                // A stop of 8.5 ms or more, or a delay that no device notices.
                let away_ns = if length < 20 { 7 * MS } else { length * MS / 2 };
                run.step(now, k, away_ns)?;
            }
        }
        // The whole force returns; the cap may hold back a part of it.
        for k in 0..1000 {
            run.step(Cause::Nothing, k, 0)?;
        }
        for (force, whole) in run.last {
            if scheme != Scheme::Capped {
                prop_assert!((force - whole).abs() < 1e-9, "{} {}", force, whole);
            }
        }
    }
}

/// A run whose two devices render a force.
fn rendering(scheme: Scheme, ramp: f64) -> Run {
    let mut run = Run::new(scheme, ramp);
    for k in 0..600_u64 {
        // The hands rest until the devices are engaged.
        let part = k.saturating_sub(300) as f64 / 300.0;
        run.places = [0.01 * part, -0.02 * part];
        run.tick(Cause::Nothing, k, 0);
    }
    run
}

/// The states of the two devices, and whether they render a force, in a tick.
fn rendered(tick: &([Wrench; MAX_DEVICES], Telemetry)) -> [(SafetyState, bool); 2] {
    [0, 1].map(|device| {
        (
            tick.1.devices[device].safety,
            tick.0[device] != Wrench::zero(),
        )
    })
}

#[test]
fn the_first_tick_after_a_pause_commands_nothing_by_the_clock() {
    use SafetyState::{Normal, Recovering, Silent};
    // The watchdog of a device is 10 ms; a fifth of this time is for the way of the command.
    for (away_ns, stands_still) in [(6_900_000, false), (7_100_000, true), (3_000 * MS, true)] {
        let mut run = rendering(Scheme::Linear, 0.0);
        let first = rendered(&run.tick(Cause::Late, 0, away_ns));
        let next = rendered(&run.tick(Cause::Nothing, 0, 0));
        let expected = if stands_still {
            ([(Silent, false); 2], [(Recovering, true); 2])
        } else {
            ([(Normal, true); 2], [(Normal, true); 2])
        };
        assert_eq!((first, next), expected, "{away_ns} ns");
        let stale = run.controller.safety_counters().map(|counts| counts.stale);
        assert_eq!(stale.collect::<Vec<_>>(), [u64::from(stands_still); 2]);
    }
}

#[test]
fn a_pause_within_a_tick_replaces_its_commands_by_zero() {
    use SafetyState::{Normal, Recovering, Silent};
    let mut run = rendering(Scheme::Linear, 0.0);
    let short = rendered(&run.tick(Cause::Long, 0, 6_900_000));
    assert_eq!(short, [(Normal, true); 2]);
    let mut run = rendering(Scheme::Linear, 0.0);
    let tick = run.tick(Cause::Long, 0, 7_100_000);
    assert_eq!(rendered(&tick), [(Silent, false); 2]);
    assert_eq!(tick.1.took_ns, 7_100_000);
    assert_eq!(tick.1.devices[1].wrench, Wrench::zero());
    assert_eq!(
        rendered(&run.tick(Cause::Nothing, 0, 0)),
        [(Recovering, true); 2]
    );
    let trip = run
        .controller
        .first_trips()
        .nth(1)
        .flatten()
        .expect("a trip");
    // In ticks: since the command of the tick before, and the part of the watchdog.
    assert_eq!((trip.state, trip.limit), (Silent, 8.0));
    assert!((trip.found - 8.1).abs() < 1e-9, "{trip:?}");
    assert_eq!(trip.tick, tick.1.tick);
}

#[test]
fn a_late_tick_and_a_long_tick_add_up() {
    let mut run = rendering(Scheme::Linear, 0.0);
    let late = TickTime {
        now_ns: run.now_ns,
        lateness_ns: 4 * MS,
    };
    let state = |x: f64| {
        Ok(DeviceState {
            pose: Pose::at(Vec3::x() * x),
            buttons: DEAD_MAN,
            ..DeviceState::resting()
        })
    };
    let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
    [readings[0], readings[1]] = run.places.map(state);
    let (mut commands, mut telemetry) = run.controller.tick(late, &readings);
    run.controller.end(4 * MS, &mut commands, &mut telemetry);
    assert_eq!(commands[0], Wrench::zero());
}

#[test]
fn the_proxy_does_not_follow_the_motion_of_a_pause() {
    // The loop stands still before a tick, and within a tick. In the second case, the reading is from before the pause.
    for cause in [Cause::Late, Cause::Long] {
        let mut run = rendering(Scheme::Linear, 0.0);
        let (_, before) = run.tick(Cause::Nothing, 0, 0);
        if cause == Cause::Long {
            run.tick(cause, 0, 500 * MS);
        }
        run.places = [0.03, 0.03];
        let now = if cause == Cause::Late {
            cause
        } else {
            Cause::Nothing
        };
        let (_, after) = run.tick(now, 0, 500 * MS);
        for device in 0..2 {
            let [from, to] = [&before, &after].map(|record| record.devices[device].pose.position);
            // Rounding of a sum of places.
            assert!((from - to).norm() < 1e-15, "{cause:?} {device}");
        }
    }
}

#[test]
fn a_pause_is_counted_from_the_last_command() {
    use SafetyState::Normal;
    // A command leaves 6.9 ms after its tick began. The next tick begins 9 ms after the last, and commands at once.
    let mut run = rendering(Scheme::Linear, 0.0);
    let long = run.tick(Cause::Long, 0, 6_900_000);
    assert_eq!(rendered(&long), [(Normal, true); 2]);
    let next = run.tick(Cause::Late, 0, 2 * MS);
    assert_eq!(rendered(&next), [(Normal, true); 2]);
    // Ticks that each are late by less than the watchdog add up to no pause.
    for _ in 0..5 {
        let late = run.tick(Cause::Late, 0, 6_900_000);
        assert_eq!(rendered(&late), [(Normal, true); 2]);
    }
}

#[test]
fn a_device_that_lets_go_loses_its_force_alone_and_its_proxy_waits() {
    for (cause, state) in [
        (Cause::LetGo, SafetyState::LetGo),
        (Cause::Fault, SafetyState::DeviceFault),
    ] {
        let mut run = rendering(Scheme::Linear, 0.0);
        let (_, before) = run.tick(Cause::Nothing, 0, 0);
        let held = run.places;
        run.places[0] += 0.001;
        for k in 0..20 {
            let tick = run.tick(cause, k, 0);
            assert_eq!(
                rendered(&tick),
                [(state, false), (SafetyState::Normal, true)]
            );
            assert_eq!(tick.1.devices[0].pose, before.devices[0].pose);
        }
        let counts: Vec<_> = run.controller.safety_counters().collect();
        let fault = u64::from(cause == Cause::Fault);
        assert_eq!(
            (counts[0].let_go, counts[0].device_faults),
            (1 - fault, fault)
        );
        assert_eq!((counts[1].let_go, counts[1].device_faults), (0, 0));
        let reported: Vec<_> = run.controller.first_device_faults().collect();
        assert_eq!(
            reported,
            [(cause == Cause::Fault).then_some((601, 1)), None]
        );
        // After a fault, the force comes back as after an engagement. Otherwise it comes back as after a loss.
        let (_, telemetry) = run.tick(Cause::Nothing, 0, 0);
        let returns = [SafetyState::Recovering, SafetyState::Engaging][fault as usize];
        assert_eq!(telemetry.devices[0].safety, returns);
        for k in 0..200 {
            run.tick(Cause::Nothing, k, 0);
        }
        // The motion since the loss of the force is not part of the scene.
        let (commands, _) = run.tick(Cause::Nothing, 0, 0);
        let whole = springs(held);
        let force = commands[0].force.x;
        assert!(
            (force - whole[0]).abs() < 1e-9,
            "{cause:?} {force} {whole:?}"
        );
    }
}

#[test]
fn stop_and_arm_neither_spend_nor_make_energy_of_a_lowered_weight() {
    // The hands lower the body's weight, stop, and arm again without having moved.
    for quiet in [1, 100, 500] {
        let mut run = Run::new(Scheme::Capped, 0.0);
        for k in 0..300 {
            run.tick(Cause::Nothing, k, 0);
        }
        for k in 0..1000 {
            run.places = [WEIGHT / SPRINGS[0] * k as f64 / 1000.0; 2];
            run.tick(Cause::Nothing, k, 0);
        }
        let before = run.controller.energy().next().expect("a body");
        for k in 0..quiet {
            let (_, stopped) = run.tick(Cause::Stopped, k, 0);
            assert!(!stopped.bodies[0].withheld.is_noticeable(), "{quiet} {k}");
        }
        for k in 0..500 {
            run.step(Cause::Nothing, k, 0)
                .expect("no step of the force");
        }
        let after = run.controller.energy().next().expect("a body");
        assert!(before.raised < -0.01, "{before:?}");
        // The springs forget no credit that the stored energy backs; sums round.
        assert!((after.raised - before.raised).abs() < 1e-12);
        assert!((after.least - before.least).abs() < 1e-12);
    }
}

#[test]
fn springs_that_resting_hands_have_paid_for_go_and_return_with_a_weight_along_ramps() {
    // The hands carry the body down or up, move its springs, and rest. The force of the body, or of the first device,
    // fades and comes back. No hand does any work on this, so the cap has nothing to withhold.
    let places = [1e-3, 3e-3, 0.01, 0.02];
    let cases = [Cause::StaleHost, Cause::TooFast].map(|cause| [-0.06, 0.06].map(|to| (cause, to)));
    for ((cause, to), d) in
        (cases.as_flattened().iter()).flat_map(|case| places.map(|d| (*case, d)))
    {
        let mut run = Run::new(Scheme::Capped, 0.0);
        for k in 0..300 {
            run.tick(Cause::Nothing, k, 0);
        }
        run.carry(to);
        for k in 0..500 {
            run.places = [run.rest + d * k as f64 / 499.0; 2];
            run.tick(Cause::Nothing, k, 0);
        }
        let [whole, _] = springs([d; 2]);
        // No smooth step rises faster than 1.5 times its mean.
        let most = whole.abs() * 1.5 * PERIOD / RECOVERY;
        let mut before = [whole; 2];
        for k in 0..600 {
            let now = if k < 200 { cause } else { Cause::Nothing };
            let (commands, telemetry) = run.tick(now, k, 0);
            let forces = [0, 1].map(|device: usize| commands[device].force.x);
            for (force, before) in forces.into_iter().zip(before) {
                let change = (force - before).abs();
                assert!(
                    change <= most + 1e-9,
                    "{cause:?} {to} {d} {k}: {before} to {force} N, allowed {most}"
                );
            }
            assert_eq!(telemetry.bodies[0].withheld.force, 0.0);
            before = forces;
        }
        for force in before {
            assert!((force - whole).abs() < 1e-9, "{d}: {force} {whole}");
        }
    }
}

#[test]
fn the_proxy_of_a_device_that_comes_late_follows_by_the_fraction_of_its_force() {
    // The first device gives no state at the start. Its hand then moves while its force comes in.
    let mut run = Run::new(Scheme::Linear, 0.0);
    for k in 0..200 {
        run.tick(Cause::Silent, k, 0);
    }
    let (_, first) = run.tick(Cause::Nothing, 0, 0);
    let from = first.devices[0].pose.position.x;
    assert_eq!(from, run.places[0]);
    for k in 0..100 {
        run.places[0] += 1e-4;
        let (_, telemetry) = run.tick(Cause::Nothing, k, 0);
        let moved = telemetry.devices[0].pose.position.x - from;
        // The smooth step stays below its end.
        assert!(moved < 1e-4 * (k + 1) as f64, "{k}: {moved}");
    }
}
