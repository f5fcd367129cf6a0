//! `palpate solve`: scenes with supports and loads, compared with reference forces, statics and the theory of beams.

use host::world::World;

use host::solve::{Frame, solve};
use meshio::write_vtu::Values;
use std::convert::Infallible;
use support::solve::{body, cube, force, load, solved};

fn refusal(text: &str) -> String {
    match World::new(&load(text)) {
        Ok(_) => "built".to_owned(),
        Err(error) => error.to_string(),
    }
}

/// The forces of the reference (an independent program), to four digits after the point.
#[test]
fn the_force_of_a_bonded_cube_agrees_with_the_reference() {
    for (law, expected) in [("linear", 21.8183), ("corotational", 21.6604)] {
        // The centre-line supports would have no effect on a symmetric mesh. This mesh is not symmetric, so they are
        // left out.
        let text = cube(law, r#"["x", "y", "z"]"#);
        let cut = text
            .find("[[body.support]]\nname = \"centre line x\"")
            .unwrap();
        let body = body(&text[..cut]);
        let [bottom, top] = ["bottom", "top"].map(|name| force(&body, name)[2]);
        // The tolerance is half a unit of the reference's last digit.
        assert!((bottom - expected).abs() < 5.1e-5, "{law}: {bottom}");
        assert!((bottom + top).abs() < 1e-6 * expected, "{law}: {top}");
    }
}

/// A plate with a hole has twice the force of the quarter that its two symmetries leave.
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
    let support = |name: &str, group: &str, axis: &str, displacement: f64| {
        format!(
            "[[body.support]]\nname = \"{name}\"\ngroup = \"{group}\"\naxes = [\"{axis}\"]\n\
             displacement = [{displacement}, 0, 0]\n"
        )
    };
    let quarter = plate(
        true,
        &(support("x", "symmetry_x", "x", 0.0) + &support("y", "symmetry_y", "y", 0.0)),
    );
    // Only the symmetry of the plate and the shift of Newton's method keep the whole plate from sliding along y.
    let whole = plate(false, &support("left", "left", "x", -0.001));
    assert!(
        (whole - 2.0 * quarter).abs() < 1e-8 * whole,
        "{whole} {quarter}"
    );
    // The plate is softer than without a hole (E t height strain = 1 N). The ligament alone would carry 0.6 N.
    assert!((0.6..1.0).contains(&whole), "{whole}");
}

/// Kirsch's problem does not feel the resistance to bending: the quarter of a plate 20 radii wide in tension, of any
/// thickness, has the same largest stress with and without it, on both of its faces.
#[test]
fn bending_leaves_the_stress_at_a_hole_as_it_is() {
    const RADIUS: f64 = 0.01;
    let (young, strain) = (1e9, 1e-6);
    let stress = |thickness: f64, bending: f64, guide: &str| {
        let text = format!(
            r#"
name = "kirsch"
gravity = [0, 0, 0]
[[body]]
name = "plate"
bending = {bending}
mesh.plate = {{ width = 0.2, height = 0.2, radius = {RADIUS}, cells = [24, 24], quarter = true }}
material = {{ young = {young}, poisson = 0.3, thickness = {thickness}, density = 1000 }}
[[body.support]]
name = "x"
group = "symmetry_x"
axes = ["x"]
[[body.support]]
name = "y"
group = "symmetry_y"
axes = ["y"]
[[body.support]]
name = "plane"
{guide}
axes = ["z"]
[[body.load]]
name = "tension"
group = "right"
force = [{}, 0, 0]
"#,
            young * strain * thickness * 0.1
        );
        let mut faces = Vec::new();
        let mut keep = |frame: Frame<'_>| {
            faces = frame.grid.in_cells;
            Ok::<(), Infallible>(())
        };
        let solution = solve(
            &World::new(&load(&text)).unwrap(),
            true,
            &mut |_| {},
            &mut keep,
        )
        .unwrap();
        assert!(solution.failures.is_empty(), "{:?}", solution.failures);
        let tensors = |name: &str| match faces.iter().find(|(other, _)| other == name) {
            Some((_, Values::Tensor(tensors))) => tensors.clone(),
            _ => panic!("no {name}"),
        };
        if bending > 0.0 {
            // In the plane there are no moments at all.
            assert_eq!(tensors("stress_top"), tensors("stress_bottom"));
        }
        let largest = tensors("stress")
            .iter()
            .map(|s| s[(0, 0)])
            .fold(0.0, f64::max);
        let von_mises = solution.bodies[0].von_mises.value;
        [largest, von_mises].map(|stress| stress / (young * strain))
    };
    let everywhere = "box = [[-1, -1, -1], [1, 1, 1]]";
    for ratio in [0.1, 0.2, 0.5] {
        let thickness = ratio * RADIUS;
        let without = stress(thickness, 0.0, everywhere);
        // Three times the stress in tension, less what the mean over a cell at the hole loses.
        assert!((2.8..3.1).contains(&without[0]), "{without:?}");
        // With bending the plate needs no guide in its plane but along a line of symmetry.
        for guide in [everywhere, "group = \"symmetry_y\""] {
            let with = stress(thickness, 1.0, guide);
            for (with, without) in with.iter().zip(&without) {
                assert!(
                    (with / without - 1.0).abs() < 1e-6,
                    "{ratio}: {with} {without}"
                );
            }
        }
    }
}

