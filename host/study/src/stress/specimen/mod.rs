//! The one drawing of bodies, hands and devices of `palpate stress hold` and `palpate stress scene`.
//!
//! The number of a cell decides the kind of the body and the device of the first hand in turn, so that every range of cells
//! contains the same fraction of each. The rest is drawn: how stiff the body is compared with its devices, how many hands
//! hold it and where, the direction of each hand on the sphere, the motion scales, the grips, the task, and the rates and the
//! latency of the host ([`Draw`]). A cell is a scene file (`shape`, `hands`) that `palpate run` repeats.
//!
//! How far the hands go is found by a march (`reach`): the hands move step by step along their directions until a device
//! meets the drawn fraction of its largest force, or until the body is strained as far as its kind allows. A direction that
//! is stiffer than its device therefore ends where the springs in series reach the force.
//!
//! **What the drawing leaves out.** Devices of one and two degrees of freedom; a hand that holds several places, a device that
//! holds several bodies, several bodies; meshes from files, nets of threads, flat patterns, holes and regions of another
//! material; tears; mountings that turn or move a device; sinusoids, recordings and buttons; ticks at another rate than
//! 1 kHz; devices that are real or emulated.

mod hands;
mod reach;
mod shape;

use super::scene::draw::{ARRIVED, BEGIN, Span};
use super::scene::rendered::Rendered;
use crate::StudyError;
use crate::chance::Chance;
use hands::Moves;
use host::scene::{LoadedScene, Scene};
use host::world::World;
use serde::{Deserialize, Serialize};
use shape::Shape;
use sim::DeviceModel;
use std::collections::BTreeMap;

/// Local models a second (Hz).
pub const RATES: [f64; 2] = [30.0, 1000.0];
/// The longest latency of a model, in publication periods.
pub const MOST_LATENCY: f64 = 2.0;
/// Fraction of the cells whose host publishes after every step.
const PLAIN: f64 = 0.4;
/// Steps a second of the other hosts (Hz).
const STEP_RATES: [f64; 3] = [250.0, 500.0, 1000.0];
/// Metres of the scene per metre of a device.
pub const SCALES: [f64; 2] = [0.3, 5.0];
/// The stiffest motion of the handles, as a multiple of what the devices render: of the half of the bodies that the devices
/// render as they are, and of the other half.
pub const RATIOS: [[f64; 2]; 2] = [[0.02, 1.0], [1.0, 300.0]];
/// The period at which the stiffness at rest is condensed (s). It is so long that inertia is negligible, and still holds a
/// membrane.
const SLOW: f64 = 1.0;

/// The kind of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A thread.
    Thread,
    /// An isotropic sheet that is held at an edge or at a patch.
    Sheet,
    /// Thin paper.
    Paper,
    /// A corotational woven sheet.
    Woven,
    /// A St. Venant-Kirchhoff woven sheet.
    WovenStVenantKirchhoff,
    /// An isotropic sheet that is fixed along all its edges.
    Plate,
    /// A strip that is pushed along itself until it buckles.
    Buckling,
    /// A slender block that is fixed at one end.
    Beam,
    /// A slender block between hands.
    Rod,
    /// A linear block (small strains and rotations).
    Linear,
    /// A corotational block (small strains, any rotation).
    Corotational,
    /// A St. Venant-Kirchhoff block (linear in the Green strain).
    StVenantKirchhoff,
    /// A neo-Hookean block (large strains).
    StableNeoHookean,
}

impl Kind {
    /// All kinds, in the order in which cells take them.
    pub const ALL: [Self; 13] = [
        Self::Linear,
        Self::Paper,
        Self::Beam,
        Self::Thread,
        Self::Corotational,
        Self::Sheet,
        Self::Rod,
        Self::Plate,
        Self::StVenantKirchhoff,
        Self::Woven,
        Self::Buckling,
        Self::StableNeoHookean,
        Self::WovenStVenantKirchhoff,
    ];

