//! The force of a tool under slow hosts, against the force of a host that steps and publishes in every tick.
//!
//! A ball is pressed on a block, taps it, rubs it, shakes on it and slides over its edge; a finger strokes a hanging cloth. The hand
//! moves as prescribed, so that all hosts meet the same motion. There is no device and no account of energy. Beside the law of the
//! tick (`rt_core::tool`) stand two simpler ones, made from the forces of the reference: the last force is held, or a
//! plane of the stiffness of the surface stands where the last message had the contact.

use super::Aim;
use crate::{Level, StudyError};
use host::engine::Engine;
use host::engine::build::{self, BuildOptions};
use host::engine::contact::Contact;
use host::engine::pacer::Pacer;
use host::engine::stats::WallStopwatch;
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::hull::Hull;
use rt_core::tool::{Patch, Tool, ToolConfig};
use rt_core::{Pose, TickRecord, Twist, Vec3};
use serde::Serialize;
use sim::Trajectory;
use std::collections::{BTreeMap, VecDeque};

/// Period of the tick (s).
const TICK: f64 = 1e-3;
/// The stiffest spring (N/m) and the largest damping (N s/m) that the device renders.
const STIFFEST: f64 = 3000.0;
const MOST_DAMPING: f64 = 30.0;
/// The speed at which an overlap parts (m/s).
const PARTING: f64 = 0.02;
/// The rate of the host (Hz) and its latency (s) for which there are aims.
const AIMED: (f64, f64) = (60.0, 0.004);
/// The hosts: rate (Hz) and latency (s).
const HOSTS: [(f64, f64); 6] = [
    AIMED,
    (30.0, 0.004),
    (125.0, 0.004),
    (250.0, 0.004),
    (60.0, 0.0),
    (60.0, 0.016),
];
/// The time around a tick (ticks) whose mean is no ripple.
const RIPPLE: usize = 25;

const BLOCK: &str = include_str!("../../../scenes/touch.toml");
const CLOTH: &str = include_str!("../../../scenes/finger.toml");

/// A motion of the hand: its name, the largest error (1) and the largest jump (N) that are asked for, and the waypoints (s, m).
struct Task {
    name: &'static str,
    error: f64,
    jump: f64,
    points: &'static [(f64, [f64; 3])],
}

/// The ball of 10 mm radius begins 5 mm above the block.
const TASKS: [Task; 8] = [
    Task {
        name: "press by half the radius",
        error: 0.01,
        jump: 0.05,
        points: &[
            (0.2, [0.0; 3]),
            (0.5, [0.0, 0.0, -0.010]),
            (1.0, [0.0, 0.0, -0.010]),
            (1.3, [0.0; 3]),
        ],
    },
    Task {
        name: "press by the radius",
        error: 0.03,
        jump: 0.05,
        points: &[
            (0.2, [0.0; 3]),
            (0.5, [0.0, 0.0, -0.015]),
            (1.0, [0.0, 0.0, -0.015]),
            (1.3, [0.0; 3]),
        ],
    },
    // The largest speed between two waypoints is 15/8 of the mean.
    Task {
        name: "tap at 0.1 m/s",
        error: 0.015,
        jump: 0.2,
        points: &[
            (0.2, [0.0; 3]),
            (0.3875, [0.0, 0.0, -0.010]),
            (0.575, [0.0; 3]),
        ],
    },
    Task {
        name: "tap at 0.3 m/s",
        error: 0.03,
        jump: 0.2,
        points: &[
            (0.2, [0.0; 3]),
            (0.2625, [0.0, 0.0, -0.010]),
            (0.325, [0.0; 3]),
        ],
    },
    Task {
        name: "tap at 1 m/s",
        error: 0.05,
        jump: f64::INFINITY,
        points: &[
            (0.2, [0.0; 3]),
            (0.219, [0.0, 0.0, -0.010]),
            (0.238, [0.0; 3]),
        ],
    },
    Task {
        name: "rub",
        error: 0.03,
        jump: 0.05,
        points: &[
            (0.2, [0.0; 3]),
            (0.5, [0.0, 0.0, -0.010]),
            (0.9, [0.015, 0.0, -0.010]),
            (1.5, [-0.015, 0.0, -0.010]),
        ],
    },
    Task {
        name: "shake at 4 Hz",
        error: 0.02,
        jump: 0.05,
        points: &[
            (0.2, [0.0; 3]),
            (0.5, [0.0, 0.0, -0.010]),
            (0.625, [0.0, 0.0, -0.006]),
            (0.75, [0.0, 0.0, -0.010]),
            (0.875, [0.0, 0.0, -0.006]),
            (1.0, [0.0, 0.0, -0.010]),
            (1.125, [0.0, 0.0, -0.006]),
        ],
    },
    Task {
        name: "slide over an edge",
        error: 0.03,
        jump: 0.05,
        points: &[
            (0.2, [0.03, 0.0, 0.0]),
            (0.5, [0.03, 0.0, -0.010]),
            (1.3, [0.07, 0.0, -0.010]),
        ],
    },
];

