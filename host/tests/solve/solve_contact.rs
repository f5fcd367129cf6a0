//! Equilibria of bodies that touch: what rests on something presses on it with its weight.

use host::scene::Scene;
use host::solve::{Frame, PairRow, PairSolution, solve};
use host::world::World;
use meshio::write_gmsh::write_solid;
use meshio::write_vtu::Values;
use physics::mesh::generate_box::graded_box;
use std::convert::Infallible;
use support::solve::{load, solved};

const DENSITY: f64 = 1000.0;
const GRAVITY: f64 = 9.81;

/// A block of 40 mm without supports, at a height, with a friction of 0.5.
fn block(name: &str, law: &str, cells: u32, height: f64) -> String {
    format!(
        r#"
[[body]]
name = "{name}"
mesh.box = {{ size = [0.04, 0.04, 0.02], cells = [{cells}, {cells}, 2] }}
position = [0.0, 0.0, {height}]
material = {{ law = "{law}", young = 20e3, poisson = 0.3, density = {DENSITY} }}
"#
    )
}

const WEIGHT: f64 = DENSITY * GRAVITY * 0.04 * 0.04 * 0.02;
const FLOOR: &str = "\n[[obstacle]]\nname = \"floor\"\nshape = \"plane\"\nfriction = 0.5\n";

fn last(pair: &PairSolution) -> &PairRow {
    pair.steps.last().expect("a step")
}

/// A block falls on a floor, and rests: the floor bears its weight. Nothing else holds it.
#[test]
fn a_floor_bears_a_block() {
    for law in ["linear", "stable_neo_hookean"] {
        let found = solved(&format!(
            "name = \"rest\"\n{}{FLOOR}",
            block("lower", law, 3, 0.011)
        ));
        assert!(found.failures.is_empty(), "{:?}", found.failures);
        let forces: Vec<_> = found.contacts.iter().map(|pair| last(pair).force).collect();
        let [by_floor] = &forces[..] else {
            panic!("{forces:?}");
        };
        // The solve ends at 1e-6 of all forces at least.
        assert!((by_floor[2] / WEIGHT - 1.0).abs() < 1e-6, "{by_floor:?}");
        let deepest = found.contacts.iter().map(|pair| last(pair).depth);
        // A thousandth of the thickness of a solid in contact.
        assert!(deepest.fold(0.0, f64::max) < 3e-8);
        let header = found.csv();
        assert!(header.contains("lower_floor_contact_normal_N"), "{header}");
        let text = found.to_string();
        assert!(text.contains("lower and floor:"), "{text}");
    }
}

/// Below the cone a block sticks to an incline: friction bears its share of the weight.
#[test]
fn a_block_sticks_to_an_incline() {
    let angle: f64 = 0.4;
    let gravity = [GRAVITY * angle.sin(), 0.0, -GRAVITY * angle.cos()];
    let text = format!(
        "name = \"incline\"\ngravity = {gravity:?}\n{}{FLOOR}",
        block("block", "corotational", 3, 0.0101),
    );
    let found = solved(&text);
    assert!(found.failures.is_empty(), "{:?}", found.failures);
    let row = last(&found.contacts[0]);
    let expected = [-WEIGHT * angle.sin(), 0.0, WEIGHT * angle.cos()];
    for (found, expected) in row.force.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-6 * WEIGHT, "{row:?}");
    }
    assert!(row.friction < 0.5 * row.normal, "{row:?}");
}

