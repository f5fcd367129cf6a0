//! Local models that no host should publish.

use super::Chance;
use super::input::extreme;
use rt_core::{LocalModel, MAX_HANDLES, Mat6, Vec3};

/// Ticks between models.
const EVERY: u64 = 16;

/// How the host behaves during a stretch.
#[derive(Clone, Copy, Debug)]
enum Behaviour {
    /// It publishes sound models.
    Sound,
    /// It publishes nothing.
    Silent,
    /// It contradicts itself: every model has another stiffness, wrench and reference, of any sign.
    Contradictory,
    /// One entry of the stiffness is at the limits of the floating-point format.
    OneExtreme,
    /// All numbers are.
    Extreme,
    /// Times, handles and devices are impossible.
    Impossible,
}

const BEHAVIOURS: [Behaviour; 6] = [
    Behaviour::Sound,
    Behaviour::Silent,
    Behaviour::Contradictory,
    Behaviour::OneExtreme,
    Behaviour::Extreme,
    Behaviour::Impossible,
];

/// The local models that the host publishes for one body held by every device.
pub(super) struct Models {
    chance: Chance,
    devices: usize,
    /// The time between two models (s).
    period: f64,
    sequence: u64,
}

impl Models {
    /// The models for `devices` devices that are read at `rate` (Hz).
    pub(super) fn new(chance: Chance, devices: usize, rate: f64) -> Self {
        Self {
            chance: chance.of("models"),
            devices,
            period: EVERY as f64 / rate,
            sequence: 0,
        }
    }

    /// The model that arrives before tick `tick`: of the bad stretch number `bad`, or of a sound stretch.
    pub(super) fn next(&mut self, tick: u64, now_ns: u64, bad: Option<u64>) -> Option<LocalModel> {
        if !tick.is_multiple_of(EVERY) {
            return None;
        }
        self.sequence += 1;
        let mut model = sound(self.devices, self.period);
        model.head.sequence = self.sequence;
        model.head.time_ns = now_ns;
        let chances = self.chance.of("mood");
        let behaviour = bad.map_or(Behaviour::Sound, |stretch| {
            let pick = chances.unit(stretch) * BEHAVIOURS.len() as f64;
            BEHAVIOURS
                .get(pick as usize)
                .copied()
                .unwrap_or(Behaviour::Sound)
        });
        let draw = self.chance.of("number");
        let n = 1024 * tick;
        match behaviour {
            Behaviour::Sound => {}
            Behaviour::Silent => return None,
            Behaviour::Contradictory => restless(&mut model, draw, n),
            Behaviour::OneExtreme => {
                let handle = (draw.unit(n) * self.devices as f64) as usize % MAX_HANDLES;
                model.stiffness[handle][handle][(1, 1)] = extreme(draw, n + 1);
            }
            Behaviour::Extreme => {
                let mut next = n;
                let mut number = || {
                    next += 1;
                    extreme(draw, next)
                };
                model.head.energy = number();
                for handle in &mut model.handles {
                    handle.wrench.force = Vec3::from_fn(|_, _| number());
                    handle.pose.position = Vec3::from_fn(|_, _| number());
                    handle.twist.linear = Vec3::from_fn(|_, _| number());
                    handle.drift.force = Vec3::from_fn(|_, _| number());
                }
                model.head.released = number();
                model.head.horizon = number();
                // Most of these models are made finite; otherwise the controller would refuse all of them.
                if draw.unit(n) < 0.9 {
                    tame(&mut model);
                }
            }
            Behaviour::Impossible => make_impossible(&mut model, draw, n),
        }
        Some(model)
    }
}

/// A sheet between hands: a spring on every hand, and a spring between every two hands.
fn sound(devices: usize, period: f64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.period = period;
    model.head.handle_count = devices as u8;
    for i in 0..devices {
        model.handles[i].device = i as u8;
        for j in 0..devices {
            let own = if i == j { 300.0 } else { -50.0 };
            let turn = 1e-3 * own;
            model.stiffness[i][j] =
                Mat6::from_diagonal(&rt_core::Vec6::new(own, own, own, turn, turn, turn));
            model.damping[i][j] = model.stiffness[i][j] * 2e-3;
        }
    }
    model
}

fn restless(model: &mut LocalModel, draw: Chance, n: u64) {
    let scale = 10_f64.powf(draw.between(n, 0.0, 6.0));
    for (i, handle) in (1..).zip(&mut model.handles) {
        let number = |k: u64| draw.between(n + 16 * i + k, -1.0, 1.0);
        handle.wrench.force = Vec3::new(number(0), number(1), number(2)) * 10.0;
        handle.pose.position = Vec3::new(number(3), number(4), number(5)) * 0.1;
        handle.twist.linear = Vec3::new(number(6), number(7), number(8));
        handle.drift.force = Vec3::new(number(9), number(10), number(11)) * 100.0;
    }
    for (i, row) in (8..).zip(&mut model.stiffness) {
        for (j, block) in (0..).zip(row) {
            let first = n + 64 * i + 8 * j;
            *block = Mat6::from_fn(|r, c| scale * draw.between(first + (r + c) as u64, -1.0, 1.0));
        }
    }
    model.head.energy = scale * draw.unit(n + 1);
    model.head.released = scale * draw.unit(n + 2);
}

/// Replaces every number that is not finite by zero.
fn tame(model: &mut LocalModel) {
    let fix = |x: &mut f64| {
        if !x.is_finite() {
            *x = 0.0;
        }
    };
    fix(&mut model.head.energy);
    fix(&mut model.head.released);
    if !(model.head.horizon.is_finite() && model.head.horizon > 0.0) {
        model.head.horizon = 1.0;
    }
    for handle in &mut model.handles {
        handle.wrench.force.iter_mut().for_each(fix);
        handle.pose.position.iter_mut().for_each(fix);
        handle.twist.linear.iter_mut().for_each(fix);
        handle.drift.force.iter_mut().for_each(fix);
    }
}

fn make_impossible(model: &mut LocalModel, draw: Chance, n: u64) {
    match (draw.unit(n) * 6.0) as u64 {
        0 => model.head.time_ns = u64::MAX,
        1 => model.head.time_ns = 0,
        2 => model.head.handle_count = u8::MAX,
        3 => model.head.handle_count = 0,
        4 => model.handles[0].device = u8::MAX,
        _ => model.head.period = extreme(draw, n + 1),
    }
}
