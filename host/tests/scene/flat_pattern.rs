//! Scenes of sheets that are cut out of flat patterns: from the OBJ file to the solution, and the errors on the way.

use host::engine::plan::{BodyPlan, stages};
use host::scene::{LoadedScene, Scene};
use host::solve::{BodySolution, Frame, Solution, solve};
use host::world::World;
use physics::Vec3;
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Cells around the sleeve and along it.
const AROUND: u32 = 32;
const ALONG: u32 = 12;
/// The radius (m) of the sleeve whose circumference is the width of its two pieces.
const RADIUS: f64 = 0.05;
/// Its length (m).
const LENGTH: f64 = 0.12;

/// The sleeve of `host/scenes/meshes/sleeve.obj`, at a radius of 0.06 m. Its two pieces lie side by side, with a gap.
/// Texture coordinates are in centimetres.
fn sleeve() -> String {
    let mut text =
        "# A sleeve of two pieces, written by host/tests/scene/flat_pattern.rs.\n".to_owned();
    for j in 0..=ALONG {
        for i in 0..AROUND {
            let (s, c) = (TAU * f64::from(i) / f64::from(AROUND)).sin_cos();
            let z = LENGTH * f64::from(j) / f64::from(ALONG);
            let _ = writeln!(text, "v {:.9} {:.9} {z:.6}", 0.06 * c, 0.06 * s);
        }
    }
    let half = AROUND / 2;
    for piece in 0..2 {
        for j in 0..=ALONG {
            for i in 0..=half {
                let u = 100.0 * PI * RADIUS * f64::from(i) / f64::from(half);
                let v = 100.0 * LENGTH * f64::from(j) / f64::from(ALONG);
                let _ = writeln!(text, "vt {:.9} {v:.4}", u + 20.0 * f64::from(piece));
            }
        }
    }
    let vertex = |piece: u32, i: u32, j: u32| 1 + j * AROUND + (piece * half + i) % AROUND;
    let point = |piece: u32, i: u32, j: u32| 1 + (piece * (ALONG + 1) + j) * (half + 1) + i;
    for piece in 0..2 {
        let _ = writeln!(text, "g {}", if piece == 0 { "front" } else { "back" });
        for (j, i) in (0..ALONG).flat_map(|j| (0..half).map(move |i| (j, i))) {
            let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(di, dj)| {
                let (i, j) = (i + di, j + dj);
                format!("{}/{}", vertex(piece, i, j), point(piece, i, j))
            });
            let _ = if (i + j) % 2 == 0 {
                writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}")
            } else {
                writeln!(text, "f {a} {b} {d}\nf {b} {c} {d}")
            };
        }
    }
    text
}

/// The scene `sleeve.toml` with its text changed.
fn changed(change: impl Fn(String) -> String, obj: &str) -> Result<LoadedScene, String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/sleeve.toml");
    let text = change(fs::read_to_string(path).unwrap());
    let files = BTreeMap::from([("meshes/sleeve.obj".to_owned(), obj.as_bytes().to_vec())]);
    Scene::load_texts("sleeve.toml", &text, &files).map_err(|error| error.to_string())
}

fn solved(loaded: &LoadedScene) -> (Solution, Vec<String>) {
    let mut frames = Vec::new();
    let mut keep = |frame: Frame<'_>| {
        frames.push(frame.grid.vtu());
        Ok::<(), Infallible>(())
    };
    let solution = solve(&World::new(loaded).unwrap(), true, &mut |_| {}, &mut keep).unwrap();
    assert!(solution.failures.is_empty(), "{:?}", solution.failures);
    (solution, frames)
}

/// The radius of the polygon whose sides have the length that the pattern gives them, less 0.06 m.
fn moved() -> f64 {
    let side = TAU * RADIUS / f64::from(AROUND);
    0.5 * side / (PI / f64::from(AROUND)).sin() - 0.06
}

fn check(body: &BodySolution, rigidity: f64) {
    let exact = 0.5 * rigidity * TAU * LENGTH / RADIUS;
    // Half a percent is the error of 32 cells around. That of the membrane's energy is the square of thickness over radius.
    let energy = body.elastic_energy / exact;
    assert!((energy - 1.0).abs() < 0.01, "{energy}");
    let error = body.displacement.value + moved();
    assert!(error.abs() < 1e-4 * RADIUS, "{error:e}");
    for reaction in &body.reactions {
        let most = reaction
            .force
            .iter()
            .fold(0.0, |most: f64, f| most.max(f.abs()));
        assert!(most < 1e-7, "{}: {most:e}", reaction.name);
    }
}

#[test]
fn the_shipped_sleeve_is_this_sleeve() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/meshes/sleeve.obj");
    assert!(fs::read_to_string(path).unwrap() == sleeve());
}

