//! One run with a fault on the way between a driver and its device, in virtual time.
//!
//! A run has an emulated device in a simulated hand, the true driver of `devices`, and the true controller, which renders
//! a wall. The hand pushes into the wall, holds, and leaves it. A fault of one [`Kind`] begins at a random time of the
//! push. The run then shows how long the force lasts at the device and in the commands of the host, how it comes back,
//! and how much energy the hand was given.
//!
//! The threads of the system cannot run in virtual time ([`sim::emulated::driver`]). Virtual time drives the state machine of
//! a device in place of its thread. Everything else is the code of the program. The same seed gives the same run.
//!
//! The demands ([`super::expected`]): no force at the device after its own watchdog, and none commanded after five of its
//! periods; a force that comes back without a restart of the host and without a jump; and less than a millijoule of net
//! energy at the hand ([`sim::NetEnergy`]).

use super::expected::{Case, judge};
use super::host::Host;
use rand_core::Rng;
use rand_pcg::Pcg64;
use rt_core::{Scheme, Vec3};
use sim::emulated::fault::{Injected, Kind};
use sim::emulated::link::{Link, World};
use sim::protocol::Protocol;
use sim::{Arm, DeviceModel, Hand, SimDevice, Trajectory, Tremor};

/// The stream of the random generator: no other part of the program draws from it.
const STREAM: u128 = 0x6661_756c_7473;
/// Period of the ticks and of the devices (ns).
pub(super) const PERIOD_NS: u64 = 1_000_000;
/// Periods without a state after which the force ends, as in the program.
pub(super) const PATIENCE: u32 = 5;
/// Stiffness (N/m) and damping (N s/m) of the wall.
pub(super) const WALL: [f64; 2] = [300.0, 1.0];
/// Distance of the wall from the origin of the device, towards negative z (m).
pub(super) const DISTANCE: f64 = 0.003;
/// Aim of the hand at the push, towards negative z (m).
const DEPTH: f64 = 0.012;
/// Time in which a force returns after a fault (s).
pub(super) const RECOVERY: f64 = 0.2;
/// Root mean square of the tremor (m).
const TREMOR: f64 = 1e-4;

/// The result of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Time from the fault until the device made no force (s); `None` if commands still reached it, or if the fault
    /// ended first.
    pub device: Option<f64>,
    /// Time from the fault until the host commanded no force (s); `None` if states still reached it.
    pub host: Option<f64>,
    /// Largest growth of the commanded force from one tick to the next, after the fault began, beyond the growth that the
    /// motion of the hand and the ramps explain (N).
    pub host_jump: f64,
    /// Largest growth of the force at the device from one millisecond to the next, after the fault began, beyond the growth
    /// that the motion of the hand and the ramps explain (N).
    pub device_jump: f64,
    /// Net energy at the hand (J).
    pub energy: f64,
    /// Ticks without a state, after the first state.
    pub missed: u64,
    /// Force before the fault, and at the end (N).
    pub forces: [f64; 2],
    /// The demands that the run did not meet.
    pub failures: Vec<String>,
}

/// The times of a run (s).
pub(super) struct Plan {
    /// The hand moves the handle out and in, to home a Falcon. None for the other devices.
    homing: Option<f64>,
    /// The operator presses the button for calibration, when there has been no state for a while.
    presses: [f64; 2],
    /// The path of the hand along z (m).
    path: Vec<(f64, f64)>,
    pub(super) fault: [f64; 2],
    arm: Arm,
    end: f64,
    pub(super) model: DeviceModel,
    pub(super) scheme: Scheme,
    /// Time in which the force comes in after an engagement (s); zero if that time is [`RECOVERY`].
    pub(super) ramp: f64,
}

impl Plan {
    fn new(protocol: Protocol, kind: Kind, random: &mut Pcg64) -> Self {
        let mut draw = |low: f64, high: f64| low + (high - low) * unit(random);
        let mut path = Vec::new();
        let mut now = if protocol == Protocol::Falcon {
            3.0
        } else {
            0.1
        };
        let out_and_in = |path: &mut Vec<(f64, f64)>, now: &mut f64| {
            path.extend([(*now, 0.0), (*now + 0.5, 0.025), (*now + 1.0, 0.0)]);
            *now += 1.1;
        };
        let homing = (protocol == Protocol::Falcon).then_some(now);
        if homing.is_some() {
            out_and_in(&mut path, &mut now);
        }
        let first = now + 0.05;
        // The push, the hold, and the way back.
        let push = now + 0.2;
        let hold = draw(0.5, 1.0);
        let back = push + 0.3 + hold;
        path.extend([
            (push, 0.0),
            (push + 0.3, -DEPTH),
            (back, -DEPTH),
            (back + 0.4, 0.0),
        ]);
        let from = draw(push + 0.2, back + 0.1);
        let mut to = from + draw(0.05, 0.3);
        if kind == Kind::BrieflyDeaf {
            to = from + 0.02;
        }
        now = back + 0.5;
        let mut second = f64::INFINITY;
        if kind != Kind::Killed {
            if protocol == Protocol::Falcon && kind == Kind::Reset {
                // It counts as lost, its firmware is uploaded, and a person homes it again.
                now += 3.0;
                out_and_in(&mut path, &mut now);
            }
            second = now.max(to + 0.3);
            now = second + 0.2;
            path.extend([(now, 0.0), (now + 0.3, -DEPTH)]);
        }
        let arm = if draw(0.0, 1.0) < 0.5 {
            Arm::TYPICAL
        } else {
            Arm::FIRM
        };
        let schemes = [
            Scheme::Capped,
            Scheme::Capped,
            Scheme::Linear,
            Scheme::Classic,
        ];
        Self {
            homing,
            presses: [first, second],
            path,
            fault: [from, to],
            arm,
            end: now + 0.8,
            model: model(protocol, draw(0.0, 1.0)),
            scheme: schemes[draw(0.0, 4.0) as usize % schemes.len()],
            ramp: if draw(0.0, 1.0) < 0.5 { 0.0 } else { 0.4 },
        }
    }
}

