//! What the number of a cell decides: the specimen, the device, the grip, the task and the host.
//!
//! Specimens and devices follow the number of the cell in turn, so that every range of cells contains the same fraction
//! of each. The rest is drawn.

use crate::stress::chance::Chance;
use serde::{Deserialize, Serialize};
use sim::DeviceModel;

/// Stiffness at the handle (N/m), from the softest to the stiffest specimen.
pub(crate) const STIFFNESS: [f64; 2] = [100.0, 15_000.0];
/// Local models a second (Hz).
pub const RATES: [f64; 2] = [30.0, 1000.0];
/// The longest latency of a model (s).
pub(crate) const MOST_LATENCY: f64 = 0.02;
/// Fraction of the cells whose host publishes after every step.
const PLAIN: f64 = 0.4;

/// The kind of a specimen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A linear block (small strains and rotations), bonded to a table.
    Linear,
    /// A corotational block (small strains, any rotation).
    Corotational,
    /// A St. Venant-Kirchhoff block (linear in the Green strain).
    StVenantKirchhoff,
    /// A neo-Hookean block (large strains).
    StableNeoHookean,
    /// An isotropic sheet, pulled in its plane.
    Sheet,
    /// An isotropic sheet, fixed along all its edges and pressed in its middle.
    Plate,
    /// A corotational woven sheet, pulled in its plane.
    Woven,
    /// A St. Venant-Kirchhoff woven sheet, pulled in its plane.
    WovenStVenantKirchhoff,
    /// A strip that is pushed along itself until it buckles.
    Buckling,
}

impl Kind {
    /// All kinds, in the order in which cells take them.
    pub const ALL: [Self; 9] = [
        Self::Linear,
        Self::Corotational,
        Self::StVenantKirchhoff,
        Self::StableNeoHookean,
        Self::Sheet,
        Self::Plate,
        Self::Woven,
        Self::WovenStVenantKirchhoff,
        Self::Buckling,
    ];

    /// The name of the kind in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear block",
            Self::Corotational => "corotational block",
            Self::StVenantKirchhoff => "St. Venant-Kirchhoff block",
            Self::StableNeoHookean => "neo-Hookean block",
            Self::Sheet => "sheet, pulled",
            Self::Plate => "sheet, pressed across",
            Self::Woven => "woven sheet",
            Self::WovenStVenantKirchhoff => "woven sheet, St. Venant-Kirchhoff",
            Self::Buckling => "buckling strip",
        }
    }

    /// Whether the specimen resists its own weight. A specimen without bending stiffness would swing under its weight.
    fn bends(self) -> bool {
        self.is_solid() || matches!(self, Self::Plate | Self::Buckling)
    }

    /// Whether the specimen is a solid.
    pub(crate) fn is_solid(self) -> bool {
        matches!(
            self,
            Self::Linear | Self::Corotational | Self::StVenantKirchhoff | Self::StableNeoHookean
        )
    }
}

/// What the hand does before the hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Task {
    /// Move to the place of the hold, and stay.
    Press,
    /// The same with tremor.
    Tremble,
    /// Move to the place of the hold, rub slowly across, and stay.
    Rub,
    /// Move to the place of the hold in three stages.
    Stages,
}

const TASKS: [Task; 4] = [Task::Press, Task::Tremble, Task::Rub, Task::Stages];

/// All that is drawn for one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Draw {
    /// The specimen.
    pub kind: Kind,
    /// The device, by its name among `sim::models::FILES`.
    pub device: String,
    /// Whether tetrahedra are quadratic.
    pub quadratic: bool,
    /// How fine the mesh is, from 0 to 1.
    pub fineness: f64,
    /// How thick the specimen is, from 0 to 1.
    pub thickness: f64,
    /// Whether it has weight.
    pub weight: bool,
    /// Rayleigh damping: by mass (1/s) and by stiffness (s).
    pub damping: [f64; 2],
    /// Static stiffness at the handle along the direction of the hand's motion (N/m).
    pub stiffness: f64,
    /// Force of the hand in the hold, as a fraction of the device's largest force.
    pub force: f64,
    /// The grip, from relaxed (0) to rigid (1).
    pub grip: f64,
    /// What the hand does.
    pub task: Task,
    /// How fast the hand moves, from 0 to 1.
    pub haste: f64,
    /// Local models a second (Hz).
    pub rate: f64,
    /// Physics steps a second (Hz).
    pub step_rate: f64,
    /// Latency of the models (s).
    pub latency: f64,
}