/// Without friction the strain is uniform, and the force is exactly E A times the strain.
#[test]
fn the_force_of_a_sliding_cube_is_exact() {
    for law in ["linear", "corotational"] {
        let body = body(&cube(law, r#"["z"]"#));
        let bottom = force(&body, "bottom");
        assert!((bottom[2] - 20.0).abs() < 1e-6, "{law}: {bottom:?}");
        assert_eq!([bottom[0], bottom[1]], [0.0, 0.0], "{law}: it slides");
        // The guides hold vertices that are at rest anyway.
        for name in ["centre line x", "centre line y"] {
            let guide = force(&body, name);
            assert!(guide.iter().all(|f| f.abs() < 1e-6), "{law}: {guide:?}");
        }
        assert_eq!(body.steps.len(), 2);
    }
}

/// A loaded block that hangs from the ceiling. The ceiling carries weight and load, and their moment.
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
        // The push acts at mid height, 0.1 m below the ceiling, and 0.05 m beside its middle. The displacement of the
        // body changes the lever arms by as much.
        let moment = body.reactions[0].moment.unwrap();
        let slack = 21.0 * body.displacement.value;
        assert!((moment[0] + 0.05).abs() < slack, "{moment:?}");
        assert!((moment[2] + 0.025).abs() < slack, "{moment:?}");
        assert!(slack < 0.02, "the arms are known: {slack}");
    }
}

/// A bar that is turned at its end: the moment against Saint-Venant's torsion of a square bar, 0.1406 G a^4 / L per
/// radian (Timoshenko and Goodier, "Theory of elasticity", section 109).
#[test]
fn the_moment_of_a_turned_bar_is_that_of_saint_venant() {
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
    // The ends are held flat, whereas Saint-Venant's theory lets them warp: about one width of the ten is stiffer.
    assert!(fine > 0.0 && fine < 0.04, "{fine}");
    assert!(coarse > fine, "{coarse}: it converges from above");
}

/// A square plate under pressure, which is held all round: the deflection of its middle against the theory of thin plates
/// (Timoshenko and Woinowsky-Krieger, "Theory of plates and shells", tables 8 and 35).
#[test]
fn a_plate_that_is_held_all_round_is_hinged_or_clamped() {
    let (side, young, poisson, thickness) = (0.1_f64, 1e9, 0.3, 1e-3_f64);
    let rigidity = young * thickness.powi(3) / (12.0 * (1.0 - poisson * poisson));
    for (border, factor) in [("hinged", 0.004_062_353), ("clamped", 0.001_265_319)] {
        let support = |edge: &str| {
            format!(
                "[[body.support]]\nname = \"{edge}\"\ngroup = \"{edge}\"\nborder = \"{border}\"\n"
            )
        };
        let supports = ["left", "right", "bottom", "top"].map(support).concat();
        let plate = format!(
            r#"
name = "plate"
gravity = [0, 0, 0]
[[body]]
name = "plate"
mesh.sheet = {{ length = {side}, width = {side}, cells = [16, 16], pattern = "alternating" }}
material = {{ young = {young}, poisson = {poisson}, thickness = {thickness}, density = 1000 }}
[[body.load]]
name = "pressure"
box = [[-1, -1, -1], [1, 1, 1]]
traction = [0, 0, 0.01]
"#
        );
        let body = body(&(plate + &supports));
        let deflection = factor * 0.01 * side.powi(4) / rigidity;
        let error = body.displacement.value / deflection - 1.0;
        // The error of the finest meshes of `palpate bench accuracy`, times the square of the ratio of the sizes.
        let most = if border == "hinged" { 0.01 } else { 0.05 };
        assert!(error.abs() < most, "{border}: {error}");
    }
}

