//! The cube on which the other programs were measured, and harder motions and materials of the cube.
//!
//! 10 cm, 1 kg, E = 20 kPa, nu = 0.3, Rayleigh damping by mass 0.1 and by stiffness 0.1, no gravity, bonded to
//! two plates, corotational linear tetrahedra by Kuhn's split, implicit Euler.

use super::motion::{self, Motion};
use super::path::{self, Method, Path};
use super::trial::{Course, Scene};
use super::{Row, Told};
use crate::{Level, StudyError};
use physics::mesh::TetMesh;
use physics::mesh::generate_box::solid_box;
use physics::{Body, BodyConfig, Border, Freedom, HandleSpec, SolidLaw, SolidMaterial, Vec3};

pub(super) const EDGE: f64 = 0.1;
const YOUNG: f64 = 2e4;
/// The handle on top, one of two.
pub(super) const TOP: usize = 1;

/// The distribution of the stiffness in the cube.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stiffness {
    /// Uniform.
    Uniform,
    /// Multiplied by 0.5 to 1.5, cell by cell, at random.
    Varied,
    /// A core of half the edge that is a hundred times stiffer.
    Core,
}

impl Stiffness {
    /// Factors on Young's modulus, one for each of `cells` centres (m).
    fn factors(self, centres: impl Iterator<Item = Vec3>) -> Vec<f64> {
        let factor = |(cell, centre): (u64, Vec3)| match self {
            Self::Varied => 0.5 + uniform(cell),
            Self::Core if centre.amax() < 0.25 * EDGE => 100.0,
            Self::Uniform | Self::Core => 1.0,
        };
        (0_u64..).zip(centres).map(factor).collect()
    }
}

/// A number from 0 to 1 that depends on `seed` alone (SplitMix64: Steele, Lea and Flood, "Fast splittable pseudorandom
/// number generators", 2014).
fn uniform(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// The cube of `n` cells along each edge, at rest. Handle 0 holds the bottom, [`TOP`] the top.
pub(super) fn cube(n: u32, quadratic: bool, stiffness: Stiffness) -> Result<Body, StudyError> {
    cube_damped(n, quadratic, stiffness, 0.1)
}

/// The same with another stiffness damping (s).
pub(super) fn cube_damped(
    n: u32,
    quadratic: bool,
    stiffness: Stiffness,
    stiffness_damping: f64,
) -> Result<Body, StudyError> {
    let law = SolidLaw::Corotational;
    cube_with(law, n, quadratic, stiffness, stiffness_damping)
}

/// The uniform cube under another law.
pub(super) fn cube_of(law: SolidLaw, n: u32, quadratic: bool) -> Result<Body, StudyError> {
    cube_with(law, n, quadratic, Stiffness::Uniform, 0.1)
}

fn cube_with(
    law: SolidLaw,
    n: u32,
    quadratic: bool,
    stiffness: Stiffness,
    stiffness_damping: f64,
) -> Result<Body, StudyError> {
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
        stiffness_damping,
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
            border: Border::Hinged,
        }
    };
    let handles = [face(-1.0), face(1.0)];
    Ok(Body::solid(&mesh, &materials, law, config, &handles)?)
}

fn centres(mesh: &TetMesh) -> impl Iterator<Item = Vec3> + '_ {
    mesh.cells.vertices().map(|cell| {
        let corners = cell.iter().take(4);
        corners.map(|&v| mesh.positions[v as usize]).sum::<Vec3>() * 0.25
    })
}

/// The cube compressed by a tenth within `duration` (s), and held until it is at rest.
pub(super) fn press(n: u32, duration: f64) -> Result<Scene, StudyError> {
    Ok(Scene {
        name: "press",
        title: format!("pressed by a tenth in {duration} s, steps of 10 ms"),
        body: cube(n, false, Stiffness::Uniform)?,
        tool: TOP,
        // Damping adds at most a fifth to the force. Each step leaves 1 / (1 + h / beta) of that part: 1e-7 at the end.
        motion: Motion::ramp(Vec3::z() * (-0.1 * EDGE), duration, 1.5, 0.01),
        along: Vec3::z(),
    })
}

/// A tremor of 10 Hz and 0.5 mm on a press of 5 mm.
pub(super) fn tremor(n: u32, steps: usize) -> Result<Scene, StudyError> {
    Ok(Scene {
        name: "tremor",
        title: "tremor of 10 Hz and 0.5 mm on a press of 5 mm in 0.5 s, steps of 1 ms".to_owned(),
        body: cube(n, false, Stiffness::Uniform)?,
        tool: TOP,
        motion: Motion {
            step: 0.001,
            steps,
            timed: steps,
            path: motion::Path::Tremor {
                to: Vec3::z() * (-0.05 * EDGE),
                duration: 0.5,
                amplitude: Vec3::new(2e-4, 0.0, 5e-4),
                frequency: 10.0,
            },
        },
        along: Vec3::z(),
    })
}

