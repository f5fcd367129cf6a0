//! A unilateral wall inside the tick: the stiffness from which on the adversary extracts energy, on each device,
//! compared with theory; and how much stiffer the wall may be under each scheme.
//!
//! The wall is a local model with a contact, in the real [`rt_core::Controller`] ([`rig`]). [`crate::adversary`] measures
//! the energy at the port of the hand; the account of the controller is not used. There are four kinds of cells:
//!
//! - **passive**: the boundary of passivity, measured by bisection ([`passive`]) and compared with theory
//!   ([`theory`]). Without friction and counts, over damping, delay and rate, theory is the exact condition. With
//!   friction and counts, theory is that of Abbott and Okamura.
//! - **stable**: the boundary of stability with the device in a typical hand ([`stable`]).
//! - **energy**: the map: most energy found at a stiffness and a damping.
//! - **scheme**: most energy found at multiples of the plain bound, and the static stiffness there ([`stiffer`]).

pub mod passive;
mod picture;
pub mod rig;
pub mod stable;
pub mod stiffer;
mod summary;
mod surprise;
mod table;
#[cfg(test)]
mod tests;
pub mod theory;

pub use summary::{Gain, Panel, gains, panels};

use crate::stress::devices::{StudyDevice, settings};
use crate::stress::study::quantities;
use crate::stress::{self, Done, Quantity, Verdict};
use host::plot::Picture;
use host::scene::{NamedDevice, SceneError};
use rig::Wall;
use rt_core::Scheme;
use serde::{Deserialize, Serialize};
use sim::{Arm, DeviceModel};
use std::collections::BTreeMap;
use theory::{Plant, Sampled};

/// The schemes that are compared.
pub const SCHEMES: [Scheme; 4] = [
    Scheme::Linear,
    Scheme::Proxy,
    Scheme::Classic,
    Scheme::Capped,
];
/// Largest extracted energy with which the wall of a scheme counts as safe (J).
pub const SAFE: f64 = 1e-3;
/// Fraction of the static stiffness that must be rendered for the wall of a scheme to count.
pub const RENDERED: f64 = 0.9;
/// Stiffnesses and dampings of the map.
const GRID: [u32; 2] = [32, 16];

/// The settings of the study.
#[derive(Clone, Debug, Serialize)]
pub struct Study {
    /// Runs the corners only.
    pub quick: bool,
    /// The seed of every random choice.
    pub seed: u64,
    /// The rate of the map (Hz); the rate of each device if none.
    pub map_rate: Option<u32>,
    /// The delay of the map (ticks).
    pub map_delay: usize,
    /// The devices, if not the built-in ones. Each needs damping: a wall on a device without damping is never passive.
    #[serde(skip)]
    pub devices: Vec<StudyDevice>,
}

/// The work of one cell.
#[derive(Clone, Debug)]
struct Task {
    device: String,
    model: DeviceModel,
    rate: u32,
    delay: usize,
    case: Case,
}

#[derive(Clone, Copy, Debug)]
enum Case {
    /// Damping of the wall as a fraction of the device's; whether with friction and counts.
    Passive(f64, bool),
    Stable(f64),
    /// Row and column in the grid.
    Energy([u32; 2]),
    Scheme {
        scheme: Scheme,
        times: f64,
        whole: bool,
        as_hand: bool,
    },
}

/// The wall of a result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// The device's name.
    pub device: String,
    /// The tick's rate (Hz).
    pub rate: u32,
    /// Ticks between a command and the tick in which the device holds it.
    pub delay: usize,
    /// The device's damping (N s/m).
    pub device_damping: f64,
    /// The wall's damping (N s/m).
    pub damping: f64,
    /// With friction, counts and the driver's velocity.
    pub whole: bool,
}

