//! The force of contact at the hand under slow hosts, against the force of a host that steps and publishes in every tick.
//!
//! A hand presses a body on a floor, on a sphere, on another body and on itself, holds it, and lets it go. The first host makes the
//! same steps as the reference and publishes rarely: its error is that of the extrapolation. The others step less often, from
//! once for a model to eight times: their error contains that of the step. The models are rendered as they are, and without the
//! rows that limit their extrapolation.

use super::Aim;
use crate::hands::Hands;
use crate::slow_host::{Change, Forces, SlowHost, TICK, limited, unlimited, whole};
use crate::{Level, StudyError};
use host::engine::stats::WallStopwatch;
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::TearLimit;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Steps a second (Hz) of the hosts, and the steps for each publication. The last is the reference.
const HOSTS: [(f64, u64); 8] = [
    (1000.0, 16),
    (60.0, 1),
    (120.0, 2),
    (240.0, 4),
    (480.0, 8),
    (125.0, 1),
    (250.0, 1),
    (1000.0, 1),
];
/// Number of the hosts that the quick part compares.
const QUICK: usize = 3;
/// The rows with which the models are rendered.
const ROWS: [(&str, Change); 4] = [
    ("none", unlimited),
    ("touch", |model| limited(model, TearLimit::is_touch)),
    ("release", |model| limited(model, |limit| !limit.is_touch())),
    ("all", whole),
];
/// Models a second (Hz) of the host that makes the same steps as the reference.
const SAME: f64 = 62.5;
/// The time of the hold (s): the hand has stood for 0.2 s at its beginning.
const HOLD: [f64; 2] = [0.7, 1.0];

/// The scenes: what is pressed, the name and the text.
const SCENES: [(&str, &str, &str); 5] = [
    (
        "on a floor",
        "press_floor.toml",
        include_str!("../../scenes/press_floor.toml"),
    ),
    (
        "along a floor",
        "press_oblique.toml",
        include_str!("../../scenes/press_oblique.toml"),
    ),
    (
        "on a sphere",
        "press_sphere.toml",
        include_str!("../../scenes/press_sphere.toml"),
    ),
    (
        "on another body",
        "press_body.toml",
        include_str!("../../scenes/press_body.toml"),
    ),
    (
        "on itself",
        "press_self.toml",
        include_str!("../../scenes/press_self.toml"),
    ),
];

/// What the hands feel of one host.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HandCell {
    /// What the body is pressed on.
    pub pressed: &'static str,
    /// Steps a second (Hz).
    pub step_rate: f64,
    /// Publications a second (Hz).
    pub publish_rate: f64,
    /// The rows that limit the extrapolation of the models.
    pub rows: &'static str,
    /// Largest force on a hand, of the reference (N).
    pub peak: f64,
    /// Largest error of the force on a hand, as a fraction of the peak (1).
    pub worst: f64,
    /// The time of this error (s).
    pub time: f64,
    /// RMS of the error, as a fraction of the peak (1).
    pub rms: f64,
    /// Largest error in the hold, as a fraction of the mean force there (1).
    pub hold: f64,
    /// Largest change of the force on a hand in a tick in which a model arrives (N).
    pub jump: f64,
    /// Largest change of the force on a hand between two ticks, of the reference (N).
    pub tick: f64,
    /// Faults of the host.
    pub faults: u64,
}

/// A soft clip: two arms of a box, joined at one end, in the legacy format of VTK.
fn clip() -> String {
    const XS: [f64; 7] = [0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06];
    const YS: [f64; 3] = [-0.01, 0.0, 0.01];
    const ZS: [f64; 6] = [0.0, 0.009, 0.018, 0.022, 0.031, 0.04];
    /// The layer between the arms, which only the joint has, and the number of columns of the joint.
    const GAP: (usize, usize) = (2, 2);
    /// The six tetrahedra of a cell: by the order in which a path along its edges takes the axes.
    const PATHS: [[usize; 3]; 6] = [
        [0, 1, 2],
        [1, 2, 0],
        [2, 0, 1],
        [0, 2, 1],
        [2, 1, 0],
        [1, 0, 2],
    ];
    let at = |[x, y, z]: [usize; 3]| (z * YS.len() + y) * XS.len() + x;
    let mut number = vec![None; XS.len() * YS.len() * ZS.len()];
    let (mut points, mut count) = (String::new(), 0);
    let (mut cells, mut tets) = (String::new(), 0);
    for z in 0..ZS.len() - 1 {
        for y in 0..YS.len() - 1 {
            let columns = if z == GAP.0 { GAP.1 } else { XS.len() - 1 };
            for x in 0..columns {
                for (path, order) in PATHS.iter().enumerate() {
                    let mut corner = [x, y, z];
                    let mut vertices = Vec::new();
                    for axis in [None, Some(order[0]), Some(order[1]), Some(order[2])] {
                        if let Some(axis) = axis {
                            corner[axis] += 1;
                        }
                        let vertex = number[at(corner)].get_or_insert_with(|| {
                            let [x, y, z] = [XS[corner[0]], YS[corner[1]], ZS[corner[2]]];
                            let _ = writeln!(points, "{x} {y} {z}");
                            count += 1;
                            count - 1
                        });
                        vertices.push(*vertex);
                    }
                    // Half of the paths turn the other way round.
                    if path >= 3 {
                        vertices.swap(0, 1);
                    }
                    let [a, b, c, d] = [vertices[0], vertices[1], vertices[2], vertices[3]];
                    let _ = writeln!(cells, "4 {a} {b} {c} {d}");
                    tets += 1;
                }
            }
        }
    }
    let types = "10\n".repeat(tets);
    format!(
        "# vtk DataFile Version 3.0\nclip\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {count} double\n{points}\
         CELLS {tets} {}\n{cells}CELL_TYPES {tets}\n{types}",
        5 * tets
    )
}

