//! Random worlds of tools: one or two hands press, tap, rub and shake tools of all shapes on soft bodies, sheets, blocks that lie free,
//! and obstacles.

use super::Case;
use super::shapes::{Kind, Obstacle, obj, round};
use super::strokes::{Stroke, Way};
use super::trouble::Troubles;
use crate::chance::Chance;
use crate::stress::scene::draw::grip;
use nalgebra::{UnitQuaternion, UnitVector3};
use physics::Vec3;
use sim::DeviceModel;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The length of a run, as a part of one without tools.
pub(super) const PART: f64 = 0.6;
/// One world in so many runs twice.
const REPEATED: u64 = 4;
/// The most friction.
const FRICTION: f64 = 0.6;
/// The hand of the adversary, which hardly yields: mass (kg), damping (N s/m) and stiffness (N/m).
const UNYIELDING: [f64; 3] = [0.3, 200.0, 5e4];
/// Publication rates of the host (Hz).
const RATES: [f64; 4] = [60.0, 90.0, 125.0, 250.0];
/// The latest message (s).
const LATEST: f64 = 0.016;
/// Names of the laws of solids.
const LAWS: [&str; 4] = [
    "linear",
    "corotational",
    "st_venant_kirchhoff",
    "stable_neo_hookean",
];

/// What lies in a world: its parts of the scene, and what tools meet.
#[derive(Default)]
struct Ground {
    text: String,
    bodies: Vec<String>,
    obstacles: Vec<Obstacle>,
    /// The half lengths (m) and the height of the middle (m) of what the tools touch, and the height above which there is nothing (m).
    half: Vec3,
    middle: f64,
    top: f64,
    /// How far beyond the surface the hands aim at most (m).
    deepest: f64,
    /// Whether the sides can be pushed, and whether an obstacle is in the way on the right.
    has_sides: bool,
    is_walled: bool,
}

/// The shape of a tool.
struct Shape {
    name: &'static str,
    text: String,
    /// The points that the radius (m) rounds, about the centre (m).
    corners: Vec<Vec3>,
    radius: f64,
    file: Option<(String, Vec<u8>)>,
}

impl Shape {
    /// How far the tool reaches along a direction from its centre (m).
    fn reach(&self, direction: &Vec3) -> f64 {
        let each = self.corners.iter().map(|corner| corner.dot(direction));
        each.fold(f64::NEG_INFINITY, f64::max) + self.radius
    }
}

/// The world of a cell, for a run of `duration` (s).
pub(super) fn case(seed: u64, cell: u64, duration: f64) -> Case {
    let chance = Chance::new(seed, cell).of("tools");
    let unit = |name: &str| chance.of(name).unit(0);
    let rate = RATES[(RATES.len() as f64 * unit("rate")) as usize];
    let steps = [1.0, 1.0, 2.0][(3.0 * unit("steps")) as usize];
    let latency = LATEST * unit("latency");
    let count = 1 + u64::from(unit("hands") < 0.5);
    let troubles = Troubles::new(chance, cell, duration, count as usize);
    let mut ground = Ground::of(chance);
    let weight = if unit("weight") < 0.4 { 0.0 } else { -9.81 };
    let mut text = format!(
        "name = \"tools\"\nduration = {duration:?}\nseed = {}\ngravity = [0.0, 0.0, {weight:?}]\n\n[host]\nstep_rate = {:?}\n\
         publish_rate = {rate:?}\nlatency = {latency:?}\n",
        1 + (unit("seed") * 1e6) as u64,
        steps * rate
    );
    for obstacle in &ground.obstacles {
        text.push_str(&obstacle.scene());
    }
    text.push_str(&ground.text);
    let (mut files, mut tools) = (BTreeMap::new(), Vec::new());
    for number in 0..count {
        let hand = Hand::new(chance, number, &ground);
        text.push_str(&hand.scene(chance, number, duration, 1.0 / rate));
        tools.push(hand.words());
        files.extend(hand.shape.file);
    }
    Case {
        tools,
        bodies: core::mem::take(&mut ground.bodies),
        obstacles: ground.obstacles.iter().map(Obstacle::words).collect(),
        host: troubles.host(rate, latency),
        troubles,
        runs: if cell.is_multiple_of(REPEATED) { 2 } else { 1 },
        ..Case::new(text, files)
    }
}

