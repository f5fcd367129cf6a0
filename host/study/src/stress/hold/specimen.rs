//! A drawn cell as a scene file, which `palpate run` can run.

use super::draw::{Draw, Kind, Task};
use sim::{Arm, DeviceModel};
use std::f64::consts::PI;

/// Length of a run (s).
const DURATION: f64 = 4.0;
/// Times at which the hand begins to move, and at which it stays (s).
const MOVES: [f64; 2] = [0.5, 2.8];
/// The target of a hand lies at most this far beyond the intended position of its device (m).
const FURTHEST: f64 = 0.2;
/// Largest compression of a block as a fraction of its height, and largest extension of a sheet as a fraction of its
/// length.
const MOST_STRAIN: [f64; 2] = [0.2, 0.05];
/// Largest sag under the own weight: of a block as a fraction of its height, of a sheet as a fraction of its length.
const MOST_SAG: [f64; 2] = [0.1, 0.03];
const GRAVITY: f64 = 9.81;
const POISSON: f64 = 0.4;
/// Length of a plate and of a strip (m).
const SIDE: f64 = 0.12;

/// How stiff a specimen is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    /// Young's modulus (Pa).
    pub(super) young: f64,
    /// Static stiffness at the handle along the direction of the hand's motion (N/m).
    pub(super) stiffness: f64,
}

impl Scale {
    /// The scale at which the stiffness of a specimen is found; the stiffness is proportional to the modulus.
    pub(super) const TRIAL: Self = Self {
        young: 1e5,
        stiffness: 1e3,
    };
}

/// The geometry of a specimen.
struct Shape {
    /// `body.mesh`.
    mesh: String,
    /// Handle and supports.
    held: String,
    /// Direction of the hand's motion, and the direction across.
    directions: [[f64; 3]; 2],
    /// Largest displacement of the hand (m).
    most: f64,
    /// Height of a block, or thickness of a sheet (m).
    thickness: f64,
}

/// The whole number at the fraction `fraction` between `low` and `high`.
fn whole(fraction: f64, low: u32, high: u32) -> u32 {
    low + (fraction * f64::from(high - low + 1)) as u32
}

/// The direction in which the hand moves a specimen of that kind.
pub(super) fn direction(kind: Kind) -> [f64; 3] {
    match kind {
        Kind::Buckling => [-1.0, 0.0, 0.0],
        Kind::Sheet | Kind::Woven | Kind::WovenStVenantKirchhoff => [1.0, 0.0, 0.0],
        _ => [0.0, 0.0, -1.0],
    }
}

fn block(draw: &Draw) -> Shape {
    let (width, height) = (0.1, 0.03 + 0.03 * draw.thickness);
    let cells = if draw.quadratic {
        whole(draw.fineness, 2, 3)
    } else {
        whole(draw.fineness, 3, 6)
    };
    let layers = if draw.quadratic {
        2
    } else {
        (cells / 2).max(2)
    };
    let cell = width / f64::from(cells);
    // The handle contains a vertex and its eight neighbours, or the corners of the middle cell.
    let half = cell * if cells.is_multiple_of(2) { 1.1 } else { 0.6 };
    let top = 0.5 * height;
    Shape {
        mesh: format!(
            "box = {{ size = [{width:?}, {width:?}, {height:?}], cells = [{cells}, {cells}, {layers}] }}\norder = {}",
            if draw.quadratic { 2 } else { 1 }
        ),
        held: format!(
            "[[body.support]]\nname = \"table\"\ngroup = \"bottom\"\n\n[[body.handle]]\nname = \"finger\"\n\
             box = [[{:?}, {:?}, {:?}], [{half:?}, {half:?}, {:?}]]\ndevice = \"device\"\n",
            -half,
            -half,
            top - 1e-3,
            top + 1e-3
        ),
        directions: [direction(draw.kind), [1.0, 0.0, 0.0]],
        most: MOST_STRAIN[0] * height,
        thickness: height,
    }
}

/// A rectangle in the plane of x and y.
fn rectangle(length: f64, width: f64, cells: [u32; 2]) -> String {
    format!("sheet = {{ length = {length:?}, width = {width:?}, cells = {cells:?} }}")
}

/// One edge fixed to a wall, the other edge held by the hand.
const BETWEEN_EDGES: &str = "[[body.support]]\nname = \"wall\"\ngroup = \"left\"\n\n\
    [[body.handle]]\nname = \"edge\"\ngroup = \"right\"\ndevice = \"device\"\n";

