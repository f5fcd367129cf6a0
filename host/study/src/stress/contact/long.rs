//! Worlds that stay in contact for 100,000 steps: a banknote that walls crumple, and a stack of sheets on a floor that rocks.

use super::Case;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt::Write as _;

/// Steps of a run, and steps a second (Hz).
const STEPS: f64 = 1e5;
const RATE: f64 = 250.0;
/// The time between two rows of a table of poses (s).
const ROW: f64 = 0.25;
/// Steps between two tests of all edges and triangles.
const EVERY: u64 = 10;

/// The worlds.
pub(super) fn cases() -> [Case; 2] {
    [note(), stack()]
}

fn head(name: &str) -> String {
    format!(
        "name = \"{name}\"\nduration = {:?}\n\n[host]\nstep_rate = {RATE:?}\npublish_rate = {RATE:?}\n\n\
         [[device]]\nname = \"idle\"\nmodel = \"falcon\"\nhand = {{}}\n",
        STEPS / RATE
    )
}

fn case(name: &str, text: String, files: BTreeMap<String, Vec<u8>>) -> Case {
    Case {
        bodies: vec![name.to_owned()],
        every: EVERY,
        runs: 1,
        ..Case::new(text, files)
    }
}

/// A table of poses: at each time (s) a place (m), and a turn about y (rad).
fn poses(of: impl Fn(f64) -> ([f64; 3], f64)) -> Vec<u8> {
    let mut text = String::from("time,x,y,z,qw,qx,qy,qz\n");
    for row in 0..=(STEPS / RATE / ROW) as u32 {
        let t = f64::from(row) * ROW;
        let ([x, y, z], angle) = of(t);
        let (sine, cosine) = libm::sincos(0.5 * angle);
        let _ = writeln!(text, "{t:?},{x:?},{y:?},{z:?},{cosine:?},0.0,{sine:?},0.0");
    }
    text.into_bytes()
}

/// A banknote on a floor with a bump. Walls close in from the sides, a lid comes down, and all of them go on to tremble.
fn note() -> Case {
    let mut text = head("note");
    text.push_str(
        r#"
[[obstacle]]
name = "floor"
shape = "plane"
friction = 0.4

[[obstacle]]
name = "bump"
shape = "sphere"
radius = 0.004
position = [0.011, 0.005, 0.0]

[[body]]
name = "note"
position = [0.0, 0.0, 0.0045]
self_contact = true
mesh.sheet = { length = 0.132, width = 0.066, cells = [24, 12], pattern = "alternating" }
material = { young = 3e9, poisson = 0.3, thickness = 0.0001, density = 900.0 }
damping = { mass = 1.0, stiffness = 0.0001 }
"#,
    );
    let mut files = BTreeMap::new();
    // From a place to another one, between two times.
    let closes = |t: f64, [from, to]: [f64; 2], [begin, end]: [f64; 2]| {
        let tremble = if t > end {
            0.0005 * libm::sin(0.2 * TAU * (t - end))
        } else {
            0.0
        };
        from + (to - from) * ((t - begin) / (end - begin)).clamp(0.0, 1.0) + tremble
    };
    let mut add = |name: &str, size: [f64; 3], of: &dyn Fn(f64) -> [f64; 3]| {
        let _ = write!(
            text,
            "\n[[obstacle]]\nname = \"{name}\"\nshape = \"box\"\nsize = {size:?}\nposes = \"{name}.csv\"\nfriction = 0.3\n"
        );
        files.insert(format!("{name}.csv"), poses(|t| (of(t), 0.0)));
    };
    for (name, side) in [("left", -1.0), ("right", 1.0)] {
        add(name, [0.02, 0.2, 0.12], &|t| {
            [side * closes(t, [0.08, 0.042], [0.5, 6.0]), 0.0, 0.05]
        });
    }
    for (name, side) in [("front", -1.0), ("back", 1.0)] {
        add(name, [0.2, 0.02, 0.12], &|t| {
            [0.0, side * closes(t, [0.048, 0.03], [6.0, 10.0]), 0.05]
        });
    }
    add("lid", [0.2, 0.2, 0.02], &|t| {
        [0.0, 0.0, closes(t, [0.1, 0.035], [10.0, 16.0])]
    });
    case("crumpled banknote", text, files)
}

/// Eight sheets on each other, on a floor that rocks and is moved to and fro.
fn stack() -> Case {
    let mut text = head("stack");
    text.push_str("\n[[obstacle]]\nname = \"floor\"\nshape = \"plane\"\nposes = \"floor.csv\"\nfriction = 0.5\n");
    for sheet in 0..8_u32 {
        let cells = 8 + sheet % 3;
        let _ = write!(
            text,
            "\n[[body]]\nname = \"sheet {sheet}\"\nposition = [0.0, 0.0, {:?}]\n\
             rotation = {{ axis = [0, 0, 1], degrees = {} }}\n\
             mesh.sheet = {{ length = 0.1, width = 0.1, cells = [{cells}, {cells}], pattern = \"alternating\" }}\n\
             material = {{ young = 1e6, poisson = 0.3, thickness = 0.0005, density = 1000.0 }}\n\
             damping = {{ mass = 0.5, stiffness = 0.001 }}\n",
            0.0003 + 0.0006 * f64::from(sheet),
            5 * sheet
        );
        if sheet > 0 {
            let _ = write!(
                text,
                "\n[[contact]]\nbetween = [\"sheet {}\", \"sheet {sheet}\"]\n",
                sheet - 1
            );
        }
    }
    let floor = poses(|t| {
        let from = (t - 1.0).max(0.0);
        let angle = 0.2 * libm::sin(0.2 * TAU * from);
        ([0.01 * libm::sin(0.3 * TAU * from), 0.0, 0.0], angle)
    });
    case(
        "stack of eight sheets",
        text,
        [("floor.csv".to_owned(), floor)].into(),
    )
}
