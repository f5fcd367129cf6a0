//! Sheets that are thrown at each other at 2 m/s, while the solver stops after one iteration of each pass.
//!
//! An exact test of all edges and triangles counts what crosses after each step. A throw is flat, with an edge or with a
//! corner ahead, or consists of eight layers.

use super::aim::Aim;
use super::world::{RADIUS, World, config, sheet_mesh};
use crate::chance::Chance;
use crate::{Level, StudyError};
use nalgebra::UnitQuaternion;
use physics::mesh::TriMesh;
use physics::{Body, Border, Freedom, HandleSpec, Vec3};

/// The speed (m/s).
const SPEED: f64 = 2.0;
/// Side of a sheet (m), and its cells.
const SIDE: f64 = 0.04;
const CELLS: [u32; 2] = [4, 4];
/// Steps of a throw.
const STEPS: usize = 12;
/// Sheets of a throw of layers.
const LAYERS: u32 = 8;
const KINDS: [&str; 4] = ["flat", "edge", "corner", "8 layers"];

/// Throws, and counts crossings.
pub(super) fn run(
    level: Level,
    seed: u64,
    progress: &mut dyn FnMut(f64),
    aims: &mut Vec<Aim>,
) -> Result<(), StudyError> {
    let throws: u64 = level.choose(64, 10_000);
    let mut crossed = [0_usize; KINDS.len()];
    let (mut truncated, mut kinetic, mut most) = (0, 0.0_f64, 0.0_f64);
    for throw in 0..throws {
        let kind = (throw % 4) as usize;
        let mut world = thrown(kind, Chance::new(seed, throw))?;
        let (mut crosses, start) = (false, energy(&world));
        for _ in 0..STEPS {
            world.step()?;
            truncated += world.contacts.report().truncated.truncated;
            crosses |= world.crossings() > 0;
            let moving: f64 = world.bodies.iter().map(Body::kinetic_energy).sum();
            kinetic = kinetic.max(moving / start);
            most = most.max(energy(&world) / start);
        }
        crossed[kind] += usize::from(crosses);
        progress((throw + 1) as f64 / throws as f64);
    }
    for (kind, crossed) in KINDS.into_iter().zip(crossed) {
        let name = format!("throws of {} that cross, {kind}", throws / 4);
        aims.push(Aim::at_most(name, "", crossed as f64, 0.0));
    }
    let name = "largest kinetic energy of a throw, of that at its start";
    aims.push(Aim::at_most(name, "", kinetic, 1.0));
    let name = "the same with the elastic energy";
    aims.push(Aim::at_most(name, "", most, 1.0));
    if truncated == 0 {
        // The throws do not show what they are for.
        let name = "throws without a truncation";
        aims.push(Aim::at_most(name, "", throws as f64, 0.0));
    }
    Ok(())
}

/// The kinetic and elastic energy of all bodies (J).
fn energy(world: &World) -> f64 {
    world.bodies.iter().map(Body::total_energy).sum()
}

/// The world of a throw, before its first step.
fn thrown(kind: usize, chance: Chance) -> Result<World, StudyError> {
    let draw = |name: &str, low: f64, high: f64| chance.of(name).between(0, low, high);
    let mut world = World::new();
    world.is_stopped = true;
    let still = config(Vec3::zeros());
    let lower = sheet_mesh([SIDE; 2], CELLS, |x| *x)?;
    let border = border(&lower);
    world.add_sheet(lower, still, &[border])?;
    let yaw = draw("yaw", -0.8, 0.8);
    let (roll, pitch) = match kind {
        1 => (draw("roll", 0.4, 1.5), 0.0),
        2 => (draw("roll", 0.4, 1.2), draw("pitch", 0.4, 1.2)),
        _ => (draw("roll", -0.02, 0.02), draw("pitch", -0.02, 0.02)),
    };
    let gap = draw("gap", 2.2 * RADIUS, 8.0 * RADIUS);
    let layers = if kind == 3 { LAYERS } else { 2 };
    for layer in 1..layers {
        let about = if kind == 3 {
            UnitQuaternion::from_euler_angles(0.0, 0.0, yaw * 0.2 * f64::from(layer))
        } else {
            UnitQuaternion::from_euler_angles(roll, pitch, yaw)
        };
        let half = 0.5 * SIDE;
        let corners = [[-half, -half], [-half, half], [half, -half], [half, half]];
        let low = corners.map(|[x, y]| (about * Vec3::new(x, y, 0.0)).z);
        let lowest = low.into_iter().fold(0.0, f64::min);
        let above = gap * f64::from(layer) - lowest;
        let aside = Vec3::new(draw("x", -0.3, 0.3), draw("y", -0.3, 0.3), 0.0) * SIDE;
        let mesh = sheet_mesh([SIDE; 2], CELLS, |x| about * x + aside + Vec3::z() * above)?;
        let spin = Vec3::new(0.0, 0.0, draw("spin", -20.0, 20.0));
        let along = Vec3::new(draw("u", -1.0, 1.0), draw("v", -1.0, 1.0), -SPEED);
        let speeds: Vec<Vec3> = mesh
            .positions
            .iter()
            .map(|x| along + spin.cross(&(x - aside)))
            .collect();
        world.add_sheet(mesh, still, &[])?;
        if let Some(body) = world.bodies.last_mut() {
            body.set_velocities(&speeds)?;
        }
    }
    world.complete(draw("friction", 0.0, 0.6));
    Ok(world)
}

/// What holds the border of a sheet.
fn border(mesh: &TriMesh) -> HandleSpec {
    let end = 0.5 * SIDE - 1e-9;
    let vertices = (0_u32..).zip(&mesh.positions);
    HandleSpec {
        vertices: vertices
            .filter(|(_, x)| x.x.abs().max(x.y.abs()) > end)
            .map(|(vertex, _)| vertex)
            .collect(),
        origin: Vec3::zeros(),
        freedom: Freedom::Fixed,
        border: Border::Hinged,
    }
}