impl Ground {
    fn of(chance: Chance) -> Self {
        let unit = |name: &str| chance.of(name).unit(0);
        let between = |name: &str, low: f64, high: f64| chance.of(name).between(0, low, high);
        let mut ground = Self::default();
        let kind = unit("ground");
        if kind < 0.15 {
            ground.add_sheet(chance);
        } else if kind < 0.3 {
            ground.add_obstacle(chance, "thing", Vec3::zeros());
        } else if kind < 0.5 {
            let floor = Obstacle::floor("floor", between("floor", 0.0, FRICTION));
            ground.obstacles.push(floor);
            ground.add_solid(chance, true);
        } else {
            ground.add_solid(chance, false);
            if kind < 0.75 {
                let side = Vec3::x() * ground.half.x;
                ground.add_obstacle(chance, "beside", side);
                ground.is_walled = true;
            }
        }
        ground
    }

    /// A soft box. One that lies free stands on the floor.
    fn add_solid(&mut self, chance: Chance, is_free: bool) {
        let unit = |name: &str| chance.of(name).unit(0);
        let between = |name: &str, low: f64, high: f64| chance.of(name).between(0, low, high);
        let log = |name: &str, low: f64, high: f64| low * libm::pow(high / low, unit(name));
        let size = [
            between("length", 0.03, 0.08),
            between("width", 0.03, 0.08),
            between("height", 0.02, 0.04),
        ];
        let cells = size.map(|length| {
            (length / between("cell", 0.01, 0.016))
                .round()
                .clamp(2.0, 5.0) as u32
        });
        self.half = 0.5 * Vec3::from(size);
        (self.middle, self.top) = (self.half.z + 2e-4, size[2] + 2e-4);
        self.has_sides = true;
        self.deepest = 0.35 * size[2];
        let law = LAWS[(4.0 * unit("law")) as usize];
        let density = between("density", 300.0, 1100.0);
        let _ = write!(
            self.text,
            "\n[[body]]\nname = \"block\"\nposition = [0.0, 0.0, {:?}]\nmesh.box = {{ size = {size:?}, cells = {cells:?} }}\n\
             material = {{ law = \"{law}\", young = {:?}, poisson = {:?}, density = {density:?} }}\n\
             damping = {{ mass = {:?}, stiffness = {:?} }}\n",
            self.middle,
            log("young", 1e4, 1e5),
            between("poisson", 0.2, 0.45),
            between("mass", 0.05, 1.0),
            log("stiffness", 5e-4, 1e-2)
        );
        if is_free {
            self.bodies.push(format!("free block, {law}"));
        } else {
            self.text
                .push_str("\n[[body.support]]\nname = \"table\"\ngroup = \"bottom\"\n");
            self.bodies.push(format!("block, {law}"));
        }
    }

    /// A sheet that two sides hold.
    fn add_sheet(&mut self, chance: Chance) {
        let unit = |name: &str| chance.of(name).unit(0);
        let between = |name: &str, low: f64, high: f64| chance.of(name).between(0, low, high);
        let log = |name: &str, low: f64, high: f64| low * libm::pow(high / low, unit(name));
        let [length, width] = [between("length", 0.06, 0.12), between("width", 0.05, 0.1)];
        let cells =
            [length, width].map(|length| (length / between("cell", 0.01, 0.016)).round() as u32);
        let thickness = log("thickness", 3e-4, 2e-3);
        self.half = Vec3::new(0.4 * length, 0.4 * width, 0.0);
        self.top = 0.5 * thickness;
        self.deepest = 0.015;
        let _ = write!(
            self.text,
            "\n[[body]]\nname = \"sheet\"\n\
             mesh.sheet = {{ length = {length:?}, width = {width:?}, cells = {cells:?}, pattern = \"alternating\" }}\n\
             material = {{ young = {:?}, poisson = 0.3, thickness = {thickness:?}, density = 1000.0 }}\n\
             damping = {{ mass = {:?}, stiffness = {:?} }}\n",
            log("young", 1e5, 1e6),
            between("mass", 0.1, 2.0),
            log("stiffness", 5e-4, 1e-2)
        );
        for side in ["left", "right"] {
            let _ = write!(
                self.text,
                "\n[[body.support]]\nname = \"{side}\"\ngroup = \"{side}\"\n"
            );
        }
        self.bodies.push("sheet".to_owned());
    }

