//! The cube on which the other programs were measured, and harder motions and materials of it.
//!
//! 10 cm, 1 kg, E = 20 kPa, nu = 0.3, Rayleigh damping by mass 0.1 and by stiffness 0.1, no gravity, bonded to
//! two plates, corotational linear tetrahedra by Kuhn's split, implicit Euler.

use super::motion::{Motion, Path};
use super::path::{self, Method};
use super::trial::Scene;
use super::{Level, Row, SpeedError};
use physics::Vec3;
use physics::fem::{Body, BodyConfig, Freedom, HandleSpec, SolidLaw, SolidMaterial};
use physics::mesh::TetMesh;
use physics::mesh::generate_box::solid_box;

pub(super) const EDGE: f64 = 0.1;
const YOUNG: f64 = 2e4;
/// The handle on top, of two.
pub(super) const TOP: usize = 1;

/// How stiff the cube's parts are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stiffness {
    /// The same everywhere.
    Uniform,
    /// 0.5 to 1.5 times as much, cell by cell, at random.
    Varied,
    /// A core of half the edge that is a hundred times stiffer.
    Core,
}

impl Stiffness {
    /// Factors on Young's modulus, one for each of `cells` centres (m).
    fn factors(self, centres: impl Iterator<Item = Vec3>) -> Vec<f64> {
        let factor = |(cell, centre): (u64, Vec3)| match self {
            Self::Uniform => 1.0,
            Self::Varied => 0.5 + share(cell),
            Self::Core if centre.amax() < 0.25 * EDGE => 100.0,
            Self::Core => 1.0,
        };
        (0_u64..).zip(centres).map(factor).collect()
    }
}

/// A number from 0 to 1 that `seed` alone decides (SplitMix64: Steele, Lea and Flood, "Fast splittable
/// pseudorandom number generators", 2014).
fn share(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// The cube of `n` cells along each edge, at rest; handle 0 holds its bottom, [`TOP`] its top.
pub(super) fn cube(n: u32, quadratic: bool, stiffness: Stiffness) -> Result<Body, SpeedError> {
    let mut mesh = solid_box([EDGE; 3], [n; 3])?;
    if quadratic {
        mesh = mesh.quadratic();
    }
    let materials: Vec<_> = stiffness
        .factors(centres(&mesh))
        .into_iter()
        .map(|factor| SolidMaterial {
            young: factor * YOUNG,
            poisson: 0.3,
            density: 1000.0,
        })
        .collect();
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping: 0.1,
        stiffness_damping: 0.1,
        ..BodyConfig::default()
    };
    let face = |side: f64| {
        let vertices = (0_u32..).zip(&mesh.positions);
        HandleSpec {
            vertices: vertices
                .filter(|(_, x)| side * x.z > 0.5 * EDGE - 1e-9)
                .map(|(vertex, _)| vertex)
                .collect(),
            origin: Vec3::z() * (0.5 * side * EDGE),
            freedom: Freedom::Translation,
        }
    };
    let handles = [face(-1.0), face(1.0)];
    let law = SolidLaw::Corotational;
    Ok(Body::solid(&mesh, &materials, law, config, &handles)?)
}

fn centres(mesh: &TetMesh) -> impl Iterator<Item = Vec3> + '_ {
    mesh.cells.vertices().map(|cell| {
        let corners = cell.iter().take(4);
        corners.map(|&v| mesh.positions[v as usize]).sum::<Vec3>() * 0.25
    })
}

/// Pressed by a tenth within `duration` (s), and held until nothing moves.
pub(super) fn press(n: u32, duration: f64) -> Result<Scene, SpeedError> {
    Ok(Scene {
        name: "press",
        title: "pressed by a tenth, steps of 10 ms",
        body: cube(n, false, Stiffness::Uniform)?,
        tool: TOP,
        // The damping's rate is 1 / 0.1 s at most: after 2 s it has left 2e-9.
        motion: Motion::ramp(Vec3::z() * (-0.1 * EDGE), duration, 2.0, 0.01),
        along: Vec3::z(),
    })
}

