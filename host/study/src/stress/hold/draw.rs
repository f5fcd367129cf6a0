//! What a cell's number decides: the specimen, the device, who holds it, what the hand does, and how the host is.
//!
//! Specimens and devices follow the cell's number in turn, so that any stretch of cells has the same share of each; the
//! rest is drawn.

use crate::stress::chance::Chance;
use serde::{Deserialize, Serialize};
use sim::DeviceModel;

/// Stiffness at the handle (N/m), from the softest to the stiffest specimen.
pub const STIFFNESS: [f64; 2] = [100.0, 15_000.0];
/// Local models a second (Hz).
pub const RATES: [f64; 2] = [30.0, 1000.0];
/// The latest that a model comes (s).
pub const MOST_LATENCY: f64 = 0.02;
/// Share of the cells whose host publishes after every step.
const PLAIN: f64 = 0.4;

/// What is pressed, pulled or pushed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A block of small strains and rotations, bonded to a table.
    Linear,
    /// The same of small strains and any rotation.
    Corotational,
    /// The same, linear in the Green strain.
    StVenantKirchhoff,
    /// The same of large strains.
    StableNeoHookean,
    /// An isotropic sheet, pulled in its plane.
    Sheet,
    /// The same, held all around and pressed in its middle.
    Plate,
    /// A corotational woven sheet, pulled in its plane.
    Woven,
    /// A St. Venant-Kirchhoff woven sheet, pulled in its plane.
    WovenStVenantKirchhoff,
    /// A strip that is pushed along itself until it buckles.
    Buckling,
}

impl Kind {
    /// All of them, in the order in which cells take them.
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

    /// What tables call it.
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

    /// Whether it resists its weight by itself: what has no stiffness of bending would swing under it.
    fn bends(self) -> bool {
        self.is_solid() || matches!(self, Self::Plate | Self::Buckling)
    }

    /// Whether it is a solid.
    pub fn is_solid(self) -> bool {
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
    /// Go there and stay.
    Press,
    /// The same, trembling.
    Tremble,
    /// Go there, slowly to and fro across, and stay.
    Rub,
    /// Go there in three stages.
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
    /// Static stiffness at the handle, the way it goes (N/m).
    pub stiffness: f64,
    /// The hand's force when it is there, as a share of the device's largest.
    pub force: f64,
    /// The grip, from relaxed (0) to rigid (1).
    pub grip: f64,
    /// What the hand does.
    pub task: Task,
    /// How fast it is, from 0 to 1.
    pub haste: f64,
    /// Local models a second (Hz).
    pub rate: f64,
    /// Physics steps a second (Hz).
    pub step_rate: f64,
    /// How late models are (s).
    pub latency: f64,
}

impl Draw {
    /// Draws cell number `cell` of the study of `seed`.
    pub fn new(seed: u64, cell: u64) -> Self {
        let chance = Chance::new(seed, cell).of("hold");
        let kinds = Kind::ALL.len() as u64;
        let kind = Kind::ALL[(cell % kinds) as usize];
        let devices: Vec<_> = DeviceModel::all().collect();
        let (device, model) = devices[(cell / kinds % devices.len() as u64) as usize];
        let scale = |n, [low, high]: [f64; 2]| low * libm::pow(high / low, chance.unit(n));
        let [soft, stiff] = STIFFNESS;
        let rate = scale(0, RATES);
        let (rate, step_rate) = if chance.unit(1) < PLAIN {
            (rate, rate)
        } else {
            // After a whole number of steps, as scenes have it.
            (1000.0 / (1000.0 / rate).round(), 1000.0)
        };
        // A strip that buckles swings by itself: what no model of 30 Hz can tell is damped out. A soft one buckles under
        // a force that nobody feels.
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

/// The stiffest wall (N/m) that a device's friction stands, however slowly it is pressed: `2 f_c / delta` (Abbott and
/// Okamura, "Effects of position quantization and sampling rate on virtual-wall passivity", 2005). Beyond it a hold
/// buzzes by the encoder's counts.
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
            // What lies between two numbers is a power of their ratio, which rounds.
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
        assert_eq!(met.len(), Kind::ALL.len() * DeviceModel::all().count());
    }
}
