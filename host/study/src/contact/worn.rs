//! Iterations of sheets that slide on triangles, drape over a ball, and are worn by a cylinder that moves.
//!
//! A step takes as many iterations as its factor and its contacts demand, whatever the number of the contacts. The sheets are
//! stepped as the host steps them: a factor is renewed after some steps, and never within one.

use super::aim::Aim;
use super::world::{DOWN, GRAVITY, RADIUS, STEP, World, config, sheet_mesh};
use crate::{Level, StudyError};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use physics::Vec3;
use physics::contact::obstacle::{ClosedMesh, Motion, TimedPose};
use physics::contact::shape::Shape;
use physics::mesh::TriMesh;
use std::f64::consts::{PI, TAU};

/// The median and the 99th percentile of the iterations of a step, and the most rows.
struct Iterations {
    median: f64,
    most: f64,
    rows: usize,
}

/// Makes `steps` steps, of which the `first` are not counted.
fn counted(world: &mut World, first: usize, steps: usize) -> Result<Iterations, StudyError> {
    let (mut counts, mut rows) = (Vec::with_capacity(steps), 0);
    for step in 0..steps {
        world.step()?;
        let report = world.contacts.report();
        if step >= first {
            counts.push(report.solved.iterations);
            rows = rows.max(report.rows.rows);
        }
    }
    counts.sort_unstable();
    let at = |part: f64| counts[(part * (counts.len() - 1) as f64) as usize] as f64;
    Ok(Iterations {
        median: at(0.5),
        most: at(0.99),
        rows,
    })
}

/// Measures the iterations.
pub(super) fn run(level: Level, aims: &mut Vec<Aim>) -> Result<(), StudyError> {
    slide(aims)?;
    let steps = level.choose(150, 300);
    let found = counted(&mut drape()?, 50, steps)?;
    let name = "iterations a step while a cloth drapes, median";
    aims.push(Aim::at_most(name, "", found.median, 24.0));
    let mut medians = [0.0; 2];
    for (cells, median) in [[28, 16], [48, 34]].into_iter().zip(&mut medians) {
        let found = counted(&mut worn(cells, steps)?, 50, steps)?;
        let of = format!("iterations a step of a worn tube of {} rows", found.rows);
        aims.extend([
            Aim::at_most(format!("{of}, median"), "", found.median, 8.0),
            Aim::at_most(format!("{of}, 99 %"), "", found.most, 25.0),
        ]);
        *median = found.median;
    }
    let [few, many] = medians;
    let name = "iterations of the larger tube, by those of the smaller one";
    aims.push(Aim::at_most(name, "", many / few, 1.3));
    Ok(())
}

/// A sheet slides on an incline of triangles, at 1.5 times the angle of friction.
fn slide(aims: &mut Vec<Aim>) -> Result<(), StudyError> {
    let (friction, first, steps) = (0.5, 25, 125);
    let (sin, cos) = libm::sincos(libm::atan(1.5 * friction));
    let gravity = Vec3::new(GRAVITY * sin, 0.0, -GRAVITY * cos);
    let mut world = World::new();
    let mesh = sheet_mesh([0.06, 0.04], [6, 4], |x| x + Vec3::z() * RADIUS)?;
    world.add_sheet(mesh, config(gravity), &[])?;
    world.add_mesh(slab()?)?;
    world.complete(friction);
    let (mut start, mut most) = (0.0, 0);
    for step in 0..steps {
        if step == first {
            start = world.velocity(0).x;
        }
        world.step()?;
        if step >= first {
            most = most.max(world.contacts.report().solved.iterations);
        }
    }
    let found = (world.velocity(0).x - start) / (f64::from(steps - first) * STEP);
    let exact = GRAVITY * (sin - friction * cos);
    let error = 100.0 * (found / exact - 1.0).abs();
    aims.extend([
        Aim::at_most(
            "incline of triangles: error of the acceleration",
            "%",
            error,
            0.1,
        ),
        Aim::at_most(
            "iterations a step while it slides on triangles, most",
            "",
            most as f64,
            6.0,
        ),
    ]);
    Ok(())
}

