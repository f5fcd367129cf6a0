//! The tick under input that no device, host or clock should ever give.
//!
//! A cell is one controller, with a random scheme, number of devices and limits. It runs for [`TICKS`] ticks. Stretches
//! of random and extreme input (`input`, `models`) alternate with stretches of sound input. After every tick, every
//! command is finite and inside the device's limits of force, moment and slew, and every sum of energy is finite. At
//! the end of each sound stretch the controller has recovered: every device and body is in its normal state. A panic is
//! caught and recorded.

use super::devices::{self, StudyDevice};
use crate::chance::Chance;
use crate::stress::study::quantities;
use crate::stress::{self, Done, Quantity, Verdict};
use host::record::energy_sums;
use host::run::panics;
use host::world::port;
use input::{Clock, Encoder, Readings};
use models::Models;
use rt_core::Reading;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::{CouplingConfig, HostState};
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::{SafetyConfig, SafetyState};
use rt_core::{
    Controller, ControllerConfig, EnergyAccount, Freedom, MAX_DEVICES, PassivityConfig, Port,
    Scheme, Telemetry, Vec3, Wrench,
};
use serde::{Deserialize, Serialize};
use sim::DeviceModel;
use std::collections::BTreeMap;

mod input;
mod models;
#[cfg(test)]
mod tests;

/// Ticks in a cell.
pub const TICKS: u64 = 100_000;
/// Length of a stretch of bad input, and of a stretch of sound input (s). A second and a half is longer than the fade,
/// the recovery and a blend together.
const STRETCH: [f64; 2] = [0.5, 1.5];
/// Ticks a second (Hz), if no device states another rate.
const RATE: f64 = 1000.0;
/// Cells of a whole study (10^8 ticks), and of a quick one.
pub const CELLS: [u64; 2] = [1000, 10];

/// The result of a cell.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outcome {
    /// The scheme.
    pub scheme: String,
    /// The device; none if all limits were drawn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
    /// Ticks done.
    pub ticks: u64,
    /// Ticks in which a command was not finite.
    pub not_finite: u64,
    /// Ticks in which a command was beyond a limit of force, moment or slew.
    pub beyond: u64,
    /// Ticks after which a sum of energy was not finite.
    pub lost_account: u64,
    /// Sound stretches after which a device or a body was not in its normal state.
    pub not_back: u64,
    /// The message of the panic, if there was one.
    pub panic: Option<String>,
    /// How often each event occurred. A cell in which an event never occurs proves nothing about that event.
    pub met: BTreeMap<String, u64>,
}

impl Outcome {
    /// Whether no check failed.
    pub fn passed(&self) -> bool {
        self.panic.is_none()
            && self.not_finite + self.beyond + self.lost_account + self.not_back == 0
    }
}

/// The study.
#[derive(Clone, Debug)]
pub struct Study {
    /// The seed of every random choice.
    pub seed: u64,
    /// Number of cells.
    pub cells: u64,
    /// The devices of the cells, in turn; none of them: devices of drawn limits.
    pub devices: Vec<StudyDevice>,
}

impl stress::Study for Study {
    type Outcome = Outcome;
    const NAME: &'static str = "faults";
    const SCHEMA: u32 = 2;
    const COMPARED: bool = true;

    fn seed(&self) -> u64 {
        self.seed
    }

    fn cells(&self) -> u64 {
        self.cells
    }

    fn settings(&self) -> serde_json::Value {
        let mut settings = serde_json::json!({ "ticks": TICKS });
        if !self.devices.is_empty() {
            settings["devices"] = devices::settings(&self.devices);
        }
        settings
    }

    fn cell(&self, cell: u64, _: &Done<'_>) -> Outcome {
        let chance = Chance::new(self.seed, cell);
        // In turn, so that every range of cells contains the same fraction of each device.
        let device = self.devices.get(cell as usize % self.devices.len().max(1));
        let mut outcome = Outcome::default();
        let run = panics::caught(|| go_through(chance, device, &mut outcome));
        outcome.panic = run.err();
        outcome
    }

    fn summary(&self, cells: &BTreeMap<u64, Outcome>) -> String {
        summary(cells)
    }

    fn verdict(&self, cells: &BTreeMap<u64, Outcome>) -> Verdict {
        Verdict {
            failed: cells.values().filter(|cell| !cell.passed()).count(),
            ..Verdict::default()
        }
    }

    fn quantities(cells: &BTreeMap<u64, Outcome>) -> Vec<Quantity> {
        let failed = cells.values().filter(|cell| !cell.passed()).count();
        quantities("all", [("cells that fail", failed as f64)])
    }
}

