//! The draw of a world: bodies in layers, what lies under them, what moves through them, two hands, and the trouble of the
//! host and the devices.

use super::shapes::{Kind, Obstacle};
use super::trouble::Troubles;
use crate::chance::Chance;
use crate::stress::scene::draw::Draw as Host;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Length of a run (s), and of a quick one.
pub(super) const DURATIONS: [f64; 2] = [1.2, 0.5];
/// The time in which the hands move, as fractions of a run.
const MOVES: [f64; 4] = [0.08, 0.35, 0.6, 0.85];
/// How far a hand moves along x, along y and up (m). Handles of different bodies and obstacles under them stay apart.
const REACH: [f64; 3] = [0.012, 0.025, 0.025];
/// The part of the room under a handle that a hand takes.
const PRESSED: f64 = 0.3;
/// The most friction.
const FRICTION: f64 = 1.2;

/// A body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Form {
    /// A sheet of a length and a width (m), with cells and a thickness (m).
    Sheet([f64; 2], [u32; 2], f64),
    /// A box with the lengths of its edges (m) and cells.
    Solid([f64; 3], [u32; 3]),
    /// A thread of a length (m), with segments and a cross-section (m²).
    Thread(f64, u32, f64),
}

impl Form {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Sheet(..) => "sheet",
            Self::Solid(..) => "solid",
            Self::Thread(..) => "thread",
        }
    }

    /// Its height (m).
    fn height(self) -> f64 {
        match self {
            Self::Sheet(_, _, thickness) => thickness,
            Self::Solid(size, _) => size[2],
            Self::Thread(_, _, area) => 2.0 * (area / std::f64::consts::PI).sqrt(),
        }
    }
}

/// A body in its layer.
#[derive(Clone, Debug)]
pub(super) struct Laid {
    pub(super) form: Form,
    /// The height of its middle (m).
    z: f64,
    /// The room under it (m).
    room: f64,
    /// Its rotation about the vertical (degrees).
    yaw: f64,
    /// Young's modulus (Pa).
    young: f64,
    damping: [f64; 2],
    touches_itself: bool,
    /// Strength (Pa) and toughness (J/m²) of a sheet that tears.
    pub(super) tear: Option<[f64; 2]>,
    /// The devices that hold it: left and right.
    held: [bool; 2],
}

/// A world.
#[derive(Clone, Debug)]
pub(super) struct Draw {
    pub(super) bodies: Vec<Laid>,
    /// Names of bodies that touch each other, with the friction.
    pairs: Vec<([usize; 2], f64)>,
    pub(super) obstacles: Vec<Obstacle>,
    weight: bool,
    /// The places of the hands (m) from where they start, at [`MOVES`].
    hands: [[[f64; 3]; 4]; 2],
    /// Steps and publications a second (Hz).
    rates: [f64; 2],
    /// Latency of the host (s).
    latency: f64,
    pub(super) troubles: Troubles,
    duration: f64,
    seed: u64,
}

impl Draw {
    /// The draw of a cell, for a run of `duration` (s).
    pub(super) fn new(seed: u64, cell: u64, duration: f64) -> Self {
        let chance = Chance::new(seed, cell);
        let unit = |name: &str| chance.of(name).unit(0);
        let between = |name: &str, low: f64, high: f64| chance.of(name).between(0, low, high);
        let troubles = Troubles::new(chance, cell, duration, 2);
        let (mut obstacles, mut top) = Obstacle::below(chance, duration);
        let mut bodies = Vec::new();
        let count = [1, 2, 2, 3, 3, 4][(6.0 * unit("bodies")) as usize];
        let owners = [
            (unit("left owner") * count as f64) as usize,
            (unit("right owner") * count as f64) as usize,
        ];
        for number in 0..count {
            let mut laid = laid(chance, number);
            let gap = chance.of("gap").between(number as u64, 1e-3, 3e-3);
            let height = laid.form.height();
            laid.z = top + gap + 0.5 * height;
            laid.room = match laid.form {
                Form::Solid(..) => height,
                // What lies under the handle of a sheet may be hard.
                Form::Sheet(..) | Form::Thread(..) => 2.5 * gap,
            };
            top += gap + height;
            laid.held = [0, 1].map(|hand| owners[hand] == number);
            if laid.held != [false; 2] {
                laid.yaw = 0.0;
            }
            bodies.push(laid);
        }
        obstacles.extend(Obstacle::passing(chance, top, duration));
        let mut pairs = Vec::new();
        for one in 0..count {
            for other in one + 1..count {
                let of = chance.of("pair");
                let number = (8 * one + other) as u64;
                if of.unit(number) < 0.9 {
                    pairs.push(([one, other], of.between(64 + number, 0.0, FRICTION)));
                }
            }
        }
        let hands = [0, 1].map(|hand| {
            let of = chance.of(["left hand", "right hand"][hand]);
            let room = bodies[owners[hand]].room;
            let mut number = 0;
            MOVES.map(|_| {
                [0, 1, 2].map(|axis| {
                    number += 1;
                    let down = if axis == 2 {
                        PRESSED * room
                    } else {
                        REACH[axis]
                    };
                    of.between(number, -down, REACH[axis])
                })
            })
        });
        let step_rate = [125.0, 250.0, 250.0, 500.0][(4.0 * unit("step rate")) as usize];
        let every = [1.0, 2.0, 4.0][(3.0 * unit("every")) as usize];
        Self {
            bodies,
            pairs,
            obstacles,
            weight: unit("weight") < 0.7,
            hands,
            rates: [step_rate, step_rate / every],
            latency: if troubles.is_late() {
                between("latency", 2e-3, 0.02)
            } else {
                1e-3
            },
            troubles,
            duration,
            seed: 1 + (unit("seed") * 1e6) as u64,
        }
    }

