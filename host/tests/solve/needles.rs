//! Which needles spoil the forces of a body, measured on strips and bars of known stiffness: the limits of
//! `host::world::shapes`.
//!
//! A strip of 200 x 50 x 1 mm without lateral contraction is clamped at one end, and its other end is moved by 20 µm: across
//! the strip against `3 E I / L^3`, or in its plane against the beam of Timoshenko.

use host::scene::{LoadedScene, Scene};
use host::solve::{Frame, solve};
use host::world::World;
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::fmt::Write;
use support::solve::force;

const LENGTH: f64 = 0.2;
const WIDTH: f64 = 0.05;
const THICKNESS: f64 = 1e-3;
const YOUNG: f64 = 1e6;
const MOVED: f64 = 2e-5;

/// `count + 1` places from 0 to `length`.
fn even(length: f64, count: usize) -> Vec<f64> {
    (0..=count)
        .map(|k| length * k as f64 / count as f64)
        .collect()
}

/// 20 x 5 cells, each line across the strip doubled at a distance of `gap` cells: one row of needles beside each line.
fn doubled(gap: f64) -> String {
    let mut along = even(LENGTH, 20);
    let inner = along[1..20].to_vec();
    along.extend(inner.iter().map(|x| x + gap * LENGTH / 20.0));
    along.sort_by(f64::total_cmp);
    let rows = vec![along; 6];
    strip(&rows)
}

/// Rows of isosceles triangles: every other row is moved by half a triangle.
fn staggered(along: usize, across: usize) -> String {
    let straight = even(LENGTH, along);
    let mut moved = vec![0.0];
    moved.extend(straight.windows(2).map(|ends| 0.5 * (ends[0] + ends[1])));
    moved.push(LENGTH);
    let row = |k: usize| {
        if k.is_multiple_of(2) {
            &straight
        } else {
            &moved
        }
    };
    strip(&(0..=across).map(|k| row(k).clone()).collect::<Vec<_>>())
}

/// An OBJ file of a strip whose rows from y = 0 to the width have vertices at these x.
fn strip(rows: &[Vec<f64>]) -> String {
    let mut text = String::new();
    let mut first = 1;
    for (k, row) in rows.iter().enumerate() {
        let y = WIDTH * k as f64 / (rows.len() - 1) as f64;
        for x in row {
            writeln!(text, "v {x:?} {y:?} 0").unwrap();
        }
        if let Some(above) = rows.get(k + 1) {
            let (mut i, mut j, next) = (0, 0, first + row.len());
            while i + 1 < row.len() || j + 1 < above.len() {
                // Of the two ends that can move on, the one whose diagonal is shorter.
                let along = j + 1 == above.len()
                    || (i + 1 < row.len()
                        && (row[i + 1] - above[j]).abs() <= (row[i] - above[j + 1]).abs());
                let third = if along { first + i + 1 } else { next + j + 1 };
                writeln!(text, "f {} {third} {}", first + i, next + j).unwrap();
                if along { i += 1 } else { j += 1 }
            }
        }
        first += row.len();
    }
    text
}

fn loaded(mesh: &str, file: &str, material: &str, supports: &str) -> LoadedScene {
    let text = format!(
        "name = 'x'\ngravity = [0, 0, 0]\n[[body]]\nname = 'b'\nmesh = {{ {mesh} }}\n\
         material = {{ young = {YOUNG:?}, poisson = 0.0, density = 1000{material} }}\n{supports}"
    );
    let files = BTreeMap::from([("m.obj".to_owned(), file.as_bytes().to_vec())]);
    Scene::load_texts("x.toml", &text, &files).unwrap_or_else(|error| panic!("{error}"))
}

/// The strip of the mesh whose end is moved along `axis`, the other one held with this border.
fn beam(file: &str, axis: usize, border: &str) -> LoadedScene {
    let name = ["x", "y", "z"][axis];
    let mut moved = [0.0; 3];
    moved[axis] = -MOVED;
    loaded(
        "file = 'm.obj'",
        file,
        &format!(", thickness = {THICKNESS:?}"),
        &format!(
            "[[body.support]]\nname = 'wall'\nbox = [[-1, -1, -1], [1e-7, 1, 1]]\nborder = '{border}'\n\
             [[body.support]]\nname = 'tip'\nbox = [[0.1999999, -1, -1], [1, 1, 1]]\naxes = ['{name}']\n\
             displacement = {moved:?}\n"
        ),
    )
}

fn tip(loaded: &LoadedScene, axis: usize) -> f64 {
    let mut keep = |_: Frame<'_>| Ok::<(), Infallible>(());
    let solution = solve(&World::new(loaded).unwrap(), false, &mut |_| {}, &mut keep).unwrap();
    assert!(solution.failures.is_empty(), "{:?}", solution.failures);
    -force(&solution.bodies[0], "tip")[axis]
}