fn go_through(chance: Chance, device: Option<&StudyDevice>, outcome: &mut Outcome) {
    let scheme = scheme(chance);
    scheme.name().clone_into(&mut outcome.scheme);
    outcome.device = device.map(|device| device.name.clone());
    let model = device.map(|device| &device.model);
    let config = config(chance, scheme, model);
    let devices = config.devices.len();
    let mut controller = Box::new(Controller::new(&config));
    let kind = Encoder {
        rate: model.map_or(RATE, |model| f64::from(model.rate_hz)),
        count: model.map_or(38e-6, |model| model.position_step),
    };
    let mut clock = Clock::new(chance, (1e9 / kind.rate).round() as u64);
    let inputs = Readings::new(chance, devices, kind);
    let mut models = Models::new(chance, devices, kind.rate);
    let mut last = [Wrench::zero(); MAX_DEVICES];
    let mut in_debt = 0;
    let [bad_ticks, sound_ticks] = STRETCH.map(|seconds| (seconds * kind.rate).round() as u64);
    let whole = bad_ticks + sound_ticks;
    for tick in 0..TICKS {
        let (stretch, at) = (tick / whole, tick % whole);
        let bad = (at < bad_ticks).then_some(stretch);
        let now_ns = clock.next(tick, bad);
        if let Some(model) = models.next(tick, now_ns, bad) {
            // Refused models are counted below.
            let _ = controller.accept(0, &model);
        }
        let readings: [Reading; MAX_DEVICES] = inputs.next(tick, bad);
        let (commands, telemetry) = controller.tick(now_ns, &readings);
        outcome.ticks += 1;
        look(&config, &commands, &last, &telemetry, outcome);
        last = commands;
        if at == whole - 1 {
            outcome.not_back += u64::from(!is_back(&telemetry));
            in_debt += u64::from(telemetry.bodies().any(|body| body.energy.available < 0.0));
        }
    }
    let counters = controller.coupling_counters().next().unwrap_or_default();
    for (name, count) in [
        ("models refused: not finite", counters.not_finite),
        ("models refused: wrong handles", counters.wrong_handles),
        ("models refused: outdated", counters.outdated),
        (
            "models refused: timestamped in the future",
            counters.to_come,
        ),
        ("models used", counters.accepted),
        ("forces faded: model too old", counters.faded),
        (
            "undisturbed stretches that ended in debt of energy",
            in_debt,
        ),
    ] {
        *outcome.met.entry(name.to_owned()).or_default() += count;
    }
    for counters in controller.safety_counters() {
        for (name, count) in [
            ("wrenches limited", counters.limited),
            ("forces slewed", counters.slewed),
            ("wrenches not a number", counters.not_a_number),
            ("readings missed", counters.missed_reads),
            ("devices silent", counters.stale),
            ("devices too fast", counters.too_fast),
            ("devices out of reach", counters.out_of_reach),
        ] {
            *outcome.met.entry(name.to_owned()).or_default() += count;
        }
    }
}

fn scheme(chance: Chance) -> Scheme {
    let thesis = Scheme::Thesis {
        stiffness: 200.0,
        damping: 2.0,
    };
    let all = [
        Scheme::Capped,
        Scheme::Linear,
        Scheme::Classic,
        thesis,
        Scheme::Hold,
    ];
    let pick = chance.of("scheme").unit(0) * all.len() as f64;
    all.get(pick as usize).copied().unwrap_or(Scheme::Linear)
}

