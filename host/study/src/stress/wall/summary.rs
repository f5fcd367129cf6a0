//! The results of the cells: how much stiffer each scheme may be, and the panels of the map.

use super::passive::SPEED;
use super::theory::Sampled;
use super::{Outcome, RENDERED, SAFE, Setting, surprise};
use crate::stress::devices::StudyDevice;
use std::collections::BTreeMap;

/// How much stiffer than the plain bound a scheme may be on a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Gain {
    /// The device's name.
    pub device: String,
    /// The tick's rate (Hz).
    pub rate: u32,
    /// Ticks of delay.
    pub delay: usize,
    /// With friction, counts and the driver's velocity.
    pub whole: bool,
    /// Whether the acceleration of the adversary was limited to that of a hand.
    pub as_hand: bool,
    /// The scheme.
    pub scheme: String,
    /// Multiples of the plain bound, with the most energy extracted (J) and the fraction of the static stiffness
    /// rendered.
    pub steps: Vec<(f64, f64, f64)>,
}

impl Gain {
    /// The largest multiple up to which no more than the safe energy was extracted and the wall was rendered as stiff
    /// as asked; zero if there is none.
    pub fn times(&self) -> f64 {
        let holds = |step: &&(f64, f64, f64)| step.1 <= SAFE && step.2 >= RENDERED;
        let last = self.steps.iter().take_while(holds).last();
        last.map_or(0.0, |step| step.0)
    }

    /// The largest multiple that any scheme could reach against a motion that begins without warning; none if there is
    /// no such bound. `devices` are the devices of the study.
    pub fn of_any_scheme(&self, devices: &[StudyDevice]) -> Option<f64> {
        let mut devices = devices.iter().filter(|_| !self.as_hand);
        let mut model = devices.find(|device| device.name == self.device)?.model;
        if !self.whole {
            model.friction = 0.0;
        }
        let period = 1.0 / f64::from(self.rate);
        let most = surprise::most(&model, period, self.delay, SPEED, RENDERED, SAFE)?;
        let sampled = Sampled {
            period,
            delay: self.delay,
            device: model.damping,
            wall: 0.0,
        };
        Some(most / sampled.plain())
    }
}

/// The gains of the schemes, in the order of the cells.
pub fn gains(cells: &BTreeMap<u64, Outcome>) -> Vec<Gain> {
    let mut gains: Vec<Gain> = Vec::new();
    for outcome in cells.values() {
        let Outcome::Scheme {
            setting,
            scheme,
            as_hand,
            times,
            energy,
            rendered,
            ..
        } = outcome
        else {
            continue;
        };
        let new = Gain {
            device: setting.device.clone(),
            rate: setting.rate,
            delay: setting.delay,
            whole: setting.whole,
            as_hand: *as_hand,
            scheme: scheme.clone(),
            steps: Vec::new(),
        };
        let same = |old: &&mut Gain| {
            let key = Gain {
                steps: Vec::new(),
                ..(**old).clone()
            };
            key == new
        };
        let step = (*times, *energy, *rendered);
        if let Some(old) = gains.iter_mut().find(same) {
            old.steps.push(step);
        } else {
            gains.push(Gain {
                steps: vec![step],
                ..new
            });
        }
    }
    for gain in &mut gains {
        gain.steps.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    gains
}

/// One device's map.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// The wall; its damping has no meaning here.
    pub setting: Setting,
    /// Damping from and to (N s/m), stiffness from and to (N/m), most energy found (J), of each cell.
    pub cells: Vec<([f64; 2], [f64; 2], f64)>,
    /// The exact boundary of passivity: damping and stiffness.
    pub passive: Vec<(f64, f64)>,
    /// The measured boundary of passivity.
    pub measured: Vec<(f64, f64)>,
    /// The boundary of stability.
    pub stable: Vec<(f64, f64)>,
    /// The measured boundary of stability.
    pub stable_measured: Vec<(f64, f64)>,
}

/// The panels of the map, by device. Boundaries of stability and measured boundaries are included if they were
/// measured at the rate and delay of the map.
pub fn panels(cells: &BTreeMap<u64, Outcome>) -> Vec<Panel> {
    let mut panels: Vec<Panel> = Vec::new();
    for outcome in cells.values() {
        let Outcome::Energy {
            setting,
            across,
            up,
            energy,
            ..
        } = outcome
        else {
            continue;
        };
        let same = |panel: &&mut Panel| panel.setting.device == setting.device;
        if let Some(panel) = panels.iter_mut().find(same) {
            panel.cells.push((*across, *up, *energy));
            continue;
        }
        let here = |other: &Setting| {
            !other.whole
                && other.device == setting.device
                && (other.rate, other.delay) == (setting.rate, setting.delay)
        };
        let mut panel = Panel {
            setting: setting.clone(),
            cells: vec![(*across, *up, *energy)],
            passive: passive(setting),
            measured: Vec::new(),
            stable: Vec::new(),
            stable_measured: Vec::new(),
        };
        for other in cells.values() {
            match other {
                Outcome::Passive {
                    setting,
                    measured: Some(measured),
                    ..
                } if here(setting) => panel.measured.push((setting.damping, *measured)),
                Outcome::Stable {
                    setting,
                    theory,
                    measured,
                } if here(setting) => {
                    panel.stable.push((setting.damping, *theory));
                    panel.stable_measured.push((setting.damping, *measured));
                }
                _ => {}
            }
        }
        panels.push(panel);
    }
    panels
}

fn passive(setting: &Setting) -> Vec<(f64, f64)> {
    let boundary = |k: u32| {
        let wall = setting.device_damping * f64::from(k) / 200.0;
        let sampled = Sampled {
            period: 1.0 / f64::from(setting.rate),
            delay: setting.delay,
            device: setting.device_damping,
            wall,
        };
        (wall, sampled.passive())
    };
    (0..200).map(boundary).collect()
}