/// The pressure of the frames, over the area of the vertices, is the weight.
#[test]
fn frames_have_the_pressure_of_contacts() {
    let text = format!(
        "name = \"rest\"\n{}{FLOOR}",
        block("block", "linear", 4, 0.0101)
    );
    let loaded = load(&text);
    let mut found = Vec::new();
    solve(
        &World::new(&loaded).unwrap(),
        true,
        &mut |_| {},
        &mut |frame: Frame<'_>| {
            found.push((frame.number, frame.grid));
            Ok::<(), Infallible>(())
        },
    )
    .unwrap();
    let [(0, rest), (1, settled)] = &found[..] else {
        panic!("{}", found.len());
    };
    let pressure = |grid: &meshio::write_vtu::UnstructuredGrid| {
        let found = grid.at_vertices.iter();
        let found = found.filter(|(name, _)| name == "contact_pressure");
        found
            .flat_map(|(_, values)| match values {
                Values::Scalar(values) => values.clone(),
                _ => panic!("{values:?}"),
            })
            .collect::<Vec<f64>>()
    };
    assert!(pressure(rest).iter().all(|p| *p == 0.0));
    let below = pressure(settled);
    let touching = below.iter().filter(|p| **p > 0.0).count();
    assert_eq!(touching, 25, "{below:?}");
    // The triangles of the face on the floor are halves of squares of 10 mm, and each is of one tetrahedron.
    let low = rest.positions.iter().fold(f64::INFINITY, |z, x| z.min(x.z));
    let is_low = |vertex: &&u32| rest.positions[**vertex as usize].z < low + 1e-9;
    let mut borne = 0.0;
    for (vertices, _) in &rest.cells {
        let corners: Vec<_> = vertices.iter().filter(is_low).collect();
        if corners.len() == 3 {
            let sum: f64 = corners.iter().map(|v| below[**v as usize]).sum();
            borne += 0.5e-4 * sum / 3.0;
        }
    }
    // The block widens below under its weight, by less than a hundredth.
    assert!((borne / WEIGHT - 1.0).abs() < 0.02, "{borne} {WEIGHT}");
}

/// A block of 40 mm on another one.
fn stack(law: &str, order: u32, degrees: f64) -> String {
    let block = |name: &str, cells: u32, height: f64| {
        let block = block(name, law, cells, height);
        block
            .replace("mesh.box =", "mesh = { box =")
            .replace("2] }", &format!("2] }}, order = {order} }}"))
    };
    let (lower, upper) = (block("lower", 3, 0.0101), block("upper", 4, 0.0303));
    format!(
        r#"
name = "stack"
{lower}{upper}
rotation = {{ axis = [0, 0, 1], degrees = {degrees} }}
{FLOOR}
[[contact]]
between = ["lower", "upper"]
friction = 0.5
"#
    )
}

/// Two blocks without supports, whose meshes do not match, rest on each other and on a floor. One is turned, so that corners of
/// both stand out.
#[test]
fn a_block_rests_on_a_block() {
    for (law, order, degrees) in [
        ("linear", 1, 30.0),
        ("stable_neo_hookean", 1, 0.0),
        ("linear", 2, 0.0),
    ] {
        let found = solved(&stack(law, order, degrees));
        assert!(found.failures.is_empty(), "{:?}", found.failures);
        let forces: Vec<f64> = found
            .contacts
            .iter()
            .map(|pair| last(pair).force[2])
            .collect();
        // A pair has the force on its first body: the upper block presses the lower one down.
        for (force, weights) in forces.into_iter().zip([-1.0, 2.0, 0.0]) {
            assert!(
                (force - weights * WEIGHT).abs() < 1e-6 * WEIGHT,
                "{law} {order}: {force}"
            );
        }
    }
}

/// A block slides off another one without friction. The error says what to look for.
#[test]
fn what_does_not_rest_is_an_error_that_asks_what_holds_it() {
    let text = stack("linear", 1, 0.0).replace("friction = 0.5", "friction = 0.0");
    let found = solved(&text.replace(
        "name = \"stack\"",
        "name = \"stack\"\ngravity = [1.0, 0.0, -9.81]",
    ));
    let [failure] = &found.failures[..] else {
        panic!("{:?}", found.failures);
    };
    assert!(
        failure.contains("bodies in contact") && failure.contains("held"),
        "{failure}"
    );
}

