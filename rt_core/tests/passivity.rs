//! The energy account and the cap. The hands never get back more energy than they supplied, even with a stiff wall, a
//! late device or wrong models. If nothing is wrong, the cap withholds nothing. The last tests are about the classic
//! controller, which takes back the energy that came out.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use nalgebra::UnitQuaternion;
use rt_core::Reading;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::{Coupling, CouplingConfig, Passed};
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyConfig;
use rt_core::velocity::VelocityEstimator;
use rt_core::{
    Controller, ControllerConfig, DeviceError, DeviceState, EnergyAccount, Freedom, HeldBack,
    LocalModel, MAX_DEVICES, PassivityConfig, Port, Pose, Scheme, TearLimit, Twist, Vec3, Withheld,
    Wrench,
};

const PERIOD: f64 = 1e-3;
/// Moving mass (kg) and damping (N s/m) of the device.
const MASS: f64 = 0.1;
const DAMPING: f64 = 0.5;
/// Largest passive stiffness of a sampled wall on this device (N/m): Colgate and Schenkel's `2 b / T`.
const BOUND: f64 = 2.0 * DAMPING / PERIOD;

/// A device that moves along x, and the forces that it renders.
struct Rig {
    controller: Box<Controller>,
    estimator: VelocityEstimator,
    x: f64,
    v: f64,
    forces: Vec<f64>,
    delay: usize,
    now_ns: u64,
    /// Net work of the hand's force, integrated with the motion.
    hand_work: f64,
    least_hand_work: f64,
    /// Work of the device's motor.
    device_work: f64,
}

fn rig(scheme: Scheme, delay: usize, x: f64) -> Rig {
    let mut passivity = PassivityConfig::new(PERIOD);
    passivity.delay = delay;
    passivity.ports = [Port {
        damping: DAMPING,
        most_damping: 0.1 * MASS / PERIOD / (1.0 + delay as f64),
        ..Port::UNKNOWN
    }; MAX_DEVICES];
    let mut config = ControllerConfig::default();
    let _ = config.devices.push(DeviceConfig {
        frame: DeviceFrame::at(Vec3::zeros()),
        safety: SafetyConfig {
            actuated: Freedom::Three,
            max_force: 20.0,
            max_moment: 0.0,
            decay: 0.1,
            patience: 10,
            recovery: 0.1,
            ..SafetyConfig::unlimited(PERIOD)
        },
    });
    let _ = config.bodies.push(coupling_config(scheme, &passivity));
    Rig {
        controller: Box::new(Controller::new(&config)),
        estimator: VelocityEstimator::new(PERIOD, VelocityEstimator::DEFAULT_CUTOFF),
        x,
        v: 0.0,
        forces: vec![0.0; delay + 1],
        delay,
        now_ns: 1_000_000,
        hand_work: 0.0,
        least_hand_work: 0.0,
        device_work: 0.0,
    }
}

fn coupling_config(scheme: Scheme, passivity: &PassivityConfig) -> CouplingConfig {
    CouplingConfig {
        scheme,
        period: PERIOD,
        blend: 0.5,
        age_limit: 1e3,
        decay: 0.1,
        recovery: PERIOD,
        hold_damping: [0.0; MAX_DEVICES],
        passivity: *passivity,
    }
}

/// A wall of stiffness `k` that begins at zero and pushes towards positive x.
fn wall(k: f64, sequence: u64, time_ns: u64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.sequence = sequence;
    model.head.time_ns = time_ns;
    model.head.handle_count = 1;
    model.handles[0].contact = Vec3::x();
    model.stiffness[0][0][(0, 0)] = k;
    model
}

impl Rig {
    fn accept(&mut self, model: &LocalModel) {
        self.controller.accept(0, model).expect("a sound model");
    }

    /// One tick, then the motion until the next under the force of `hand` (N; of time, position and velocity).
    fn tick(&mut self, hand: impl Fn(f64, f64, f64) -> f64) {
        let velocity = self.estimator.update(&Vec3::new(self.x, 0.0, 0.0));
        let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
        readings[0] = Ok(DeviceState {
            pose: Pose::at(Vec3::new(self.x, 0.0, 0.0)),
            twist: Twist {
                linear: velocity,
                ..Twist::zero()
            },
            ..DeviceState::resting()
        });
        let (commands, _) = self.controller.tick(self.now_ns, &readings);
        self.forces.push(commands[0].force.x);
        let force = self.forces[self.forces.len() - 1 - self.delay];
        // Semi-implicit steps of a hundredth of a tick: the motion errs by less than a thousandth.
        let h = PERIOD / 100.0;
        for k in 0..100 {
            let push = hand(self.now_ns as f64 * 1e-9 + f64::from(k) * h, self.x, self.v);
            let before = self.x;
            self.v += (push + force - DAMPING * self.v) / MASS * h;
            self.x += self.v * h;
            self.hand_work += push * (self.x - before);
            self.device_work += force * (self.x - before);
        }
        self.least_hand_work = self.least_hand_work.min(self.hand_work);
        self.now_ns += 1_000_000;
    }

    fn energy(&self) -> EnergyAccount {
        self.controller.energy().next().expect("one body")
    }
}

