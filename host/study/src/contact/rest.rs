//! Sheets that rest, slide, fall, part and are wound about a cylinder.

use super::aim::Aim;
use super::world::{DOWN, GRAVITY, RADIUS, STEP, World, config, sheet_mesh};
use crate::{Level, StudyError};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use physics::contact::obstacle::{Motion, TimedPose};
use physics::contact::shape::Shape;
use physics::mesh::TriMesh;
use physics::{Border, Freedom, HandlePose, HandleSpec, Vec3};
use std::f64::consts::PI;

/// Thickness of a sheet (m).
const THICKNESS: f64 = 2.0 * RADIUS;
/// A sheet of 60 by 40 mm, and its cells.
const SIZE: [f64; 2] = [0.06, 0.04];
const CELLS: [u32; 2] = [6, 4];

/// Measures bodies that move by themselves.
pub(super) fn run(
    level: Level,
    progress: &mut dyn FnMut(f64),
    aims: &mut Vec<Aim>,
) -> Result<(), StudyError> {
    let mut ordinary = Vertices::default();
    rest(aims, &mut ordinary)?;
    incline(aims, &mut ordinary)?;
    capstan(level, aims, &mut ordinary)?;
    progress(0.5);
    pair(aims, &mut ordinary)?;
    drop_sheet(aims, &mut ordinary)?;
    part(aims)?;
    progress(1.0);
    let fraction = ordinary.truncated as f64 / ordinary.steps as f64;
    let name = "truncated vertex-steps of the scenes above";
    aims.push(Aim::at_most(name, "", fraction, 1e-4));
    Ok(())
}

/// Vertex-steps.
#[derive(Clone, Copy, Debug, Default)]
struct Vertices {
    truncated: usize,
    steps: usize,
}

impl Vertices {
    /// Takes the last step in.
    fn count(&mut self, world: &World) {
        self.truncated += world.contacts.report().truncated.truncated;
        self.steps += world.contacts.surfaces().vertices;
    }
}

/// A sheet of the usual size above a plane, on an incline of `angle` (rad) that falls along x.
fn above_plane(height: f64, angle: f64, friction: f64) -> Result<World, StudyError> {
    let (sin, cos) = libm::sincos(angle);
    let gravity = Vec3::new(GRAVITY * sin, 0.0, -GRAVITY * cos);
    let mut world = World::new();
    let mesh = sheet_mesh(SIZE, CELLS, |x| x + Vec3::z() * (RADIUS + height))?;
    world.add_sheet(mesh, config(gravity), &[])?;
    world.add_floor()?;
    world.complete(friction);
    Ok(world)
}

/// A sheet falls 0.2 mm on a plane, and rests.
fn rest(aims: &mut Vec<Aim>, ordinary: &mut Vertices) -> Result<(), StudyError> {
    const STEPS: usize = 150;
    let mut world = above_plane(0.2e-3, 0.0, 0.5)?;
    let (mut last_off, mut deepest, mut iterations) = (0, 0.0_f64, Vec::new());
    let mut off = f64::NAN;
    for step in 1..=STEPS {
        world.step()?;
        ordinary.count(&world);
        off = (world.force([0, 1]).z / world.weight(0) - 1.0).abs();
        if off > 1e-6 {
            last_off = step;
        }
        deepest = deepest.max(world.depth());
        if step > STEPS / 2 {
            iterations.push(world.contacts.report().solved.iterations);
        }
    }
    let iterations = iterations.into_iter().max().unwrap_or_default();
    aims.extend([
        Aim::at_most(
            "a sheet at rest: relative error of the weight",
            "",
            off,
            1e-6,
        ),
        Aim::at_most(
            "steps from a fall of 0.2 mm to 1e-6 of the weight",
            "",
            last_off as f64,
            40.0,
        ),
        Aim::at_most("depth at rest", "um", 1e6 * world.depth(), 1.0),
        Aim::at_most("deepest ever", "thickness", deepest / THICKNESS, 0.25),
        Aim::at_most(
            "iterations a step at rest, most",
            "",
            iterations as f64,
            2.0,
        ),
    ]);
    Ok(())
}