/// A slab of triangles below the plane `z = 0`. Its edges match none of the sheet.
fn slab() -> Result<ClosedMesh, StudyError> {
    let (long, wide) = (80, 6);
    let count = (long + 1) * (wide + 1);
    let at = |i: u32, j: u32, layer: u32| layer * count + j * (long + 1) + i;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for z in [0.0, -0.05] {
        for j in 0..=wide {
            let row = 0..=long;
            positions.extend(row.map(|i| {
                let (x, y) = (
                    f64::from(i) / f64::from(long),
                    f64::from(j) / f64::from(wide),
                );
                Vec3::new(3.0 * x - 0.2, 0.2 * y - 0.0989, z)
            }));
        }
    }
    let mut square = |[a, b, c, d]: [u32; 4]| triangles.extend([[a, b, c], [a, c, d]]);
    for (i, j) in (0..wide).flat_map(|j| (0..long).map(move |i| (i, j))) {
        square([
            at(i, j, 0),
            at(i + 1, j, 0),
            at(i + 1, j + 1, 0),
            at(i, j + 1, 0),
        ]);
        square([
            at(i, j, 1),
            at(i, j + 1, 1),
            at(i + 1, j + 1, 1),
            at(i + 1, j, 1),
        ]);
    }
    // The side below an edge of the top.
    let mut side = |a: [u32; 2], b: [u32; 2]| {
        square([
            at(a[0], a[1], 0),
            at(a[0], a[1], 1),
            at(b[0], b[1], 1),
            at(b[0], b[1], 0),
        ]);
    };
    for i in 0..long {
        side([i, 0], [i + 1, 0]);
        side([i + 1, wide], [i, wide]);
    }
    for j in 0..wide {
        side([long, j], [long, j + 1]);
        side([0, j + 1], [0, j]);
    }
    Ok(ClosedMesh::new(positions, triangles)?)
}

/// A cloth of 1,152 triangles that falls on a ball and drapes over it.
fn drape() -> Result<World, StudyError> {
    let mut world = World::new();
    let mesh = sheet_mesh([0.2; 2], [24; 2], |x| x + Vec3::z() * 0.052)?;
    let mut cloth = config(DOWN);
    cloth.mass_damping = 0.5;
    world.add_as_host(mesh, cloth)?;
    world.add_obstacle(Shape::sphere(0.05), Motion::Still(Isometry3::identity()))?;
    world.complete(0.4);
    Ok(world)
}

/// A tube of a sheet, drawn over a cylinder with 2 % of strain, which turns to and fro and moves across its axis. After a jump of
/// its velocity all contacts slip or stick otherwise, and four steps take up to 160 iterations; its motion begins without one.
fn worn([around, along]: [u32; 2], steps: usize) -> Result<World, StudyError> {
    let (radius, length) = (0.05, 0.3);
    let at = |i: u32, j: u32| j * around + i % around;
    let (mut drawn, mut rest) = (Vec::new(), Vec::new());
    for (i, j) in (0..=along).flat_map(|j| (0..around).map(move |i| (i, j))) {
        let (sin, cos) = libm::sincos(TAU * f64::from(i) / f64::from(around));
        let z = length * (f64::from(j) / f64::from(along) - 0.5);
        rest.push(Vec3::new(0.98 * radius * cos, 0.98 * radius * sin, z));
        drawn.push(Vec3::new(
            (radius + RADIUS) * cos,
            (radius + RADIUS) * sin,
            z,
        ));
    }
    let mut triangles = Vec::new();
    for (i, j) in (0..along).flat_map(|j| (0..around).map(move |i| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        if (i + j) % 2 == 0 {
            triangles.extend([[a, b, c], [a, c, d]]);
        } else {
            triangles.extend([[a, b, d], [b, c, d]]);
        }
    }
    let mut world = World::new();
    world.add_as_host(TriMesh::new(rest, triangles)?, config(DOWN))?;
    world.bodies[0].set_positions(&drawn)?;
    let poses = (0..=steps).map(|step| {
        let time = STEP * step as f64;
        // Begins as an arm does, with the least jerk (Flash and Hogan, "The coordination of arm movements", 1985).
        let part = (time / 0.2).min(1.0);
        let begun = part.powi(3) * (10.0 - part * (15.0 - 6.0 * part));
        let across = Vec3::new(
            0.02 * (libm::cos(7.0 * time) - 1.0),
            0.0,
            0.02 * libm::sin(9.0 * time),
        );
        let turn = 0.2 * PI * libm::sin(6.0 * time);
        let turn = UnitQuaternion::from_axis_angle(&Vec3::z_axis(), begun * turn);
        TimedPose {
            time,
            pose: Isometry3::from_parts(Translation3::from(across * begun), turn),
        }
    });
    let poses = Motion::Poses(poses.collect());
    world.add_obstacle(Shape::Cylinder { half: 0.3, radius }, poses)?;
    world.complete(0.3);
    Ok(world)
}