/// A hand that pushes into the wall and retreats, ever faster: from 0.5 to 40 Hz.
fn sweep(t: f64, _: f64, v: f64) -> f64 {
    let phase = core::f64::consts::TAU * (0.5 * t + 39.5 / 20.0 * t * t);
    -3.0 + 2.5 * phase.sin() - 0.5 * v
}

/// Stiffness up to which a plain sampled spring is passive at the hand (N/m). Colgate and Schenkel: with a `delay` of
/// `d` ticks, `b > K T / 2 max sin((2 d + 1) x / 2) / sin(x / 2)`, with the maximum at `x = 0`.
fn bound(delay: usize) -> f64 {
    BOUND / (2 * delay + 1) as f64
}

fn pressed(scheme: Scheme, k: f64, delay: usize) -> Rig {
    let mut rig = rig(scheme, delay, 1e-3);
    rig.accept(&wall(k, 1, 1));
    for _ in 0..10_000 {
        rig.tick(sweep);
    }
    rig
}

#[test]
fn a_wall_ten_times_too_stiff_gives_the_hand_no_more_than_the_allowance() {
    for delay in [0, 1, 3] {
        for times in [0.5, 1.0, 2.0, 5.0, 10.0] {
            let rig = pressed(Scheme::Capped, times * bound(delay), delay);
            let account = rig.energy();
            println!("{delay} {times} {:.2e} {account:?}", rig.least_hand_work);
            // Twice the allowance and a margin, at the port of the hand.
            assert!(rig.least_hand_work > -1e-3, "{delay} {times}");
            // The controller's own account agrees.
            assert!(account.least > -1e-3, "{delay} {times}");
        }
    }
}

/// A wall that begins at zero, as a host publishes it that foresees the touch of a hand at `x`: no spring before the touch, and
/// a touch with the rest of the gap and a damper of `time` (s); after the touch the spring.
fn foreseen(k: f64, time: f64, x: f64, sequence: u64, time_ns: u64) -> LocalModel {
    let mut model = wall(0.0, sequence, time_ns);
    model.handles[0].contact = Vec3::zeros();
    model.handles[0].pose = Pose::at(Vec3::new(x, 0.0, 0.0));
    if x > 0.0 {
        model.head.tear_limit = TearLimit {
            root: -time,
            critical: x,
            area: -k,
        };
        model.handles[0].tear_slope[0] = -1.0;
    } else {
        model.stiffness[0][0][(0, 0)] = k;
        model.handles[0].wrench.force.x = -k * x;
        model.head.energy = 0.5 * k * x * x;
    }
    model
}

/// The hand bounces on the wall: its period is that of the messages times a ratio, and it turns at a phase of theirs. `is_there`
/// tells whether the wall that a message foresees is in the next one.
fn bounced(scheme: Scheme, times: f64, ratio: f64, phase: f64, is_there: bool) -> Rig {
    const TICKS: u64 = 16;
    let mut rig = rig(scheme, 0, 1e-3);
    let k = times * BOUND;
    for tick in 0..4000 {
        if tick % TICKS == 0 {
            // A wall that is gone moves away as fast as the hand comes.
            let x = if is_there { rig.x } else { rig.x.abs() };
            let sequence = tick / TICKS + 1;
            rig.accept(&foreseen(k, 0.01, x, sequence, rig.now_ns));
        }
        let turn = core::f64::consts::TAU / (ratio * TICKS as f64 * PERIOD);
        rig.tick(|t, x, v| -40.0 * x + 3.0 * (turn * t + phase).sin() - 0.5 * v);
    }
    rig
}

#[test]
fn a_hand_that_bounces_on_a_foreseen_touch_gains_no_more_than_the_allowance() {
    // The hand would gain: without the cap it does.
    let mut gained = 0.0_f64;
    for times in [0.5, 2.0, 10.0] {
        for ratio in [0.5, 1.0, 1.37, 2.0, 3.0, 7.0] {
            for phase in [0.0, 0.8, 1.6, 2.4, 3.2, 4.0, 4.8, 5.6] {
                for is_there in [true, false] {
                    let capped = bounced(Scheme::Capped, times, ratio, phase, is_there);
                    let case = format!("{times} {ratio} {phase} {is_there} {:?}", capped.energy());
                    // Twice the allowance and a margin, at the port of the hand, as at a wall.
                    assert!(
                        capped.least_hand_work > -1e-3,
                        "{} {case}",
                        capped.least_hand_work
                    );
                }
                let plain = bounced(Scheme::Linear, times, ratio, phase, true);
                gained = gained.max(-plain.least_hand_work);
            }
        }
    }
    assert!(gained > 2e-3, "{gained}");
}

#[test]
fn the_account_is_the_work_done_at_the_device() {
    for scheme in [Scheme::Linear, Scheme::Capped] {
        for delay in [0, 2] {
            let rig = pressed(scheme, 2.0 * bound(delay), delay);
            let supplied = rig.energy().supplied;
            // The force is held over a tick, so its work is exact. The last tick is not accounted for yet.
            let last = 20.0 * 1e-3;
            assert!(
                (supplied + rig.device_work).abs() < last,
                "{supplied} {}",
                rig.device_work
            );
        }
    }
}