/// A cell's result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "what", rename_all = "snake_case")]
pub enum Outcome {
    /// The boundary of passivity (N/m).
    Passive {
        /// The wall.
        #[serde(flatten)]
        setting: Setting,
        /// The exact condition's stiffness; with friction and counts, the bound for hands up to [`passive::SPEED`].
        theory: f64,
        /// Abbott and Okamura's bound for any speed; only with friction and counts.
        any_speed: Option<f64>,
        /// The smallest stiffness at which energy was extracted; none if there was none.
        measured: Option<f64>,
        /// The family of the motion that extracted it.
        family: Option<String>,
        /// Ticks that the adversary spent.
        spent: u64,
    },
    /// The boundary of stability (N/m).
    Stable {
        /// The wall.
        #[serde(flatten)]
        setting: Setting,
        /// The largest stiffness with all eigenvalues inside the unit circle.
        theory: f64,
        /// The smallest stiffness at which a disturbance grew.
        measured: f64,
    },
    /// A cell of the map.
    Energy {
        /// The wall.
        #[serde(flatten)]
        setting: Setting,
        /// Stiffness (N/m).
        stiffness: f64,
        /// Edges of the cell in damping (N s/m).
        across: [f64; 2],
        /// Edges of the cell in stiffness (N/m).
        up: [f64; 2],
        /// Most energy extracted (J).
        energy: f64,
    },
    /// A scheme at a multiple of the plain bound.
    Scheme {
        /// The wall.
        #[serde(flatten)]
        setting: Setting,
        /// The scheme.
        scheme: String,
        /// Whether the acceleration of the adversary was limited to that of a hand.
        as_hand: bool,
        /// Multiple of the plain bound.
        times: f64,
        /// Stiffness (N/m).
        stiffness: f64,
        /// Most energy extracted (J).
        energy: f64,
        /// The family of the motion that extracted it.
        family: String,
        /// Static stiffness rendered, as a fraction of the wall's.
        rendered: f64,
    },
}

/// Refuses a device on which no wall is passive.
///
/// # Errors
/// [`SceneError::Value`] with file, line and field, if the device has no damping.
pub fn check(device: &NamedDevice) -> Result<(), SceneError> {
    if device.model.damping > 0.0 {
        return Ok(());
    }
    let allowed = "above 0 for a study of walls: on a device without damping, no wall is passive";
    Err(device.source.error("damping", "0", allowed))
}

impl stress::Study for Study {
    type Outcome = Outcome;
    const NAME: &'static str = "wall";
    const SCHEMA: u32 = 2;
    const COMPARED: bool = true;

    fn seed(&self) -> u64 {
        self.seed
    }

    fn cells(&self) -> u64 {
        self.tasks().len() as u64
    }

    fn settings(&self) -> serde_json::Value {
        let models: BTreeMap<_, _> = DeviceModel::spatial()
            .map(|(name, m)| {
                let numbers = [m.mass, m.damping, m.friction, m.position_step, m.max_force];
                (name, numbers)
            })
            .collect();
        let models = if self.devices.is_empty() {
            serde_json::json!(models)
        } else {
            settings(&self.devices)
        };
        serde_json::json!({
            "study": self,
            "budgets": self.budgets(),
            "devices": models,
            "schemes": SCHEMES.map(|scheme| scheme.name()),
        })
    }

    fn cell(&self, cell: u64, _: &Done<'_>) -> Outcome {
        // A cell takes far longer than the list of all.
        self.work(&self.tasks().swap_remove(cell as usize), cell)
    }

    fn summary(&self, cells: &BTreeMap<u64, Outcome>) -> String {
        let mut text = String::new();
        let of = stress::Study::cells(self);
        if (cells.len() as u64) < of {
            put!(
                text,
                "{} of {of} cells: merge the files of all shards for the rest\n",
                cells.len()
            );
        }
        table::boundaries(&mut text, cells);
        table::whole(&mut text, cells);
        table::gains(&mut text, cells, &self.devices());
        text
    }

    /// A wall has no limits that it must keep.
    fn verdict(&self, _: &BTreeMap<u64, Outcome>) -> Verdict {
        Verdict::default()
    }

    fn draw(&self, cells: &BTreeMap<u64, Outcome>) -> Option<Picture> {
        Some(picture::map(cells))
    }

    fn quantities(cells: &BTreeMap<u64, Outcome>) -> Vec<Quantity> {
        quantities_of(cells)
    }
}