/// A block with a curved lower face is pressed flat without friction, by a tenth of Young's modulus.
#[test]
fn a_curved_block_is_pressed_flat() {
    const LOAD: f64 = 2000.0;
    let planes = |from: f64, to: f64, cells: u32| {
        let planes = (0..=cells).map(|i| from + (to - from) * f64::from(i) / f64::from(cells));
        planes.collect::<Vec<f64>>()
    };
    let across = planes(-0.02, 0.02, 6);
    let mut mesh = graded_box([&across, &across, &planes(0.0, 0.02, 3)]).unwrap();
    for x in &mut mesh.positions {
        x.z += (x.x * x.x + x.y * x.y) / 0.2 * (1.0 - x.z / 0.02);
    }
    let files = [("curved.msh".to_owned(), write_solid(&mesh).into_bytes())];
    let text = format!(
        r#"
name = "curved"
gravity = [0.0, 0.0, 0.0]
{}
[[body.support]]
name = "ground"
group = "bottom"
[[body]]
name = "upper"
mesh = {{ file = "curved.msh" }}
position = [0.0, 0.0, 0.0101]
material = {{ law = "linear", young = 20e3, poisson = 0.3, density = 1000.0 }}
[[body.load]]
name = "load"
group = "top"
traction = [0.0, 0.0, {}]
[[body.support]]
name = "guide"
group = "top"
axes = ["x", "y"]
[[contact]]
between = ["lower", "upper"]
friction = 0.0
"#,
        block("lower", "linear", 5, 0.0),
        -LOAD
    );
    let loaded = Scene::load_texts("curved.toml", &text, &files.into()).unwrap();
    let world = World::new(&loaded).unwrap();
    let found = solve(&world, false, &mut |_| {}, &mut |_: Frame<'_>| {
        Ok::<(), Infallible>(())
    });
    let found = found.unwrap();
    assert!(found.failures.is_empty(), "{:?}", found.failures);
    let force = last(&found.contacts[0]).force[2];
    let load = LOAD * 0.04 * 0.04;
    assert!((force + load).abs() < 1e-6 * load, "{force}");
}

/// A plate is pressed on a plate by the way (m) of its upper face from a height (m). Returns the sums of the contact.
fn pressed_plates(thickness: f64, height: f64, way: f64) -> PairRow {
    let plate = |name: &str, cells: u32, height: f64| {
        block(name, "linear", cells, height).replace("0.04, 0.02]", &format!("0.04, {thickness}]"))
    };
    let found = solved(&format!(
        r#"
name = "plates"
gravity = [0.0, 0.0, 0.0]
{}
[[body.support]]
name = "ground"
group = "bottom"
{}
[[body.support]]
name = "press"
group = "top"
displacement = [0.0, 0.0, {}]
[[contact]]
between = ["lower", "upper"]
thickness = 1e-5
friction = 0.0
"#,
        plate("lower", 3, 0.0),
        plate("upper", 4, thickness + height),
        -way
    ));
    assert!(found.failures.is_empty(), "{:?}", found.failures);
    last(&found.contacts[0]).clone()
}

/// A block that comes from afar in one step touches as one that begins near, and the far sides of thin plates do not touch.
#[test]
fn only_sides_that_meet_touch_and_none_is_passed() {
    let near = pressed_plates(0.02, 1e-4, 1.1e-3);
    let far = pressed_plates(0.02, 0.03, 0.031);
    assert_eq!((near.count, far.count), (25, 25));
    let [near, far] = [near, far].map(|row| row.normal);
    assert!(
        near > 0.1 && (far / near - 1.0).abs() < 1e-6,
        "{near} {far}"
    );
    assert_eq!(pressed_plates(1e-3, 1e-4, 1.5e-4).count, 25);
}

/// The forces of a block that nothing loads and that touches nothing are rounding, of which no part is a residual.
#[test]
fn a_block_without_loads_has_no_residual() {
    let found = solved(&format!(
        "name = \"apart\"\ngravity = [0, 0, 0]\n{}[[body.support]]\nname = \"top\"\ngroup = \"top\"\n{FLOOR}",
        block("block", "corotational", 4, 1.02003)
    ));
    assert!(found.failures.is_empty(), "{:?}", found.failures);
    let steps = &found.bodies[0].steps;
    assert!(steps.iter().all(|row| row.residual == 0.0), "{steps:?}");
}
