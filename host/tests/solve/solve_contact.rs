//! Equilibria of bodies that touch: what rests on something presses on it with its weight.

use crate::solve_support;
use host::solve::{Frame, PairSolution, solve};
use host::world::World;
use meshio::write_vtu::Values;
use solve_support::{load, solved};
use std::convert::Infallible;

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

fn last(pair: &PairSolution) -> &host::solve::PairRow {
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
    // The cells of the floor's face are squares of 10 mm, whose corners have shares of a sixth or a third of them.
    let mean = WEIGHT / (0.04 * 0.04);
    let below = pressure(settled);
    let touching = below.iter().filter(|p| **p > 0.0).count();
    assert_eq!(touching, 25, "{below:?}");
    assert!(below.iter().all(|p| *p < 4.0 * mean), "{below:?}");
}