#[test]
fn a_plain_wall_ten_times_too_stiff_makes_energy() {
    // Without the cap, the tests above would fail.
    let account = pressed(Scheme::Linear, 10.0 * BOUND, 0).energy();
    assert!(account.least < -0.05, "{account:?}");
}

#[test]
fn a_wall_pressed_slowly_is_as_stiff_as_asked() {
    let k = 5.0 * BOUND;
    let mut rig = rig(Scheme::Capped, 0, 1e-3);
    rig.accept(&wall(k, 1, 1));
    // The hand goes one millimetre deep in two seconds, and holds.
    let deep = |t: f64| -2e-3 * (t / 2.0).min(1.0) + 1e-3;
    for _ in 0..3000 {
        rig.tick(|t, x, v| 2e4 * (deep(t) - x) - 60.0 * v);
    }
    let force = rig.forces.last().copied().unwrap_or_default();
    println!("{force} {} {}", k * rig.x, rig.x);
    assert!((force / (-k * rig.x) - 1.0).abs() < 0.01);
}

/// The coupling of a body without any force, which the first device holds.
fn in_the_air(passivity: &PassivityConfig) -> Coupling {
    let mut coupling = Coupling::new(coupling_config(Scheme::Capped, passivity));
    coupling.accept(&wall(0.0, 1, 1)).expect("a sound model");
    coupling.tick(1, &[(Pose::identity(), Twist::zero())]);
    coupling
}

#[test]
fn a_body_is_credited_with_the_dissipation_of_those_devices_that_hold_it() {
    // Two devices, each on a body of its own. Both hands move.
    let friction = [0.3, 0.5];
    let mut config = ControllerConfig::default();
    let mut passivity = PassivityConfig::new(PERIOD);
    for (port, friction) in passivity.ports.iter_mut().zip(friction) {
        port.friction = friction;
    }
    for _ in 0..2 {
        let _ = config.devices.push(DeviceConfig {
            frame: DeviceFrame::at(Vec3::zeros()),
            safety: SafetyConfig::unlimited(PERIOD),
        });
        let body = coupling_config(Scheme::Capped, &passivity);
        let _ = config.bodies.push(body);
    }
    let mut controller = Controller::new(&config);
    for body in 0..2 {
        let mut model = wall(0.0, 1, 1);
        model.handles[0].device = body as u8;
        controller.accept(body, &model).expect("a sound model");
    }
    let by = 1e-4;
    for k in 0..=10 {
        let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
        for reading in &mut readings[..2] {
            *reading = Ok(DeviceState {
                pose: Pose::at(Vec3::x() * (by * f64::from(k))),
                ..DeviceState::resting()
            });
        }
        controller.tick(1_000_000 + k as u64 * 1_000_000, &readings);
    }
    // The first tick has the first place, and the first step tells no direction.
    for (energy, friction) in controller.energy().zip(friction) {
        let expected = passivity.credit * friction * 9.0 * by;
        assert!((energy.credited - expected).abs() < 1e-12, "{energy:?}");
    }
}

#[test]
fn the_classic_controller_damps_a_hand_that_only_turns() {
    let mut passivity = PassivityConfig::new(PERIOD);
    let damping = 0.01;
    passivity.ports[0].most_turning_damping = damping;
    let mut coupling = Coupling::new(coupling_config(Scheme::Classic, &passivity));
    // A moment turns the hand, and no hand supplies its energy.
    let (pushed, rate) = (0.1, 2.0);
    let mut model = wall(0.0, 1, 1);
    model.handles[0].contact = Vec3::zeros();
    model.handles[0].wrench.moment.z = pushed;
    coupling.accept(&model).expect("a sound model");
    let mut moment = 0.0;
    for k in 0..1000 {
        let turn = Vec3::z() * (rate * PERIOD * f64::from(k));
        let pose = Pose {
            rotation: UnitQuaternion::from_scaled_axis(turn),
            ..Pose::identity()
        };
        let twist = Twist {
            angular: Vec3::z() * rate,
            ..Twist::zero()
        };
        let [wrench, ..] = coupling.tick(1, &[(pose, twist)]);
        moment = wrench.moment.z;
        let mut held = [Wrench::zero(); MAX_DEVICES];
        held[0] = wrench;
        coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
    }
    // The missing energy soon exceeds the energy that the device can take out in a tick.
    assert!(
        (moment - (pushed - damping * rate)).abs() < 1e-12,
        "{moment}"
    );
}

#[test]
fn a_device_that_was_silent_is_credited_with_its_slowest_possible_motion() {
    let mut passivity = PassivityConfig::new(PERIOD);
    let (damping, friction) = (0.5, 0.3);
    passivity.ports[0].damping = damping;
    passivity.ports[0].friction = friction;
    let mut coupling = in_the_air(&passivity);
    let mut at = |x: f64| {
        coupling.tick(1, &[(Pose::at(Vec3::x() * x), Twist::zero())]);
        coupling.energy().credited
    };
    let count = 38e-6;
    at(0.0);
    at(count);
    let before = at(2.0 * count);
    for _ in 0..99 {
        at(2.0 * count);
    }
    let (far, silent) = (5e-3, 100.0 * PERIOD);
    let found = at(2.0 * count + far) - before;
    // Friction over the path, and `b D^2 / t` of the damper: a fraction of both. If the path were taken to be that of
    // one tick, it would be 5 mJ.
    let expected = passivity.credit * far * (friction + damping * far / silent);
    assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
}

