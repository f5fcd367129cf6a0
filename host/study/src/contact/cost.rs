//! The processor time of detection, rows, solve and certificate, by row and by vertex.

use super::motions;
use super::world::{DOWN, RADIUS, Stages, World, config, sheet_mesh};
use crate::speed::Times;
use crate::speed::clock::cpu_time;
use crate::{Level, StudyError};
use nalgebra::UnitQuaternion;
use physics::Vec3;
use physics::contact::{Lists, Meeting, Moves, Rows, Step};
use serde::Serialize;

/// The time of a stage in a scene of one size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// The scene.
    pub scene: &'static str,
    /// The stage: `lists`, `rows`, `lists and rows`, `solve` or `certificate`.
    pub stage: &'static str,
    /// Triangles of all surfaces.
    pub triangles: usize,
    /// Vertices of all surfaces.
    pub vertices: usize,
    /// Rows of a step, median.
    pub rows: usize,
    /// The times of a step (s).
    pub time: Times,
    /// The time by vertex (s).
    pub by_vertex: Share,
    /// The time by row (s); `null` for a scene without rows.
    pub by_row: Option<Share>,
}

/// A time divided by a number of things (s).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Share {
    /// Of the median step.
    pub median: f64,
    /// Of the 99.9th percentile.
    pub p999: f64,
}

impl Share {
    fn of(time: &Times, count: usize) -> Self {
        Self {
            median: time.median / count as f64,
            p999: time.p999 / count as f64,
        }
    }
}

/// Cells along a side of a sheet for about 1K, 3.4K, 10K and 50K triangles.
const CELLS: [u32; 4] = [16, 29, 50, 112];
/// Steps of a prescribed motion, which is then run backwards and again.
const THERE: u32 = 24;

/// Measures the times.
pub(super) fn run(level: Level, progress: &mut dyn FnMut(f64)) -> Result<Vec<Cost>, StudyError> {
    let sizes = level.take(&CELLS, 1);
    let mut costs = Vec::new();
    for (number, cells) in sizes.iter().enumerate() {
        // A percentile of 99.9 needs a thousand steps. Larger meshes have the longest of their steps instead.
        let full = match cells {
            ..30 => 1000,
            30..100 => 200,
            _ => 50,
        };
        let steps = level.choose(20, full);
        for scene in motions::all(*cells)? {
            costs.extend(prescribed(&scene, steps));
        }
        costs.extend(landing(*cells, steps)?);
        progress((number + 1) as f64 / sizes.len() as f64);
    }
    Ok(costs)
}

/// A scene, with the sizes that divide times.
struct Size {
    scene: &'static str,
    triangles: usize,
    vertices: usize,
    rows: usize,
}

impl Size {
    fn cost(&self, stage: &'static str, times: Vec<f64>) -> Cost {
        let time = Times::of(times);
        Cost {
            scene: self.scene,
            stage,
            triangles: self.triangles,
            vertices: self.vertices,
            rows: self.rows,
            by_vertex: Share::of(&time, self.vertices),
            by_row: (self.rows > 0).then(|| Share::of(&time, self.rows)),
            time,
        }
    }
}

fn median(mut counts: Vec<usize>) -> usize {
    counts.sort_unstable();
    counts.get(counts.len() / 2).copied().unwrap_or_default()
}

/// The lists and the rows of a prescribed motion, without a solve.
fn prescribed(scene: &motions::Scene, steps: u32) -> [Cost; 2] {
    let surfaces = &scene.surfaces;
    let at = |step: u32| {
        let phase = step % (2 * THERE);
        scene.at(f64::from(phase.min(2 * THERE - phase)) * motions::STEP)
    };
    let mut x = at(0);
    let mut lists = Lists::new(surfaces, &x);
    let mut rows = Rows::new(surfaces, 8 * surfaces.vertices);
    let masses = vec![1e-6; surfaces.vertices];
    let (mut of_lists, mut of_rows, mut counts) = (Vec::new(), Vec::new(), Vec::new());
    for step in 0..steps {
        let next = at(step + 1);
        let u: Vec<Vec3> = next.iter().zip(&x).map(|(next, x)| next - x).collect();
        let v: Vec<Vec3> = u.iter().map(|u| u / motions::STEP).collect();
        let start = cpu_time();
        lists.follow(surfaces, &x, |hierarchy, cluster| {
            Moves::of(hierarchy.members(cluster), &u)
        });
        let listed = cpu_time();
        let report = rows.begin(&Step {
            surfaces,
            obstacles: &[],
            x: &x,
            u: &u,
            v: &v,
            masses: &masses,
            h: motions::STEP,
            parting: 0.2,
            meeting: &Meeting::by_radii(surfaces, 0.3),
            hierarchy: lists.hierarchy(),
            pairs: &|found| lists.each(surfaces, &x, found),
        });
        of_rows.push(cpu_time() - listed);
        of_lists.push(listed - start);
        counts.push(report.rows);
        x = next;
    }
    let size = Size {
        scene: scene.name,
        triangles: surfaces.triangles.len(),
        vertices: surfaces.vertices,
        rows: median(counts),
    };
    [size.cost("lists", of_lists), size.cost("rows", of_rows)]
}

/// Two sheets fall on each other and on a plane.
fn landing(cells: u32, steps: u32) -> Result<[Cost; 3], StudyError> {
    let mut world = World::new();
    for layer in 0..2 {
        let turn = UnitQuaternion::from_axis_angle(&Vec3::z_axis(), 0.3 * f64::from(layer));
        let height = RADIUS + f64::from(layer + 1) * 0.5e-3;
        let mesh = sheet_mesh([0.2; 2], [cells; 2], |x| turn * x + Vec3::z() * height)?;
        world.add_sheet(mesh, config(DOWN), &[])?;
    }
    world.add_floor()?;
    world.complete(0.3);
    let (mut stages, mut counts): (Vec<Stages>, _) = (Vec::new(), Vec::new());
    for _ in 0..steps {
        stages.push(world.step()?);
        counts.push(world.contacts.report().rows.rows);
    }
    let surfaces = world.contacts.surfaces();
    let size = Size {
        scene: "two sheets land",
        triangles: surfaces.triangles.len(),
        vertices: surfaces.vertices,
        rows: median(counts),
    };
    let times = |of: fn(&Stages) -> f64| stages.iter().map(of).collect();
    Ok([
        size.cost("lists and rows", times(|stage| stage.begin)),
        size.cost("solve", times(|stage| stage.solve)),
        size.cost("certificate", times(|stage| stage.certify)),
    ])
}
