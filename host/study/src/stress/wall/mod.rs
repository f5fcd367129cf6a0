//! A unilateral wall inside the tick: from which stiffness on energy comes out of it, on each device, beside theory;
//! and how much stiffer it may be under each scheme.
//!
//! The wall is a local model with a contact, in the real [`rt_core::Controller`] ([`rig`]). What comes out is certified
//! at the hand's port by [`sim::adversary`], never by the controller's own account. Four kinds of cells:
//!
//! - **passive**: the boundary of passivity, measured by halving ([`passive`]), beside the exact condition
//!   ([`theory`]): without friction and counts over damping, delay and rate; with them against Abbott and Okamura.
//! - **stable**: the boundary of stability with the device in a typical hand ([`stable`]).
//! - **energy**: the map: most energy found at a stiffness and a damping.
//! - **scheme**: most energy found at multiples of the plain bound, and the static stiffness there ([`stiffer`]).

pub mod passive;
pub mod rig;
pub mod stable;
pub mod stiffer;
mod summary;
mod surprise;
#[cfg(test)]
mod tests;
pub mod theory;

pub use summary::{Gain, Panel, gains, panels};

use crate::stress::jobs::{self, Header, JobError, Options, Progress};
use rig::Wall;
use rt_core::Scheme;
use serde::{Deserialize, Serialize};
use sim::{Arm, DeviceModel};
use std::collections::BTreeMap;
use theory::{Plant, Sampled};

/// Version of the lines of results.
const SCHEMA: u32 = 2;
/// The schemes that are compared.
pub const SCHEMES: [Scheme; 4] = [
    Scheme::Linear,
    Scheme::Proxy,
    Scheme::Classic,
    Scheme::Capped,
];
/// Energy up to which a scheme's wall counts as safe (J).
pub const SAFE: f64 = 1e-3;
/// Share of the stiffness asked for that must be rendered for a scheme's wall to count.
pub const RENDERED: f64 = 0.9;
/// Stiffnesses and dampings of the map.
const GRID: [u32; 2] = [32, 16];

/// What is done.
#[derive(Clone, Debug, Serialize)]
pub struct Study {
    /// The corners only.
    pub quick: bool,
    /// Fixes every random choice.
    pub seed: u64,
    /// The map's rate (Hz); each device's own where there is none.
    pub map_rate: Option<u32>,
    /// The map's delay (ticks).
    pub map_delay: usize,
}

/// One cell's work.
#[derive(Clone, Copy, Debug)]
struct Task {
    device: &'static str,
    model: DeviceModel,
    rate: u32,
    delay: usize,
    what: What,
}

#[derive(Clone, Copy, Debug)]
enum What {
    /// Damping of the wall as a share of the device's; whether with friction and counts.
    Passive(f64, bool),
    Stable(f64),
    /// Place in the grid.
    Energy([u32; 2]),
    Scheme {
        scheme: Scheme,
        times: f64,
        whole: bool,
        as_hand: bool,
    },
}

/// Which wall a result is of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// The device's name.
    pub device: String,
    /// The tick's rate (Hz).
    pub rate: u32,
    /// Ticks between a command and when it is held.
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
        /// Of which wall.
        #[serde(flatten)]
        setting: Setting,
        /// The exact condition's; with friction and counts for hands up to [`passive::SPEED`].
        theory: f64,
        /// Abbott and Okamura's, for any speed; only with friction and counts.
        any_speed: Option<f64>,
        /// Where energy came out first; none if nowhere.
        measured: Option<f64>,
        /// The family of the motion that got it.
        family: Option<String>,
        /// Ticks that the adversary spent.
        spent: u64,
    },
    /// The boundary of stability (N/m).
    Stable {
        /// Of which wall.
        #[serde(flatten)]
        setting: Setting,
        /// The largest stiffness with all eigenvalues inside the unit circle.
        theory: f64,
        /// Where a disturbance grew first.
        measured: f64,
    },
    /// A cell of the map.
    Energy {
        /// Of which wall.
        #[serde(flatten)]
        setting: Setting,
        /// Stiffness (N/m).
        stiffness: f64,
        /// Edges of the cell: from and to in damping (N s/m).
        across: [f64; 2],
        /// Edges of the cell: from and to in stiffness (N/m).
        up: [f64; 2],
        /// Most energy found (J).
        energy: f64,
    },
    /// A scheme at a multiple of the plain bound.
    Scheme {
        /// Of which wall.
        #[serde(flatten)]
        setting: Setting,
        /// The scheme.
        scheme: String,
        /// Whether the adversary kept to what a hand accelerates by.
        as_hand: bool,
        /// Multiple of the plain bound.
        times: f64,
        /// Stiffness (N/m).
        stiffness: f64,
        /// Most energy found (J).
        energy: f64,
        /// The family of the motion that got it.
        family: String,
        /// Static stiffness, as a share of what was asked.
        rendered: f64,
    },
}

