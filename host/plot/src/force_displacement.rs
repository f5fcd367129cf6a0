//! Force against displacement: the picture of a material test.
//!
//! Each curve has the direction along which its device or support is loaded. Displacements away from the start and forces
//! on the body along that direction are positive, so that a body that resists gives a curve in the upper right. A line has
//! its full colour while the displacement grows and is pale while it returns: the area between the two is the energy lost.

use nalgebra::Vector3;
use plotters::prelude::*;

use super::axis::Axis;
use super::direction::{first_usable, main_direction};
use super::ink::Role;
use super::lines;
use super::page::{self, Area, Axes, Drawn, Entry, Key, Marker};
use super::picture::Picture;
use super::reduce::usable;

const WIDTH: i32 = 720;
const HEIGHT: i32 = 480;

/// A turn of the motion counts if the displacement changes by this fraction of its largest value. Smaller turns are the
/// tremor of a hand or the counts of an encoder.
const TURN: f64 = 0.02;

/// Most points of a curve that are marked: more marks cannot be distinguished.
const MOST_MARKS: usize = 30;

/// The force on a body against the displacement of the device or the support that loads the body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadCurve {
    /// Its name in the legend.
    pub name: String,
    /// The name of the direction of loading, such as `x` or `−z`.
    pub direction: String,
    /// Displacement from the start (m) and force on the body (N), both along the direction, in the order of time.
    pub points: Vec<(f64, f64)>,
}

impl LoadCurve {
    /// The curve of a motion over `position` (m) under the forces `force` on the body (N): along the principal direction
    /// of the force, without force that of the motion. It points to where the motion is farthest from its start.
    pub fn of_motion(name: &str, position: &[[f64; 3]], force: &[[f64; 3]]) -> Self {
        let start = first_usable(position);
        let moved = position.iter().map(|p| Vector3::from(*p) - start);
        let moved: Vec<[f64; 3]> = moved.map(Into::into).collect();
        let direction = main_direction(force, &moved);
        Self::along(name, direction.axis, &direction.name, &moved, force)
    }

    /// The curve of displacements `moved` (m) under the forces `force` on the body (N) along the unit vector `axis`,
    /// which the labels call `label`. The curve takes the opposite direction if the motion goes there.
    fn along(
        name: &str,
        axis: Vector3<f64>,
        label: &str,
        moved: &[[f64; 3]],
        force: &[[f64; 3]],
    ) -> Self {
        let project = |v: &[f64; 3]| axis.dot(&Vector3::from(*v));
        let points: Vec<_> = moved
            .iter()
            .map(project)
            .zip(force.iter().map(project))
            .collect();
        let usable = points.iter().map(|point| point.0).filter(|x| usable(*x));
        let farthest = usable.fold(
            0.0_f64,
            |most, x| if x.abs() > most.abs() { x } else { most },
        );
        let (sign, direction) = if farthest < 0.0 {
            (-1.0, opposite(label))
        } else {
            (1.0, label.to_owned())
        };
        Self {
            name: name.to_owned(),
            direction,
            points: points
                .into_iter()
                .map(|(x, y)| (sign * x, sign * y))
                .collect(),
        }
    }

    /// The curve of a part that is displaced by `fractions` of `displacement` (m) under the forces `force` on the body
    /// (N).
    pub fn of_support(
        name: &str,
        displacement: [f64; 3],
        fractions: &[f64],
        force: &[[f64; 3]],
    ) -> Self {
        let moved = fractions
            .iter()
            .map(|fraction| displacement.map(|along| fraction * along));
        let moved: Vec<_> = moved.collect();
        let axis = Vector3::from(displacement).try_normalize(0.0);
        let axis = axis.unwrap_or_else(Vector3::x);
        Self::along(name, axis, &label(axis), &moved, force)
    }
}

/// The name of a direction: that of an axis of the world, or the components.
fn label(direction: Vector3<f64>) -> String {
    let along = |axis: usize| (0..3).all(|other| other == axis || direction[other] == 0.0);
    match (0..3).find(|axis| along(*axis)) {
        Some(axis) if direction[axis] < 0.0 => opposite(["x", "y", "z"][axis]),
        Some(axis) => ["x", "y", "z"][axis].to_owned(),
        None => {
            let [x, y, z]: [f64; 3] = direction.map(|x| (100.0 * x).round() / 100.0 + 0.0).into();
            format!("({x:.2}, {y:.2}, {z:.2})").replace('-', "−")
        }
    }
}