    /// An obstacle beside a place, about as high as what is there.
    fn add_obstacle(&mut self, chance: Chance, name: &'static str, place: Vec3) {
        let unit = |name: &str| chance.of(name).unit(0);
        let between = |name: &str, low: f64, high: f64| chance.of(name).between(0, low, high);
        let friction = between("friction of obstacle", 0.0, FRICTION);
        let size = between("size of obstacle", 0.015, 0.03);
        let kinds = [Kind::Box, Kind::Sphere, Kind::Capsule, Kind::Plane];
        // A plane is nothing beside a thing.
        let count = if self.bodies.is_empty() { 4.0 } else { 2.0 };
        let kind = kinds[(count * unit("kind of obstacle")) as usize];
        let mut obstacle = Obstacle::new(name, kind, size, friction);
        // A box reaches to 0.8 of its size along x, and to 0.75 up; a capsule of half the radius to its size up.
        let [aside, up] = match kind {
            Kind::Plane => [0.0, 0.0],
            Kind::Box => [0.8 * size, 0.75 * size],
            _ => [size, size],
        };
        let top = self.top + between("step", -3e-3, 3e-3);
        let x = place.x
            + if self.bodies.is_empty() {
                0.0
            } else {
                aside + 2e-4
            };
        let top = if kind == Kind::Plane { 0.0 } else { top };
        obstacle.at([x, 0.0, top - up]);
        if self.bodies.is_empty() {
            (self.half, self.middle) = (Vec3::new(aside.max(0.02), 0.6 * size, 0.0), top);
            self.deepest = 0.02;
        }
        self.top = self.top.max(top);
        self.obstacles.push(obstacle);
    }
}

/// A hand with its tool.
struct Hand {
    shape: Shape,
    /// Where the tool begins (m), and where it goes.
    start: Vec3,
    way: Way,
    stroke: Stroke,
    model: &'static str,
    turns: bool,
}

impl Hand {
    fn new(chance: Chance, number: u64, ground: &Ground) -> Self {
        let chance = chance.of("hand");
        let unit = |name: &str| chance.of(name).unit(number);
        let between = |name: &str, low: f64, high: f64| chance.of(name).between(number, low, high);
        let models: Vec<_> = DeviceModel::spatial().collect();
        let turning = models.iter().find(|(_, model)| model.rotation.is_some());
        let plain = models[(models.len() as f64 * unit("model")) as usize];
        let (model, numbers) = turning
            .filter(|_| unit("turns") < 0.4)
            .copied()
            .unwrap_or(plain);
        let shape = shape(chance, number);
        let (gap, depth) = (
            between("gap", 1e-3, 8e-3),
            between("depth", 1e-3, ground.deepest),
        );
        let across = |name: &str, half: f64| between(name, -half, half);
        let is_aside = ground.has_sides && unit("aside") < 0.35;
        let (surface, inward) = if is_aside {
            // Of two hands, one pushes each way. The obstacle is on the other side of the first one.
            let side = if number == 0 || ground.is_walled {
                -1.0
            } else {
                1.0
            };
            let low = shape.reach(&-Vec3::z()) + 1e-3;
            let y = across("y", 0.5 * ground.half.y);
            let surface = Vec3::new(side * ground.half.x, y, ground.middle.max(low));
            (surface, Vec3::x() * -side)
        } else {
            let [x, y] = [
                across("x", 1.1 * ground.half.x),
                across("y", 1.1 * ground.half.y),
            ];
            (Vec3::new(x, y, ground.top), -Vec3::z())
        };
        let angle = between("along", 0.0, std::f64::consts::TAU);
        let (sine, cosine) = libm::sincos(angle);
        let along = if is_aside {
            Vec3::y() * cosine
        } else {
            Vec3::new(cosine, sine, 0.0)
        };
        Self {
            start: surface - inward * (gap + shape.reach(&inward)),
            way: Way {
                inward,
                along,
                gap,
                depth,
                width: between("width", 2e-3, 0.02),
            },
            stroke: Stroke::of(unit("stroke")),
            model,
            turns: numbers.rotation.is_some(),
            shape,
        }
    }

    /// Its tool, device and motion in words.
    fn words(&self) -> String {
        let (shape, model) = (self.shape.name, self.model);
        format!("{shape} on {model} {}", self.stroke.name())
    }