    /// The name of the kind in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Thread => "thread",
            Self::Sheet => "sheet",
            Self::Paper => "paper",
            Self::Woven => "woven sheet",
            Self::WovenStVenantKirchhoff => "woven sheet, St. Venant-Kirchhoff",
            Self::Plate => "plate",
            Self::Buckling => "buckling strip",
            Self::Beam => "beam",
            Self::Rod => "rod",
            Self::Linear => "linear block",
            Self::Corotational => "corotational block",
            Self::StVenantKirchhoff => "St. Venant-Kirchhoff block",
            Self::StableNeoHookean => "neo-Hookean block",
        }
    }

    /// Whether the body is a block of about equal sides.
    fn is_block(self) -> bool {
        matches!(
            self,
            Self::Linear | Self::Corotational | Self::StVenantKirchhoff | Self::StableNeoHookean
        )
    }

    /// Whether the body is a solid.
    fn is_solid(self) -> bool {
        self.is_block() || matches!(self, Self::Beam | Self::Rod)
    }

    /// Whether the body resists its own weight. A body without bending stiffness would swing under its weight.
    fn bends(self) -> bool {
        self.is_solid() || matches!(self, Self::Plate | Self::Buckling | Self::Paper)
    }
}

/// The motion of the hands before the hold.
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

/// A disturbance that takes a part of the force away for a while, so that the cell is judged by its hold alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Nothing.
    Nothing,
    /// The hands press fast.
    Fast,
    /// The devices limit the rate of change of their forces: `max_slew`.
    Slew,
    /// The host stalls. A scene file cannot say so: it is `--fault` of `palpate run`.
    Stall,
}

impl Cause {
    /// All causes, in the order of the tables.
    pub const ALL: [Self; 4] = [Self::Nothing, Self::Fast, Self::Slew, Self::Stall];

    /// The name of the cause in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Fast => "fast press",
            Self::Slew => "slew limit",
            Self::Stall => "stall",
        }
    }
}

/// One hand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DrawnHand {
    /// Its device, by its name among `sim::models::FILES`.
    pub device: String,
    /// Metres of the scene per metre of the device, a factor.
    pub scale: f64,
    /// Where it holds the body, as fractions along and across the part of the body that is its own.
    pub place: [f64; 2],
    /// Whether it holds the whole edge or end, if its part of the body has one.
    pub edge: bool,
    /// The direction of its motion, as fractions of its length.
    pub direction: [f64; 3],
    /// How far it goes, as a fraction of the hand that goes furthest.
    pub share: f64,
    /// The grip, from relaxed (0) to rigid (1).
    pub grip: f64,
}