/// The name of the opposite direction.
fn opposite(label: &str) -> String {
    let Some(inner) = label.strip_prefix('(').and_then(|l| l.strip_suffix(')')) else {
        return format!("−{label}");
    };
    let flipped = inner.split(", ").map(|part| match part.strip_prefix('−') {
        Some(positive) => positive.to_owned(),
        None if part.bytes().all(|byte| b"0.".contains(&byte)) => part.to_owned(),
        None => format!("−{part}"),
    });
    format!("({})", flipped.collect::<Vec<_>>().join(", "))
}

/// Draws force against displacement, 720 by 480 pixels. What is not a number is left out.
pub fn force_displacement(title: &str, curves: &[LoadCurve]) -> Picture {
    page::picture(WIDTH, HEIGHT, |area| draw(area, title, curves))
}

fn draw(area: &Area, title: &str, curves: &[LoadCurve]) -> Drawn {
    let drawn: Vec<Vec<(f64, f64)>> = curves.iter().map(millimetres).collect();
    let branches: Vec<Vec<Branch>> = drawn.iter().map(|points| branches(points)).collect();
    let returns = branches.iter().flatten().any(|branch| !branch.loading);
    let subtitle = if returns {
        "full colour: displacement grows; pale: displacement falls"
    } else {
        ""
    };
    let top = page::title(area, title, subtitle)?;
    // The axes name a direction that all curves have in common. Otherwise the legend names each direction.
    let common = curves.first().map(|first| &first.direction);
    let common = common.filter(|name| curves.iter().all(|curve| curve.direction == **name));
    let along = common.map_or("along the loading".to_owned(), |name| {
        format!("along {name}")
    });
    let entries = curves.iter().enumerate().map(|(i, curve)| Entry {
        name: match common {
            Some(_) => curve.name.clone(),
            None => format!("{}, along {}", curve.name, curve.direction),
        },
        key: Key::Ink(Role::Number(i).ink(0), marker(&drawn[i])),
    });
    let top = top + page::legend(area, WIDTH, top, &entries.collect::<Vec<_>>())?;
    // Both axes include zero, which is no displacement or no force.
    let all = || drawn.iter().flatten();
    let x = Axis::linear(all().map(|point| point.0).chain([0.0]), 0.04, 8.0);
    let y = Axis::linear(all().map(|point| point.1).chain([0.0]), 0.06, 8.0);
    let (x_label, y_label) = (
        format!("Displacement {along} (mm)"),
        format!("Force on the body {along} (N)"),
    );
    let axes = Axes {
        x: &x,
        y: &y,
        x_label: Some(&x_label),
        y_label: &y_label,
    };
    let (_, below) = area.split_vertically(top * page::UNITS);
    let mut panel = page::panel(&below, &axes)?;
    page::grid(&mut panel, &axes)?;
    for zero in [[(x.from, 0.0), (x.to, 0.0)], [(0.0, y.from), (0.0, y.to)]] {
        panel.draw_series([PathElement::new(zero, page::zero_style())])?;
    }
    if drawn.iter().all(Vec::is_empty) {
        page::nothing(&panel)?;
    }
    for (i, points) in drawn.iter().enumerate() {
        let ink = Role::Number(i).ink(0);
        for branch in &branches[i] {
            let path: Vec<_> = points[branch.from..=branch.to]
                .iter()
                .map(|point| panel.backend_coord(point))
                .collect();
            let ink = if branch.loading { ink } else { ink.pale() };
            lines::line(area, &thinned(&path), ink)?;
        }
        for point in points {
            let (x, y) = panel.backend_coord(point);
            marker(points).draw(area, x, y, ink.color)?;
        }
    }
    Ok(())
}

/// The mark at the points of a curve: a circle at each step of a solve, but none at the ticks of a run.
fn marker(points: &[(f64, f64)]) -> Marker {
    if points.len() > MOST_MARKS {
        Marker::None
    } else {
        Marker::Circle
    }
}

/// The points that can be drawn, with displacements in mm.
fn millimetres(curve: &LoadCurve) -> Vec<(f64, f64)> {
    let points = curve.points.iter().map(|(x, y)| (1e3 * x, *y));
    points.filter(|(x, y)| usable(*x) && usable(*y)).collect()
}

/// The path without points that are less than half a pixel from the point before them.
fn thinned(path: &[(i32, i32)]) -> Vec<(i32, i32)> {
    let apart = page::UNITS / 2;
    let mut kept: Vec<(i32, i32)> = Vec::new();
    for (index, at) in path.iter().enumerate() {
        let near =
            |last: &(i32, i32)| (at.0 - last.0).abs() < apart && (at.1 - last.1).abs() < apart;
        if index + 1 == path.len() || !kept.last().is_some_and(near) {
            kept.push(*at);
        }
    }
    kept
}

/// A part of a curve between two turns of the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Branch {
    from: usize,
    to: usize,
    /// Whether the distance from the start grows.
    loading: bool,
}