/// The finger of 12 mm radius begins 20 mm beside the cloth.
const STROKE: Task = Task {
    name: "stroke a hanging cloth",
    error: 0.03,
    jump: 0.05,
    points: &[
        (0.2, [0.0; 3]),
        (0.8, [0.0, 0.03, 0.0]),
        (1.2, [0.0, 0.03, 0.0]),
        (1.8, [0.015, 0.03, 0.0]),
    ],
};

/// A tool of another shape: its name, its fields in place of the ball's, its lowest point (m), and its corners for a hull.
struct Shaped {
    name: &'static str,
    fields: &'static str,
    lowest: f64,
}

const SHAPES: [Shaped; 4] = [
    Shaped {
        name: "plate",
        fields: "shape = \"plate\"\nlength = 0.03\nwidth = 0.02\nradius = 0.002",
        lowest: 0.002,
    },
    Shaped {
        name: "capsule",
        fields: "shape = \"capsule\"\nlength = 0.02\nradius = 0.006\nrotation = { axis = [1, 1, 0], degrees = 90 }",
        lowest: 0.006,
    },
    Shaped {
        name: "box on a corner",
        fields: "shape = \"box\"\nsize = [0.02, 0.02, 0.02]\nradius = 0.003\n\
                 rotation = { axis = [1, -1, 0], degrees = 54.7356 }",
        lowest: 0.015_124,
    },
    Shaped {
        name: "hull of a wedge",
        fields: "shape = \"hull\"\nmesh = { file = \"wedge.obj\", scale = 0.01 }\nradius = 0.002",
        lowest: 0.007,
    },
];
/// The motions of the quick part.
const QUICK: [&str; 3] = ["press by half the radius", "tap at 0.3 m/s", "rub"];
/// The motions of these tools.
const SHAPED: [&str; 2] = ["press by half the radius", "rub"];
/// A wedge with its edge below.
const WEDGE: &str = "v -1 -0.7 0.5\nv 1 -0.7 0.5\nv 1 0.7 0.5\nv -1 0.7 0.5\nv -1 0 -0.5\nv 1 0 -0.5\n\
                     f 1 2 3\nf 1 3 4\nf 2 1 5\nf 2 5 6\nf 4 3 6\nf 4 6 5\nf 1 4 5\nf 3 2 6\n";

/// A tool under one host.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ToolCell {
    /// The body, and the tool if it is no ball.
    pub body: String,
    /// The motion.
    pub task: &'static str,
    /// Steps a second (Hz).
    pub rate: f64,
    /// Latency (s).
    pub latency: f64,
    /// Largest force of the reference (N).
    pub peak: f64,
    /// RMS of the error, as a fraction of the peak (1).
    pub rms: f64,
    /// Largest jump at a patch, beyond the reference (N).
    pub jump: f64,
    /// RMS about the mean over 50 ms, beyond the reference (N).
    pub ripple: f64,
    /// The same if the last force is held, as a fraction (1).
    pub held: f64,
    /// The same of a late plane, as a fraction (1).
    pub plane: f64,
}

/// A host with its tool.
struct ToolHost {
    engine: Engine,
    pacer: Pacer,
    latency_ns: u64,
    tool: Tool,
    /// Patches on their way, with the times at which they come (ns).
    on_the_way: VecDeque<(u64, Box<Patch>)>,
    forces: Vec<Vec3>,
    proxies: Vec<Vec3>,
    /// Whether a patch came, by tick.
    arrivals: Vec<bool>,
    /// The stiffness of the surface in the newest patch (N/m), by tick.
    stiffness: Vec<f64>,
}

impl ToolHost {
    fn new(loaded: &LoadedScene, rate: f64, latency: f64) -> Result<Self, StudyError> {
        let mut loaded = loaded.clone();
        let host = &mut loaded.scene.host;
        (host.step_rate, host.publish_rate, host.latency) = (rate, rate, latency);
        let world = World::new(&loaded)?;
        let shape = world.tool_shapes().next();
        let bodies = build::bodies(&world, BuildOptions::default())?;
        let contact = Contact::new(&world, &bodies)?;
        Ok(Self {
            engine: Engine::new(bodies).touching(contact),
            pacer: Pacer::new(rate, 1),
            latency_ns: (latency * 1e9) as u64,
            tool: Tool::new(ToolConfig {
                hull: shape.map_or(Hull::POINT, |shape| *shape.hull()),
                turns: false,
                radius: shape.map_or(0.0, |shape| shape.radius()),
                period: TICK,
                stiffest: STIFFEST,
                most_damping: MOST_DAMPING,
                parting: PARTING,
            }),
            on_the_way: VecDeque::new(),
            forces: Vec::new(),
            proxies: Vec::new(),
            arrivals: Vec::new(),
            stiffness: Vec::new(),
        })
    }