fn pulled(draw: &Draw) -> Shape {
    let cells = whole(draw.fineness, 6, 16);
    Shape {
        mesh: rectangle(0.15, 0.1, [cells, cells * 2 / 3]),
        held: BETWEEN_EDGES.to_owned(),
        directions: [direction(draw.kind), [0.0, 1.0, 0.0]],
        most: MOST_STRAIN[1] * 0.15,
        thickness: 0.0005 + 0.0015 * draw.thickness,
    }
}

fn plate(draw: &Draw) -> Shape {
    let cells = 2 * whole(draw.fineness, 3, 6);
    // The plate is so thick that its stretching stiffness is not a thousand times its bending stiffness; hands meet
    // both.
    let side = SIDE;
    let half = 1.1 * side / f64::from(cells);
    let thickness = 0.008 + 0.006 * draw.thickness;
    let edges = ["left", "right", "front", "back"].iter().zip([
        [[-0.061, -0.061, -0.01], [-0.059, 0.061, 0.01]],
        [[0.059, -0.061, -0.01], [0.061, 0.061, 0.01]],
        [[-0.061, -0.061, -0.01], [0.061, -0.059, 0.01]],
        [[-0.061, 0.059, -0.01], [0.061, 0.061, 0.01]],
    ]);
    let supports: Vec<String> = edges
        .map(|(name, corners)| {
            format!("[[body.support]]\nname = \"{name}\"\nbox = {corners:?}\n\n")
        })
        .collect();
    let supports = supports.concat();
    Shape {
        mesh: rectangle(side, side, [cells, cells]),
        held: format!(
            "{supports}[[body.handle]]\nname = \"finger\"\n\
             box = [[{:?}, {:?}, -0.01], [{half:?}, {half:?}, 0.01]]\ndevice = \"device\"\n",
            -half, -half
        ),
        directions: [direction(draw.kind), [0.0, 1.0, 0.0]],
        // Beyond a deflection of its thickness, a plate stretches more than it bends.
        most: 0.7 * thickness,
        thickness,
    }
}

fn strip(draw: &Draw) -> Shape {
    let (length, width) = (SIDE, 0.04);
    let across = whole(draw.fineness, 3, 6);
    let thickness = 0.005 + 0.004 * draw.thickness;
    Shape {
        mesh: rectangle(length, width, [3 * across, across]),
        held: BETWEEN_EDGES.to_owned(),
        directions: [direction(draw.kind), [0.0, 1.0, 0.0]],
        most: buckles(length, thickness) * (3.0 + 7.0 * draw.fineness),
        thickness,
    }
}

/// The shortening at which a strip with hinged ends buckles (m): Euler's load over the axial stiffness.
fn buckles(length: f64, thickness: f64) -> f64 {
    PI * PI * thickness * thickness / (12.0 * (1.0 - POISSON * POISSON) * length)
}

fn shape(draw: &Draw) -> Shape {
    match draw.kind {
        Kind::Sheet | Kind::Woven | Kind::WovenStVenantKirchhoff => pulled(draw),
        Kind::Plate => plate(draw),
        Kind::Buckling => strip(draw),
        _ => block(draw),
    }
}

