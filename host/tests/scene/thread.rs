//! Threads in scenes: generated or read from a file, compared with the force of a stretched bar, and refused with
//! parameters that threads do not have.

use host::scene::{LoadedScene, Scene};
use host::solve::{BodySolution, Frame, solve};
use host::world::{Kind, World};
use std::collections::BTreeMap;
use std::convert::Infallible;

fn load(text: &str, files: &[(&str, String)]) -> LoadedScene {
    let file = |(name, text): &(&str, String)| ((*name).to_owned(), text.clone().into_bytes());
    let files: BTreeMap<_, _> = files.iter().map(file).collect();
    match Scene::load_texts("x.toml", text, &files) {
        Ok(loaded) => loaded,
        Err(error) => panic!("{error}"),
    }
}

fn solved(loaded: &LoadedScene) -> BodySolution {
    let mut keep = |_: Frame<'_>| Ok::<(), Infallible>(());
    let solution =
        solve(&World::new(loaded).unwrap(), false, &mut |_| {}, &mut keep).expect("a solution");
    assert!(solution.failures.is_empty(), "{:?}", solution.failures);
    solution.bodies.into_iter().next().expect("a body")
}

/// A thread of `mesh` without weight, whose right end is moved by `pull` (m).
fn pulled(mesh: &str, material: &str, right: &str, pull: f64) -> String {
    format!(
        r#"
name = "thread"
gravity = [0, 0, 0]
[[body]]
name = "thread"
mesh = {{ {mesh} }}
material = {{ young = 2e6, poisson = 0.3, density = 1000, {material} }}
[[body.support]]
name = "left"
box = [[-0.1001, -1, -1], [-0.0999, 1, 1]]
[[body.support]]
name = "between"
box = [[-0.0999, -1, -1], [0.0999, 1, 1]]
axes = ["y", "z"]
[[body.support]]
name = "right"
{right}
displacement = [{pull}, 0, 0]
"#
    )
}

const GENERATED: &str = "thread = { length = 0.2, segments = 4 }";
const RIGHT: &str = "group = \"right\"";

fn force(body: &BodySolution, name: &str) -> [f64; 3] {
    let mut reactions = body.reactions.iter();
    let found = reactions.find(|reaction| reaction.name == name);
    found.expect("a reaction").force
}

#[test]
fn a_pulled_thread_resists_with_its_stiffness() {
    let loaded = load(&pulled(GENERATED, "area = 1e-6", RIGHT, 0.02), &[]);
    let body = solved(&loaded);
    assert_eq!(body.kind, Kind::Thread);
    assert_eq!((body.elements, body.vertices_of_element), (4, 2));
    // EA is 2 N, and the thread is extended by a tenth. The residual of the solver is below 1e-8.
    let [x, y, z] = force(&body, "right");
    assert!(
        (x - 0.2).abs() < 1e-8 && y == 0.0 && z == 0.0,
        "{x} {y} {z}"
    );
    assert!((force(&body, "left")[0] + 0.2).abs() < 1e-8);
    // The energy is k (l - L0)^2 / 2 with k = EA / L0 = 10 N/m.
    assert!((body.elastic_energy - 0.002).abs() < 1e-9);
    assert!((body.mass - 1000.0 * 1e-6 * 0.2).abs() < 1e-12);
}

#[test]
fn a_rod_resists_compression_where_a_thread_does_not() {
    let loaded = |material: &str| load(&pulled(GENERATED, material, RIGHT, -0.02), &[]);
    let rod = solved(&loaded("area = 1e-6, tension_only = false"));
    assert!((force(&rod, "right")[0] + 0.2).abs() < 1e-8);
    let built = World::new(&loaded("area = 1e-6"))
        .expect("a world")
        .bodies
        .remove(0);
    let mut body = built.body;
    let shorter: Vec<_> = body.positions().map(|x| x * 0.9).collect();
    body.set_positions(&shorter).expect("positions");
    assert_eq!(body.elastic_energy(), 0.0);
}

/// The same thread as a VTK file, with a cross-section for each line.
fn file() -> String {
    "# vtk DataFile Version 3.0\nthread\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 double\n\
     -0.1 0 0\n0 0 0\n0.1 0 0\nCELLS 2 6\n2 0 1\n2 1 2\nCELL_TYPES 2\n3\n3\n\
     CELL_DATA 2\nFIELD cells 1\nsection 1 2 double\n1e-6\n2e-6\n"
        .to_owned()
}