impl Study {
    fn tasks(&self) -> Vec<Task> {
        let quick = self.quick;
        let delays: &[usize] = if quick { &[0, 1] } else { &[0, 1, 3] };
        let shares: &[f64] = if quick {
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
        for (device, model) in DeviceModel::all().take(if quick { 2 } else { usize::MAX }) {
            let rates: &[u32] = if quick { &[1000] } else { &[1000, 4000] };
            for (&rate, &delay) in rates
                .iter()
                .flat_map(|r| delays.iter().map(move |d| (r, d)))
            {
                let mut add = |what| {
                    tasks.push(Task {
                        device,
                        model,
                        rate,
                        delay,
                        what,
                    });
                };
                for &share in shares {
                    add(What::Passive(share, false));
                    add(What::Stable(share));
                }
                if delay == 0 {
                    add(What::Passive(0.0, true));
                }
                if delay > 1 || (quick && delay > 0) {
                    continue;
                }
                for (scheme, &times) in SCHEMES
                    .iter()
                    .flat_map(|s| multiples.iter().map(move |t| (*s, t)))
                {
                    for (whole, as_hand) in [(false, false), (true, false), (true, true)] {
                        add(What::Scheme {
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
                    device,
                    model,
                    rate: self.map_rate.unwrap_or(model.rate_hz),
                    delay: self.map_delay,
                    what: What::Energy(place),
                });
            }
        }
        tasks
    }

    /// Cells of the map over stiffness and damping.
    fn grid(&self) -> [u32; 2] {
        if self.quick { [8, 5] } else { GRID }
    }

    /// Ticks that the adversary may spend on: halving at one stiffness, a cell of the map, a scheme.
    fn budgets(&self) -> [u64; 3] {
        if self.quick {
            [100_000, 60_000, 60_000]
        } else {
            [300_000, 60_000, 200_000]
        }
    }

    /// What the results are a function of.
    pub fn header(&self) -> Header {
        let models: BTreeMap<_, _> = DeviceModel::all()
            .map(|(name, m)| {
                let numbers = [m.mass, m.damping, m.friction, m.position_step, m.max_force];
                (name, numbers)
            })
            .collect();
        Header {
            study: "wall".to_owned(),
            schema: SCHEMA,
            seed: self.seed,
            cells: self.tasks().len() as u64,
            settings: serde_json::json!({
                "study": self,
                "budgets": self.budgets(),
                "devices": models,
                "schemes": SCHEMES.map(|scheme| scheme.name()),
            }),
        }
    }

    /// Runs all cells that are not done.
    ///
    /// # Errors
    /// [`JobError`]: the file of results cannot be used.
    pub fn run(
        &self,
        options: &Options,
        progress: impl FnMut(&Progress),
    ) -> Result<BTreeMap<u64, Outcome>, JobError> {
        let tasks = self.tasks();
        let work = |cell: u64| self.work(&tasks[cell as usize], cell);
        jobs::run(&self.header(), options, work, progress)
    }

    fn work(&self, task: &Task, cell: u64) -> Outcome {
        let [halving, map, scheme_budget] = self.budgets();
        // Each cell draws on its own.
        let seed = self.seed.wrapping_mul(1_000_003).wrapping_add(cell);
        let wall = |stiffness, share, whole, scheme| Wall {
            model: task.model,
            rate: task.rate,
            delay: task.delay,
            whole,
            scheme,
            stiffness,
            damping: share * task.model.damping,
        };
        match task.what {
            What::Passive(share, whole) => {
                let wall = wall(1.0, share, whole, Scheme::Linear);
                let sampled = task.sampled(share);
                let found = passive::boundary(&wall, 4.0 * sampled.plain(), halving, seed);
                let (model, period) = (&task.model, sampled.period);
                Outcome::Passive {
                    setting: task.setting(share, whole),
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
            What::Stable(share) => {
                let plant = Plant::held(&task.model, &Arm::TYPICAL);
                let sampled = task.sampled(share);
                let wall = wall(1.0, share, false, Scheme::Linear);
                Outcome::Stable {
                    setting: task.setting(share, false),
                    theory: sampled.stable(&plant),
                    measured: stable::boundary(&wall, &plant, sampled.plain()),
                }
            }
            What::Energy([row, column]) => {
                let [rows, columns] = self.grid();
                let share = |column: f64| column / f64::from(columns);
                let [low, high] = task.range();
                let stiffness =
                    |row: f64| low * libm::exp(row / f64::from(rows) * libm::log(high / low));
                let (column, row) = (f64::from(column), f64::from(row));
                let middle = share(column + 0.5);
                let wall = wall(stiffness(row + 0.5), middle, false, Scheme::Linear);
                let damping = task.model.damping;
                Outcome::Energy {
                    setting: task.setting(middle, false),
                    stiffness: wall.stiffness,
                    across: [column, column + 1.0].map(|at| damping * share(at)),
                    up: [row, row + 1.0].map(stiffness),
                    energy: stiffer::most_energy(&wall, map, seed),
                }
            }
            What::Scheme {
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
    fn sampled(&self, share: f64) -> Sampled {
        Sampled {
            period: 1.0 / f64::from(self.rate),
            delay: self.delay,
            device: self.model.damping,
            wall: share * self.model.damping,
        }
    }

    /// Stiffness at the bottom and the top of the map (N/m): from a tenth of the plain bound to twice what is stable.
    fn range(&self) -> [f64; 2] {
        let sampled = self.sampled(0.0);
        let stable = sampled.stable(&Plant::held(&self.model, &Arm::TYPICAL));
        [0.1 * sampled.plain(), 2.0 * stable]
    }

    fn setting(&self, share: f64, whole: bool) -> Setting {
        Setting {
            device: self.device.to_owned(),
            rate: self.rate,
            delay: self.delay,
            device_damping: self.model.damping,
            damping: share * self.model.damping,
            whole,
        }
    }
}