impl Study {
    /// The devices of the study.
    pub fn devices(&self) -> Vec<StudyDevice> {
        if !self.devices.is_empty() {
            return self.devices.clone();
        }
        let most = if self.quick { 2 } else { usize::MAX };
        StudyDevice::built_in().into_iter().take(most).collect()
    }

    /// The rates of the tick (Hz) of all cells but those of the map: 1 and 4 kHz. For a device that the user chose: its
    /// own rate, and four times that.
    fn rates(&self, model: &DeviceModel) -> Vec<u32> {
        let slow = if self.devices.is_empty() {
            1000
        } else {
            model.rate_hz
        };
        if self.quick {
            vec![slow]
        } else {
            vec![slow, 4 * slow]
        }
    }

    fn tasks(&self) -> Vec<Task> {
        let quick = self.quick;
        let delays: &[usize] = if quick { &[0, 1] } else { &[0, 1, 3] };
        let fractions: &[f64] = if quick {
            &[0.0, 0.4]
        } else {
            &[0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
        };
        let multiples: &[f64] = if quick {
            &[1.0, 10.0]
        } else {
            &[1.0, 2.0, 3.0, 5.0, 10.0, 20.0]
        };
        let mut tasks = Vec::new();
        for StudyDevice {
            name: device,
            model,
        } in self.devices()
        {
            let rates = self.rates(&model);
            for (&rate, &delay) in rates
                .iter()
                .flat_map(|r| delays.iter().map(move |d| (r, d)))
            {
                let mut add = |case| {
                    tasks.push(Task {
                        device: device.clone(),
                        model,
                        rate,
                        delay,
                        case,
                    });
                };
                for &fraction in fractions {
                    add(Case::Passive(fraction, false));
                    add(Case::Stable(fraction));
                }
                if delay == 0 {
                    add(Case::Passive(0.0, true));
                }
                if delay > 1 || (quick && delay > 0) {
                    continue;
                }
                for (scheme, &times) in SCHEMES
                    .iter()
                    .flat_map(|s| multiples.iter().map(move |t| (*s, t)))
                {
                    for (whole, as_hand) in [(false, false), (true, false), (true, true)] {
                        add(Case::Scheme {
                            scheme,
                            times,
                            whole,
                            as_hand,
                        });
                    }
                }
            }
            let [rows, columns] = self.grid();
            for place in (0..rows).flat_map(|k| (0..columns).map(move |b| [k, b])) {
                tasks.push(Task {
                    device: device.clone(),
                    model,
                    rate: self.map_rate.unwrap_or(model.rate_hz),
                    delay: self.map_delay,
                    case: Case::Energy(place),
                });
            }
        }
        tasks
    }

    /// Cells of the map over stiffness and damping.
    fn grid(&self) -> [u32; 2] {
        if self.quick { [8, 5] } else { GRID }
    }

    /// Ticks that the adversary may spend: on bisection at one stiffness, on a cell of the map, on a scheme.
    fn budgets(&self) -> [u64; 3] {
        if self.quick {
            [100_000, 60_000, 60_000]
        } else {
            [300_000, 60_000, 200_000]
        }
    }

    fn work(&self, task: &Task, cell: u64) -> Outcome {
        let [halving, map, scheme_budget] = self.budgets();
        // Each cell has a seed of its own.
        let seed = self.seed.wrapping_mul(1_000_003).wrapping_add(cell);
        let wall = |stiffness, fraction, whole, scheme| Wall {
            model: task.model,
            rate: task.rate,
            delay: task.delay,
            whole,
            scheme,
            stiffness,
            damping: fraction * task.model.damping,
        };
        match task.case {
            Case::Passive(fraction, whole) => {
                let wall = wall(1.0, fraction, whole, Scheme::Linear);
                let sampled = task.sampled(fraction);
                let found = passive::boundary(&wall, 4.0 * sampled.plain(), halving, seed);
                let (model, period) = (&task.model, sampled.period);
                Outcome::Passive {
                    setting: task.setting(fraction, whole),
                    theory: if whole {
                        theory::at_speed(model, period, passive::SPEED)
                    } else {
                        sampled.passive()
                    },
                    any_speed: whole.then(|| theory::any_speed(model, period)),
                    measured: found.as_ref().map(|found| found.stiffness),
                    family: found.as_ref().map(|found| found.family.to_owned()),
                    spent: found.map_or(0, |found| found.spent),
                }
            }
            Case::Stable(fraction) => {
                let plant = Plant::held(&task.model, &Arm::TYPICAL);
                let sampled = task.sampled(fraction);
                let wall = wall(1.0, fraction, false, Scheme::Linear);
                Outcome::Stable {
                    setting: task.setting(fraction, false),
                    theory: sampled.stable(&plant),
                    measured: stable::boundary(&wall, &plant, sampled.plain()),
                }
            }
            Case::Energy([row, column]) => {
                let [rows, columns] = self.grid();
                let fraction = |column: f64| column / f64::from(columns);
                let [low, high] = task.range();
                let stiffness =
                    |row: f64| low * libm::exp(row / f64::from(rows) * libm::log(high / low));
                let (column, row) = (f64::from(column), f64::from(row));
                let middle = fraction(column + 0.5);
                let wall = wall(stiffness(row + 0.5), middle, false, Scheme::Linear);
                let damping = task.model.damping;
                Outcome::Energy {
                    setting: task.setting(middle, false),
                    stiffness: wall.stiffness,
                    across: [column, column + 1.0].map(|at| damping * fraction(at)),
                    up: [row, row + 1.0].map(stiffness),
                    energy: stiffer::most_energy(&wall, map, seed),
                }
            }
            Case::Scheme {
                scheme,
                times,
                whole,
                as_hand,
            } => {
                let stiffness = times * task.sampled(0.0).plain();
                let wall = wall(stiffness, 0.0, whole, scheme);
                let attack = stiffer::attack(&wall, as_hand, scheme_budget, seed);
                Outcome::Scheme {
                    setting: task.setting(0.0, whole),
                    scheme: scheme.name().to_owned(),
                    as_hand,
                    times,
                    stiffness,
                    energy: attack.energy,
                    family: attack.family.to_owned(),
                    rendered: attack.rendered,
                }
            }
        }
    }
}

impl Task {
    fn sampled(&self, fraction: f64) -> Sampled {
        Sampled {
            period: 1.0 / f64::from(self.rate),
            delay: self.delay,
            device: self.model.damping,
            wall: fraction * self.model.damping,
        }
    }