/// A tremor of 10 Hz and 0.5 mm on a press of 5 mm.
pub(super) fn tremor(n: u32, steps: usize) -> Result<Scene, SpeedError> {
    Ok(Scene {
        name: "tremor",
        title: "tremor of 10 Hz and 0.5 mm in a press of 5 mm, steps of 1 ms",
        body: cube(n, false, Stiffness::Uniform)?,
        tool: TOP,
        motion: Motion {
            step: 0.001,
            steps,
            path: Path::Tremor {
                to: Vec3::z() * (-0.05 * EDGE),
                duration: 0.5,
                amplitude: Vec3::new(2e-4, 0.0, 5e-4),
                frequency: 10.0,
            },
        },
        along: Vec3::z(),
    })
}

/// The other motions and materials, less of each where `level` is quick.
fn harder(n: u32, level: Level) -> Result<Vec<Scene>, SpeedError> {
    let down = Vec3::z() * (-0.1 * EDGE);
    let scene = |name, title, stiffness, motion, along| {
        Ok::<_, SpeedError>(Scene {
            name,
            title,
            body: cube(n, false, stiffness)?,
            tool: TOP,
            motion,
            along,
        })
    };
    let full = level == Level::Full;
    Ok(vec![
        scene(
            "press_1ms",
            "pressed by a tenth in 1.5 s, steps of 1 ms",
            Stiffness::Uniform,
            Motion {
                steps: if full { 2000 } else { 150 },
                ..Motion::ramp(down, 1.5, 0.5, 0.001)
            },
            Vec3::z(),
        )?,
        scene(
            "varied",
            "the same in 3 s, steps of 10 ms, E 0.5 to 1.5 times",
            Stiffness::Varied,
            Motion::ramp(down, if full { 3.0 } else { 0.6 }, 0.5, 0.01),
            Vec3::z(),
        )?,
        scene(
            "core",
            "the same, a core 100 times stiffer",
            Stiffness::Core,
            Motion::ramp(down, if full { 3.0 } else { 0.6 }, 0.5, 0.01),
            Vec3::z(),
        )?,
        scene(
            "shear",
            "sheared by half its height in 4 s, steps of 10 ms",
            Stiffness::Uniform,
            Motion {
                steps: if full { 450 } else { 100 },
                ..Motion::ramp(Vec3::x() * (0.5 * EDGE), 4.0, 0.5, 0.01)
            },
            Vec3::x(),
        )?,
        tremor(n, if full { 1000 } else { 150 })?,
    ])
}

/// All scenes of the cube on all paths.
pub(super) fn run(level: Level, mut progress: impl FnMut(f64)) -> Result<Vec<Row>, SpeedError> {
    // With the share of the time that each mesh takes, roughly.
    let (presses, others, duration): (&[(u32, f64)], &[(u32, f64)], f64) = match level {
        Level::Quick => (&[(6, 0.15), (8, 0.2), (10, 0.3)], &[(6, 0.35)], 1.0),
        Level::Full => (
            &[(6, 0.06), (8, 0.12), (10, 0.26)],
            &[(6, 0.06), (10, 0.5)],
            15.0,
        ),
    };
    let mut rows = Vec::new();
    let mut done = 0.0;
    for &(n, share) in presses {
        progress(done);
        // Newton's method takes longer than all the others together.
        compare(&press(n, duration)?, n < 8, &mut rows)?;
        done += share;
    }
    for &(n, share) in others {
        progress(done);
        for scene in harder(n, level)? {
            compare(&scene, true, &mut rows)?;
        }
        done += share;
    }
    Ok(rows)
}

/// A row for each path; Newton's method only `with_newton`.
pub(super) fn compare(
    scene: &Scene,
    with_newton: bool,
    rows: &mut Vec<Row>,
) -> Result<(), SpeedError> {
    let newton = if with_newton {
        Some(scene.drive(path::NEWTON)?)
    } else {
        None
    };
    // The tight solutions that were needed so far.
    let mut tight: Vec<(Method, super::trial::Course)> = Vec::new();
    for one in path::ALL {
        if one.method == path::NEWTON {
            if let Some(course) = &newton {
                // It is its own reference: what it leaves over is its residual.
                rows.push(scene.row(one.name, course, course, Some(course)));
            }
            continue;
        }
        let exact = one.method.tight();
        if !tight.iter().any(|(method, _)| *method == exact) {
            tight.push((exact, scene.drive(exact)?));
        }
        let Some((_, against)) = tight.iter().find(|(method, _)| *method == exact) else {
            continue;
        };
        let course = scene.drive(one.method)?;
        rows.push(scene.row(one.name, &course, against, newton.as_ref()));
    }
    Ok(())
}