    fn tick(&mut self, hand: &Vec3, velocity: &Vec3, number: u64, watch: &WallStopwatch) {
        let time_ns = number * 1_000_000;
        let twist = Twist {
            linear: *velocity,
            ..Twist::zero()
        };
        let mut record = TickRecord {
            tick: number,
            time_ns,
            device_count: 1,
            ..TickRecord::empty()
        };
        let hand = Pose::at(*hand);
        record.proxies[0] = (hand, twist);
        let pose = if number == 1 { hand } else { self.tool.proxy() };
        record.tools[0] = Some(pose);
        self.engine.follow(&record);
        while self.pacer.next_ns() <= time_ns {
            let at = self.pacer.next_ns();
            let due = self.pacer.begin(at);
            self.engine.step(due, watch, &mut |_, _| {});
            let comes = at + self.latency_ns;
            let patches = self.engine.patches();
            let patches = patches.map(|(_, patch)| (comes, Box::new(patch.clone())));
            self.on_the_way.extend(patches);
        }
        let mut has_come = false;
        let is_here = |(comes, _): &mut (u64, Box<Patch>)| *comes <= time_ns;
        while self.on_the_way.front_mut().is_some_and(is_here) {
            let Some((_, patch)) = self.on_the_way.pop_front() else {
                break;
            };
            has_come = true;
            self.stiffness
                .resize(self.forces.len() + 1, patch.head.stiffness);
            // A refusal would appear as an error of the force.
            let _ = self.tool.accept(&*patch);
        }
        let last = self.stiffness.last().copied().unwrap_or(f64::INFINITY);
        self.stiffness.resize(self.forces.len() + 1, last);
        self.arrivals.push(has_come);
        self.forces.push(self.tool.tick(&hand).force);
        self.proxies.push(self.tool.proxy().position);
    }
}

/// The forces of tools: the cells, and the aims for a host of 60 Hz.
///
/// # Errors
/// [`StudyError`] if a scene cannot be built.
pub(super) fn run(
    level: Level,
    progress: &mut dyn FnMut(f64),
    aims: &mut Vec<Aim>,
) -> Result<Vec<ToolCell>, StudyError> {
    let (moduli, hosts): (&[&str], _) = match level {
        Level::Quick => (&["30e3"], &HOSTS[..1]),
        Level::Full => (&["30e3", "10e3", "100e3"], &HOSTS[..]),
    };
    // The reference steps in each tick, for which the quick part has a coarser block and a few motions of the ball.
    let is_quick = matches!(level, Level::Quick);
    let cells = if is_quick { "[8, 8, 4]" } else { "[12, 12, 6]" };
    let block = BLOCK.replace("[12, 12, 6]", cells);
    let mut cells = Vec::new();
    let mut each: Vec<(String, String, &Task)> = Vec::new();
    for young in moduli {
        let text = block.replace("young = 30e3", &format!("young = {young}"));
        let tasks = TASKS.iter();
        let tasks = tasks.filter(|task| !is_quick || QUICK.contains(&task.name));
        each.extend(tasks.map(|task| (format!("block of {young} Pa"), text.clone(), task)));
    }
    each.push(("cloth".to_owned(), CLOTH.to_owned(), &STROKE));
    for shape in SHAPES.iter().filter(|_| !is_quick) {
        let place = format!("position = [0.0, 0.0, {}]", 0.035 + shape.lowest);
        let text = block
            .replace("radius = 0.010", shape.fields)
            .replace("position = [0.0, 0.0, 0.045]", &place);
        let tasks = TASKS.iter().filter(|task| SHAPED.contains(&task.name));
        each.extend(tasks.map(|task| (shape.name.to_owned(), text.clone(), task)));
    }
    let count = each.len() as f64;
    let files = BTreeMap::from([("wedge.obj".to_owned(), WEDGE.as_bytes().to_vec())]);
    for (done, (body, text, task)) in each.into_iter().enumerate() {
        let loaded = Scene::load_texts("tool.toml", &text, &files)?;
        let found = compare(&loaded, &body, task, hosts)?;
        let aimed = |cell: &&ToolCell| (cell.rate, cell.latency) == AIMED;
        for cell in found.iter().filter(aimed) {
            let of = format!("{}, {}", cell.body, cell.task);
            aims.push(Aim::at_most(
                format!("{of}: RMS error of the force at 60 Hz, by the peak"),
                "",
                cell.rms,
                task.error,
            ));
            if task.jump.is_finite() {
                aims.push(Aim::at_most(
                    format!("{of}: jump of the force at a message, beyond the reference"),
                    "N",
                    cell.jump,
                    task.jump,
                ));
            }
            aims.push(Aim::at_most(
                format!("{of}: ripple of the force, beyond the reference"),
                "N",
                cell.ripple,
                0.03,
            ));
        }
        cells.extend(found);
        progress((done + 1) as f64 / count);
    }
    Ok(cells)
}