/// The scene of `draw` with the specimen at `scale`. The model of the device decides how far its hand reaches.
pub(super) fn scene(name: &str, draw: &Draw, scale: Scale, model: &DeviceModel) -> String {
    let Shape {
        mesh,
        held,
        directions,
        most,
        thickness,
    } = shape(draw);
    let Scale {
        young,
        stiffness: along,
    } = scale;
    let mut density: f64 = 1000.0;
    if draw.weight {
        density = density.min(if draw.kind.is_solid() {
            MOST_SAG[0] * young / (GRAVITY * thickness)
        } else {
            // A beam's 5 q L^4 / (384 E I).
            let slenderness = SIDE / thickness;
            MOST_SAG[1] * 6.4 * young / (GRAVITY * SIDE * slenderness * slenderness)
        });
    }
    let law = match draw.kind {
        Kind::Linear => "linear",
        Kind::StVenantKirchhoff | Kind::WovenStVenantKirchhoff => "st_venant_kirchhoff",
        Kind::StableNeoHookean => "stable_neo_hookean",
        _ => "corotational",
    };
    let thick = if draw.kind.is_solid() {
        String::new()
    } else {
        format!("thickness = {thickness:?}\n")
    };
    let weave = if matches!(draw.kind, Kind::Woven | Kind::WovenStVenantKirchhoff) {
        let (weft, shear) = (0.5 * young, 0.1 * young);
        format!(
            "\n[body.material.weave]\nwarp = [1.0, 0.3, 0.0]\nyoung_weft = {weft:?}\nshear = {shear:?}\n"
        )
    } else {
        String::new()
    };
    let material = format!(
        "law = \"{law}\"\nyoung = {young:?}\npoisson = {POISSON}\ndensity = {density:?}\n{thick}{weave}"
    );
    let [mass, stiffness] = draw.damping;
    let gravity = if draw.weight { -GRAVITY } else { 0.0 };
    let depth = (draw.force * model.max_force / along).min(most);
    let load = if draw.kind == Kind::Buckling && !draw.weight {
        // A hundredth of the axial load decides the side to which the strip buckles.
        let aside = 0.01 * along * buckles(SIDE, thickness);
        format!(
            "\n[[body.load]]\nname = \"push aside\"\n\
             box = [[-0.011, -0.03, -0.01], [0.011, 0.03, 0.01]]\nforce = [0.0, 0.0, {aside:?}]\n"
        )
    } else {
        String::new()
    };
    format!(
        "name = \"{name}\"\nduration = {DURATION:?}\nseed = 1\ngravity = [0.0, 0.0, {gravity:?}]\n\n\
         [host]\nstep_rate = {:?}\npublish_rate = {:?}\nlatency = {:?}\n\n\
         [[body]]\nname = \"specimen\"\ndamping = {{ mass = {mass:?}, stiffness = {stiffness:?} }}\n\n\
         [body.mesh]\n{mesh}\n\n[body.material]\n{material}\n{held}{load}\n\
         [[device]]\nname = \"device\"\nmodel = \"{}\"\nwire = false\n\n{}",
        draw.step_rate,
        draw.rate,
        draw.latency,
        draw.device,
        hand(draw, model, directions, depth, scale, thickness),
    )
}

/// `[device.hand]`: a hand that reaches the depth `depth` (m) against the specimen and the device's friction.
fn hand(
    draw: &Draw,
    model: &DeviceModel,
    directions: [[f64; 3]; 2],
    depth: f64,
    Scale { stiffness, .. }: Scale,
    thickness: f64,
) -> String {
    let arm = Arm::between(draw.grip);
    let names = ["relaxed", "typical", "firm", "rigid"];
    let name = names[(draw.grip * 3.999) as usize];
    // The hand's spring must be stretched by the force.
    let beyond = |depth: f64| {
        let bears = match draw.kind {
            Kind::Buckling => depth.min(buckles(SIDE, thickness)),
            _ => depth,
        };
        let held = stiffness * bears + model.friction;
        depth + (held / arm.stiffness).min(FURTHEST)
    };
    let tremor = if draw.task == Task::Tremble {
        5e-5 + 1e-4 * draw.haste
    } else {
        0.0
    };
    let [begin, end] = MOVES;
    let mut rows = vec![(begin, 0.0, 0.0)];
    match draw.task {
        Task::Press | Task::Tremble => {
            rows.push((begin + 2.0 - 1.4 * draw.haste, beyond(depth), 0.0));
        }
        Task::Rub => {
            // The hand arrives within 0.8 s, then rubs for 1.5 s.
            let wide = beyond(0.4 * depth) - beyond(0.0);
            rows.push((begin + 0.8, beyond(depth), 0.0));
            for (fraction, side) in [(0.25, 1.0), (0.75, -1.0), (1.0, 0.0)] {
                let time = begin + 0.8 + 1.5 * fraction;
                rows.push((time, beyond(depth), wide * side));
            }
        }
        Task::Stages => {
            let each = (end - begin) / 3.0;
            let goes = each * (0.9 - 0.5 * draw.haste);
            for stage in 1..=3 {
                let fraction = f64::from(stage) / 3.0;
                let arrives = begin + each * f64::from(stage - 1) + goes;
                rows.push((arrives, beyond(fraction * depth), 0.0));
                if stage < 3 {
                    rows.push((arrives + each - goes, beyond(fraction * depth), 0.0));
                }
            }
        }
    }
    let rows: Vec<String> = rows
        .iter()
        .map(|(time, a, c)| {
            let [along, across] = directions;
            let place = |axis: usize| along[axis] * a + across[axis] * c;
            format!("[{time:?}, {:?}, {:?}, {:?}]", place(0), place(1), place(2))
        })
        .collect();
    format!(
        "[device.hand]\ngrip = \"{name}\"\nmass = {:?}\ndamping = {:?}\nstiffness = {:?}\ntremor = {tremor:?}\n\
         waypoints = [{}]\n",
        arm.mass,
        arm.damping,
        arm.stiffness,
        rows.join(", ")
    )
}