/// A strip that is clamped at one end and turned at the other: the moment of a beam, 4 E I / L per radian.
#[test]
fn a_turned_support_turns_a_clamped_border() {
    let body = body(
        r#"
name = "strip"
gravity = [0, 0, 0]
[[body]]
name = "strip"
mesh.sheet = { length = 0.1, width = 0.02, cells = [40, 8] }
material = { young = 1e9, poisson = 0, thickness = 1e-3, density = 1000 }
[[body.support]]
name = "wall"
group = "left"
border = "clamped"
[[body.support]]
name = "gripper"
group = "right"
border = "clamped"
rotation = [0, 1e-5, 0]
"#,
    );
    let moment = body.reactions.last().unwrap().moment.unwrap()[1];
    let expected = 4.0 * (1e9 * 0.02 * 1e-3_f64.powi(3) / 12.0) / 0.1 * 1e-5;
    // The error falls with the square of the size of the cells.
    assert!(
        (moment / expected - 1.0).abs() < 0.005,
        "{moment} {expected}"
    );
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

/// A damped motion ends in the equilibrium.
#[test]
fn a_damped_motion_ends_in_equilibrium() {
    let moving = body(HANGING);
    let still = body(&HANGING.replace("\"dynamic\"", "\"static\""));
    let (a, b) = (force(&moving, "ceiling")[2], force(&still, "ceiling")[2]);
    assert!((b - 11.81).abs() < 1e-6, "{b}");
    // After 1.5 s of damping at 10 /s, e^-15 of some newtons remains.
    assert!((a - b).abs() < 1e-5, "{a} {b}");
    let lengths = (moving.displacement.value, still.displacement.value);
    assert!((lengths.0 - lengths.1).abs() < 1e-6, "{lengths:?}");
    assert_eq!(moving.steps.len(), 200);
    assert!(moving.steps.iter().all(|row| row.residual <= 1e-8));
}

#[test]
fn frames_come_evenly_and_hold_the_state() {
    let mut frames = Vec::new();
    let mut keep = |frame: Frame<'_>| {
        frames.push((frame.number, frame.at, frame.grid));
        Ok::<(), Infallible>(())
    };
    let _ = solve(
        &World::new(&load(HANGING)).unwrap(),
        true,
        &mut |_| {},
        &mut keep,
    )
    .unwrap();
    let times: Vec<_> = frames
        .iter()
        .map(|(number, at, _)| (*number, *at))
        .collect();
    assert_eq!(times, [(0, 0.0), (1, 0.5), (2, 1.0), (3, 1.5), (4, 2.0)]);
    let names = |s: &meshio::write_vtu::UnstructuredGrid| {
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
    let top = |s: &meshio::write_vtu::UnstructuredGrid| {
        s.positions.iter().map(|p| p.z).fold(-1.0, f64::max)
    };
    assert!((top(&frames[0].2) - 0.05).abs() < 1e-15);
    assert!(
        (top(&frames[1].2) - 0.10).abs() < 1e-15,
        "the ramp ends at 0.5 s"
    );
}

/// A solve that stops early reports the place and the reason, and keeps its last state.
#[test]
fn a_solve_that_stops_early_keeps_the_last_good_state() {
    // St. Venant-Kirchhoff bodies collapse under compression; 80 % is beyond their limit.
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

/// A bar that bears 0.445 of its load: the solve says so for any number of load steps, and keeps the state there.
#[test]
fn a_solve_that_stops_within_a_load_step_says_how_far_it_came() {
    for steps in [1, 4, 16] {
        let text = format!(
            r#"
name = "bar"
gravity = [0, 0, -300]
[solve]
load_steps = {steps}
[[body]]
name = "bar"
mesh = {{ box = {{ size = [0.2, 0.02, 0.02], cells = [20, 2, 2] }} }}
material = {{ young = 3e4, poisson = 0.45, density = 1000 }}
[[body.support]]
name = "wall"
group = "left"
"#
        );
        let mut last = None;
        let mut keep = |frame: Frame<'_>| {
            last = Some((frame.number, frame.at));
            Ok::<(), Infallible>(())
        };
        let solution = solve(
            &World::new(&load(&text)).unwrap(),
            true,
            &mut |_| {},
            &mut keep,
        )
        .unwrap();
        let body = &solution.bodies[0];
        let row = body.steps.last().unwrap();
        // With 200 load steps, the solve comes to 0.4479. A load step is halved ten times.
        assert!(
            (row.at - 0.4479).abs() < 1.0 / 1024.0,
            "{steps}: {}",
            row.at
        );
        let said = format!("bar: at {:.4} of the loads: ", row.at);
        assert!(
            solution.failures[0].starts_with(&said),
            "{:?}",
            solution.failures
        );
        let frames = (row.at * f64::from(steps)).ceil() as usize;
        assert_eq!(last, Some((frames, row.at)), "the state is a frame");
        // The bar has a mass of 80 g, and weight is what the wall bears.
        let weight = 0.08 * 300.0 * row.at;
        assert!(
            (body.applied[2] + weight).abs() < 1e-9 * weight,
            "{:?}",
            body.applied
        );
        let wall = force(body, "wall")[2];
        assert!((wall - weight).abs() < 1e-6 * weight, "{wall} {weight}");
        assert!(body.displacement.value > 0.1, "{}", body.displacement.value);
    }
}

/// The forces of a body at rest are rounding, of which no part is a residual.
#[test]
fn a_body_without_loads_has_no_residual() {
    let solution = solved(
        r#"
name = "rest"
gravity = [0, 0, 0]
[[body]]
name = "sheet"
mesh.sheet = { length = 0.1, width = 0.1, cells = [4, 4], pattern = "alternating" }
rotation = { axis = [1, 2, 3], degrees = 31 }
material = { young = 1e6, poisson = 0.3, thickness = 0.001, density = 1000 }
"#,
    );
    let steps = &solution.bodies[0].steps;
    assert!(steps.iter().all(|row| row.residual == 0.0), "{steps:?}");
    let said = solution.to_string();
    assert!(said.contains("no residual above rounding"), "{said}");
}

/// Two supports cannot hold one vertex at two places: no equilibrium has both.
#[test]
fn supports_that_hold_a_vertex_at_two_places_are_refused() {
    let scene = |wall: &str, second: &str| {
        format!(
            r#"
name = "x"
gravity = [0, 0, 0]
[[body]]
name = "b"
mesh.box = {{ size = [1, 1, 1], cells = [1, 1, 1] }}
material = {{ young = 1e3, poisson = 0.3, density = 1 }}
[[body.support]]
name = "wall"
group = "left"
axes = {wall}
[[body.support]]
name = "lid"
group = "top"
{second}
"#
        )
    };
    let all = r#"["x", "y", "z"]"#;
    for (wall, second, expected) in [
        (
            all,
            "displacement = [0, 0, 0.1]",
            Some(
                "moved by 1e-1 m along z, but support \"wall\" moves it by 0e0 m, allowed: one place for each vertex: \
                  give both supports the same displacement, leave the axis to one of them, or make the group or the \
                  box of one smaller",
            ),
        ),
        (
            all,
            "rotation = [0, 0, 0.1]",
            Some("but support \"wall\" moves it by 0e0 m"),
        ),
        (r#"["x", "y"]"#, "displacement = [0, 0, 0.1]", None),
        (all, "displacement = [0, 0, 0]", None),
    ] {
        let said = refusal(&scene(wall, second));
        match expected {
            Some(expected) => {
                assert!(
                    said.starts_with("x.toml:12: body[0].support[1]: found vertex"),
                    "{said}"
                );
                assert!(said.contains(expected), "{said}");
            }
            None => assert_eq!(said, "built", "{second}"),
        }
    }
}

#[test]
fn parameters_of_another_kind_of_body_are_refused() {
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
    let clamp =
        |which: &str| format!("[[body.support]]\nname = \"s\"\n{which}\nborder = \"clamped\"\n");
    let cases = [
        (
            base.replace("density = 1", "density = 1, thickness = 1"),
            "x.toml:6: body[0].material.thickness: found a thickness, allowed: no such field, because the mesh is a solid",
        ),
        (
            base.replace(
                "density = 1",
                "density = 1, weave = { young_weft = 1, shear = 1 }",
            ),
            "x.toml:6: body[0].material.weave: found a weave, allowed: no such field, because the mesh is a solid",
        ),
        (
            base.replace("mesh", "bending = 1\nmesh"),
            "x.toml:5: body[0].bending: found 1.0, allowed: 0: only sheets have a bending model",
        ),
        (
            sheet.replace("mesh", "bending = 1\nmesh").replace(
                "density = 1",
                "density = 1, weave = { young_weft = 1e3, shear = 1 }",
            ),
            "x.toml:5: body[0].bending: found 1.0, allowed: 0 without `bending_warp`, `bending_weft` or `bending_twist` in the weave",
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
            "x.toml:6: body[0].material.fields.young: found \"E\", allowed: nothing (the mesh has no values by element that are finite numbers)",
        ),
        (
            format!("{sheet}[[body.load]]\nname = \"l\"\ngroup = \"left\"\ntraction = [1, 0, 0]\n"),
            "x.toml:10: body[0].load[0].traction: found a part of the mesh without a whole face, allowed: a part with an area, or `force` in its place",
        ),
        (
            format!("{base}[[body.support]]\nname = \"s\"\ngroup = \"lid\"\n"),
            "x.toml:9: body[0].support[0].group: found \"lid\", allowed: a group of the mesh: \"left\", \"right\", \"front\", \"back\", \"bottom\", \"top\"",
        ),
        (
            format!("{base}{}", clamp("group = \"left\"")),
            "x.toml:10: body[0].support[0].border: found \"clamped\", but the body has no stiffness against bending, allowed: \"hinged\"",
        ),
        (
            format!(
                "{}{}",
                sheet.replace("mesh", "bending = 0\nmesh"),
                clamp("group = \"left\"\nrotation = [0, 0, 0]")
            ),
            "x.toml:12: body[0].support[0].border: found \"clamped\", but the body has no stiffness against bending, allowed: \"hinged\"",
        ),
        (
            format!("{sheet}{}", clamp("box = [[-1, -1, -1], [0, 0, 1]]")),
            "x.toml:10: body[0].support[0].border: found \"clamped\", but its vertices contain no edge of the sheet's border, allowed: \"hinged\"",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(refusal(&text), expected, "{text}");
    }
}

/// A cantilever of cloth under a small force at its end: `F L^3 / (3 B w)` with the rigidity `B` of the threads along it.
#[test]
fn a_cantilever_of_cloth_bends_by_the_rigidity_of_its_threads() {
    for (warp, rigidity) in [("[1, 0, 0]", 2e-5), ("[0, 1, 0]", 5e-6)] {
        let body = body(&format!(
            r#"
name = "strip"
gravity = [0, 0, 0]
[[body]]
name = "strip"
mesh.sheet = {{ length = 0.1, width = 0.02, cells = [40, 8] }}
[body.material]
young = 1e6
poisson = 0.2
thickness = 0.001
density = 300
[body.material.weave]
warp = {warp}
young_weft = 1e6
shear = 0.05e6
bending_warp = 2e-5
bending_weft = 5e-6
bending_twist = 1e-6
[[body.support]]
name = "left"
group = "left"
border = "clamped"
[[body.load]]
name = "end"
group = "right"
force = [0, 0, 1e-7]
"#,
        ));
        let expected = 1e-7 * 1e-3 / (3.0 * rigidity * 0.02);
        // The cells at the clamp cost the square of a fortieth, about a tenth of a thousandth.
        let found = body.displacement.value / expected;
        assert!((found - 1.0).abs() < 5e-4, "{found}");
    }
}

/// A woven strip is pulled along its warp and free to contract. The force is E A times the force of the Green strain.
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
    // The force is E w t l (l^2 - 1) / 2 at a stretch of 1.2.
    let found = force(&body, "right")[0];
    assert!((found - 10.56).abs() < 1e-6, "{found}");
}