/// The errors of bending across the strip and in its plane, relative to theory, and whether needles are warned of.
fn errors(file: &str) -> ([f64; 2], bool) {
    let second = |width: f64, height: f64| width * height.powi(3) / 12.0;
    let bending = LENGTH.powi(3) / (3.0 * YOUNG * second(WIDTH, THICKNESS));
    let in_plane = LENGTH.powi(3) / (3.0 * YOUNG * second(THICKNESS, WIDTH))
        + 1.2 * LENGTH / (0.5 * YOUNG * THICKNESS * WIDTH);
    let across = beam(file, 2, "clamped");
    let errors = [
        tip(&across, 2) * bending / MOVED - 1.0,
        tip(&beam(file, 1, "hinged"), 1) * in_plane / MOVED - 1.0,
    ];
    (errors, is_warned_of(&across))
}

fn is_warned_of(loaded: &LoadedScene) -> bool {
    let mut warnings = World::new(loaded).unwrap().warnings.into_iter();
    warnings.any(|warning| warning.found.contains("with a quality below"))
}

#[test]
fn sheets_without_the_warning_bend_as_they_should() {
    for (name, file) in [
        ("equilateral", staggered(12, 5)),
        ("1 : 3", staggered(12, 10)),
        ("1 : 7", staggered(12, 20)),
        ("rectangles, 1 : 32", strip(&vec![even(LENGTH, 5); 41])),
        ("rows of 1 : 33", doubled(0.03)),
    ] {
        let ([across, in_plane], is_warned) = errors(&file);
        assert!(!is_warned, "{name}");
        // The largest of these errors are measured to be 2 % and 93 %: linear triangles of this size are stiff in their
        // plane whatever their shape, and the bound is twice.
        assert!(across.abs() < 0.04, "{name}: {across}");
        assert!((0.0..2.0).contains(&in_plane), "{name}: {in_plane}");
    }
}

#[test]
fn sheets_with_the_warning_err_by_what_the_warning_says() {
    for (name, file, across_is, in_plane_is) in [
        ("1 : 13", staggered(12, 40), 0.072, 1.52),
        ("1 : 53", staggered(12, 160), 0.261, 4.02),
        (
            "rectangles, 1 : 128",
            strip(&vec![even(LENGTH, 5); 161]),
            -0.839,
            0.929,
        ),
        ("rows of 1 : 1000", doubled(1e-3), -0.511, 0.138),
        ("rows of 1 : 10000", doubled(1e-4), -0.952, 0.138),
    ] {
        let ([across, in_plane], is_warned) = errors(&file);
        assert!(is_warned, "{name}");
        // Half of the last digit of what was measured; if a limit acts, the last bits of a mesh decide on a percent.
        assert!((across - across_is).abs() < 0.01, "{name}: {across}");
        assert!((in_plane - in_plane_is).abs() < 0.01, "{name}: {in_plane}");
    }
}

#[test]
fn a_few_needles_matter_only_where_a_sheet_bends() {
    let file = doubled(1e-3);
    let warned = |bending: &str| {
        let supports = format!(
            "bending = {bending}\n[[body.support]]\nname = 'all'\nbox = [[-1, -1, -1], [1, 1, 1]]\n"
        );
        let thickness = format!(", thickness = {THICKNESS:?}");
        is_warned_of(&loaded("file = 'm.obj'", &file, &thickness, &supports))
    };
    assert!(warned("1"));
    assert!(!warned("0"));
}

/// Bars of 200 x 50 x 50 mm: flat cells, whose tetrahedra are needles, against cells of equal sides.
#[test]
fn a_solid_of_needles_is_warned_of_and_too_stiff() {
    let bar = |cells: [u32; 3], order: u32| {
        let loaded = loaded(
            &format!(
                "box = {{ size = [{LENGTH:?}, {WIDTH:?}, {WIDTH:?}], cells = {cells:?} }}, order = {order}"
            ),
            "",
            "",
            &format!(
                "[[body.support]]\nname = 'wall'\ngroup = 'left'\n[[body.support]]\nname = 'tip'\ngroup = 'right'\n\
                 axes = ['z']\ndisplacement = [0, 0, {:?}]\n",
                -MOVED
            ),
        );
        let compliance =
            LENGTH.powi(3) * 4.0 / (YOUNG * WIDTH.powi(4)) + 2.4 * LENGTH / (YOUNG * WIDTH * WIDTH);
        (
            tip(&loaded, 2) * compliance / MOVED - 1.0,
            is_warned_of(&loaded),
        )
    };
    // Quadratic tetrahedra of good shape are exact to a thousandth, and linear ones of this size 1.8 times too stiff.
    let (error, is_warned) = bar([8, 2, 2], 2);
    assert!(!is_warned && error.abs() < 2e-3, "{error}");
    let (error, is_warned) = bar([8, 2, 2], 1);
    assert!(!is_warned && (0.5..1.0).contains(&error), "{error}");
    let (error, is_warned) = bar([2, 2, 40], 1);
    assert!(is_warned && (4.0..7.0).contains(&error), "{error}");
    let (error, is_warned) = bar([2, 2, 40], 2);
    assert!(is_warned && (0.02..0.05).contains(&error), "{error}");
}