/// Runs a device of `protocol` with a fault of `kind`, both at times that `seed` decides.
///
/// # Panics
/// If the emulated device or its driver cannot be set up, which no seed causes.
pub fn run(protocol: Protocol, kind: Kind, seed: u64) -> Outcome {
    let case = Case { protocol, kind };
    let mut random = Pcg64::new(u128::from(seed), STREAM);
    let plan = Plan::new(protocol, kind, &mut random);
    let ns = |seconds: f64| (seconds * 1e9) as u64;
    let [from_ns, to_ns] = plan.fault.map(ns);
    let injected = Injected {
        kind,
        from_ns,
        to_ns,
    };
    let device = held(plan.model, &plan, seed);
    let link = Link::new(World::new(protocol, device, injected, random));
    let mut host = Host::new(protocol, &plan, &link, injected);
    let end_ns = ns(plan.end);
    let mut presses = plan.presses.map(ns).to_vec();
    // A process that was stopped, or preempted within a tick, skips the deadlines that have passed.
    let mut woken_ns = 0;
    let mut now_ns = link.now_ns().next_multiple_of(PERIOD_NS);
    assert!(
        plan.homing.is_none_or(|homing| now_ns < ns(homing)),
        "the boot took too long"
    );
    while now_ns < end_ns {
        if kind == Kind::Killed && now_ns > from_ns {
            host.stop(from_ns);
            link.run(now_ns);
        } else if kind == Kind::Stopped && now_ns > from_ns && woken_ns == 0 {
            // The tick of this deadline wakes when the process continues.
            woken_ns = to_ns.max(now_ns);
            host.stop(from_ns);
            link.run(woken_ns);
            host.tick(now_ns, woken_ns, woken_ns);
        } else if kind == Kind::Preempted && now_ns > from_ns && woken_ns == 0 {
            woken_ns = to_ns.max(now_ns);
            host.tick(now_ns, now_ns, woken_ns);
        } else {
            host.tick(now_ns, now_ns, now_ns);
        }
        if presses.first().is_some_and(|&press_ns| now_ns >= press_ns) {
            presses.remove(0);
            if host.is_without_state() {
                link.press();
            }
        }
        now_ns += PERIOD_NS;
        while now_ns < woken_ns {
            now_ns += PERIOD_NS;
        }
    }
    link.run(end_ns);
    let seen = link.seen();
    let since = |at_ns: Option<u64>| at_ns.map(|at_ns| (at_ns - from_ns) as f64 * 1e-9);
    // After the end of the fault, the host may command zero.
    let lasts = if kind == Kind::Killed {
        f64::INFINITY
    } else {
        plan.fault[1] - plan.fault[0]
    };
    let cuts = |gone: f64| case.cuts_commands() && gone <= lasts;
    let mut outcome = Outcome {
        device: since(seen.gone_ns).filter(|gone| cuts(*gone)),
        host: since(host.gone_ns()).filter(|gone| {
            let meant = case.is_meant() && *gone <= lasts;
            case.cuts_states() || case.is_told() || meant
        }),
        host_jump: host.jump(),
        device_jump: host.device_jump(&seen.forces),
        energy: seen.energy.largest(),
        missed: host.missed(),
        forces: [seen.before, seen.force],
        failures: Vec::new(),
    };
    outcome.failures = judge(case, &plan, &outcome, host.trips(), host.is_back());
    outcome
}

/// The device in the hand that follows the plan.
fn held(model: DeviceModel, plan: &Plan, seed: u64) -> SimDevice {
    let path = plan
        .path
        .iter()
        .map(|(at, z)| (*at, Vec3::new(0.0, 0.0, *z)));
    let trajectory = Trajectory::new_waypoints(&path.collect::<Vec<_>>());
    let hand = trajectory.map(|trajectory| Hand::new(trajectory).with_arm(plan.arm));
    let hand = match (hand, Tremor::new(TREMOR, seed)) {
        (Ok(hand), Ok(tremor)) => hand.with_tremor(tremor),
        other => panic!("the hand cannot follow its path: {other:?}"),
    };
    match SimDevice::new(model, Some(hand), PERIOD_NS as f64 * 1e-9) {
        Ok(device) => device,
        Err(error) => panic!("{error}"),
    }
}

/// The model of the device, which sends 1,000 states a second. Of the built-in devices that move along all axes, `drawn`
/// (from zero to one) chooses the device of the firmware protocol.
fn model(protocol: Protocol, drawn: f64) -> DeviceModel {
    let all: Vec<_> = DeviceModel::all()
        .filter(|(_, model)| model.axes.is_none())
        .collect();
    let name = match protocol {
        Protocol::Reports | Protocol::Stream => {
            let place = (drawn * all.len() as f64) as usize;
            all[place.min(all.len() - 1)].0
        }
        Protocol::WoodenHaptics => "woodenhaptics",
        Protocol::Falcon => "falcon",
    };
    match DeviceModel::named(name) {
        Some(model) => DeviceModel {
            rate_hz: 1000,
            ..model
        },
        None => panic!("{name} is a built-in device"),
    }
}

/// Uniform in [0, 1), from the upper 53 bits.
fn unit(random: &mut Pcg64) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}