#[test]
fn the_dissipation_of_a_rotation_is_credited_as_well() {
    let mut passivity = PassivityConfig::new(PERIOD);
    let (damping, friction) = (5e-3, 0.02);
    passivity.ports[0].turning_damping = damping;
    passivity.ports[0].turning_friction = friction;
    let mut coupling = in_the_air(&passivity);
    let mut at = |angle: f64| {
        let pose = Pose {
            rotation: UnitQuaternion::from_scaled_axis(Vec3::z() * angle),
            ..Pose::identity()
        };
        coupling.tick(1, &[(pose, Twist::zero())]);
        coupling.energy().credited
    };
    let count = 1e-3;
    at(0.0);
    at(count);
    let before = at(2.0 * count);
    let found = at(3.0 * count) - before;
    let expected = passivity.credit * count * (friction + damping * count / PERIOD);
    // Rounding of a small angle's logarithm.
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    // A flicker about the edge of a count is credited nothing.
    let before = at(2.0 * count);
    for _ in 0..10 {
        at(3.0 * count);
        assert_eq!(at(2.0 * count), before);
    }
}

#[test]
fn the_energy_stored_in_the_first_model_belongs_to_the_body() {
    let mut coupling = Coupling::new(coupling_config(
        Scheme::Capped,
        &PassivityConfig::new(PERIOD),
    ));
    let (k, pull) = (200.0, 3.0);
    let mut model = wall(k, 1, 1);
    model.head.period = 16.0 * PERIOD;
    model.handles[0].contact = Vec3::zeros();
    model.handles[0].wrench.force = Vec3::x() * pull;
    model.head.energy = pull * pull / (2.0 * k);
    model.head.released = model.head.energy;
    coupling.accept(&model).expect("a sound model");
    let still = [(Pose::identity(), Twist::zero())];
    let last = (0..100).map(|_| coupling.tick(1, &still)[0].force.x).last();
    // No hand has supplied this energy, and yet it is available: 22 times the allowance.
    assert_eq!(last, Some(pull));
    assert_eq!(coupling.energy().capped, 0);
    let more = coupling.energy().available - model.head.energy;
    let allowance = PassivityConfig::new(PERIOD).allowance;
    assert!((more - allowance).abs() < 1e-15, "{more}");
}

#[test]
fn hands_that_move_before_the_first_model_must_pay_for_the_energy_in_it() {
    // The body stores 5 mJ, of which it had this much before the hands moved.
    for own in [0.0, 1e-3, 5e-3, 8e-3] {
        let passivity = PassivityConfig::new(PERIOD);
        let mut coupling = Coupling::new(coupling_config(Scheme::Capped, &passivity));
        let (k, stretch) = (200.0, [-3e-3, 4e-3]);
        let mut model = wall(k, 1, 1);
        model.head.period = PERIOD;
        model.head.handle_count = 2;
        model.handles[1].device = 1;
        model.stiffness[1][1] = model.stiffness[0][0];
        for (handle, x) in model.handles.iter_mut().zip(stretch) {
            handle.contact = Vec3::zeros();
            handle.pose = Pose::at(Vec3::x() * x);
            handle.wrench.force = Vec3::x() * -k * x;
        }
        let stored = stretch.map(|x| 0.5 * k * x * x).iter().sum::<f64>();
        (model.head.energy, model.head.released) = (stored, own);
        // The hands go out before the model comes, and back after it.
        let at =
            |fraction: f64| stretch.map(|x| (Pose::at(Vec3::x() * x * fraction), Twist::zero()));
        let mut tick = |fraction: f64, coming: Option<&LocalModel>| {
            if let Some(model) = coming {
                coupling.accept(model).expect("a sound model");
            }
            let wrenches = coupling.tick(1, &at(fraction));
            let mut held = [Wrench::zero(); MAX_DEVICES];
            for (held, wrench) in held.iter_mut().zip(&wrenches[..2]) {
                *held = *wrench;
            }
            coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
        };
        (0..100).for_each(|tick_number| tick(f64::from(tick_number) / 100.0, None));
        // The hands rest until the force has come in.
        (0..100).for_each(|tick_number| tick(1.0, (tick_number == 0).then_some(&model)));
        (0..=500).for_each(|tick_number| tick(1.0 - f64::from(tick_number) / 500.0, None));
        let account = coupling.energy();
        let most = own.min(stored);
        assert_eq!(account.initial, most);
        let got = -account.supplied;
        assert!(got <= most + 2.0 * passivity.allowance, "{own}: {got}");
        // The body gives back the energy that is its own, less the energy that the blend of its force withholds.
        assert!(got >= 0.8 * most, "{own}: {got}");
    }
}

/// The force that the body of [`pulling`] asks for on each hand (N).
const PULLS: [f64; 2] = [2.0, 3.0];