/// All that is drawn for one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Draw {
    /// The kind of the body.
    pub kind: Kind,
    /// The hands, one to three.
    pub hands: Vec<DrawnHand>,
    /// Whether the body is fixed to a table or a wall, too.
    pub supported: bool,
    /// The stiffness of the stiffest motion of the handles at rest, a factor of what their devices render.
    pub ratio: f64,
    /// Whether tetrahedra are quadratic.
    pub quadratic: bool,
    /// How fine the mesh is, from 0 to 1.
    pub fineness: f64,
    /// How thick the body is, from 0 to 1.
    pub thickness: f64,
    /// Whether it has weight.
    pub weight: bool,
    /// Rayleigh damping: by mass (1/s) and by stiffness (s).
    pub damping: [f64; 2],
    /// The largest force of a hand in the hold, as a fraction of the largest force of its device.
    pub force: f64,
    /// The motion of the hands.
    pub task: Task,
    /// How fast the hands move, from 0 to 1.
    pub haste: f64,
    /// The disturbance that takes a part of the force away.
    pub cause: Cause,
    /// When: the time of a fast press or of a stall. For a slew limit, its duration is the time in which the force of a device
    /// may change by its largest force.
    pub span: Span,
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
        let chance = Chance::new(seed, cell).of("specimen");
        let kinds = Kind::ALL.len() as u64;
        let kind = Kind::ALL[(cell % kinds) as usize];
        let scale = |n, [low, high]: [f64; 2]| low * libm::pow(high / low, chance.unit(n));
        // Two hands are as frequent as one. A rod is held between hands.
        let count = [1, 1, 2, 2, 3][(chance.unit(0) * 5.0) as usize];
        let count = if kind == Kind::Rod {
            count.max(2)
        } else {
            count
        };
        let supported = match kind {
            Kind::Rod => false,
            Kind::Thread | Kind::Sheet | Kind::Paper => count == 1 || chance.unit(1) < 0.4,
            _ => true,
        };
        let (rate, step_rate, latency) = rates(chance.of("rates"));
        let (cause, span) = cause(chance.of("cause"));
        // A strip that buckles swings by itself. The damping suppresses the frequencies that no model of 30 Hz can
        // resolve.
        let least = if kind == Kind::Buckling { 0.01 } else { 5e-4 };
        Self {
            kind,
            hands: hands(chance, kind, supported, cell / kinds, count),
            supported,
            ratio: scale(2, RATIOS[usize::from(chance.unit(3) < 0.5)]),
            quadratic: kind.is_solid() && chance.unit(4) < 0.2,
            fineness: chance.unit(5),
            thickness: chance.unit(6),
            weight: kind.bends() && supported && chance.unit(7) < 0.5,
            damping: [scale(8, [0.05, 5.0]), scale(9, [least, 0.03])],
            force: chance.between(10, 0.15, 0.55),
            task: TASKS[(chance.unit(11) * TASKS.len() as f64) as usize],
            haste: chance.unit(12),
            cause,
            span,
            rate,
            step_rate,
            latency,
        }
    }

    /// The scene of the cell, under `name`, and its text in `source`.
    ///
    /// # Errors
    /// [`StudyError`] if the scene cannot be built.
    pub fn scene(&self, name: &str) -> Result<LoadedScene, StudyError> {
        let load = |young: f64, moves: Option<&Moves>| -> Result<_, StudyError> {
            let text = self.text(name, young, moves);
            Ok(Scene::load_texts("cell.toml", &text, &BTreeMap::new())?)
        };
        // The stiffness is proportional to the modulus. Weight is not: it is drawn for the modulus.
        let trial = load(TRIAL, None)?;
        let world = World::new(&trial)?;
        let mut body = world.bodies[0].body.clone();
        let devices: Vec<_> = (0..self.hands.len()).collect();
        let ratio = Rendered::new(&world, &devices, &mut body, SLOW)?.ratio();
        let young = TRIAL * self.ratio / ratio;
        let moves = reach::march(&load(young, None)?, self, self.shape().most)?;
        load(young, Some(&moves))
    }

    fn shape(&self) -> Shape {
        shape::shape(self)
    }

    /// The text of the scene with a Young's modulus of `young` (Pa). Without `moves` the hands stay.
    fn text(&self, name: &str, young: f64, moves: Option<&Moves>) -> String {
        let shape = self.shape();
        let gravity = if self.weight { -GRAVITY } else { 0.0 };
        let [mass, stiffness] = self.damping;
        let mut text = format!(
            "name = \"{name}\"\nduration = {:?}\nseed = 1\ngravity = [0.0, 0.0, {gravity:?}]\n\n\
             [host]\nstep_rate = {:?}\npublish_rate = {:?}\nlatency = {:?}\n\n\
             [[body]]\nname = \"{}\"\ndamping = {{ mass = {mass:?}, stiffness = {stiffness:?} }}\n{}",
            super::scene::draw::DURATION,
            self.step_rate,
            self.rate,
            self.latency,
            self.kind.name(),
            shape.body(self, young),
        );
        for (index, hand) in self.hands.iter().enumerate() {
            text.push_str(&hands::device(self, index, hand, moves));
        }
        text
    }

    /// The stalls of the host.
    pub(super) fn stalls(&self) -> Vec<Span> {
        let stalls = self.cause == Cause::Stall;
        stalls.then_some(self.span).into_iter().collect()
    }

    /// The model of the device of a hand.
    fn model(&self, hand: usize) -> DeviceModel {
        let named = DeviceModel::named(&self.hands[hand].device);
        named.expect("the drawing takes devices that are carried along")
    }
}