/// A sheet on an incline of 0.9 and 1.5 times the angle of friction.
fn incline(aims: &mut Vec<Aim>, ordinary: &mut Vertices) -> Result<(), StudyError> {
    let friction = 0.5;
    let (mut place, mut iterations) = (0.0, 0);
    let mut world = above_plane(0.0, libm::atan(0.9 * friction), friction)?;
    let (steps, last) = (250, 50);
    for step in 0..steps {
        if step == steps - last {
            place = world.mean(0).x;
        }
        world.step()?;
        ordinary.count(&world);
    }
    let creep = (world.mean(0).x - place) / (f64::from(last) * STEP);
    let angle = libm::atan(1.5 * friction);
    let mut world = above_plane(0.0, angle, friction)?;
    let (steps, first) = (125, 25);
    let mut start = 0.0;
    for step in 0..steps {
        if step == first {
            start = world.velocity(0).x;
        }
        world.step()?;
        ordinary.count(&world);
        if step >= first {
            iterations = iterations.max(world.contacts.report().solved.iterations);
        }
    }
    let found = (world.velocity(0).x - start) / (f64::from(steps - first) * STEP);
    let (sin, cos) = libm::sincos(angle);
    let exact = GRAVITY * (sin - friction * cos);
    aims.extend([
        Aim::at_most(
            "incline above the cone: error of the acceleration",
            "%",
            100.0 * (found / exact - 1.0).abs(),
            0.1,
        ),
        Aim::at_most(
            "incline below the cone: creep",
            "um/s",
            1e6 * creep.abs(),
            0.01,
        ),
        Aim::at_most(
            "iterations a step while it slides, most",
            "",
            iterations as f64,
            6.0,
        ),
    ]);
    Ok(())
}

/// A belt around half of a cylinder that turns below it: `T2 / T1 = exp(mu pi)` (Euler and Eytelwein).
fn capstan(level: Level, aims: &mut Vec<Aim>, ordinary: &mut Vertices) -> Result<(), StudyError> {
    let (radius, friction, segments) = (0.05, 0.3, 20);
    let spin = 0.008 / STEP;
    let around = radius + RADIUS;
    let segment = 2.0 * around * libm::sin(0.5 * PI / f64::from(segments));
    // Half a circle, with two straight segments on either side.
    let length = segment * f64::from(segments + 4);
    let mesh = sheet_mesh([length, 0.01], [segments + 4, 1], |x| {
        let number = x.x / segment;
        let half = 0.5 * f64::from(segments);
        let angle = number.clamp(-half, half) * PI / f64::from(segments);
        let (sin, cos) = libm::sincos(angle);
        let straight = segment * (number.abs() - half).max(0.0);
        Vec3::new(around * sin, x.y, around * cos - straight)
    })?;
    let mut world = World::new();
    let handles = [-1.0, 1.0].map(|side| end(&mesh, side * around, -2.0 * segment));
    let mut belt = config(Vec3::zeros());
    belt.bending = 0.0;
    belt.mass_damping = 20.0;
    world.add_sheet(mesh, belt, &handles)?;
    let steps: usize = level.choose(300, 600);
    world.add_obstacle(
        Shape::Cylinder { half: 0.05, radius },
        Motion::Poses(turning(spin, steps)),
    )?;
    world.complete(friction);
    let (mut tensions, mut passes) = ([0.0; 2], 0);
    for step in 0..steps {
        // Both ends are drawn down by 2 % of half the length within 50 steps.
        let drawn = 0.01 * length * (step as f64 / 50.0).min(1.0);
        for (pose, handle) in world.hands[0].iter_mut().zip(&handles) {
            *pose = HandlePose::at(handle.origin - Vec3::z() * drawn);
        }
        world.step()?;
        ordinary.count(&world);
        if step >= steps - 50 {
            for (end, tension) in tensions.iter_mut().enumerate() {
                let report = world.bodies[0].handle_report(end);
                *tension += report.map_or(f64::NAN, |report| report.wrench_on_hand.force.z);
            }
            passes = passes.max(world.contacts.report().solved.passes);
        }
    }
    let (low, high) = (tensions[0].min(tensions[1]), tensions[0].max(tensions[1]));
    let error = high / low / libm::exp(friction * PI) - 1.0;
    aims.extend([
        Aim::at_most(
            "capstan: error of the ratio of the tensions",
            "%",
            100.0 * error.abs(),
            0.5,
        ),
        Aim::at_most("passes of a step of it, most", "", passes as f64, 4.0),
    ]);
    Ok(())
}

/// What holds an end of a belt, at `x` and `z` (m).
fn end(mesh: &TriMesh, x: f64, z: f64) -> HandleSpec {
    let is_end = |at: &Vec3| (at.x - x).abs() < 1e-6 && (at.z - z).abs() < 1e-6;
    let vertices = (0_u32..).zip(&mesh.positions);
    HandleSpec {
        vertices: vertices
            .filter(|(_, at)| is_end(at))
            .map(|(vertex, _)| vertex)
            .collect(),
        origin: Vec3::new(x, 0.0, z),
        freedom: Freedom::Translation,
        border: Border::Hinged,
    }
}