/// A hand that presses: the cells, and the aims for hosts of 60 Hz.
///
/// # Errors
/// [`StudyError`] if a scene cannot be built.
pub(super) fn run(
    level: Level,
    progress: &mut dyn FnMut(f64),
    aims: &mut Vec<Aim>,
) -> Result<Vec<HandCell>, StudyError> {
    let files = BTreeMap::from([("clip.vtk".to_owned(), clip().into_bytes())]);
    let mut cells = Vec::new();
    for (done, (pressed, name, text)) in SCENES.into_iter().enumerate() {
        let loaded = Scene::load_texts(name, text, &files)?;
        let found = press(pressed, &loaded, level)?;
        let slow = |cell: &&HandCell| cell.rows == "all" && cell.publish_rate == SAME;
        for cell in found.iter().filter(slow) {
            aims.push(Aim::at_most(
                format!(
                    "force of a body pressed {pressed}, models of 62.5 Hz, largest error by the peak"
                ),
                "",
                cell.worst,
                0.05,
            ));
            aims.push(Aim::at_most(
                format!("force of a body pressed {pressed}, models of 62.5 Hz, error in the hold"),
                "",
                cell.hold,
                0.01,
            ));
            aims.push(Aim::at_most(
                "jump of that force at a message, by the largest change in a tick of the reference",
                "",
                cell.jump / cell.tick,
                1.0,
            ));
        }
        cells.extend(found);
        progress((done + 1) as f64 / SCENES.len() as f64);
    }
    Ok(cells)
}

fn press(
    pressed: &'static str,
    loaded: &LoadedScene,
    level: Level,
) -> Result<Vec<HandCell>, StudyError> {
    let ticks = (loaded.scene.duration / TICK).round() as u64;
    let changes = ROWS.map(|(_, change)| change);
    let slow = match level {
        Level::Quick => &HOSTS[..QUICK],
        Level::Full => &HOSTS[..HOSTS.len() - 1],
    };
    let reference = HOSTS[HOSTS.len() - 1];
    let hosts = slow
        .iter()
        .map(|host| SlowHost::new(loaded, *host, &changes));
    let mut hosts: Vec<SlowHost> = hosts.collect::<Result<_, _>>()?;
    let mut reference = SlowHost::new(loaded, reference, &[unlimited])?;
    let hands = Hands::new(&World::new(loaded)?, &reference.engine);
    let watch = WallStopwatch::start();
    for number in 1..=ticks {
        for host in hosts.iter_mut().chain([&mut reference]) {
            host.tick(&hands, number, number * 1_000_000, &watch);
        }
    }
    let exact = reference.forces(0);
    let norms = exact.iter().flatten().map(physics::Vec3::norm);
    let peak = norms.fold(0.0, f64::max);
    let tick = (1..exact.len()).map(|at| change(exact, at));
    let tick = tick.fold(0.0, f64::max);
    let hold = HOLD.map(|time| (time / TICK) as usize);
    let hold = hold[0]..hold[1];
    let held = &exact[hold.clone()];
    let most = |forces: &Forces| forces.iter().map(physics::Vec3::norm).fold(0.0, f64::max);
    let mean = held.iter().map(most).sum::<f64>() / held.len() as f64;
    let mut cells = Vec::new();
    for (host, (rate, steps)) in hosts.iter().zip(slow) {
        for (rendering, (rows, _)) in ROWS.into_iter().enumerate() {
            let forces = host.forces(rendering);
            let errors: Vec<f64> = forces
                .iter()
                .zip(exact)
                .map(|(forces, exact)| {
                    let pairs = forces.iter().zip(exact);
                    pairs
                        .map(|(force, exact)| (force - exact).norm())
                        .fold(0.0, f64::max)
                })
                .collect();
            let at = (0..errors.len()).max_by(|a, b| errors[*a].total_cmp(&errors[*b]));
            let at = at.unwrap_or(0);
            let squares: f64 = errors.iter().map(|error| error * error).sum();
            let arrivals = (1..errors.len()).filter(|at| host.arrivals()[*at]);
            cells.push(HandCell {
                pressed,
                step_rate: *rate,
                publish_rate: rate / *steps as f64,
                rows,
                peak,
                worst: errors[at] / peak,
                time: (at + 1) as f64 * TICK,
                rms: (squares / errors.len() as f64).sqrt() / peak,
                hold: errors[hold.clone()].iter().copied().fold(0.0, f64::max) / mean,
                jump: arrivals.map(|at| change(forces, at)).fold(0.0, f64::max),
                tick,
                faults: host.engine.stats().faults,
            });
        }
    }
    Ok(cells)
}

/// The largest change of the force on a hand from the tick before to tick `at` (N).
fn change(forces: &[Forces], at: usize) -> f64 {
    let pairs = forces[at].iter().zip(&forces[at - 1]);
    pairs
        .map(|(now, before)| (now - before).norm())
        .fold(0.0, f64::max)
}