#[test]
fn a_woven_sleeve_relaxes_to_the_radius_of_its_pattern() {
    let (solution, frames) = solved(&changed(|text| text, &sleeve()).unwrap());
    let body = &solution.bodies[0];
    // The mass is that of the pieces.
    let mass = 500.0 * 0.0008 * TAU * RADIUS * LENGTH;
    assert!((body.mass / mass - 1.0).abs() < 1e-6);
    check(body, 5e-6);
    // Frames at the start and at the end, with what ParaView shows.
    assert_eq!(frames.len(), 2);
    for name in ["displacement", "stress"] {
        assert!(frames[1].contains(&format!("Name=\"{name}\"")), "{name}");
    }
}

/// The faces of an isotropic sleeve have the stress of its moment, `E t / 2 R`, and its membrane has none.
#[test]
fn an_isotropic_sleeve_reports_the_stress_of_its_moment() {
    let isotropic = |text: String| {
        let (before, after) = text.split_once("[body.material.weave]").unwrap();
        let (_, supports) = after.split_once("# Supports").unwrap();
        format!("{before}# Supports{supports}")
    };
    let (solution, _) = solved(&changed(isotropic, &sleeve()).unwrap());
    let body = &solution.bodies[0];
    let (young, thickness): (f64, f64) = (0.4e6, 0.0008);
    check(body, young * thickness.powi(3) / 12.0);
    let expected = young * thickness / (2.0 * RADIUS);
    let error = body.von_mises.value / expected - 1.0;
    assert!(error.abs() < 0.02, "{error}");
}

#[test]
fn a_run_starts_from_the_relaxed_shape() {
    let held = |text: String| {
        text + r#"
[[body.handle]]
name = "cuff"
box = [[-1.0, -1.0, 0.119], [1.0, 1.0, 0.121]]
device = "hand"
[[device]]
name = "hand"
model = "falcon"
hand = {}
"#
    };
    let loaded = changed(held, &sleeve()).unwrap();
    let world = World::new(&loaded).unwrap();
    let start = world.start(0);
    let at = |z: f64| {
        let near = |x: &Vec3| (x.z - z).abs() < 0.004;
        let radii = start.positions().filter(near).map(|x| x.xy().norm());
        radii.fold(0.0, f64::max)
    };
    // The hand holds one end as wide as it is; the other end is as wide as the pattern.
    assert!((at(LENGTH) - 0.06).abs() < 1e-6, "{}", at(LENGTH));
    assert!((at(0.0) - 0.06 - moved()).abs() < 1e-3, "{}", at(0.0));
    let planned = stages(&loaded.scene, &[BodyPlan::new(&world, 0)]);
    assert!(
        planned
            .iter()
            .any(|stage| stage.name == "bending" && stage.needed)
    );
}

#[test]
fn wrong_flat_patterns_are_refused_with_advice() {
    let refused = |from: &str, to: &str, obj: &str| {
        let loaded = changed(
            |text| {
                assert!(text.contains(from));
                text.replacen(from, to, 1)
            },
            obj,
        );
        match loaded.and_then(|loaded| {
            let built = World::new(&loaded).map(|mut world| world.bodies.remove(0));
            built.map_err(|error| error.to_string())
        }) {
            Ok(_) => panic!("{to} was accepted"),
            Err(error) => error,
        }
    };
    let plain = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let same = ("young = 0.4e6", "young = 0.4e6");
    let error = refused(same.0, same.1, plain);
    assert!(
        error.ends_with(
            "line 4: expected a vertex with texture coordinates, such as 1/1, because they are the flat pattern, \
             found \"1 2 3\""
        ),
        "{error}"
    );
    let error = refused("texture_unit = 0.01", "texture_unit = 0", &sleeve());
    assert_eq!(
        error,
        "sleeve.toml:17: body[0].mesh.flat_pattern.texture_unit: found 0, allowed: a number above 0"
    );
    let error = refused(
        "flat_pattern = { texture_unit = 0.01 }",
        "flat_pattern = {}",
        &sleeve(),
    );
    assert!(error.ends_with("missing field `texture_unit`"), "{error}");
    let error = refused(
        "file = \"meshes/sleeve.obj\"",
        "sheet = { length = 1, width = 1, cells = [2, 2] }",
        "",
    );
    assert_eq!(
        error,
        "sleeve.toml:17: body[0].mesh.flat_pattern: found a pattern for a mesh that is built in, allowed: `file` with an \
         OBJ file, whose texture coordinates are the pattern"
    );
    let error = refused(same.0, same.1, &sleeve().replacen("vt ", "vt 1", 1));
    assert!(error.contains("mirrored in the flat pattern"), "{error}");
    // Without the field, texture coordinates are skipped, whatever they are.
    let loaded = changed(
        |text| text.replace("flat_pattern", "# flat_pattern"),
        &sleeve().replace("vt ", "vt none "),
    );
    let built = World::new(&loaded.unwrap()).unwrap().bodies.remove(0);
    assert!(built.body.elastic_energy() < 1e-24);
}
