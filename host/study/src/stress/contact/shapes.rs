//! The obstacles of random worlds: shapes and closed meshes that stand, follow a table of poses, or change vertex by vertex.

use crate::chance::Chance;
use physics::Vec3;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Frames a second of an animated mesh (Hz).
const FRAME_RATE: f64 = 40.0;

/// The kind of an obstacle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Plane,
    Sphere,
    Capsule,
    Cylinder,
    Box,
    Mesh,
}

impl Kind {
    /// The kind of a number below one. No thing that has sides is a plane.
    pub(super) fn of(number: f64) -> Self {
        let all = [
            Self::Sphere,
            Self::Capsule,
            Self::Cylinder,
            Self::Box,
            Self::Mesh,
            Self::Mesh,
        ];
        all[(number * all.len() as f64) as usize]
    }
}

#[derive(Clone, Debug)]
enum Motion {
    Still,
    /// Times (s), places (m), and turns about the vertical (degrees).
    Poses(Vec<(f64, [f64; 3], f64)>),
    /// The vertices of each frame (m).
    Frames(Vec<Vec<Vec3>>),
}

/// An obstacle.
#[derive(Clone, Debug)]
pub(super) struct Obstacle {
    name: &'static str,
    kind: Kind,
    /// Half its extent (m).
    size: f64,
    friction: f64,
    position: [f64; 3],
    motion: Motion,
}

impl Obstacle {
    pub(super) fn new(name: &'static str, kind: Kind, size: f64, friction: f64) -> Self {
        Self {
            name,
            kind,
            size,
            friction,
            position: [0.0; 3],
            motion: Motion::Still,
        }
    }

    pub(super) fn floor(name: &'static str, friction: f64) -> Self {
        Self::new(name, Kind::Plane, 0.0, friction)
    }

    pub(super) fn at(&mut self, position: [f64; 3]) {
        self.position = position;
    }

    pub(super) fn follow(&mut self, poses: impl Into<Vec<(f64, [f64; 3], f64)>>) {
        self.motion = Motion::Poses(poses.into());
    }

    /// Grows and shrinks, in each direction at another time.
    pub(super) fn breathe(&mut self, chance: Chance, duration: f64) {
        let rate = chance.between(0, 0.5, 2.5);
        let (depth, lag) = (chance.between(1, 0.05, 0.3), chance.between(2, 0.0, 3.0));
        self.animate(duration, |out, t| {
            let phase = std::f64::consts::TAU * rate * t + lag * (out.x + 0.5 * out.y);
            out * (1.0 - depth * (0.5 - 0.5 * libm::cos(phase)))
        });
    }

    /// Moves to and fro along y, and is bent.
    pub(super) fn wander(&mut self, chance: Chance, duration: f64) {
        let (reach, bend) = (chance.between(8, 0.04, 0.12), chance.between(9, 0.0, 0.4));
        let size = self.size;
        self.animate(duration, |out, t| {
            let phase = std::f64::consts::TAU * t / duration;
            let to = 0.5 - 0.5 * libm::cos(phase);
            out + Vec3::new(0.0, -reach * to / size, bend * out.y * libm::sin(phase))
        });
    }

    fn animate(&mut self, duration: f64, place: impl Fn(&Vec3, f64) -> Vec3) {
        let (round, _) = round();
        let count = (duration * FRAME_RATE).ceil() as u32 + 1;
        let frames = (0..count).map(|frame| {
            let t = f64::from(frame) / FRAME_RATE;
            round.iter().map(|out| place(out, t) * self.size).collect()
        });
        self.motion = Motion::Frames(frames.collect());
    }

    /// Its kind and motion in words.
    pub(super) fn words(&self) -> String {
        let kind = match self.kind {
            Kind::Plane => "plane",
            Kind::Sphere => "sphere",
            Kind::Capsule => "capsule",
            Kind::Cylinder => "cylinder",
            Kind::Box => "box",
            Kind::Mesh => "mesh",
        };
        match self.motion {
            Motion::Still => format!("still {kind}"),
            Motion::Poses(_) => format!("moved {kind}"),
            Motion::Frames(_) => format!("animated {kind}"),
        }
    }