const GRAVITY: f64 = 9.81;
/// The modulus at which the stiffness is found (Pa).
const TRIAL: f64 = 1e6;

/// Publications and steps a second (Hz), and the latency (s).
fn rates(chance: Chance) -> (f64, f64, f64) {
    let [low, high] = RATES;
    let rate = low * libm::pow(high / low, chance.unit(0));
    let (rate, step_rate) = if chance.unit(1) < PLAIN {
        (rate, rate)
    } else {
        let steps = STEP_RATES[(chance.unit(2) * STEP_RATES.len() as f64) as usize].max(rate);
        // A whole number of steps, as in scene files.
        (steps / (steps / rate).floor(), steps)
    };
    // Half of the hosts are at most half a period late.
    (
        rate,
        step_rate,
        MOST_LATENCY * chance.unit(3).powi(2) / rate,
    )
}

/// Every cause is over in time for a hold of a second that begins a second later.
fn cause(chance: Chance) -> (Cause, Span) {
    let from_begin = |duration| Span {
        at: BEGIN,
        duration,
    };
    match (chance.unit(0) * 10.0) as u64 {
        0 => (Cause::Fast, from_begin(chance.between(1, 0.05, 0.15))),
        1 => (Cause::Slew, from_begin(chance.between(1, 0.3, 1.5))),
        2 => {
            let duration = 0.05 * libm::pow(20.0, chance.unit(1));
            let at = chance.between(2, BEGIN, ARRIVED - 0.1 - duration);
            (Cause::Stall, Span { at, duration })
        }
        _ => (Cause::Nothing, Span::default()),
    }
}

fn hands(chance: Chance, kind: Kind, supported: bool, turn: u64, count: usize) -> Vec<DrawnHand> {
    let devices: Vec<_> = DeviceModel::spatial().map(|(name, _)| name).collect();
    let together = supported && chance.unit(20) < 0.3;
    let opposed = chance.unit(21) < 0.5;
    let mut all: Vec<DrawnHand> = Vec::new();
    for index in 0..count {
        let chance = chance.of("hand").of(&index.to_string());
        let device = match index {
            0 => turn as usize % devices.len(),
            _ => (chance.unit(0) * devices.len() as f64) as usize,
        };
        let [low, high] = SCALES;
        let mut direction = on_sphere(chance);
        if kind == Kind::Buckling && index == 0 {
            // Along itself, towards the wall.
            direction = normalized([-3.0, direction[1], direction[2]]);
        }
        // Most threads are pulled: along themselves the last hand moves away from the rest.
        if kind == Kind::Thread && index + 1 == count && chance.unit(10) < 0.8 {
            direction[0] = direction[0].abs();
        }
        match all.first() {
            Some(first) if together => direction = first.direction,
            Some(first) if opposed && index == 1 => direction = first.direction.map(|x| -x),
            _ => {}
        }
        all.push(DrawnHand {
            device: devices[device].to_owned(),
            // Half of the devices move as far as the handles.
            scale: if chance.unit(3) < 0.5 {
                1.0
            } else {
                low * libm::pow(high / low, chance.unit(4))
            },
            place: [chance.unit(5), chance.unit(6)],
            edge: chance.unit(7) < 0.4,
            direction,
            share: if index == 0 {
                1.0
            } else {
                chance.between(8, 0.4, 1.0)
            },
            grip: chance.unit(9),
        });
    }
    all
}

/// A direction, uniform on the sphere.
fn on_sphere(chance: Chance) -> [f64; 3] {
    let height = chance.between(1, -1.0, 1.0);
    let turn = chance.between(2, 0.0, std::f64::consts::TAU);
    let radius = (1.0 - height * height).sqrt();
    [radius * libm::cos(turn), radius * libm::sin(turn), height]
}

fn normalized(vector: [f64; 3]) -> [f64; 3] {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    vector.map(|x| x / length)
}

#[cfg(test)]
mod tests;
