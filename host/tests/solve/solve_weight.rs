//! A static solve lets a body settle under its weight before displacements and loads grow. Compared with the theory of
//! bars.

use host::world::World;

use host::scene::Scene;
use host::solve::{Frame, solve};
use std::convert::Infallible;
use support::solve::{body, cube, force, load, solved};

const YOUNG: f64 = 20e3;
const LENGTH: f64 = 0.2;
const AREA: f64 = 0.05 * 0.05;
/// Weight of the bar (N).
const WEIGHT: f64 = 1000.0 * 9.81 * AREA * LENGTH;

/// A linear bar without lateral contraction, which hangs from its top. `rest` adds supports and loads at its bottom.
fn bar(steps: usize, rest: &str) -> String {
    format!(
        r#"
name = "bar"
[solve]
load_steps = {steps}
[[body]]
name = "bar"
mesh.box = {{ size = [0.05, 0.05, {LENGTH}], cells = [1, 1, 8] }}
material = {{ law = "linear", young = {YOUNG}, poisson = 0.0, density = 1000 }}
[[body.support]]
name = "ceiling"
group = "top"
{rest}
"#
    )
}

const GRIPPER: &str = r#"
[[body.support]]
name = "gripper"
group = "bottom"
displacement = [0, 0, -0.004]
"#;

/// The bar between two supports carries half of its weight at each. A pull of its lower end adds E A u / L: in the linear
/// range the forces of weight and pull are summed, at every step.
#[test]
fn weight_and_pull_superpose_in_the_linear_range() {
    let body = body(&bar(4, GRIPPER));
    let stages: Vec<_> = body.steps.iter().map(|row| row.stage).collect();
    assert_eq!(stages, [Some("weight"), None, None, None, None]);
    let at: Vec<_> = body.steps.iter().map(|row| row.at).collect();
    assert_eq!(at, [0.0, 0.25, 0.5, 0.75, 1.0]);
    for row in &body.steps {
        let pull = YOUNG * AREA * 0.004 * row.at / LENGTH;
        let [ceiling, gripper] = [row.forces[0][2], row.forces[1][2]];
        // The solve ends at 1e-8 of the forces.
        assert!((ceiling - (0.5 * WEIGHT + pull)).abs() < 1e-6, "{row:?}");
        assert!((gripper - (0.5 * WEIGHT - pull)).abs() < 1e-6, "{row:?}");
    }
}

/// The force-displacement curve of the gripper begins at zero displacement with its reaction to the weight, and rises by
/// E A / L.
#[test]
fn the_curve_begins_with_the_weight() {
    let curves = solved(&bar(4, GRIPPER)).load_curves();
    let [curve] = &curves[..] else {
        panic!("{curves:?}");
    };
    assert_eq!(
        (curve.name.as_str(), curve.direction.as_str()),
        ("gripper", "−z")
    );
    assert_eq!(curve.points.len(), 5);
    for (step, (x, y)) in curve.points.iter().enumerate() {
        let u = 0.001 * step as f64;
        assert!((x - u).abs() < 1e-15, "{x}");
        let expected = YOUNG * AREA * u / LENGTH - 0.5 * WEIGHT;
        assert!((y - expected).abs() < 1e-6, "{y} {expected}");
    }
    // Without weight the curve begins with the unloaded body.
    let text = bar(1, GRIPPER).replace("[solve]", "gravity = [0, 0, 0]\n[solve]");
    let curve = solved(&text).load_curves().remove(0);
    assert_eq!(curve.points[0], (0.0, 0.0));
    assert_eq!(curve.points.len(), 2);
    assert!((curve.points[1].1 - YOUNG * AREA * 0.004 / LENGTH).abs() < 1e-6);
}

/// Under a load, too, the weight comes first, and alone.
#[test]
fn weight_acts_before_a_load() {
    let pulled = "[[body.load]]\nname = \"pull\"\ngroup = \"bottom\"\nforce = [0, 0, -2]\n";
    let body = body(&bar(2, pulled));
    let forces: Vec<_> = body.steps.iter().map(|row| row.forces[0][2]).collect();
    for (force, load) in forces.iter().zip([0.0, 1.0, 2.0]) {
        assert!((force - (WEIGHT + load)).abs() < 1e-6, "{forces:?}");
    }
    assert_eq!(force(&body, "ceiling")[2], forces[2]);
    // A bar under its own weight grows by rho g L^2 / 2 E. The corners of a bar of one cell differ in weight, and the
    // heaviest one hangs lowest.
    let sag = 1000.0 * 9.81 * LENGTH * LENGTH / (2.0 * YOUNG);
    let settled = body.steps[0].displacement.value;
    assert!((1.0..1.1).contains(&(settled / sag)), "{settled} {sag}");
    // The load adds F L / E A, in proportion to its fraction. The corners differ in load, too.
    for (step, load) in [(1, 1.0), (2, 2.0)] {
        let more = body.steps[step].displacement.value - settled;
        let expected = load * LENGTH / (YOUNG * AREA);
        assert!((more / expected - 1.0).abs() < 0.02, "{more} {expected}");
    }
}

