//! Clocks that step, and devices that report impossible states.

use super::Chance;
use nalgebra::{Quaternion, UnitQuaternion};
use rt_core::Reading;
use rt_core::{DeviceError, DeviceState, MAX_DEVICES, Pose, Twist, Vec3};

/// The rate for which the motions of hands are stated (Hz).
const RATE: f64 = 1000.0;

/// Numbers at the limits of the floating-point format.
const EXTREMES: [f64; 12] = [
    0.0,
    -0.0,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    f64::EPSILON,
    1e154,
    -1e-154,
];

/// An entry of [`EXTREMES`], or an ordinary number.
pub(super) fn extreme(draw: Chance, n: u64) -> f64 {
    let pick = draw.unit(2 * n) * 2.0 * EXTREMES.len() as f64;
    let ordinary = draw.between(2 * n + 1, -10.0, 10.0);
    EXTREMES.get(pick as usize).copied().unwrap_or(ordinary)
}

/// The clock that the tick reads.
pub(super) struct Clock {
    chance: Chance,
    now_ns: u64,
    period_ns: u64,
}

impl Clock {
    /// The clock of a tick of the period `period_ns` (ns).
    pub(super) fn new(chance: Chance, period_ns: u64) -> Self {
        Self {
            chance: chance.of("clock"),
            now_ns: 1_000_000_000,
            period_ns,
        }
    }

    /// The time of a tick (ns). In one bad stretch in four, the clock steps at some ticks, forwards or back, and
    /// continues from there.
    pub(super) fn next(&mut self, tick: u64, bad: Option<u64>) -> u64 {
        self.now_ns = self.now_ns.saturating_add(self.period_ns);
        let steps = bad.is_some_and(|stretch| self.chance.of("steps").unit(stretch) < 0.25);
        if steps && self.chance.unit(2 * tick) < 0.02 {
            // From a microsecond to three centuries.
            let step = 10_f64.powf(self.chance.between(2 * tick + 1, 3.0, 19.0)) as u64;
            self.now_ns = if self.chance.of("back").unit(tick) < 0.5 {
                self.now_ns.saturating_sub(step)
            } else {
                self.now_ns.saturating_add(step)
            };
        }
        if bad.is_none() && self.now_ns > u64::MAX / 2 {
            // A clock at the end of its range restarts.
            self.now_ns = 1_000_000_000;
        }
        self.now_ns
    }
}

/// How the devices behave during a stretch.
#[derive(Clone, Copy, Debug)]
enum Behaviour {
    /// A hand that moves gently.
    Gentle,
    /// An arbitrary pose within a metre, a new one in every tick.
    Jump,
    /// Numbers at the limits of the floating-point format.
    Extreme,
    /// An encoder that stands at a limit of its range.
    AtLimit,
    /// No state, for each of the possible reasons.
    Silent,
    /// An invalid rotation.
    Twisted,
    /// Another of these behaviours in every tick.
    Any,
}

const BEHAVIOURS: [Behaviour; 7] = [
    Behaviour::Gentle,
    Behaviour::Jump,
    Behaviour::Extreme,
    Behaviour::AtLimit,
    Behaviour::Silent,
    Behaviour::Twisted,
    Behaviour::Any,
];

fn behaviour(draw: Chance, n: u64) -> Behaviour {
    let pick = draw.unit(n) * BEHAVIOURS.len() as f64;
    BEHAVIOURS
        .get(pick as usize)
        .copied()
        .unwrap_or(Behaviour::Gentle)
}

/// Makes the readings of the devices.
pub(super) struct Readings {
    chance: Chance,
    devices: usize,
    kind: Encoder,
}

/// The rate of the devices, and what their encoders can count.
#[derive(Clone, Copy, Debug)]
pub(super) struct Encoder {
    /// Readings a second (Hz).
    pub(super) rate: f64,
    /// Displacement of one count (m).
    pub(super) count: f64,
}

impl Readings {
    pub(super) fn new(chance: Chance, devices: usize, kind: Encoder) -> Self {
        Self {
            chance: chance.of("hands"),
            devices,
            kind,
        }
    }

    /// The readings of tick `tick`: of the bad stretch number `bad`, or of a sound stretch.
    pub(super) fn next(&self, tick: u64, bad: Option<u64>) -> [Reading; MAX_DEVICES] {
        let mut readings = [const { Err(DeviceError::NoReport) }; MAX_DEVICES];
        for (device, reading) in readings.iter_mut().enumerate().take(self.devices) {
            // Without names, number 7 of device 3 would be number 3 of device 4.
            let draw = self.chance.of(["a", "b", "c", "d"][device % 4]);
            let behaviour = bad.map_or(Behaviour::Gentle, |stretch| {
                behaviour(draw.of("mood"), stretch)
            });
            *reading = read(behaviour, draw, tick, device, self.kind);
        }
        readings
    }
}

fn read(behaviour: Behaviour, draw: Chance, tick: u64, device: usize, kind: Encoder) -> Reading {
    let n = 16 * tick;
    let mut state = gentle(tick, device, kind.rate);
    match behaviour {
        Behaviour::Gentle => {}
        Behaviour::Jump => {
            state.pose.position = Vec3::from_fn(|i, _| draw.between(n + i as u64, -1.0, 1.0));
            state.twist.linear = Vec3::from_fn(|i, _| draw.between(n + 3 + i as u64, -5.0, 5.0));
        }
        Behaviour::Extreme => {
            let number = |i: usize| extreme(draw, n + i as u64);
            state.pose.position = Vec3::from_fn(|i, _| number(i));
            state.twist = Twist {
                linear: Vec3::from_fn(|i, _| number(3 + i)),
                angular: Vec3::from_fn(|i, _| number(6 + i)),
            };
        }
        Behaviour::AtLimit => {
            // Sixteen bits.
            let end = f64::from(i16::MAX) * kind.count;
            state.pose.position = Vec3::new(end, -end, end);
        }
        Behaviour::Silent => {
            let errors = [
                DeviceError::NoReport,
                DeviceError::Disconnected(19),
                DeviceError::Busy,
            ];
            let pick = draw.unit(n) * errors.len() as f64;
            return Err(errors[(pick as usize).min(errors.len() - 1)]);
        }
        Behaviour::Twisted => {
            let number = |i: u64| extreme(draw, n + i);
            state.pose.rotation = UnitQuaternion::new_unchecked(Quaternion::new(
                number(0),
                number(1),
                number(2),
                number(3),
            ));
        }
        Behaviour::Any => {
            return read(
                behaviour_but_any(draw, n),
                draw.of("any"),
                tick,
                device,
                kind,
            );
        }
    }
    Ok(state)
}

fn behaviour_but_any(draw: Chance, n: u64) -> Behaviour {
    match behaviour(draw, n) {
        Behaviour::Any => Behaviour::Extreme,
        behaviour => behaviour,
    }
}

/// The state of a device that is read at `rate` (Hz), and whose hand moves gently about one place.
fn gentle(tick: u64, device: usize, rate: f64) -> DeviceState {
    let phase = 0.01 * (RATE / rate) * tick as f64 + device as f64;
    let (sin, cos) = (libm::sin(phase), libm::cos(phase));
    let axis = Vec3::new(sin, cos, 0.5);
    let tangent = Vec3::new(cos, -sin, 0.0);
    DeviceState {
        pose: Pose {
            position: axis * 5e-3,
            rotation: UnitQuaternion::from_scaled_axis(axis * 0.1),
        },
        twist: Twist {
            linear: tangent * (5e-3 * 10.0),
            angular: tangent * (0.1 * 10.0),
        },
        ..DeviceState::resting()
    }
}