/// The branches of a curve. Consecutive branches share the point of the turn.
fn branches(points: &[(f64, f64)]) -> Vec<Branch> {
    let distance = |index: usize| points[index].0.abs();
    let largest = (0..points.len()).map(distance).fold(0.0, f64::max);
    let (mut from, mut extreme, mut loading) = (0, 0, true);
    let mut branches = Vec::new();
    for index in 1..points.len() {
        let sign = if loading { 1.0 } else { -1.0 };
        let beyond = sign * (distance(index) - distance(extreme));
        if beyond > 0.0 {
            extreme = index;
        } else if beyond < -TURN * largest {
            branches.push(Branch {
                from,
                to: extreme,
                loading,
            });
            (from, extreme, loading) = (extreme, index, !loading);
        }
    }
    if !points.is_empty() {
        let to = points.len() - 1;
        branches.push(Branch { from, to, loading });
    }
    branches
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle wave with the noise of an encoder has one branch for each of its slopes.
    #[test]
    fn loading_and_unloading_are_told_apart() {
        let noise = |i: usize| if i.is_multiple_of(2) { 0.01 } else { 0.0 };
        let wave = |i: usize| match i {
            0..100 => i as f64,
            100..250 => 200.0 - i as f64,
            _ => i as f64 - 300.0,
        };
        let points: Vec<_> = (0..=300)
            .map(|i| (0.01 * wave(i) + noise(i), 0.0))
            .collect();
        let found = branches(&points);
        let loading: Vec<_> = found.iter().map(|branch| branch.loading).collect();
        assert_eq!(loading, [true, false, true, false]);
        for (branch, turn) in found.iter().zip([100_usize, 200, 250, 300]) {
            assert!(branch.to.abs_diff(turn) <= 2, "{branch:?}");
        }
        assert!(found.windows(2).all(|pair| pair[0].to == pair[1].from));
        assert_eq!(branches(&[]), []);
        let still = [(0.0, 1.0); 3];
        let one = Branch {
            from: 0,
            to: 2,
            loading: true,
        };
        assert_eq!(branches(&still), [one]);
    }

    /// Pulled down or pressed down, a spring that resists gives the same curve: k times the displacement.
    #[test]
    fn a_spring_gives_its_line_in_every_direction() {
        for axis in [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [-0.6, 0.8, 0.0]] {
            let at = |s: f64| axis.map(|along| along * s);
            let position: Vec<_> = (0..=10).map(|i| at(0.001 * f64::from(i))).collect();
            let force: Vec<_> = (0..=10).map(|i| at(0.5 * f64::from(i))).collect();
            let fractions: Vec<_> = (0..=10).map(|i| 0.1 * f64::from(i)).collect();
            for curve in [
                LoadCurve::of_motion("hand", &position, &force),
                LoadCurve::of_support("top", at(0.01), &fractions, &force),
            ] {
                for (index, (x, y)) in curve.points.iter().enumerate() {
                    let step = index as f64;
                    assert!((x - 0.001 * step).abs() < 1e-12, "{curve:?}");
                    assert!((y - 0.5 * step).abs() < 1e-12, "{curve:?}");
                }
            }
        }
        let down = LoadCurve::of_support("top", [0.0, 0.0, -0.01], &[1.0], &[[0.0; 3]]);
        assert_eq!(down.direction, "−z");
        assert_eq!(opposite("(0.71, −0.71, 0.00)"), "(−0.71, 0.71, 0.00)");
    }

    #[test]
    fn the_way_back_is_pale() {
        let curve = |points: Vec<(f64, f64)>| LoadCurve {
            name: "top".to_owned(),
            direction: "z".to_owned(),
            points,
        };
        let lines = |curve: LoadCurve| {
            let svg = force_displacement("test", &[curve]).svg();
            assert!(svg.contains("Displacement along z (mm)"));
            let [full, pale] = [Role::Number(0).ink(0), Role::Number(0).ink(0).pale()]
                .map(|ink| format!("#{:02X}{:02X}{:02X}", ink.color.0, ink.color.1, ink.color.2));
            let curves = svg.lines().filter(|line| line.starts_with("<polyline"));
            let of = |color: &str| curves.clone().filter(|line| line.contains(color)).count();
            (of(&full), of(&pale))
        };
        // The legend has the full colour, too.
        assert_eq!(lines(curve(vec![(0.0, 0.0), (0.01, 2.0)])), (2, 0));
        let and_back = curve(vec![(0.0, 0.0), (0.01, 2.0), (0.0, 1.0)]);
        assert_eq!(lines(and_back), (2, 1));
        let nothing = force_displacement("test", &[curve(vec![(f64::NAN, 1.0)])]).svg();
        assert!(nothing.contains("no data"));
    }
}