/// What acts alone grows in the load steps.
#[test]
fn there_is_no_stage_of_its_own_where_one_thing_acts() {
    let weight = body(&bar(4, ""));
    let weightless = bar(4, GRIPPER).replace("[solve]", "gravity = [0, 0, 0]\n[solve]");
    for body in [&weight, &body(&weightless)] {
        assert_eq!(body.steps.len(), 4);
        assert!(body.steps.iter().all(|row| row.stage.is_none()));
        let at: Vec<_> = body.steps.iter().map(|row| row.at).collect();
        assert_eq!(at, [0.25, 0.5, 0.75, 1.0]);
    }
    let cube = body(&cube("linear", r#"["z"]"#));
    assert!(cube.steps.iter().all(|row| row.stage.is_none()));
    for row in &weight.steps {
        assert!((row.forces[0][2] - WEIGHT * row.at).abs() < 1e-6);
    }
}

/// The frames: rest at -1, the settled bar at 0, then the load steps.
#[test]
fn the_settled_body_is_a_frame() {
    let mut frames = Vec::new();
    let mut keep = |frame: Frame<'_>| {
        let lowest = frame.grid.positions.iter().map(|p| p.z);
        frames.push((frame.number, frame.at, lowest.fold(0.0, f64::min)));
        Ok::<(), Infallible>(())
    };
    let pulled = "[[body.load]]\nname = \"pull\"\ngroup = \"bottom\"\nforce = [0, 0, -2]\n";
    let solution = solve(
        &World::new(&load(&bar(2, pulled))).unwrap(),
        true,
        &mut |_| {},
        &mut keep,
    )
    .expect("solved");
    let times: Vec<_> = frames.iter().map(|frame| (frame.0, frame.1)).collect();
    assert_eq!(times, [(0, -1.0), (1, 0.0), (2, 0.5), (3, 1.0)]);
    assert!(frames.windows(2).all(|pair| pair[1].2 < pair[0].2));
    let report = solution.to_string();
    assert!(
        report.contains("weight first, then 2 load steps"),
        "{report}"
    );
}

/// All bodies of a scene have the same steps, so that a row of the table is one moment of all.
#[test]
fn the_table_has_a_row_for_each_step() {
    let text = bar(2, GRIPPER)
        + r#"
[[body]]
name = "other bar"
mesh.box = { size = [0.05, 0.05, 0.2], cells = [1, 1, 2] }
material = { young = 20e3, poisson = 0.0, density = 1000 }
support = [{ name = "ceiling", group = "top" }]
"#;
    let csv = solved(&text).csv();
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 4);
    let column = |name: &str| -> Vec<f64> {
        let index = rows[0].iter().position(|other| *other == name);
        let index = index.unwrap_or_else(|| panic!("{name} in {:?}", rows[0]));
        rows[1..]
            .iter()
            .map(|row| row[index].parse().expect("a number"))
            .collect()
    };
    assert_eq!(column("step"), [1.0, 2.0, 3.0]);
    assert_eq!(column("fraction"), [0.0, 0.5, 1.0]);
    assert_eq!(
        column("bar_gripper_displacement_z_m"),
        [0.0, -0.002, -0.004]
    );
    let sums = column("bar_gripper_force_z_N").into_iter();
    let sums = sums
        .zip(column("bar_ceiling_force_z_N"))
        .map(|(a, b)| a + b);
    for sum in sums.chain(column("other_bar_ceiling_force_z_N")) {
        assert!((sum - WEIGHT).abs() < 1e-5, "{sum}");
    }
    assert!(column("bar_ceiling_moment_x_Nm").iter().all(|m| m.is_nan()));
    let energy = column("bar_elastic_energy_J");
    assert!(energy.is_sorted() && energy[0] > 0.0, "{energy:?}");
    // A static solve has no time.
    assert!(!csv.contains("time_s"));
    assert!(Scene::parse(&text, "bar.toml").is_ok());
}