    /// Stiffness at the bottom and the top of the map (N/m): from a tenth of the plain bound to twice the largest
    /// stable stiffness.
    fn range(&self) -> [f64; 2] {
        let sampled = self.sampled(0.0);
        let stable = sampled.stable(&Plant::held(&self.model, &Arm::TYPICAL));
        [0.1 * sampled.plain(), 2.0 * stable]
    }

    fn setting(&self, fraction: f64, whole: bool) -> Setting {
        Setting {
            device: self.device.clone(),
            rate: self.rate,
            delay: self.delay,
            device_damping: self.model.damping,
            damping: fraction * self.model.damping,
            whole,
        }
    }
}

fn quantities_of(cells: &BTreeMap<u64, Outcome>) -> Vec<Quantity> {
    let mut values = Vec::new();
    for outcome in cells.values() {
        let Outcome::Passive {
            setting,
            measured: Some(measured),
            ..
        } = outcome
        else {
            continue;
        };
        if setting.damping == 0.0 {
            let name = if setting.whole {
                "passive stiffness with friction and counts (N/m)"
            } else {
                "passive stiffness (N/m)"
            };
            let of = place(&setting.device, setting.rate, setting.delay);
            values.extend(quantities(&of, [(name, *measured)]));
        }
    }
    for gain in gains(cells).iter().filter(|gain| gain.whole) {
        let of = place(&gain.device, gain.rate, gain.delay);
        let name = if gain.as_hand {
            "multiple of the plain bound, motion of a hand"
        } else {
            "multiple of the plain bound, any motion"
        };
        values.extend(quantities(
            &format!("{of}, {}", gain.scheme),
            [(name, gain.times())],
        ));
    }
    values
}

fn place(device: &str, rate: u32, delay: usize) -> String {
    format!("{device}, {rate} Hz, delay {delay}")
}
