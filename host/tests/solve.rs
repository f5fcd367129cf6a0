//! `palpate solve`: scenes with supports and loads against reference forces, statics and beam theory.

use host::scene::{LoadedScene, Scene};
use host::solve::{BodySolution, Frame, Solution, solve};
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::fmt::Write as _;
use std::process::Command;

fn load(text: &str) -> LoadedScene {
    match Scene::load_texts("x.toml", text, &BTreeMap::new()) {
        Ok(loaded) => loaded,
        Err(error) => panic!("{error}"),
    }
}

fn solved(text: &str) -> Solution {
    let keep = |_: Frame<'_>| Ok::<(), Infallible>(());
    match solve(&load(text), false, |_| {}, keep) {
        Ok(solution) => solution,
        Err(error) => panic!("{error}"),
    }
}

fn body(text: &str) -> BodySolution {
    let solution = solved(text);
    assert!(solution.failures.is_empty(), "{:?}", solution.failures);
    solution.bodies.into_iter().next().unwrap()
}

fn refusal(text: &str) -> String {
    let keep = |_: Frame<'_>| Ok::<(), Infallible>(());
    match solve(&load(text), false, |_| {}, keep) {
        Ok(_) => "solved".to_owned(),
        Err(error) => error.to_string(),
    }
}

fn force(body: &BodySolution, name: &str) -> [f64; 3] {
    body.reactions
        .iter()
        .find(|reaction| reaction.name == name)
        .unwrap()
        .force
}

/// A cube of 10 cm, 20 kPa, compressed by 10 % between its plates.
fn cube(law: &str, axes: &str) -> String {
    format!(
        r#"
name = "cube"
gravity = [0, 0, 0]
[solve]
load_steps = 2
[[body]]
name = "cube"
mesh.box = {{ size = [0.1, 0.1, 0.1], cells = [6, 6, 6] }}
material = {{ law = "{law}", young = 20e3, poisson = 0.3, density = 1000 }}
[[body.support]]
name = "bottom"
group = "bottom"
axes = {axes}
[[body.support]]
name = "top"
group = "top"
axes = {axes}
displacement = [0, 0, -0.01]
[[body.support]]
name = "centre line x"
box = [[-0.001, -1, -1], [0.001, 1, 1]]
axes = ["x"]
[[body.support]]
name = "centre line y"
box = [[-1, -0.001, -1], [1, 0.001, 1]]
axes = ["y"]
"#
    )
}