    /// The files that its part of the scene names.
    pub(super) fn files(&self) -> BTreeMap<String, Vec<u8>> {
        let mut files = BTreeMap::new();
        let (round, triangles) = round();
        let mut add = |name: String, positions: &[Vec3]| {
            files.insert(name, obj(positions, &triangles).into_bytes());
        };
        match &self.motion {
            Motion::Frames(frames) => {
                for (number, positions) in frames.iter().enumerate() {
                    add(format!("{}_{number:04}.obj", self.name), positions);
                }
            }
            Motion::Still | Motion::Poses(_) if self.kind == Kind::Mesh => {
                let positions: Vec<Vec3> = round.iter().map(|x| x * self.size).collect();
                add(format!("{}.obj", self.name), &positions);
            }
            Motion::Still | Motion::Poses(_) => {}
        }
        if let Motion::Poses(poses) = &self.motion {
            let mut text = String::from("time,x,y,z,qw,qx,qy,qz\n");
            for (time, [x, y, z], degrees) in poses {
                let (sine, cosine) = libm::sincos(0.5 * degrees.to_radians());
                let _ = writeln!(
                    text,
                    "{time:?},{x:?},{y:?},{z:?},{cosine:?},0.0,0.0,{sine:?}"
                );
            }
            files.insert(format!("{}.csv", self.name), text.into_bytes());
        }
        files
    }

    /// Its part of the scene.
    pub(super) fn scene(&self) -> String {
        let Self { name, size, .. } = *self;
        let shape = match self.kind {
            Kind::Plane => "shape = \"plane\"".to_owned(),
            Kind::Sphere => format!("shape = \"sphere\"\nradius = {size:?}"),
            Kind::Capsule => format!(
                "shape = \"capsule\"\nradius = {:?}\nlength = {size:?}",
                0.5 * size
            ),
            Kind::Cylinder => format!(
                "shape = \"cylinder\"\nradius = {:?}\nlength = {:?}",
                0.8 * size,
                1.6 * size
            ),
            Kind::Box => format!(
                "shape = \"box\"\nsize = {:?}",
                [1.6 * size, 1.8 * size, 1.5 * size]
            ),
            Kind::Mesh if matches!(self.motion, Motion::Frames(_)) => {
                format!("mesh = {{ file = \"{name}_####.obj\", frame_rate = {FRAME_RATE:?} }}")
            }
            Kind::Mesh => format!("mesh = {{ file = \"{name}.obj\" }}"),
        };
        let place = if matches!(self.motion, Motion::Poses(_)) {
            format!("poses = \"{name}.csv\"")
        } else {
            format!("position = {:?}", self.position)
        };
        let friction = self.friction;
        format!("\n[[obstacle]]\nname = \"{name}\"\n{shape}\n{place}\nfriction = {friction:?}\n")
    }
}

/// A round mesh of radius one: an octahedron whose triangles are divided by four. Its normals point outwards.
pub(super) fn round() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut x = vec![
        Vec3::x(),
        -Vec3::x(),
        Vec3::y(),
        -Vec3::y(),
        Vec3::z(),
        -Vec3::z(),
    ];
    let eighths = [
        [0, 2, 4],
        [2, 1, 4],
        [1, 3, 4],
        [3, 0, 4],
        [2, 0, 5],
        [1, 2, 5],
        [3, 1, 5],
        [0, 3, 5],
    ];
    let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    let mut triangles = Vec::new();
    for [a, b, c] in eighths {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[p, q]: [u32; 2]| {
            *middles.entry([p.min(q), p.max(q)]).or_insert_with(|| {
                let middle = (x[p as usize] + x[q as usize]).normalize();
                x.push(middle);
                x.len() as u32 - 1
            })
        });
        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    (x, triangles)
}

/// A mesh file.
pub(super) fn obj(positions: &[Vec3], triangles: &[[u32; 3]]) -> String {
    let mut text = String::new();
    for x in positions {
        let _ = writeln!(text, "v {:?} {:?} {:?}", x.x, x.y, x.z);
    }
    for [a, b, c] in triangles {
        let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    text
}