/// A body that pulls two hands along x.
fn pulling() -> LocalModel {
    let mut model = wall(0.0, 1, 1);
    model.head.period = PERIOD;
    model.head.handle_count = 2;
    model.handles[1].device = 1;
    for (handle, pull) in model.handles.iter_mut().zip(PULLS) {
        handle.contact = Vec3::zeros();
        // The weight is no force of the springs, and the cap leaves it whole.
        handle.weight = Vec3::z() * -9.0;
        handle.wrench.force = Vec3::new(pull, 0.0, -9.0);
    }
    model
}

/// Forces along x of a body that pulls two hands. Its own energy is 10 mJ at first. Then the models claim 20 mJ, which no
/// hand has supplied. Also returns the fraction of that claim that the account covers, and the force that the cap
/// withholds.
fn claimed(passivity: &PassivityConfig) -> ([f64; 2], f64, Withheld) {
    let mut coupling = Coupling::new(coupling_config(Scheme::Capped, passivity));
    let mut model = pulling();
    model.head.released = 10e-3;
    let still = [(Pose::identity(), Twist::zero()); 2];
    let mut forces = [0.0; 2];
    for (time, energy) in [(1, 10e-3), (2, 20e-3)] {
        (model.head.sequence, model.head.time_ns, model.head.energy) = (time, time, energy);
        coupling.accept(&model).expect("a sound model");
        for _ in 0..10 {
            let wrenches = coupling.tick(2, &still);
            forces = [0, 1].map(|i| wrenches[i].force.x);
            if energy > 15e-3 {
                assert!(wrenches[..2].iter().all(|wrench| wrench.force.z == -9.0));
            }
        }
    }
    let covered = coupling.energy().available / model.head.energy;
    (forces, covered, coupling.withheld())
}

#[test]
fn the_whole_energy_is_backed_where_any_device_is_slow_or_late() {
    // Which device has a slew limit, and the ticks by which the devices are late.
    for (slow, delay, whole) in [
        ([false, false], 0, true),
        // Six tenths of the energy must be backed, and half of it is.
        ([false, false], 1, false),
        ([true, false], 0, false),
        ([false, true], 0, false),
        ([true, true], 3, false),
    ] {
        let mut passivity = PassivityConfig::new(PERIOD);
        passivity.delay = delay;
        for (port, slow) in passivity.ports.iter_mut().zip(slow) {
            port.max_slew = if slow { 100.0 } else { f64::INFINITY };
        }
        let (forces, covered, withheld) = claimed(&passivity);
        assert!((covered - 10.4 / 20.0).abs() < 1e-12, "{covered}");
        let backed = if slow == [false, false] { 0.6 } else { 1.0 };
        let left = if whole { 1.0 } else { covered / backed };
        for (force, pull) in forces.into_iter().zip(PULLS) {
            assert!((force - pull * left).abs() < 1e-12, "{slow:?} {force}");
        }
        // The withheld force is that of the hand with the largest force.
        let expected = if whole { 0.0 } else { PULLS[1] };
        assert_eq!(withheld.of, expected);
        assert!((withheld.force - expected * (1.0 - left)).abs() < 1e-12);
        assert_eq!(withheld.is_noticeable(), !whole);
    }
}

#[test]
fn what_the_cap_holds_back_is_recorded_as_far_as_the_force_is_trusted() {
    let ms = 1_000_000;
    let mut coupling = Coupling::new(CouplingConfig {
        age_limit: 0.01,
        decay: 0.05,
        ..coupling_config(Scheme::Capped, &PassivityConfig::new(PERIOD))
    });
    let still = [(Pose::identity(), Twist::zero()); 2];
    let mut model = pulling();
    let mut expected = HeldBack::default();
    for tick in 1..180_u64 {
        // The models claim ten times the energy that was supplied, from 50 ms on. The last model comes at 90 ms.
        if tick <= 90 {
            (model.head.sequence, model.head.time_ns) = (tick, tick * ms);
            model.head.energy = if tick < 50 { 10e-3 } else { 100e-3 };
            model.head.released = 10e-3;
            coupling.accept(&model).expect("a sound model");
        }
        let wrenches = coupling.tick(tick * ms, &still);
        let s = coupling.trust();
        // The larger of the two forces. Before the claim, it comes in without the cap.
        if tick > 50 {
            let whole = PULLS[1] * s * s * (3.0 - 2.0 * s);
            expected.note(tick * ms, whole, wrenches[1].force.x);
        }
    }
    let found = coupling.held_back().capped;
    assert!((found.sum - expected.sum).abs() < 1e-9, "{found:?}");
    assert!((found.most - expected.most).abs() < 1e-12, "{found:?}");
    assert!((found.of - expected.of).abs() < 1e-12, "{found:?}");
    (expected.sum, expected.most, expected.of) = (found.sum, found.most, found.of);
    assert_eq!(found, expected);
    assert!(found.ticks > 60 && found.most > 1.0, "{found:?}");
}