#[test]
fn a_file_of_lines_is_a_thread_and_may_contain_its_cross_section() {
    let right = "box = [[0.0999, -1, -1], [0.1001, 1, 1]]";
    let material = "area = 1, fields = { area = \"section\" }";
    let text = pulled("file = \"t.vtk\"", material, right, 0.03);
    let body = solved(&load(&text, &[("t.vtk", file())]));
    // The thread consists of springs of 20 and 40 N/m in series.
    let [x, ..] = force(&body, "right");
    assert!((x - 0.03 * 20.0 * 40.0 / 60.0).abs() < 1e-8, "{x}");
}

#[test]
fn a_region_has_another_cross_section() {
    let region = "[[body.region]]\nbox = [[0, -1, -1], [0.1, 1, 1]]\narea = 2e-6\n";
    let text = pulled(GENERATED, "area = 1e-6", RIGHT, 0.03) + region;
    let [x, ..] = force(&solved(&load(&text, &[])), "right");
    // Half of the thread is twice as stiff: its halves have 20 and 40 N/m.
    assert!((x - 0.4).abs() < 1e-8, "{x}");
}

#[test]
fn parameters_that_a_thread_does_not_have_are_refused() {
    let refused = |mesh: &str, material: &str| {
        let loaded = load(&pulled(mesh, material, RIGHT, 0.0), &[]);
        let error = World::new(&loaded).expect_err("refused");
        error.to_string()
    };
    for (material, expected) in [
        (
            "law = \"corotational\"",
            "`area`: threads have a cross-section",
        ),
        (
            "area = 1e-6, thickness = 1e-3",
            "no such field, because the mesh is a thread",
        ),
        (
            "area = 1e-6, weave = { young_weft = 1, shear = 1 }",
            "no such field, because the mesh is a thread",
        ),
        (
            "area = 1e-6, law = \"linear\"",
            "\"corotational\" for a thread",
        ),
        (
            "area = 1e-6, fields = { thickness = \"t\" }",
            "no such field, because the mesh is a thread",
        ),
    ] {
        let error = refused(GENERATED, material);
        assert!(error.contains(expected), "{material}: {error}");
    }
    let quadratic = format!("{GENERATED}, order = 2");
    let error = refused(&quadratic, "area = 1e-6");
    assert!(error.contains("1: lines are linear"), "{error}");
    for material in [
        "thickness = 1e-3, area = 1e-6",
        "thickness = 1e-3, tension_only = true",
    ] {
        let sheet = "sheet = { length = 0.2, width = 0.1, cells = [2, 2] }";
        let error = refused(sheet, material);
        assert!(
            error.contains("no such field, because the mesh is a sheet"),
            "{error}"
        );
    }
}

#[test]
fn a_thread_is_generated_within_limits() {
    let error = |mesh: &str| {
        let text = pulled(mesh, "area = 1e-6", RIGHT, 0.0);
        Scene::parse(&text, "x.toml").map_or_else(|error| error.to_string(), |_| "none".to_owned())
    };
    let none = error("thread = { length = 0.2, segments = 0 }");
    assert!(
        none.contains("body[0].mesh.thread.segments: found 0"),
        "{none}"
    );
    let many = error("thread = { length = 0.2, segments = 100000000 }");
    assert!(many.contains("body[0].mesh.thread.segments"), "{many}");
    let long = error("thread = { length = -1, segments = 2 }");
    assert!(
        long.contains("body[0].mesh.thread.length: found -1"),
        "{long}"
    );
}

#[test]
fn a_thread_needs_no_poisson_ratio() {
    let with = pulled(GENERATED, "area = 1e-6", RIGHT, 0.02);
    let without = with.replace("poisson = 0.3, ", "");
    assert_ne!(with, without);
    let results = [&with, &without].map(|text| solved(&load(text, &[])));
    assert_eq!(results[0].elastic_energy, results[1].elastic_energy);
    assert_eq!(results[0].reactions[0].force, results[1].reactions[0].force);
    // A region may name it all the same, without effect.
    let region = "[[body.region]]\nbox = [[-1, -1, -1], [1, 1, 1]]\npoisson = 0.2\n";
    for text in [with, without] {
        let body = solved(&load(&(text + region), &[]));
        assert_eq!(body.elastic_energy, results[0].elastic_energy);
    }
}

#[test]
fn a_sheet_or_a_solid_needs_one() {
    let sheet = "sheet = { length = 0.2, width = 0.1, cells = [4, 2] }";
    let solid = "box = { size = [0.2, 0.1, 0.1], cells = [2, 1, 1] }";
    for (mesh, material) in [(sheet, "thickness = 0.001"), (solid, "law = \"linear\"")] {
        let text = pulled(mesh, material, RIGHT, 0.02).replace("poisson = 0.3, ", "");
        let error = World::new(&load(&text, &[])).expect_err("no Poisson's ratio");
        assert_eq!(
            error.to_string(),
            "x.toml:7: body[0].material: missing field `poisson`"
        );
    }
}