/// The reference's forces, four digits after the point (an independent program's).
#[test]
fn a_bonded_cube_pushes_back_as_the_reference_says() {
    for (law, expected) in [("linear", 21.8183), ("corotational", 21.6604)] {
        // The supports across the middle change nothing by symmetry only if the mesh had it: leave them out.
        let text = cube(law, r#"["x", "y", "z"]"#);
        let cut = text
            .find("[[body.support]]\nname = \"centre line x\"")
            .unwrap();
        let body = body(&text[..cut]);
        let [bottom, top] = ["bottom", "top"].map(|name| force(&body, name)[2]);
        // Half a unit of the reference's last digit.
        assert!((bottom - expected).abs() < 5.1e-5, "{law}: {bottom}");
        assert!((bottom + top).abs() < 1e-6 * expected, "{law}: {top}");
    }
}

/// A plate with a hole and the quarter of it that its symmetries leave are the same problem.
#[test]
fn a_quarter_of_a_plate_with_a_hole_carries_half_of_its_force() {
    let plate = |quarter: bool, supports: &str| {
        let text = format!(
            r#"
name = "plate"
gravity = [0, 0, 0]
[[body]]
name = "plate"
bending = 0
mesh.plate = {{ width = 0.2, height = 0.1, radius = 0.02, cells = [6, 8], quarter = {quarter} }}
material = {{ young = 1e6, poisson = 0.3, thickness = 0.001, density = 1000 }}
{supports}
[[body.support]]
name = "right"
group = "right"
axes = ["x"]
displacement = [0.001, 0, 0]
[[body.support]]
name = "plane"
box = [[-1, -1, -1], [1, 1, 1]]
axes = ["z"]
"#
        );
        force(&body(&text), "right")[0]
    };
    let support = |name: &str, group: &str, axis: &str, way: f64| {
        format!(
            "[[body.support]]\nname = \"{name}\"\ngroup = \"{group}\"\naxes = [\"{axis}\"]\n\
             displacement = [{way}, 0, 0]\n"
        )
    };
    let quarter = plate(
        true,
        &(support("x", "symmetry_x", "x", 0.0) + &support("y", "symmetry_y", "y", 0.0)),
    );
    // Nothing keeps the whole from sliding along y but its own symmetry, and Newton's shift.
    let whole = plate(false, &support("left", "left", "x", -0.001));
    assert!(
        (whole - 2.0 * quarter).abs() < 1e-8 * whole,
        "{whole} {quarter}"
    );
    // Softer than without a hole, E t height strain = 1 N, and the ligament alone would carry 0.6 N.
    assert!((0.6..1.0).contains(&whole), "{whole}");
}

/// Free to slide, strain is uniform: E A times the strain, exactly.
#[test]
fn a_sliding_cube_pushes_back_exactly() {
    for law in ["linear", "corotational"] {
        let body = body(&cube(law, r#"["z"]"#));
        let bottom = force(&body, "bottom");
        assert!((bottom[2] - 20.0).abs() < 1e-6, "{law}: {bottom:?}");
        assert_eq!([bottom[0], bottom[1]], [0.0, 0.0], "{law}: it slides");
        // The guides hold what is at rest anyway.
        for name in ["centre line x", "centre line y"] {
            let guide = force(&body, name);
            assert!(guide.iter().all(|f| f.abs() < 1e-6), "{law}: {guide:?}");
        }
        assert_eq!(body.steps.len(), 2);
    }
}

/// A block hanging from the ceiling, with a load: the ceiling carries both, and their moment.
#[test]
fn a_support_carries_weight_and_loads() {
    for order in [1, 2] {
        let body = body(&format!(
            r#"
name = "block"
[[body]]
name = "block"
mesh = {{ box = {{ size = [0.1, 0.1, 0.2], cells = [2, 2, 4] }}, order = {order} }}
material = {{ young = 1e6, poisson = 0.3, density = 1000 }}
[[body.support]]
name = "ceiling"
group = "top"
rotation = [0, 0, 0]
[[body.load]]
name = "pull"
group = "bottom"
traction = [0, 0, -100]
[[body.load]]
name = "push"
group = "right"
force = [0, 0.5, 0]
"#
        ));
        let expected = [0.0, -0.5, 2.0 * 9.81 + 1.0];
        let found = force(&body, "ceiling");
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
        }
        // The push acts at mid height, 0.1 m below the ceiling, and 0.05 m beside its middle; what the
        // body moves by changes the arms by some of its displacement.
        let moment = body.reactions[0].moment.unwrap();
        let slack = 21.0 * body.displacement.value;
        assert!((moment[0] + 0.05).abs() < slack, "{moment:?}");
        assert!((moment[2] + 0.025).abs() < slack, "{moment:?}");
        assert!(slack < 0.02, "the arms are known: {slack}");
    }
}

/// A bar turned at its end: moment against Saint-Venant's torsion of a square bar, 0.1406 G a^4 / L per
/// radian (Timoshenko and Goodier, "Theory of elasticity", section 109).
#[test]
fn a_turned_bar_resists_as_saint_venant_says() {
    let torsion = |cells: usize| {
        let body = body(&format!(
            r#"
name = "bar"
gravity = [0, 0, 0]
[[body]]
name = "bar"
mesh = {{ box = {{ size = [0.4, 0.04, 0.04], cells = [{}, {cells}, {cells}] }}, order = 2 }}
material = {{ law = "linear", young = 1e6, poisson = 0.25, density = 1000 }}
[[body.support]]
name = "wall"
group = "left"
[[body.support]]
name = "wrench"
group = "right"
rotation = [1e-3, 0, 0]
"#,
            5 * cells
        ));
        body.reactions.last().unwrap().moment.unwrap()[0]
    };
    let expected = 0.1406 * 0.4e6 * 0.04_f64.powi(4) / 0.4 * 1e-3;
    let [coarse, fine] = [2, 4].map(|cells| torsion(cells) / expected - 1.0);
    // The ends are held flat where Saint-Venant lets them warp: about one width of the ten is stiffer.
    assert!(fine > 0.0 && fine < 0.04, "{fine}");
    assert!(coarse > fine, "{coarse}: it converges from above");
}

const HANGING: &str = r#"
name = "hanging"
duration = 2.0
[solve]
analysis = "dynamic"
step = 0.01
ramp = 0.5
frames = 4
[[body]]
name = "block"
damping = { mass = 20.0 }
mesh.box = { size = [0.1, 0.1, 0.1], cells = [2, 2, 2] }
material = { law = "stable_neo_hookean", young = 20e3, poisson = 0.3, density = 1000 }
[[body.support]]
name = "ceiling"
group = "top"
displacement = [0, 0, 0.05]
[[body.load]]
name = "pull"
group = "bottom"
force = [0, 0, -2]
"#;

/// In time, damped, it ends where equilibrium is.
#[test]
fn motion_comes_to_rest_in_equilibrium() {
    let moving = body(HANGING);
    let still = body(&HANGING.replace("\"dynamic\"", "\"static\""));
    let (a, b) = (force(&moving, "ceiling")[2], force(&still, "ceiling")[2]);
    assert!((b - 11.81).abs() < 1e-6, "{b}");
    // What is left after 1.5 s of damping at 10 /s: e^-15 of some newtons.
    assert!((a - b).abs() < 1e-5, "{a} {b}");
    let lengths = (moving.displacement.value, still.displacement.value);
    assert!((lengths.0 - lengths.1).abs() < 1e-6, "{lengths:?}");
    assert_eq!(moving.steps.len(), 200);
    assert!(moving.steps.iter().all(|row| row.residual <= 1e-8));
}

#[test]
fn frames_come_evenly_and_hold_the_state() {
    let mut frames = Vec::new();
    let keep = |frame: Frame<'_>| {
        frames.push((frame.number, frame.at, frame.snapshot));
        Ok::<(), Infallible>(())
    };
    let _ = solve(&load(HANGING), true, |_| {}, keep).unwrap();
    let times: Vec<_> = frames
        .iter()
        .map(|(number, at, _)| (*number, *at))
        .collect();
    assert_eq!(times, [(0, 0.0), (1, 0.5), (2, 1.0), (3, 1.5), (4, 2.0)]);
    let names = |s: &meshio::write_vtu::Snapshot| {
        let all = s.at_vertices.iter().chain(&s.in_cells);
        all.map(|(name, _)| name.clone()).collect::<Vec<_>>()
    };
    let expected = [
        "displacement",
        "velocity",
        "von_mises",
        "stress",
        "young",
        "poisson",
    ];
    assert_eq!(names(&frames[4].2), expected);
    let top =
        |s: &meshio::write_vtu::Snapshot| s.positions.iter().map(|p| p.z).fold(-1.0, f64::max);
    assert!((top(&frames[0].2) - 0.05).abs() < 1e-15);
    assert!(
        (top(&frames[1].2) - 0.10).abs() < 1e-15,
        "the ramp ends at 0.5 s"
    );
}

/// A solve that gets stuck says where and why, and keeps what it had.
#[test]
fn a_solve_that_gets_stuck_keeps_the_last_good_state() {
    // St. Venant-Kirchhoff collapses under compression; 80 % is beyond what it can bear.
    let text = cube("st_venant_kirchhoff", r#"["x", "y", "z"]"#)
        .replace("-0.01", "-0.08")
        .replace("load_steps = 2", "load_steps = 8");
    let cut = text
        .find("[[body.support]]\nname = \"centre line x\"")
        .unwrap();
    let solution = solved(&text[..cut]);
    assert_eq!(solution.failures.len(), 1, "{:?}", solution.failures);
    let failure = &solution.failures[0];
    assert!(failure.starts_with("cube: at 0."), "{failure}");
    assert!(failure.contains("the last state is kept"), "{failure}");
    let body = &solution.bodies[0];
    let reached = body.steps.last().unwrap().at;
    assert!(!body.steps.is_empty() && reached < 1.0, "{reached}");
    let moved = body.displacement.value;
    assert!(
        moved >= 0.08 * reached - 1e-12 && moved.is_finite(),
        "{moved}"
    );
    assert_eq!(body.inverted, 0);
}

#[test]
fn bodies_get_what_their_kind_has_and_nothing_else() {
    let base = r#"
name = "x"
[[body]]
name = "b"
mesh.box = { size = [1, 1, 1], cells = [1, 1, 1] }
material = { young = 1e3, poisson = 0.3, density = 1 }
"#;
    let sheet = base
        .replace(
            "box = { size = [1, 1, 1], cells = [1, 1, 1] }",
            "sheet = { length = 1, width = 1, cells = [1, 1] }",
        )
        .replace("density = 1", "density = 1, thickness = 1e-3");
    let cases = [
        (
            base.replace("density = 1", "density = 1, thickness = 1"),
            "x.toml:6: body[0].material.thickness: found a thickness, allowed: none: the mesh is a solid",
        ),
        (
            base.replace(
                "density = 1",
                "density = 1, weave = { young_weft = 1, shear = 1 }",
            ),
            "x.toml:6: body[0].material.weave: found a weave, allowed: none: the mesh is a solid",
        ),
        (
            base.replace("mesh", "bending = 1\nmesh"),
            "x.toml:5: body[0].bending: found 1.0, allowed: 0: only isotropic sheets have a bending model",
        ),
        (
            sheet.replace("young = 1e3", "young = 1e3, law = \"linear\""),
            "x.toml:6: body[0].material.law: found a law of solids or woven sheets, allowed: \"corotational\" for an isotropic sheet",
        ),
        (
            sheet.replace(", thickness = 1e-3", ""),
            "x.toml:6: body[0].material: found no thickness, allowed: `thickness`: sheets have one",
        ),
        (
            sheet.replace("sheet = {", "order = 2\nmesh.sheet = {"),
            "x.toml:5: body[0].mesh.order: found 2 for a mesh of triangles, allowed: 1: triangles are linear",
        ),
        (
            base.replace("density = 1", "density = 1, fields = { young = \"E\" }"),
            "x.toml:6: body[0].material.fields.young: found \"E\", allowed: nothing (the mesh has no values by element)",
        ),
        (
            format!("{sheet}[[body.load]]\nname = \"l\"\ngroup = \"left\"\ntraction = [1, 0, 0]\n"),
            "x.toml:10: body[0].load[0].traction: found a part of the mesh without a whole face, allowed: a part with an area, or `force` in its place",
        ),
        (
            format!("{base}[[body.support]]\nname = \"s\"\ngroup = \"lid\"\n"),
            "x.toml:9: body[0].support[0].group: found \"lid\", allowed: a group of the mesh: \"left\", \"right\", \"front\", \"back\", \"bottom\", \"top\"",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(refusal(&text), expected, "{text}");
    }
}

/// A woven strip pulled along its warp, free to contract: E A times the Green strain's force.
#[test]
fn a_woven_strip_pulls_back_along_its_warp() {
    let body = body(
        r#"
name = "strip"
gravity = [0, 0, 0]
[[body]]
name = "strip"
mesh.sheet = { length = 0.1, width = 0.04, cells = [10, 4] }
[body.material]
young = 1e6
poisson = 0.2
thickness = 0.001
density = 300
weave = { warp = [1, 0, 0], young_weft = 0.4e6, shear = 0.05e6 }
[[body.support]]
name = "left"
group = "left"
axes = ["x"]
[[body.support]]
name = "right"
group = "right"
axes = ["x"]
displacement = [0.02, 0, 0]
[[body.support]]
name = "edge"
group = "bottom"
axes = ["y"]
[[body.support]]
name = "plane"
box = [[-1, -1, -1], [1, 1, 1]]
axes = ["z"]
"#,
    );
    // E w t l (l^2 - 1) / 2 at a stretch of 1.2.
    let found = force(&body, "right")[0];
    assert!((found - 10.56).abs() < 1e-6, "{found}");
}

/// The program: what it prints, writes and answers.
#[test]
fn the_program_writes_what_was_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let palpate = |scene: &str| {
        std::fs::write(file("scene.toml"), scene).unwrap();
        Command::new(env!("CARGO_BIN_EXE_palpate"))
            .arg("solve")
            .arg(file("scene.toml"))
            .arg("--vtu")
            .arg(file("frames"))
            .arg("--plot")
            .arg(file("plot.svg"))
            .arg("--json")
            .arg(file("solution.json"))
            .output()
            .unwrap()
    };
    let output = palpate(&cube("linear", r#"["z"]"#));
    assert_eq!(output.status.code(), Some(0));
    let printed = String::from_utf8(output.stdout).unwrap();
    let bottom = printed
        .lines()
        .find(|line| line.contains("bottom"))
        .unwrap();
    assert!(
        bottom.contains("force (0.000, 0.000, 20.000) N"),
        "{bottom}"
    );
    let json: serde_json::Value =
        serde_json::from_slice(&std::fs::read(file("solution.json")).unwrap()).unwrap();
    assert_eq!(json["schema"], "palpate.solve/1");
    assert_eq!(json["bodies"][0]["elements"], 1296);
    assert_eq!(json["bodies"][0]["reactions"][1]["name"], "top");
    assert!(
        std::fs::read_to_string(file("plot.svg"))
            .unwrap()
            .contains("cube, bottom")
    );
    let list = std::fs::read_to_string(file("frames/frames.pvd")).unwrap();
    for number in 0..=2 {
        let name = format!("cube_{number:04}.vtu");
        assert!(list.contains(&name), "{list}");
        let frame = std::fs::read_to_string(file("frames").join(name)).unwrap();
        assert!(frame.ends_with("</VTKFile>\n"));
    }

    // One that gets stuck: what it has is written, and the answer is 1.
    let stuck = cube("st_venant_kirchhoff", r#"["x", "y", "z"]"#).replace("-0.01", "-0.09");
    let output = palpate(&stuck);
    assert_eq!(output.status.code(), Some(1));
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.contains("not solved cube: at 0."), "{printed}");
    assert!(file("frames/cube_0000.vtu").exists());

    // One that is wrong.
    let output = palpate("name = 3");
    assert_eq!(output.status.code(), Some(2));
}

/// What the program says of a scene, and its exit code.
fn said(folder: &std::path::Path, scene: &str) -> (String, Option<i32>) {
    let path = folder.join("scene.toml");
    std::fs::write(&path, scene).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .arg("solve")
        .arg(&path)
        .output()
        .unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    (printed, output.status.code())
}

/// Steel under next to nothing: it moves, the program says that rounding limits the digits, or that they are too few.
#[test]
fn a_load_that_drowns_in_rounding_is_not_taken_for_carried() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |analysis: &str, force: f64| {
        format!(
            r#"
name = "block"
gravity = [0, 0, 0]
{analysis}
[[body]]
name = "block"
mesh.box = {{ size = [0.1, 0.1, 0.1], cells = [4, 4, 4] }}
material = {{ law = "linear", young = 210e9, poisson = 0.3, density = 7850 }}
[[body.support]]
name = "floor"
group = "bottom"
[[body.load]]
name = "push"
group = "top"
force = [{force}, 0, 0]
"#
        )
    };
    let moved = |force: f64| body(&scene("", force)).displacement.value / force;
    let (far, near) = (moved(1e4), moved(1e-4));
    // Strains of 5e-14 are known to 1.1e-16: 0.2 %; three times that.
    assert!((near - far).abs() < 7e-3 * far, "{near:e} {far:e}");
    let (printed, code) = said(folder.path(), &scene("", 1e-4));
    assert_eq!(code, Some(0), "{printed}");
    assert!(printed.contains("limited by rounding: "), "{printed}");
    let (printed, code) = said(folder.path(), &scene("", 1e4));
    assert_eq!(code, Some(0), "{printed}");
    assert!(!printed.contains("limited by rounding"), "{printed}");

    let motion = "duration = 1e-4\n[solve]\nanalysis = \"dynamic\"\nstep = 1e-5";
    for analysis in ["", motion] {
        let (printed, code) = said(folder.path(), &scene(analysis, 1e-9));
        assert_eq!(code, Some(1), "{printed}");
        assert!(printed.contains("too few digits"), "{printed}");
    }
}

/// A strip that lies a kilometre from the origin: rubber deforms as at the origin, steel under next to nothing is told.
#[test]
fn a_strip_far_away_is_solved_as_far_as_its_digits_allow() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |far: u32, young: f64, force: f64| {
        let mut mesh = String::new();
        for column in 0..=8 {
            for row in 0..=2 {
                let (x, y) = (f64::from(column) / 64.0, f64::from(row) / 64.0);
                writeln!(mesh, "v {} {y} 0", f64::from(far) + x).expect("a string takes it");
            }
        }
        for column in 0..8 {
            for row in 1..=2 {
                let a = 3 * column + row;
                writeln!(mesh, "f {a} {} {}\nf {a} {} {}", a + 3, a + 4, a + 4, a + 1)
                    .expect("a string takes it");
            }
        }
        std::fs::write(folder.path().join("strip.obj"), mesh).unwrap();
        format!(
            r#"
name = "strip"
gravity = [0, 0, 0]
[[body]]
name = "strip"
mesh.file = "strip.obj"
material = {{ young = {young:e}, poisson = 0.3, thickness = 1e-3, density = 1000 }}
[[body.support]]
name = "wall"
box = [[{far}, -1, -1], [{far}.001, 1, 1]]
[[body.support]]
name = "plane"
box = [[{far}, -1, -1], [{}, 1, 1]]
axes = ["z"]
[[body.load]]
name = "pull"
box = [[{far}.124, -1, -1], [{}, 1, 1]]
force = [{force:e}, 0, 0]
"#,
            far + 1,
            far + 1,
        )
    };
    let moved = |far: u32| {
        let text = scene(far, 1e6, 1.0);
        let (printed, code) = said(folder.path(), &text);
        assert_eq!(code, Some(0), "{printed}");
        let keep = |_: Frame<'_>| Ok::<(), Infallible>(());
        let loaded = Scene::load(&folder.path().join("scene.toml")).unwrap();
        solve(&loaded, false, |_| {}, keep).unwrap().bodies[0]
            .displacement
            .value
    };
    let (near, far) = (moved(0), moved(1000));
    // Coordinates of 1 km are kept to 6e-14 m, of 4 mm of motion: 1.5e-11; each of eight cells adds as much.
    assert!((near - far).abs() < 1e-9 * near, "{near} {far}");
    let (printed, code) = said(folder.path(), &scene(1000, 210e9, 1e-4));
    assert_eq!(code, Some(1), "{printed}");
    assert!(printed.contains("too few digits"), "{printed}");
    assert!(printed.contains("nearer to the origin"), "{printed}");
}

/// A mesh written in each format and read again, with its material by element, gives the same solution.
#[test]
fn a_mesh_travels_with_its_material() {
    let scene = |mesh: &str, material: &str, region: &str, hold: &str, pull: &str| {
        format!(
            r#"
name = "bar"
[solve]
tolerance = 1e-10
[[body]]
name = "bar"
mesh = {{ {mesh} }}
material = {{ law = "linear", young = 1e6, poisson = 0.3, density = 1000{material} }}
{region}
[[body.support]]
name = "wall"
{hold}
[[body.load]]
name = "pull"
{pull}
force = [1, 0, -1]
"#
        )
    };
    let boxes = [
        "box = [[-1, -1, -1], [-0.0999, 1, 1]]",
        "box = [[0.0999, -1, -1], [1, 1, 1]]",
    ];
    let core = r"
[[body.region]]
box = [[-0.05, -1, -1], [0.05, 1, 1]]
young = 3e6
poisson = 0.4
";
    let generated = "box = { size = [0.2, 0.04, 0.04], cells = [8, 2, 2] }, order = 2";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let text = scene(generated, "", core, boxes[0], boxes[1]);
    std::fs::write(&path, &text).unwrap();
    let expected = body(&text);
    for (ending, by) in [
        ("msh", ["group = \"left\"", "group = \"right\""]),
        ("vtk", boxes),
        ("vtu", boxes),
    ] {
        let file = format!("bar.{ending}");
        let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
            .arg("mesh")
            .arg(&path)
            .arg(folder.path().join(&file))
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{ending}");
        let printed = String::from_utf8(output.stdout).unwrap();
        assert!(printed.contains("young 1000000 to 3000000"), "{printed}");

        let fields = ", fields = { young = \"young\", poisson = \"poisson\" }";
        let text = scene(&format!("file = \"{file}\""), fields, "", by[0], by[1]);
        let second = folder.path().join("second.toml");
        std::fs::write(&second, text).unwrap();
        let keep = |_: Frame<'_>| Ok::<(), Infallible>(());
        let solution = solve(&Scene::load(&second).unwrap(), false, |_| {}, keep).unwrap();
        let found = &solution.bodies[0];
        assert_eq!(
            (found.elements, found.vertices),
            (expected.elements, expected.vertices)
        );
        // Formats number vertices in another order, so sums round differently, and the tolerance is 1e-10.
        let (a, b) = (found.displacement.value, expected.displacement.value);
        assert!((a - b).abs() < 1e-8 * b, "{ending}: {a} {b}");
        let (a, b) = (force(found, "wall"), force(&expected, "wall"));
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() < 1e-8, "{ending}: {a} {b}");
        }
    }
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .arg("mesh")
        .arg(&path)
        .arg(folder.path().join("bar.stl"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
}