#[test]
fn a_slow_force_keeps_back_the_work_that_it_will_do_before_it_vanishes() {
    // Slew limits (N/s) and velocities (m/s) that the hands report. No hand has moved, so no damper acts.
    for (slews, velocities) in [
        ([50.0, f64::INFINITY], [0.05, 0.05]),
        ([f64::INFINITY, 20.0], [0.05, 0.05]),
        ([100.0, 80.0], [0.1, 0.08]),
        // A hand that moves against its force gets no work from it.
        ([50.0, 20.0], [-0.05, 0.05]),
    ] {
        let mut passivity = PassivityConfig::new(PERIOD);
        for (port, slew) in passivity.ports.iter_mut().zip(slews) {
            port.max_slew = slew;
        }
        let mut coupling = Coupling::new(coupling_config(Scheme::Capped, &passivity));
        let mut model = pulling();
        let at = velocities.map(|v| {
            let twist = Twist {
                linear: Vec3::x() * v,
                ..Twist::zero()
            };
            (Pose::identity(), twist)
        });
        let mut forces = [0.0; 2];
        for tick in 1..60_u64 {
            if tick == 1 || tick == 20 {
                model.head.energy = if tick == 1 { 10e-3 } else { 20e-3 };
                model.head.released = 10e-3;
                (model.head.sequence, model.head.time_ns) = (tick, tick);
                coupling.accept(&model).expect("a sound model");
            }
            let wrenches = coupling.tick(tick, &at);
            // The whole force, with the weight across the motion, falls evenly while the hand moves on.
            let each = forces.iter().zip(velocities).zip(slews);
            let lingers: f64 = each
                .map(|((force, v), slew)| {
                    f64::max(0.5 * force * v * (force.hypot(9.0) / slew), 0.0)
                })
                .sum();
            let left = coupling.energy().available - lingers;
            forces = [0, 1].map(|i| wrenches[i].force.x);
            let mut held = [Wrench::zero(); MAX_DEVICES];
            (held[0], held[1]) = (wrenches[0], wrenches[1]);
            coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
            if tick > 25 {
                for (force, pull) in forces.into_iter().zip(PULLS) {
                    let wanted = pull * left.max(0.0) / 20e-3;
                    assert!((force - wanted).abs() < 1e-12, "{slews:?} {tick} {force}");
                }
            }
        }
    }
}

/// One hand that makes a step, and rests. The body pulls and turns it by `force` (N) along and `moment` (N m) about z,
/// across the motion: no work is done. It claims no energy, and damps the hand by `damping` (N s/m). Returns the wrenches
/// from the step on, with the credit that the cap could spend, and whether the cap counted the tick.
fn after_a_step(
    [force, moment, damping]: [f64; 3],
    [far, turn]: [f64; 2],
    ticks: u32,
) -> Vec<(Wrench, f64, bool, Withheld)> {
    let mut coupling = Coupling::new(coupling_config(
        Scheme::Capped,
        &PassivityConfig::new(PERIOD),
    ));
    let mut model = wall(0.0, 1, 1);
    let handle = &mut model.handles[0];
    handle.contact = Vec3::zeros();
    handle.wrench.force.z = force;
    handle.wrench.moment.z = moment;
    model.damping[0][0][(0, 0)] = damping;
    coupling.accept(&model).expect("a sound model");
    let mut tick = |stepped: bool, moves: bool| {
        let before = coupling.energy().capped;
        let by = if stepped { 1.0 } else { 0.0 };
        let pose = Pose {
            position: Vec3::x() * (far * by),
            rotation: UnitQuaternion::from_scaled_axis(Vec3::x() * (turn * by)),
        };
        let twist = Twist {
            linear: Vec3::x() * if moves { far / PERIOD } else { 0.0 },
            ..Twist::zero()
        };
        let [wrench, ..] = coupling.tick(1, &[(pose, twist)]);
        let mut held = [Wrench::zero(); MAX_DEVICES];
        // The device holds only the parts that do no work here.
        held[0].force.z = wrench.force.z;
        coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
        let energy = coupling.energy();
        let capped = energy.capped > before;
        (wrench, energy.available, capped, coupling.withheld())
    };
    for _ in 0..1100 {
        tick(false, false);
    }
    (0..ticks).map(|k| tick(true, k == 0)).collect()
}

#[test]
fn springs_spend_no_more_in_a_tick_than_the_credit_however_the_hand_moves_on() {
    // Force and moment of the springs, and the step of the hand (m, rad).
    for ([force, moment], [far, turn]) in [
        ([3.0, 0.0], [2e-3, 0.0]),
        ([0.0, 0.1], [0.0, 0.05]),
        ([2.0, 0.05], [1e-3, 0.03]),
        ([2.0, 0.0], [0.0, 0.03]),
        // A slow hand: the credit covers more than a tick.
        ([2.0, 0.01], [1e-4, 1e-3]),
    ] {
        let ticks = after_a_step([force, moment, 0.0], [far, turn], 60);
        for (tick, (wrench, credit, capped, withheld)) in ticks.into_iter().enumerate() {
            // A hand may repeat any recent motion, in any direction. The memory decays in 20 ms.
            let fade = (-PERIOD * tick as f64 / 0.02).exp();
            let most = (force * far + moment * turn) * fade;
            let left = (credit / most).min(1.0);
            // Rounding of a rotation's logarithm.
            let near = |found: f64, wanted: f64| (found - wanted).abs() < 1e-9;
            assert!(
                near(wrench.force.z, force * left),
                "{tick} {wrench:?} {left}"
            );
            assert!(near(wrench.moment.z, moment * left), "{tick} {wrench:?}");
            assert_eq!(capped, left < 1.0, "{tick}");
            assert!(near(withheld.force, force * (1.0 - left)), "{tick}");
        }
    }
}