    /// The host, with the losses of its link.
    pub(super) fn host(&self) -> Host {
        self.troubles.host(self.rates[1], self.latency)
    }

    /// The files that the scene names.
    pub(super) fn files(&self) -> BTreeMap<String, Vec<u8>> {
        self.obstacles.iter().flat_map(Obstacle::files).collect()
    }

    /// The scene, as `palpate run` reads it.
    pub(super) fn scene(&self) -> String {
        let weight = if self.weight { -9.81 } else { 0.0 };
        let mut text = format!(
            "name = \"contact\"\nduration = {:?}\nseed = {}\ngravity = [0.0, 0.0, {weight:?}]\n\n[host]\n\
             step_rate = {:?}\npublish_rate = {:?}\nlatency = {:?}\n",
            self.duration, self.seed, self.rates[0], self.rates[1], self.latency
        );
        for obstacle in &self.obstacles {
            text.push_str(&obstacle.scene());
        }
        for (number, body) in self.bodies.iter().enumerate() {
            text.push_str(&body.scene(number));
        }
        for ([one, other], friction) in &self.pairs {
            let _ = write!(
                text,
                "\n[[contact]]\nbetween = [\"body {one}\", \"body {other}\"]\nfriction = {friction:?}\n"
            );
        }
        for (hand, places) in self.hands.iter().enumerate() {
            let each = MOVES.iter().zip(places).map(|(part, [x, y, z])| {
                format!("[{:?}, {x:?}, {y:?}, {z:?}]", part * self.duration)
            });
            let _ = write!(
                text,
                "\n[[device]]\nname = \"hand {hand}\"\nmodel = \"omega3\"\n\n[device.hand]\ngrip = \"firm\"\n\
                 tremor = 0.0001\nwaypoints = [[0.0, 0.0, 0.0, 0.0], {}]\n",
                each.collect::<Vec<_>>().join(", ")
            );
        }
        text
    }
}

impl Laid {
    fn scene(&self, number: usize) -> String {
        let young = self.young;
        let (mesh, material) = match self.form {
            Form::Sheet([length, width], [along, across], thickness) => (
                format!(
                    "sheet = {{ length = {length:?}, width = {width:?}, cells = [{along}, {across}], \
                     pattern = \"alternating\" }}"
                ),
                format!("poisson = 0.3, thickness = {thickness:?}, density = 1000.0"),
            ),
            Form::Solid(size, cells) => (
                format!("box = {{ size = {size:?}, cells = {cells:?} }}"),
                "poisson = 0.35, density = 600.0".to_owned(),
            ),
            Form::Thread(length, segments, area) => (
                format!("thread = {{ length = {length:?}, segments = {segments} }}"),
                format!("poisson = 0.4, area = {area:?}, density = 1100.0"),
            ),
        };
        let mut text = format!(
            "\n[[body]]\nname = \"body {number}\"\nposition = [0.0, 0.0, {:?}]\n\
             rotation = {{ axis = [0, 0, 1], degrees = {:?} }}\nself_contact = {}\nmesh.{mesh}\n\
             material = {{ young = {young:?}, {material} }}\ndamping = {{ mass = {:?}, stiffness = {:?} }}\n",
            self.z, self.yaw, self.touches_itself, self.damping[0], self.damping[1]
        );
        if let Some([strength, toughness]) = self.tear {
            let _ = writeln!(
                text,
                "tear = {{ strength = {strength:?}, toughness = {toughness:?}, starts = \"anywhere\" }}"
            );
        }
        for (hand, _) in self.held.iter().enumerate().filter(|(_, held)| **held) {
            // One hand presses a solid from above, two bend it.
            let is_pressed = matches!(self.form, Form::Solid(..)) && self.held != [true; 2];
            let group = if is_pressed {
                "top"
            } else {
                ["left", "right"][hand]
            };
            let _ = write!(
                text,
                "\n[[body.handle]]\nname = \"grip {hand}\"\ngroup = \"{group}\"\ndevice = \"hand {hand}\"\n"
            );
        }
        text
    }
}