    /// Its part of the scene of a run of `duration` (s), with a host of this period (s).
    fn scene(&self, chance: Chance, number: u64, duration: f64, period: f64) -> String {
        let chance = chance.of("hand");
        let unit = |name: &str| chance.of(name).unit(number);
        let [x, y, z]: [f64; 3] = self.start.into();
        let friction = FRICTION * unit("friction");
        let holds = unit("holds") < 0.15;
        let mut text = format!(
            "\n[[tool]]\nname = \"tool {number}\"\ndevice = \"hand {number}\"\nposition = [{x:?}, {y:?}, {z:?}]\n\
             friction = {friction:?}\n{}{}",
            self.shape.text,
            if holds { "take_button = 1\n" } else { "" }
        );
        let [mass, damping, stiffness] = if self.stroke == Stroke::Loop {
            UNYIELDING
        } else {
            let grip = grip(chance.of("grip"), number);
            [grip.mass, grip.damping, grip.stiffness]
        };
        let own = chance.of(["left", "right"][number as usize]);
        let points = self.way.points(self.stroke, own, duration, period);
        let rows = points.iter().map(|(time, to)| {
            let [x, y, z]: [f64; 3] = (*to).into();
            format!("[{time:?}, {x:?}, {y:?}, {z:?}]")
        });
        let _ = write!(
            text,
            "\n[[device]]\nname = \"hand {number}\"\nmodel = \"{}\"\nwire = {}\n\n[device.hand]\nmass = {mass:?}\n\
             damping = {damping:?}\nstiffness = {stiffness:?}\ntremor = 0.0001\nwaypoints = [{}]\n",
            self.model,
            unit("wire") < 0.5,
            rows.collect::<Vec<_>>().join(", ")
        );
        if holds {
            let [from, to] = [0.3, 0.7].map(|part| part * duration);
            let _ = writeln!(
                text,
                "presses = [{{ button = 1, from = {from:?}, to = {to:?} }}]"
            );
        }
        if self.turns {
            let turn = |n: u64, part: f64| {
                let [x, y, z] =
                    [0, 1, 2].map(|axis| own.of("turns").between(3 * n + axis, -0.25, 0.25));
                format!("[{:?}, {x:?}, {y:?}, {z:?}]", part * duration)
            };
            let _ = writeln!(
                text,
                "turns = [[{:?}, 0.0, 0.0, 0.0], {}, {}]",
                0.2 * duration,
                turn(0, 0.45),
                turn(1, 0.7)
            );
        }
        text
    }
}

/// The shape of the tool of this number.
fn shape(chance: Chance, number: u64) -> Shape {
    let unit = |name: &str| chance.of(name).unit(number);
    let between = |name: &str, low: f64, high: f64| chance.of(name).between(number, low, high);
    let box_of = |half: Vec3| -> Vec<Vec3> {
        let corners = (0..8).map(|corner| {
            Vec3::from_fn(|axis, _| f64::from(2 * (corner >> axis & 1) - 1) * half[axis])
        });
        corners.collect()
    };
    let mut file = None;
    let kind = unit("shape");
    let (name, radius, corners, sizes) = if kind < 0.25 {
        (
            "sphere",
            between("radius", 3e-3, 0.012),
            vec![Vec3::zeros()],
            String::new(),
        )
    } else if kind < 0.45 {
        let length = between("length", 5e-3, 0.03);
        let ends = [0.5, -0.5].map(|part| Vec3::z() * (part * length));
        let sizes = format!("length = {length:?}\n");
        (
            "capsule",
            between("radius", 3e-3, 8e-3),
            ends.to_vec(),
            sizes,
        )
    } else if kind < 0.65 {
        let [length, width] = [
            between("length", 0.012, 0.04),
            between("width", 0.012, 0.03),
        ];
        let radius = between("radius", 1e-3, 4e-3);
        let half = 0.5 * Vec3::new(length, width, 2.0 * radius) - Vec3::repeat(radius);
        let sizes = format!("length = {length:?}\nwidth = {width:?}\n");
        ("plate", radius, box_of(half), sizes)
    } else if kind < 0.85 {
        let size = ["length", "width", "height"].map(|name| between(name, 8e-3, 0.025));
        let radius = between("radius", 1e-3, 3e-3);
        let half = 0.5 * Vec3::from(size) - Vec3::repeat(radius);
        ("box", radius, box_of(half), format!("size = {size:?}\n"))
    } else {
        let (points, triangles) = round();
        let half = Vec3::from(["length", "width", "height"].map(|name| between(name, 4e-3, 0.012)));
        let of = chance.of("hull");
        let points: Vec<Vec3> = (0..)
            .zip(&points)
            .map(|(n, out)| out.component_mul(&half) * of.between(32 * number + n, 0.8, 1.2))
            .collect();
        let name = format!("hull_{number}.obj");
        let sizes = format!("mesh = {{ file = \"{name}\" }}\n");
        file = Some((name, obj(&points, &triangles).into_bytes()));
        ("hull", between("radius", 1e-3, 3e-3), points, sizes)
    };
    let mut text = format!("shape = \"{name}\"\nradius = {radius:?}\n{sizes}");
    let mut turned = corners;
    if unit("turned") < 0.6 {
        let axis = ["x", "y", "z"].map(|name| between(&format!("axis {name}"), -1.0, 1.0));
        let degrees = between("degrees", -180.0, 180.0);
        let turn = UnitQuaternion::from_axis_angle(
            &UnitVector3::new_normalize(axis.into()),
            degrees.to_radians(),
        );
        for corner in &mut turned {
            *corner = turn * *corner;
        }
        let _ = writeln!(
            text,
            "rotation = {{ axis = {axis:?}, degrees = {degrees:?} }}"
        );
    }
    Shape {
        name,
        text,
        corners: turned,
        radius,
        file,
    }
}