#[test]
fn dampers_may_go_into_debt_by_the_allowance_and_withhold_no_force_of_springs() {
    let allowance = PassivityConfig::new(PERIOD).allowance;
    let (force, far) = (0.1, 1e-3);
    for (damping, whole) in [(0.5, true), (5.0, false)] {
        let ticks = after_a_step([force, 0.0, damping], [far, 0.0], 2);
        let (wrench, credit, capped, withheld) = ticks[0];
        let asked = damping * far / PERIOD;
        let most = (credit + allowance - force * far) / far;
        let wanted = asked.min(most);
        assert!(
            (wrench.force.x + wanted).abs() < 1e-9,
            "{wrench:?} {wanted}"
        );
        assert_eq!((wanted == asked, capped), (whole, !whole));
        assert_eq!(wrench.force.z, force);
        assert_eq!(withheld, Withheld::default());
        assert!(!ticks[1].2);
    }
}

#[test]
fn only_a_step_onwards_is_credited_with_dissipation() {
    let mut passivity = PassivityConfig::new(PERIOD);
    passivity.ports[0].friction = 1.0;
    let mut coupling = in_the_air(&passivity);
    let mut place = Vec3::zeros();
    let mut step = |by: Vec3| {
        place += by;
        let before = coupling.energy().credited;
        coupling.tick(1, &[(Pose::at(place), Twist::zero())]);
        coupling.energy().credited - before
    };
    step(Vec3::zeros());
    // The first step, a step back, and steps across tell nothing of the path of the hand.
    let by = 1e-4;
    let whole = passivity.credit * by;
    for (way, part) in [
        (Vec3::x(), 0.0),
        (Vec3::x(), 1.0),
        (-Vec3::x(), 0.0),
        (-Vec3::x(), 1.0),
        (Vec3::zeros(), 0.0),
        (-Vec3::x(), 1.0),
        (Vec3::y(), 0.0),
        (Vec3::z(), 0.0),
        (Vec3::new(0.0, 0.6, 0.8), 1.0),
    ] {
        let found = step(way * by);
        // Rounding of places of tenths of a millimetre.
        assert!((found - part * whole).abs() < 1e-15, "{way} {found}");
    }
}

#[test]
fn the_classic_controller_restores_passivity_up_to_three_times_the_bound() {
    for delay in [0, 1] {
        let wall = 3.0 * bound(delay);
        assert!(pressed(Scheme::Linear, wall, delay).least_hand_work < -0.05);
        let rig = pressed(Scheme::Classic, wall, delay);
        // No energy comes out at the hand: the dissipation of the device covers the energy that is taken back late.
        assert_eq!(rig.least_hand_work, 0.0, "{delay}");
        assert!(rig.energy().capped > 0);
        // At five times the bound, less than a millijoule comes out before it is taken back.
        let rig = pressed(Scheme::Classic, 5.0 * bound(delay), delay);
        assert!(rig.least_hand_work > -1e-3, "{delay}");
    }
}