impl Draw {
    /// Draws cell number `cell` of the study of `seed`.
    pub fn new(seed: u64, cell: u64) -> Self {
        let chance = Chance::new(seed, cell).of("hold");
        let kinds = Kind::ALL.len() as u64;
        let kind = Kind::ALL[(cell % kinds) as usize];
        let devices: Vec<_> = DeviceModel::spatial().collect();
        let (device, model) = devices[(cell / kinds % devices.len() as u64) as usize];
        let scale = |n, [low, high]: [f64; 2]| low * libm::pow(high / low, chance.unit(n));
        let [soft, stiff] = STIFFNESS;
        let rate = scale(0, RATES);
        let (rate, step_rate) = if chance.unit(1) < PLAIN {
            (rate, rate)
        } else {
            // A whole number of steps, as in scene files.
            (1000.0 / (1000.0 / rate).round(), 1000.0)
        };
        // A strip that buckles swings by itself. The damping suppresses the frequencies that no model of 30 Hz can
        // resolve. A soft strip would buckle under a force that nobody feels.
        let buckles = kind == Kind::Buckling;
        let (softest, least) = if buckles { (2e3, 0.01) } else { (soft, 5e-4) };
        Self {
            kind,
            device: device.to_owned(),
            quadratic: kind.is_solid() && chance.unit(2) < 0.2,
            fineness: chance.unit(3),
            thickness: chance.unit(4),
            weight: kind.bends() && chance.unit(5) < 0.5,
            damping: [scale(6, [0.05, 5.0]), scale(7, [least, 0.03])],
            stiffness: scale(8, [softest, stiff.min(stiffest(&model))]),
            force: chance.between(9, 0.15, 0.55),
            grip: chance.unit(10),
            task: TASKS[(chance.unit(11) * TASKS.len() as f64) as usize],
            haste: chance.unit(12),
            rate,
            step_rate,
            latency: MOST_LATENCY * chance.unit(13),
        }
    }
}

/// The stiffest wall (N/m) that the friction of a device makes passive, however slowly a hand presses: `2 f_c / delta`
/// (Abbott and Okamura, "Effects of position quantization and sampling rate on virtual-wall passivity", 2005). Above
/// this stiffness a hold chatters over the encoder's counts.
pub fn stiffest(model: &DeviceModel) -> f64 {
    2.0 * model.friction / model.position_step
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn draws_repeat_and_stay_in_what_the_study_states() {
        let mut met = BTreeSet::new();
        for cell in 0..2000 {
            let draw = Draw::new(3, cell);
            assert_eq!(draw, Draw::new(3, cell));
            let model = DeviceModel::named(&draw.device).expect("it is carried along");
            // A number between two bounds is a power of their ratio, which rounds.
            let within = |x: f64, [low, high]: [f64; 2]| {
                assert!(x >= low * (1.0 - 1e-12) && x <= high * (1.0 + 1e-12), "{x}");
            };
            within(draw.stiffness, STIFFNESS);
            assert!(draw.stiffness <= stiffest(&model) * (1.0 + 1e-12));
            within(draw.rate, RATES);
            within(draw.latency, [0.0, MOST_LATENCY]);
            let steps = draw.step_rate / draw.rate;
            assert!((steps - steps.round()).abs() < 1e-9 * steps, "{steps}");
            met.insert((draw.kind, draw.device));
        }
        assert_eq!(met.len(), Kind::ALL.len() * DeviceModel::spatial().count());
    }
}