/// The other motions and materials, shorter if `level` is quick.
fn harder(n: u32, level: Level) -> Result<Vec<Scene>, StudyError> {
    let down = Vec3::z() * (-0.1 * EDGE);
    let aside = Vec3::x() * (0.5 * EDGE);
    let (first, slow, slower, trembling) = match level {
        Level::Quick => (100, 0.5, 1.0, 150),
        Level::Full => (1000, 3.0, 4.0, 600),
    };
    let scene = |name, title, stiffness, motion, along| {
        Ok::<_, StudyError>(Scene {
            name,
            title,
            body: cube(n, false, stiffness)?,
            tool: TOP,
            motion,
            along,
        })
    };
    Ok(vec![
        scene(
            "press_1ms",
            format!("{first} steps of 1 ms of a press by a tenth in 1.5 s"),
            Stiffness::Uniform,
            Motion::ramp(down, 1.5, 0.0, 0.001).first(first),
            Vec3::z(),
        )?,
        scene(
            "varied",
            format!("pressed by a tenth in {slow} s, steps of 10 ms, E 0.5 to 1.5 times"),
            Stiffness::Varied,
            Motion::ramp(down, slow, 0.5, 0.01),
            Vec3::z(),
        )?,
        scene(
            "core",
            format!("pressed by a tenth in {slow} s, steps of 10 ms, a core 100 times stiffer"),
            Stiffness::Core,
            Motion::ramp(down, slow, 0.5, 0.01),
            Vec3::z(),
        )?,
        scene(
            "shear",
            format!("sheared by half its height in {slower} s, steps of 10 ms"),
            Stiffness::Uniform,
            Motion::ramp(aside, slower, 0.5, 0.01),
            Vec3::x(),
        )?,
        tremor(n, trembling)?,
    ])
}

/// All scenes of the cube on all paths. `tell` is given the fraction done, and each row.
pub(super) fn run(level: Level, tell: &mut dyn FnMut(Told<'_>)) -> Result<Vec<Row>, StudyError> {
    // Each mesh with its approximate fraction of the time.
    let (presses, others, duration) = match level {
        Level::Quick => ([(6, 0.25), (8, 0.2), (10, 0.4)], &[(4, 0.15)][..], 0.5),
        Level::Full => (
            [(6, 0.09), (8, 0.12), (10, 0.24)],
            &[(6, 0.15), (10, 0.4)][..],
            15.0,
        ),
    };
    let mut rows = Vec::new();
    let mut done = 0.0;
    for (n, fraction) in presses {
        tell(Told::Fraction(done));
        compare(
            &press(n, duration)?,
            paths(level, n),
            &mut rows,
            &mut |row| {
                tell(Told::Cube(row));
            },
        )?;
        done += fraction;
    }
    for &(n, fraction) in others {
        tell(Told::Fraction(done));
        for scene in harder(n, level)? {
            compare(&scene, paths(level, n), &mut rows, &mut |row| {
                tell(Told::Cube(row));
            })?;
        }
        done += fraction;
    }
    Ok(rows)
}

/// The paths for a mesh of `n` cells along the edge.
fn paths(level: Level, n: u32) -> impl Iterator<Item = Path> {
    path::ALL.into_iter().filter(move |path| match level {
        _ if n <= 6 => true,
        // Newton's method takes longer than all other paths together.
        Level::Full => path.method != path::NEWTON,
        Level::Quick => path.strict && path.method != path::NEWTON,
    })
}

/// Adds a row for each path, and tells it.
pub(super) fn compare(
    scene: &Scene,
    paths: impl IntoIterator<Item = Path>,
    rows: &mut Vec<Row>,
    tell: &mut dyn FnMut(&Row),
) -> Result<(), StudyError> {
    let mut add = |row: Row| {
        tell(&row);
        rows.push(row);
    };
    let mut newton = None;
    // The tight solutions that have been computed so far.
    let mut tight: Vec<(Method, Course)> = Vec::new();
    for path in paths {
        let course = scene.drive(path.method)?;
        let exact = path.method.tight();
        if exact == path.method {
            // This path is its own reference.
            add(scene.row(path.name, &course, &course, Some(&course)));
            newton = Some(course);
            continue;
        }
        if !tight.iter().any(|(method, _)| *method == exact) {
            tight.push((exact, scene.drive(exact)?));
        }
        if let Some((_, against)) = tight.iter().find(|(method, _)| *method == exact) {
            add(scene.row(path.name, &course, against, newton.as_ref()));
        }
    }
    Ok(())
}