#[test]
fn the_classic_controller_leaves_a_passive_wall_untouched() {
    let forces = |scheme| {
        let mut rig = rig(scheme, 0, 1e-3);
        let mut wall = wall(BOUND, 1, 1);
        // Four times the damping that makes a sampled spring passive by itself: the velocity filter lags.
        wall.damping[0][0][(0, 0)] = 4.0 * BOUND * PERIOD / 2.0;
        rig.accept(&wall);
        for _ in 0..10_000 {
            rig.tick(sweep);
        }
        let pairs = rig.forces.array_windows();
        let hits = pairs.filter(|[before, now]| *before == 0.0 && *now > 0.0);
        assert!(hits.count() > 10, "the hand came and went");
        assert_eq!(rig.energy().capped, 0);
        rig.forces.iter().map(|f| f.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(forces(Scheme::Classic), forces(Scheme::Linear));
}

#[test]
fn the_classic_controller_damps_each_hand_as_far_as_its_device_can() {
    let mut passivity = PassivityConfig::new(PERIOD);
    for (port, most) in passivity.ports.iter_mut().zip([1.0, 3.0]) {
        port.most_damping = most;
    }
    let mut coupling = Coupling::new(coupling_config(Scheme::Classic, &passivity));
    // A body that pushes both hands, whatever they do.
    let mut model = wall(0.0, 1, 1);
    model.head.period = PERIOD;
    model.head.handle_count = 2;
    model.handles[1].device = 1;
    for handle in &mut model.handles {
        handle.contact = Vec3::zeros();
        handle.wrench.force = Vec3::x();
    }
    coupling.accept(&model).expect("a sound model");
    let speed = 0.1;
    for k in 0..10 {
        // The force of the first model grows over two ticks.
        let pushed = (f64::from(k) / 2.0).min(1.0);
        let pose = Pose::at(Vec3::x() * (speed * PERIOD * f64::from(k)));
        let twist = Twist {
            linear: Vec3::x() * speed,
            ..Twist::zero()
        };
        let wrenches = coupling.tick(1, &[(pose, twist); 2]);
        let supplied = coupling.energy().supplied;
        // The missing energy soon exceeds the energy that both devices can take out in a tick.
        let most = if supplied < -4.0 * speed * speed * PERIOD {
            [1.0, 3.0]
        } else {
            let each = -supplied / (4.0 * speed * speed * PERIOD);
            [each, 3.0 * each]
        };
        for (wrench, most) in wrenches.iter().zip(most) {
            assert!(
                (wrench.force.x - (pushed - most * speed)).abs() < 1e-12,
                "{k}"
            );
        }
        let mut held = [Wrench::zero(); MAX_DEVICES];
        for (held, wrench) in held.iter_mut().zip(&wrenches) {
            *held = *wrench;
        }
        coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
    }
    assert!(coupling.energy().supplied < -4.0 * speed * speed * PERIOD);
}

/// Fraction of a wall's stiffness that a trembling hand feels in the last of the given seconds. `known` tells whether
/// the account knows the encoder count.
fn held_by_a_trembling_hand(known: bool, seconds: u32) -> f64 {
    let (k, count) = (10.0 * BOUND, 4e-5);
    let mut passivity = PassivityConfig::new(PERIOD);
    passivity.ports[0] = Port {
        damping: DAMPING,
        friction: 0.4,
        most_damping: 0.1 * MASS / PERIOD,
        count: if known { count } else { 0.0 },
        ..Port::UNKNOWN
    };
    let mut coupling = Coupling::new(coupling_config(Scheme::Capped, &passivity));
    coupling.accept(&wall(k, 1, 1)).expect("a sound model");
    let mut estimator = VelocityEstimator::new(PERIOD, VelocityEstimator::DEFAULT_CUTOFF);
    let (mut rendered, mut asked) = (0.0, 0.0);
    for tick in 0..1000 * seconds {
        let t = f64::from(tick) * PERIOD;
        let grown = t.min(1.0);
        // Half a millimetre deep, with a tremor of 0.1 mm at 10 Hz.
        let deep = grown * (0.5e-3 + 0.1e-3 * (20.0 * core::f64::consts::PI * t).sin());
        let shown = Vec3::new(-(deep / count).round() * count, 0.0, 0.0);
        let twist = Twist {
            linear: estimator.update(&shown),
            ..Twist::zero()
        };
        let wrenches = coupling.tick(1, &[(Pose::at(shown), twist)]);
        let mut held = [Wrench::zero(); MAX_DEVICES];
        held[0] = wrenches[0];
        coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
        if t > f64::from(seconds - 1) {
            rendered += wrenches[0].force.x;
            asked += k * deep;
        }
    }
    rendered / asked
}

#[test]
fn a_wall_of_counts_stays_stiff_in_a_trembling_hand() {
    // Ten times the bound, but less than 2 (1 - 0.4) f_c / D = 12,000 N/m.
    let rendered = held_by_a_trembling_hand(true, 30);
    // Over whole periods, dampers and counts average out to a few per mille.
    assert!((rendered - 1.0).abs() < 0.01, "{rendered}");
    // Without the correction for counts, the wall becomes soft.
    let soft = held_by_a_trembling_hand(false, 30);
    assert!(soft < 0.9, "{soft}");
}

#[test]
fn a_single_count_back_is_no_velocity() {
    let (k, b, count) = (5000.0, 5.0, 4e-5);
    let mut passivity = PassivityConfig::new(PERIOD);
    passivity.ports[0] = Port {
        friction: 0.4,
        count,
        ..Port::UNKNOWN
    };
    let mut coupling = Coupling::new(coupling_config(Scheme::Capped, &passivity));
    let mut model = wall(k, 1, 1);
    model.damping[0][0][(0, 0)] = b;
    coupling.accept(&model).expect("a sound model");
    // The estimated velocity of counts is late: it may have any sign.
    let speed = 0.01;
    // The force beside that of the spring, at a depth of this number of counts.
    let mut beside = |deep: f64| {
        let twist = Twist {
            linear: Vec3::x() * speed,
            ..Twist::zero()
        };
        let shown = Pose::at(Vec3::new(-deep * count, 0.0, 0.0));
        let wrenches = coupling.tick(1, &[(shown, twist)]);
        let mut held = [Wrench::zero(); MAX_DEVICES];
        held[0] = wrenches[0];
        coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
        wrenches[0].force.x - k * deep * count
    };
    // The force of the first model grows gradually. Then the hand goes in, count by count: no step reverses.
    for _ in 0..2000 {
        beside(0.0);
    }
    for deep in [1.0, 2.0, 3.0, 4.0, 5.0, 6.0] {
        beside(deep);
    }
    let damper = -b * speed;
    // The stiffness leads by half a step: by half of each count that follows another.
    let lead = 0.5 * k * count;
    // Differences of forces of some newtons.
    let is = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found}");
    is(beside(7.0), damper + lead);
    is(beside(7.0), damper);
    // During a tremor on the edge of a count, neither damper nor lead acts, nor between the counts.
    for deep in [6.0, 6.0, 7.0, 6.0, 6.0, 7.0] {
        is(beside(deep), 0.0);
    }
    // One more count onward, and two counts back at once: such steps are motions of the hand.
    is(beside(8.0), damper + lead);
    is(beside(6.0), damper - 2.0 * lead);
    is(beside(6.0), damper);
}