/// The poses of a cylinder along y that turns at `spin` (rad/s) after the first 100 steps.
fn turning(spin: f64, steps: usize) -> Vec<TimedPose> {
    let lying = UnitQuaternion::from_axis_angle(&Vec3::x_axis(), 0.5 * PI);
    let rows = 0..=steps.div_ceil(100);
    let each = rows.map(|row| {
        let time = 100.0 * STEP * row as f64;
        let angle = spin * (time - 100.0 * STEP).max(0.0);
        let turn = UnitQuaternion::from_axis_angle(&Vec3::y_axis(), angle);
        TimedPose {
            time,
            pose: Isometry3::from_parts(Translation3::identity(), turn * lying),
        }
    });
    each.collect()
}

/// Two sheets whose meshes do not match, thrown at each other without gravity.
fn pair(aims: &mut Vec<Aim>, ordinary: &mut Vertices) -> Result<(), StudyError> {
    let mut world = World::new();
    for (number, speed) in [(0, 0.0), (1, -0.2)] {
        let turn = UnitQuaternion::from_axis_angle(&Vec3::z_axis(), 0.3 * f64::from(number));
        let mesh = sheet_mesh(SIZE, CELLS, |x| {
            turn * x + Vec3::z() * (1e-3 * f64::from(number))
        })?;
        let speeds = vec![Vec3::new(0.1, 0.0, 1.0) * speed; mesh.positions.len()];
        world.add_sheet(mesh, config(Vec3::zeros()), &[])?;
        if let Some(body) = world.bodies.last_mut() {
            body.set_velocities(&speeds)?;
        }
    }
    world.complete(0.5);
    let mut off = f64::NAN;
    for _ in 0..40 {
        world.step()?;
        ordinary.count(&world);
        let (mut sums, mut size) = ([Vec3::zeros(); 2], 0.0);
        for (_, _, touch) in world.contacts.points() {
            let force = touch.force();
            size += force.norm();
            for (at, weight) in touch.nodes {
                sums[at.body] += force * weight;
            }
        }
        if size > 0.0 {
            off = ((sums[0] + sums[1]).norm() / size).max(off);
        }
    }
    let name = "sum of the impulses of two bodies, relative to their size";
    aims.push(Aim::at_most(name, "", off, 1e-14));
    Ok(())
}

/// A sheet falls 5 mm on a plane while it moves along the plane: its rebound, and the energy that the contacts create.
fn drop_sheet(aims: &mut Vec<Aim>, ordinary: &mut Vertices) -> Result<(), StudyError> {
    let mut world = above_plane(5e-3, 0.0, 0.3)?;
    let speed = vec![Vec3::x() * 0.3; world.bodies[0].vertex_count()];
    world.bodies[0].set_velocities(&speed)?;
    let (mut fastest_down, mut fastest_up) = (0.0_f64, 0.0_f64);
    let (mut created, mut net, mut moves, mut stored) = (0.0, 0.0, 0.0_f64, 0.0);
    for _ in 0..100 {
        world.step()?;
        ordinary.count(&world);
        let speed = world.velocity(0).z;
        fastest_down = fastest_down.max(-speed);
        fastest_up = fastest_up.max(speed);
        let report = world.contacts.report();
        let gain = report.stored - stored - report.taken;
        stored = report.stored;
        created += gain.max(0.0);
        net += gain;
        moves = moves.max(world.bodies[0].kinetic_energy());
    }
    aims.extend([
        Aim::at_most(
            "rebound of a sheet from 5 mm",
            "%",
            100.0 * fastest_up / fastest_down,
            8.0,
        ),
        Aim::at_most(
            "energy of the steps in which contacts create energy, of what moves",
            "%",
            100.0 * created / moves,
            0.2,
        ),
        Aim::at_most(
            "net energy of the contacts, of what moves",
            "%",
            100.0 * net / moves,
            0.0,
        ),
    ]);
    Ok(())
}

/// A sheet starts 1 mm below a plane. Its sides part at 0.2 m/s.
fn part(aims: &mut Vec<Aim>) -> Result<(), StudyError> {
    const PARTING: f64 = 0.2;
    let mut world = World::new();
    let mesh = sheet_mesh(SIZE, CELLS, |x| x - Vec3::z() * 1e-3)?;
    world.add_sheet(mesh, config(DOWN), &[])?;
    world.add_floor()?;
    world.complete(0.5);
    let (mut energy, mut fastest) = (0.0_f64, 0.0_f64);
    for _ in 0..100 {
        world.step()?;
        let body = &world.bodies[0];
        energy = energy.max(body.kinetic_energy());
        let speeds = body.node_velocities().iter().map(Vec3::norm);
        fastest = speeds.fold(fastest, f64::max);
    }
    let unit = 0.5 * world.bodies[0].total_mass() * PARTING * PARTING;
    aims.extend([
        Aim::at_most(
            "parting at v: kinetic energy",
            "m v^2 / 2",
            energy / unit,
            2.0,
        ),
        Aim::at_most("parting at v: fastest vertex", "v", fastest / PARTING, 2.5),
    ]);
    Ok(())
}