/// The body of this number, not yet in its layer.
fn laid(chance: Chance, number: usize) -> Laid {
    let of = |name: &str| chance.of(name).unit(number as u64);
    let between =
        |name: &str, low: f64, high: f64| chance.of(name).between(number as u64, low, high);
    let log =
        |name: &str, low: f64, high: f64| libm::exp(between(name, libm::log(low), libm::log(high)));
    let count = |name: &str, low: f64, high: f64| between(name, low, high + 1.0) as u32;
    let kind = of("form");
    let form = if kind < 0.5 {
        let size = [between("length", 0.06, 0.1), between("width", 0.04, 0.08)];
        let cells = [count("along", 4.0, 8.0), count("across", 4.0, 8.0)];
        Form::Sheet(size, cells, log("thickness", 2e-4, 1e-3))
    } else if kind < 0.8 {
        let size = [
            between("length", 0.03, 0.06),
            between("width", 0.03, 0.06),
            between("height", 0.015, 0.03),
        ];
        let cells = [count("along", 2.0, 4.0), count("across", 2.0, 4.0), 2];
        Form::Solid(size, cells)
    } else {
        let length = between("length", 0.06, 0.12);
        Form::Thread(
            length,
            count("segments", 8.0, 20.0),
            log("area", 2e-7, 3e-6),
        )
    };
    let young = match form {
        Form::Sheet(..) => log("young", 2e5, 5e6),
        Form::Solid(..) => log("young", 5e3, 5e4),
        Form::Thread(..) => log("young", 1e6, 1e7),
    };
    let tears = matches!(form, Form::Sheet(..)) && of("tears") < 0.3;
    Laid {
        form,
        z: 0.0,
        room: 0.0,
        yaw: between("yaw", -90.0, 90.0),
        young,
        damping: [between("mass", 0.1, 2.0), log("stiffness", 2e-4, 3e-3)],
        touches_itself: of("itself") < 0.5,
        tear: tears.then(|| {
            [
                young * between("strength", 0.05, 0.3),
                log("toughness", 50.0, 1000.0),
            ]
        }),
        held: [false; 2],
    }
}

impl Obstacle {
    /// What is under the bodies: mostly a floor, and often a thing on it. Returns the height above which there is room (m).
    fn below(chance: Chance, duration: f64) -> (Vec<Self>, f64) {
        let of = |name: &str| chance.of(name).unit(0);
        let friction = |name: &str| chance.of(name).between(0, 0.0, FRICTION);
        let mut all = Vec::new();
        if of("floor") < 0.85 {
            all.push(Self::floor("floor", friction("friction of floor")));
        }
        if of("under") < 0.45 {
            let kind = Kind::of(of("kind of under"));
            let size = chance.of("size of under").between(0, 0.008, 0.02);
            let is_animated = kind == Kind::Mesh && of("animated") < 0.7;
            let mut under = Self::new("under", kind, size, friction("friction of under"));
            // A little above the floor, which it may not touch while it breathes.
            under.at([0.0, 0.0, 1.5 * size]);
            if is_animated {
                under.breathe(chance.of("breath"), duration);
            }
            all.push(under);
            return (all, 3.0 * size + 1e-3);
        }
        (all, 0.0)
    }

    /// What passes through the layers between two heights, beside the handles.
    fn passing(chance: Chance, top: f64, duration: f64) -> Option<Self> {
        let of = |name: &str| chance.of(name).unit(0);
        (of("passing") < 0.5).then(|| {
            let kind = Kind::of(of("kind of passing"));
            let size = chance.of("size of passing").between(0, 0.006, 0.015);
            let friction = chance.of("friction of passing").between(0, 0.0, FRICTION);
            let mut passing = Self::new("passing", kind, size, friction);
            let of = chance.of("path");
            let side = 0.09 + 1.8 * size;
            let height = of
                .between(0, 0.5 * top, top + 0.5 * size)
                .max(1.8 * size + 1e-3);
            let along = of.between(1, -0.012, 0.012);
            if kind == Kind::Mesh && of.unit(2) < 0.3 {
                passing.at([along, side, height]);
                passing.wander(of, duration);
            } else {
                let end = of.between(3, -0.06, 0.03);
                passing.follow([
                    (0.0, [along, side, height], 0.0),
                    (
                        of.between(4, 0.05, 0.2) * duration,
                        [along, side, height],
                        0.0,
                    ),
                    (
                        of.between(5, 0.6, 0.9) * duration,
                        [along, end, height],
                        of.between(6, -90.0, 90.0),
                    ),
                    (duration, [along, side, height], 0.0),
                ]);
            }
            passing
        })
    }
}