fn compare(
    loaded: &LoadedScene,
    body: &str,
    task: &Task,
    rates: &[(f64, f64)],
) -> Result<Vec<ToolCell>, StudyError> {
    let start = Vec3::from(loaded.scene.tools[0].position);
    let points = task.points.iter();
    let points: Vec<_> = points.map(|(time, at)| (*time, Vec3::from(*at))).collect();
    let path = Trajectory::new_waypoints(&points).unwrap_or_else(|_| Trajectory::still());
    let end = points.last().map_or(0.0, |last| last.0) + 0.1;
    let ticks = (end / TICK).round() as u64;
    let mut reference = ToolHost::new(loaded, 1.0 / TICK, 0.0)?;
    let hosts = rates.iter();
    let mut hosts: Vec<ToolHost> = hosts
        .map(|(rate, latency)| ToolHost::new(loaded, *rate, *latency))
        .collect::<Result<_, _>>()?;
    let watch = WallStopwatch::start();
    let mut hands = Vec::new();
    for number in 1..=ticks {
        let (moved, velocity) = path.at(number as f64 * TICK);
        let hand = start + moved;
        for host in hosts.iter_mut().chain([&mut reference]) {
            host.tick(&hand, &velocity, number, &watch);
        }
        hands.push(hand);
    }
    let exact = &reference.forces;
    let peak = exact.iter().map(Vec3::norm).fold(0.0, f64::max);
    let cells = hosts.iter().zip(rates).map(|(host, (rate, latency))| {
        let (mut held, mut plane) = (Vec::new(), Vec::new());
        let mut last: Option<usize> = None;
        let late = (latency / TICK).round() as usize;
        for (at, hand) in hands.iter().enumerate() {
            if host.arrivals[at] {
                last = at.checked_sub(late);
            }
            let force = last.map_or(Vec3::zeros(), |last| exact[last]);
            held.push(force);
            let normal = force.try_normalize(0.0).unwrap_or_default();
            let deeper = last.map_or(0.0, |last| normal.dot(&(hands[last] - hand)));
            let stiffness = reference.stiffness[last.unwrap_or(0)].min(STIFFEST);
            plane.push(normal * (force.norm() + stiffness * deeper).max(0.0));
        }
        let change = |forces: &[Vec3], at: usize| (forces[at] - forces[at - 1]).norm();
        let arrivals = (1..exact.len()).filter(|at| host.arrivals[*at]);
        let jumps = arrivals.map(|at| change(&host.forces, at) - change(exact, at));
        ToolCell {
            body: body.to_owned(),
            task: task.name,
            rate: *rate,
            latency: *latency,
            peak,
            rms: rms(&host.forces, exact) / peak,
            jump: jumps.fold(0.0, f64::max),
            ripple: (ripple(&host.forces) - ripple(exact)).max(0.0),
            held: rms(&held, exact) / peak,
            plane: rms(&plane, exact) / peak,
        }
    });
    Ok(cells.collect())
}

/// RMS of the differences of two forces (N).
fn rms(forces: &[Vec3], exact: &[Vec3]) -> f64 {
    let pairs = forces.iter().zip(exact);
    let squares: f64 = pairs.map(|(a, b)| (a - b).norm_squared()).sum();
    (squares / exact.len() as f64).sqrt()
}

/// RMS of a force about its mean over the times nearby (N).
fn ripple(forces: &[Vec3]) -> f64 {
    let windows = forces.windows(2 * RIPPLE + 1);
    let count = windows.len().max(1) as f64;
    let squares = windows.map(|window| {
        let mean = window.iter().sum::<Vec3>() / window.len() as f64;
        (window[RIPPLE] - mean).norm_squared()
    });
    (squares.sum::<f64>() / count).sqrt()
}