/// The configuration of a cell. The numbers of a device come from `model`, if there is one. All others are drawn.
fn config(chance: Chance, scheme: Scheme, model: Option<&DeviceModel>) -> ControllerConfig {
    let draw = chance.of("config");
    let devices = 1 + (draw.unit(0) * MAX_DEVICES as f64) as usize;
    let rate = model.map_or(RATE, |model| f64::from(model.rate_hz));
    let period = (1e9 / rate).round() * 1e-9;
    let mut config = ControllerConfig::default();
    let max_slew = if draw.unit(1) < 0.5 {
        f64::INFINITY
    } else {
        draw.between(2, 1e2, 1e5)
    };
    let mut passivity = PassivityConfig::new(period);
    passivity.delay = (draw.unit(3) * 4.0) as usize;
    passivity.ports = [Port {
        damping: draw.between(4, 0.0, 1.0),
        friction: draw.between(5, 0.0, 0.3),
        turning_damping: draw.between(20, 0.0, 0.01),
        turning_friction: draw.between(21, 0.0, 0.03),
        most_damping: draw.between(6, 1.0, 50.0),
        most_turning_damping: 0.05,
        force_scale: 1.0,
        count: 3e-5,
        max_slew,
    }; MAX_DEVICES];
    let capabilities = model.map(DeviceModel::capabilities);
    if let Some(model) = model {
        let port = port(model, max_slew, &DeviceFrame::at(Vec3::zeros()), period);
        passivity.ports = [port; MAX_DEVICES];
    }
    for _ in 0..devices {
        // The loop serves at least as many devices.
        let _ = config.devices.push(DeviceConfig {
            frame: DeviceFrame::at(Vec3::zeros()),
            safety: SafetyConfig {
                actuated: match &capabilities {
                    Some(found) => found.actuated,
                    None if draw.unit(7) < 0.5 => Freedom::Three,
                    None => Freedom::Six,
                },
                max_force: capabilities
                    .as_ref()
                    .map_or_else(|| draw.between(8, 1.0, 40.0), |found| found.max_force),
                max_moment: capabilities.as_ref().map_or(0.5, |found| found.max_moment),
                max_speed: draw.between(9, 0.5, 5.0),
                max_reach: draw.between(10, 0.05, 0.5),
                max_slew,
                patience: 10,
                decay: 0.3,
                recovery: 0.2,
                ..SafetyConfig::unlimited(period)
            },
        });
    }
    let _ = config.bodies.push(CouplingConfig {
        scheme,
        period,
        blend: 0.5,
        age_limit: 0.1,
        decay: 0.3,
        recovery: 0.2,
        hold_damping: [2.0; MAX_DEVICES],
        passivity,
    });
    config
}

/// Checks the commands and the telemetry of one tick.
fn look(
    config: &ControllerConfig,
    commands: &[Wrench; MAX_DEVICES],
    last: &[Wrench; MAX_DEVICES],
    telemetry: &Telemetry,
    outcome: &mut Outcome,
) {
    let (mut finite, mut within) = (true, true);
    for ((device, command), last) in config.devices.iter().zip(commands).zip(last) {
        let safety = &device.safety;
        finite &= command.is_finite();
        // A product and a norm round a few times.
        let room = 1.0 + 1e-12;
        let step = (command.force - last.force).norm();
        let slew = safety.max_slew * safety.period * room;
        within &= command.force.norm() <= safety.max_force * room
            && command.moment.norm() <= safety.max_moment * room
            // A fault removes the force at once.
            && (step <= slew || command.force == Vec3::zeros());
    }
    outcome.not_finite += u64::from(!finite);
    outcome.beyond += u64::from(!within);
    let sound = telemetry.bodies().all(|body| is_finite(&body.energy));
    outcome.lost_account += u64::from(!sound);
}

fn is_finite(energy: &EnergyAccount) -> bool {
    let sums = energy_sums(energy);
    sums.iter().all(|(_, sum)| sum.is_finite())
}

/// Whether every device and body is in its normal state again.
fn is_back(telemetry: &Telemetry) -> bool {
    let devices = telemetry.devices().all(|device| {
        let at_work = matches!(
            device.safety,
            SafetyState::Normal | SafetyState::Limited | SafetyState::Slewed
        );
        device.fresh && at_work
    });
    let mut bodies = telemetry.bodies();
    devices && bodies.all(|body| body.state == HostState::Live && body.trust == 1.0)
}

/// The sums of the cells by scheme, the events that occurred, and the panics.
fn summary(cells: &BTreeMap<u64, Outcome>) -> String {
    let mut text = String::new();
    let mut by_scheme: BTreeMap<&str, [u64; 7]> = BTreeMap::new();
    let mut met: BTreeMap<&str, u64> = BTreeMap::new();
    for cell in cells.values() {
        let sums = by_scheme.entry(&cell.scheme).or_default();
        let counts = [
            1,
            cell.ticks,
            cell.not_finite,
            cell.beyond,
            cell.lost_account,
            cell.not_back,
            u64::from(cell.panic.is_some()),
        ];
        for (sum, count) in sums.iter_mut().zip(counts) {
            *sum += count;
        }
        for (event, count) in &cell.met {
            *met.entry(event).or_default() += count;
        }
    }
    put!(
        text,
        "| scheme | cells | ticks | not finite | beyond limits | account lost | not recovered | panics |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|");
    for (scheme, sums) in by_scheme {
        let columns: Vec<_> = sums.iter().map(u64::to_string).collect();
        put!(text, "| {scheme} | {} |", columns.join(" | "));
    }
    put!(text, "\nEvents that occurred:");
    for (event, count) in met {
        put!(text, "  {count:>12}  {event}");
    }
    for (number, cell) in cells {
        if let Some(panic) = &cell.panic {
            put!(text, "  cell {number} panicked: {panic}");
        }
    }
    text
}
