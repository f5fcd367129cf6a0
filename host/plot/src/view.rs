//! Deformed bodies, obstacles and hands, seen from a fixed direction: shaded triangles, coloured by a value at the vertices.
//! Obstacles are grey.
//!
//! The projection is orthographic, so one scale bar serves the whole picture. What lies farther away is drawn first (the
//! painter's algorithm, by the depth of the centres), which is exact enough for surfaces of many small triangles. An
//! obstacle is divided into such triangles, and each counts as farther away by its size, so that it does not cover a sheet
//! that lies on it.

mod tools;

use nalgebra::Vector3;
use plotters::prelude::*;

use super::axis::Axis;
use super::font::text_width;
use super::page::{self, Area, Drawn, UNITS};
use super::reduce::usable;

pub use tools::ToolMark;

/// A body as it is drawn. Indices that do not exist are left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Positions (m).
    pub positions: Vec<[f64; 3]>,
    /// The value at each vertex, which determines the colour.
    pub values: Vec<f64>,
    /// Triangles: three vertices each.
    pub triangles: Vec<[u32; 3]>,
    /// Lines: two vertices each.
    pub lines: Vec<[u32; 2]>,
}

/// An obstacle as it is drawn. Indices that do not exist are left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Obstacle {
    /// Positions (m).
    pub positions: Vec<[f64; 3]>,
    /// Triangles: three vertices each, counterclockwise seen from outside. The sides that face away are not drawn.
    pub triangles: Vec<[u32; 3]>,
    /// Whether it is a part of a plane. A plane is behind everything, and the picture need not show all of it.
    pub plane: bool,
}

/// A hand as it is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HandMark {
    /// The name in the legend.
    pub name: String,
    /// Position (m).
    pub position: [f64; 3],
    /// Force on the hand (N).
    pub force: [f64; 3],
}

/// Directions to the right and upwards in the picture, and to the viewer: 30 degrees above the horizontal plane, 60
/// degrees from the x axis towards the negative y axis.
const RIGHT: [f64; 3] = [0.866_025_403_784, 0.5, 0.0];
const UP: [f64; 3] = [-0.25, 0.433_012_701_892, 0.866_025_403_784];
const TOWARDS: [f64; 3] = [0.433_012_701_892, -0.75, 0.5];
/// Direction of the light: from above and behind the left shoulder of the viewer.
const LIGHT: [f64; 3] = [-0.1, -0.5, 0.86];
/// Length of the arrow of the largest force (pixels).
const ARROW: f64 = 64.0;
/// A smaller largest force does not fill the arrow (N): it would magnify noise.
const SMALL_FORCE: f64 = 0.05;
/// The edges of triangles are drawn up to this number of triangles.
const MOST_EDGES: usize = 4_000;
/// Height of the strip below the view, with the scales (pixels).
const SCALES: i32 = 64;

/// The colour of obstacles in full light, and of planes.
const OBSTACLE: RGBColor = RGBColor(205, 205, 205);
const PLANE: RGBColor = RGBColor(236, 236, 236);
/// The longest side of a triangle of an obstacle, as a part of the longer side of the picture.
const PIECE: f64 = 1.0 / 24.0;

/// Draws bodies, obstacles, tools and hands on the part of the page from (`x`, `y`) on, of this width and height (pixels), with the
/// scale of colours, a scale bar and an arrow that shows the scale of forces.
pub(super) fn draw(
    area: &Area,
    [x, y, width, height]: [i32; 4],
    label: &str,
    (shapes, obstacles): (&[Shape], &[Obstacle]),
    (hands, tools): (&[HandMark], &[ToolMark]),
) -> Drawn {
    let forces = hands.iter().map(|hand| hand.force);
    let forces = forces.chain(tools.iter().map(|tool| tool.force));
    let sizes = forces.map(|force| Vector3::from(force).norm());
    let strongest = sizes.filter(|f| usable(*f)).fold(0.0, f64::max);
    let per_newton = ARROW / strongest.max(SMALL_FORCE);
    let inner = [x + 8, y + 8, width - 16, height - SCALES - 16];
    let camera = Camera::fitting(inner, (shapes, obstacles), (hands, tools), per_newton);
    let values = shapes.iter().flat_map(|shape| shape.values.iter().copied());
    let scale = Axis::linear(values.filter(|value| usable(*value)).chain([0.0]), 0.0, 6.0);
    draw_planes(area, &camera, obstacles, [x, y, width, height - SCALES])?;
    draw_shapes(area, &camera, (shapes, obstacles), &scale)?;
    if shapes.iter().all(|shape| shape.positions.is_empty()) {
        let text = "this moment has no bodies";
        let at = x + (width - text_width(text, 12.0, false) as i32) / 2;
        page::write(area, text, at, y + 24, page::font(12.0), page::TEXT)?;
    }
    for tool in tools {
        tools::draw(area, &camera, tool, per_newton)?;
    }
    for (index, hand) in hands.iter().enumerate() {
        draw_hand(area, &camera, hand, page::series_color(index), per_newton)?;
    }
    axes(area, x + 34, y + height - SCALES - 34)?;
    let below = y + height - SCALES;
    color_scale(area, x + 8, below + 14, &scale, label)?;
    rulers(area, x + width - 150, below, &camera, strongest, per_newton)
}

/// The projection onto the page.
struct Camera {
    /// Units of the page for a metre.
    scale: f64,
    /// The place of the middle of the box around everything (units).
    middle: [f64; 2],
    /// The projection of the middle of the box (m).
    center: [f64; 2],
    /// The longer side of the box in the picture (m).
    across: f64,
}

/// The coordinates of a point in the picture (m): to the right and upwards.
fn flat(point: [f64; 3]) -> Option<[f64; 2]> {
    let point = Vector3::from(point);
    let flat = [RIGHT, UP].map(|axis| point.dot(&Vector3::from(axis)));
    flat.iter().all(|x| usable(*x)).then_some(flat)
}

impl Camera {
    /// The largest picture in which all bodies, obstacles, hands and arrows are inside of a rectangle (pixels).
    fn fitting(
        [x, y, width, height]: [i32; 4],
        (shapes, obstacles): (&[Shape], &[Obstacle]),
        (hands, tools): (&[HandMark], &[ToolMark]),
        per_newton: f64,
    ) -> Self {
        let bodies = shapes.iter().flat_map(|shape| shape.positions.iter());
        let obstacles = obstacles.iter().filter(|obstacle| !obstacle.plane);
        let solids = obstacles.flat_map(|obstacle| obstacle.positions.iter());
        let ghosts = tools.iter().flat_map(|tool| tool.ghost.iter());
        let mut points: Vec<([f64; 2], [f64; 2])> = bodies
            .chain(solids)
            .chain(ghosts)
            .filter_map(|point| Some((flat(*point)?, [0.0; 2])))
            .collect();
        let arrows = hands.iter().map(|hand| (hand.position, hand.force));
        for (at, force) in arrows.chain(tools.iter().map(|tool| (tool.at, tool.force))) {
            let Some((at, force)) = flat(at).zip(flat(force)) else {
                continue;
            };
            // The mark and the head of the arrow need room, too.
            let tip = force.map(|f| f * per_newton + 10.0 * f.signum());
            points.extend([(at, tip), (at, [-9.0; 2]), (at, [9.0; 2])]);
        }
        let bounds = |scale: f64| {
            let mut bounds = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
            for (at, pixels) in &points {
                for k in 0..2 {
                    let place = scale * at[k] + pixels[k];
                    bounds[0][k] = bounds[0][k].min(place);
                    bounds[1][k] = bounds[1][k].max(place);
                }
            }
            bounds
        };
        let fits = |scale: f64| {
            let [least, most] = bounds(scale);
            most[0] - least[0] <= f64::from(width) && most[1] - least[1] <= f64::from(height)
        };
        // The size grows with the scale. The bounds: a picture of a kilometre, and of a micrometre.
        let (mut low, mut high) = (f64::from(width) * 1e-3, f64::from(width) * 1e6);
        for _ in 0..60 {
            let between = (low * high).sqrt();
            if fits(between) {
                low = between;
            } else {
                high = between;
            }
        }
        let scale = if points.is_empty() { 1e3 } else { low };
        let [least, most] = bounds(scale);
        let center = [0, 1].map(|k| {
            let sum = 0.5 * (least[k] + most[k]);
            if sum.is_finite() { sum / scale } else { 0.0 }
        });
        Self {
            scale: scale * f64::from(UNITS),
            middle: [(x, width), (y, height)]
                .map(|(from, size)| f64::from((2 * from + size) * UNITS) / 2.0),
            center,
            across: [0, 1]
                .map(|k| (most[k] - least[k]) / scale)
                .into_iter()
                .fold(1e-9, f64::max),
        }
    }

    /// The place of a point on the page (units).
    fn place(&self, point: [f64; 3]) -> Option<[f64; 2]> {
        let [across, up] = flat(point)?;
        let [x, y] = self.middle;
        let place = [
            x + self.scale * (across - self.center[0]),
            y - self.scale * (up - self.center[1]),
        ];
        // Far outside of the page, whole numbers overflow.
        place.iter().all(|x| x.abs() < 1e8).then_some(place)
    }
}

fn whole([x, y]: [f64; 2]) -> (i32, i32) {
    (x.round() as i32, y.round() as i32)
}

/// A triangle or a line on the page.
struct Facet {
    depth: f64,
    corners: Vec<[f64; 2]>,
    color: RGBColor,
    /// Whether its edges may be drawn.
    edged: bool,
}

/// Draws the planes that face the viewer, cut at the border of a rectangle (pixels).
fn draw_planes(area: &Area, camera: &Camera, obstacles: &[Obstacle], inner: [i32; 4]) -> Drawn {
    let planes = obstacles.iter().filter(|obstacle| obstacle.plane);
    for corners in planes.flat_map(facing) {
        let places: Option<Vec<_>> = corners.iter().map(|p| camera.place((*p).into())).collect();
        let within = cut(places.unwrap_or_default(), inner);
        if within.len() > 2 {
            let corners: Vec<_> = within.into_iter().map(whole).collect();
            area.draw(&Polygon::new(corners, PLANE.filled()))?;
        }
    }
    Ok(())
}

/// The triangles of an obstacle that face the viewer.
fn facing(obstacle: &Obstacle) -> impl Iterator<Item = [Vector3<f64>; 3]> + '_ {
    let corners = obstacle.triangles.iter().filter_map(|triangle| {
        let at = triangle.map(|vertex| obstacle.positions.get(vertex as usize));
        let [Some(a), Some(b), Some(c)] = at else {
            return None;
        };
        Some([a, b, c].map(|point| Vector3::from(*point)))
    });
    corners.filter(|[a, b, c]| (b - a).cross(&(c - a)).dot(&Vector3::from(TOWARDS)) > 0.0)
}

/// The part of a convex polygon (units) within a rectangle (pixels): the algorithm of Sutherland and Hodgman (1974).
fn cut(mut polygon: Vec<[f64; 2]>, [x, y, width, height]: [i32; 4]) -> Vec<[f64; 2]> {
    let bounds = [(x, width), (y, height)];
    let bounds = bounds.map(|(from, size)| [from, from + size].map(|at| f64::from(at * UNITS)));
    for (axis, [least, most]) in bounds.into_iter().enumerate() {
        for (bound, sign) in [(least, 1.0), (most, -1.0)] {
            let inside = |p: &[f64; 2]| sign * (p[axis] - bound) >= 0.0;
            let ends = polygon.iter().zip(polygon.iter().cycle().skip(1));
            let mut kept = Vec::new();
            for (from, to) in ends {
                if inside(from) {
                    kept.push(*from);
                }
                if inside(from) != inside(to) {
                    let t = (bound - from[axis]) / (to[axis] - from[axis]);
                    kept.push([0, 1].map(|k| from[k] + t * (to[k] - from[k])));
                }
            }
            polygon = kept;
        }
    }
    polygon
}

/// Divides a triangle until no side is longer than `longest` (m), and gives the parts to `take`.
fn divide(corners: [Vector3<f64>; 3], longest: f64, take: &mut impl FnMut([Vector3<f64>; 3])) {
    let [a, b, c] = corners;
    let turns = [[a, b, c], [b, c, a], [c, a, b]];
    let side = |turn: &[Vector3<f64>; 3]| (turn[1] - turn[0]).norm();
    let longer = |one, other| {
        if side(&other) > side(&one) {
            other
        } else {
            one
        }
    };
    let [a, b, c] = turns.into_iter().reduce(longer).unwrap_or(corners);
    let length = side(&[a, b, c]);
    if length <= longest || !length.is_finite() {
        return take([a, b, c]);
    }
    let middle = (a + b) / 2.0;
    divide([a, middle, c], longest, take);
    divide([middle, b, c], longest, take);
}

/// The pieces of the obstacles that are no planes.
fn pieces(camera: &Camera, obstacles: &[Obstacle]) -> Vec<Facet> {
    let longest = PIECE * camera.across;
    let mut facets = Vec::new();
    let solids = obstacles.iter().filter(|obstacle| !obstacle.plane);
    for corners in solids.flat_map(facing) {
        let color = mixed(OBSTACLE, BLACK, shadow(&corners));
        divide(corners, longest, &mut |corners| {
            let places = corners.map(|point| camera.place(point.into()));
            if let [Some(a), Some(b), Some(c)] = places {
                let middle: Vector3<f64> = corners.iter().sum::<Vector3<f64>>() / 3.0;
                facets.push(Facet {
                    depth: middle.dot(&Vector3::from(TOWARDS)) - longest,
                    corners: vec![a, b, c],
                    color,
                    edged: false,
                });
            }
        });
    }
    facets
}

/// The part of black in the colour of a triangle: none in full light.
fn shadow([a, b, c]: &[Vector3<f64>; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a));
    // The side of a sheet that the viewer sees is lit.
    let seen = normal.dot(&Vector3::from(TOWARDS)).signum();
    let angle = seen * normal.dot(&Vector3::from(LIGHT).normalize());
    0.38 * (1.0 - (angle / normal.norm().max(f64::MIN_POSITIVE)).max(0.0))
}

fn draw_shapes(
    area: &Area,
    camera: &Camera,
    (shapes, obstacles): (&[Shape], &[Obstacle]),
    scale: &Axis,
) -> Drawn {
    let mut facets: Vec<Facet> = Vec::new();
    for shape in shapes {
        let triangles = shape.triangles.iter().map(|t| &t[..]);
        let lines = shape.lines.iter().map(|l| &l[..]);
        facets.extend(
            triangles
                .chain(lines)
                .filter_map(|corners| facet(camera, shape, corners, scale)),
        );
    }
    let edges = facets.len() <= MOST_EDGES;
    facets.extend(pieces(camera, obstacles));
    facets.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    for facet in &facets {
        let dark = mixed(facet.color, BLACK, 0.35);
        if let [from, to] = facet.corners[..] {
            let path = [whole(from), whole(to)];
            area.draw(&PathElement::new(path, page::stroke(dark, 5.0)))?;
            area.draw(&PathElement::new(path, page::stroke(facet.color, 3.5)))?;
            continue;
        }
        // Each triangle is slightly larger than it is, so that no seams show.
        let corners: Vec<_> = grown(&facet.corners).into_iter().map(whole).collect();
        area.draw(&Polygon::new(corners, facet.color.filled()))?;
        let outline = if facet.edged {
            edges.then(|| page::stroke(dark, 0.25))
        } else {
            // The thin pieces at the centre of a cap would leave seams nevertheless.
            Some(page::stroke(facet.color, 0.5))
        };
        if let Some(outline) = outline {
            let corners = facet.corners.iter().chain(facet.corners.first());
            let path: Vec<_> = corners.map(|corner| whole(*corner)).collect();
            area.draw(&PathElement::new(path, outline))?;
        }
    }
    Ok(())
}

fn facet(camera: &Camera, shape: &Shape, corners: &[u32], scale: &Axis) -> Option<Facet> {
    let count = corners.len() as f64;
    let points: Vec<[f64; 3]> = corners
        .iter()
        .map(|v| shape.positions.get(*v as usize).copied())
        .collect::<Option<_>>()?;
    let places: Vec<_> = points
        .iter()
        .map(|point| camera.place(*point))
        .collect::<Option<_>>()?;
    let values = corners.iter().map(|v| shape.values.get(*v as usize));
    let value = values.flatten().sum::<f64>() / count;
    let vectors: Vec<_> = points.iter().map(|p| Vector3::from(*p)).collect();
    let middle = vectors.iter().sum::<Vector3<f64>>() / count;
    let fraction = (value - scale.from) / (scale.to - scale.from);
    let color = if usable(fraction) {
        viridis(fraction)
    } else {
        RGBColor(128, 128, 128)
    };
    let dark = match vectors[..] {
        [a, b, c] => shadow(&[a, b, c]),
        _ => 0.0,
    };
    Some(Facet {
        depth: middle.dot(&Vector3::from(TOWARDS)),
        corners: places,
        color: mixed(color, BLACK, dark),
        edged: true,
    })
}

/// The triangle with its corners moved half a pixel away from its centre.
fn grown(corners: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let count = corners.len().max(1) as f64;
    let center = [0, 1].map(|k| corners.iter().map(|c| c[k]).sum::<f64>() / count);
    let away = |corner: &[f64; 2]| {
        let [dx, dy] = [corner[0] - center[0], corner[1] - center[1]];
        let length = libm::hypot(dx, dy).max(1.0);
        let by = 0.5 * f64::from(UNITS) / length;
        [corner[0] + by * dx, corner[1] + by * dy]
    };
    corners.iter().map(away).collect()
}

/// The colour with a part of another colour.
fn mixed(a: RGBColor, b: RGBColor, part: f64) -> RGBColor {
    let mix = |a: u8, b: u8| (f64::from(a) + part * (f64::from(b) - f64::from(a))).round() as u8;
    RGBColor(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}

/// Dark blue over green to yellow: matplotlib's viridis, which has an even scale of lightness and which colour-blind
/// readers can read.
fn viridis(fraction: f64) -> RGBColor {
    const STOPS: [RGBColor; 7] = [
        RGBColor(68, 1, 84),
        RGBColor(68, 58, 131),
        RGBColor(49, 104, 142),
        RGBColor(33, 145, 140),
        RGBColor(53, 183, 121),
        RGBColor(144, 215, 67),
        RGBColor(253, 231, 37),
    ];
    let at = fraction.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let k = (at as usize).min(STOPS.len() - 2);
    mixed(STOPS[k], STOPS[k + 1], at - k as f64)
}

fn draw_hand(
    area: &Area,
    camera: &Camera,
    hand: &HandMark,
    color: RGBColor,
    per_newton: f64,
) -> Drawn {
    let Some((at, [across, up])) = camera.place(hand.position).zip(flat(hand.force)) else {
        return Ok(());
    };
    let by = per_newton * f64::from(UNITS);
    arrow(area, at, [at[0] + by * across, at[1] - by * up], color)?;
    let center = whole(at);
    area.draw(&Circle::new(center, 7 * UNITS, WHITE.filled()))?;
    area.draw(&Circle::new(center, 5 * UNITS + UNITS / 2, color.filled()))
}

/// An arrow with a white edge, which shows on every colour.
fn arrow(area: &Area, from: [f64; 2], to: [f64; 2], color: RGBColor) -> Drawn {
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let length = libm::hypot(dx, dy);
    let units = f64::from(UNITS);
    if length < 2.0 * units {
        return Ok(());
    }
    let [ux, uy] = [dx / length, dy / length];
    for (color, width, extra) in [(WHITE, 6.0, 2.2), (color, 3.0, 0.0)] {
        let head = (11.0 * units).min(length);
        let (half, extra) = (0.45 * head + extra * units, extra * units);
        let base = [to[0] - head * ux, to[1] - head * uy];
        let back = [base[0] - extra * ux, base[1] - extra * uy];
        let tip = [to[0] + extra * ux, to[1] + extra * uy];
        let shaft = [whole(from), whole(base)];
        area.draw(&PathElement::new(shaft, page::stroke(color, width)))?;
        let corners = vec![
            whole(tip),
            whole([back[0] - half * uy, back[1] + half * ux]),
            whole([back[0] + half * uy, back[1] - half * ux]),
        ];
        area.draw(&Polygon::new(corners, color.filled()))?;
    }
    Ok(())
}

/// The directions of the axes of the scene, about (`x`, `y`) pixels.
fn axes(area: &Area, x: i32, y: i32) -> Drawn {
    const GREY: RGBColor = RGBColor(96, 96, 96);
    for (name, axis) in [
        ("x", [1.0, 0.0, 0.0]),
        ("y", [0.0, 1.0, 0.0]),
        ("z", [0.0, 0.0, 1.0]),
    ] {
        let Some([across, up]) = flat(axis) else {
            continue;
        };
        let at = |pixels: f64| (f64::from(x) + pixels * across, f64::from(y) - pixels * up);
        let tip = at(22.0);
        let ends = [(x * UNITS, y * UNITS), in_units(tip)];
        area.draw(&PathElement::new(ends, page::stroke(GREY, 1.5)))?;
        let (across, down) = at(31.0);
        let left = across - 0.5 * text_width(name, 12.0, false);
        let (left, down) = (left.round() as i32, down.round() as i32);
        page::write(area, name, left, down, page::font(12.0), GREY)?;
    }
    Ok(())
}

fn in_units((x, y): (f64, f64)) -> (i32, i32) {
    whole([x * f64::from(UNITS), y * f64::from(UNITS)])
}

/// The scale of colours from (`x`, `y`) pixels on, with its label above it.
fn color_scale(area: &Area, x: i32, y: i32, scale: &Axis, label: &str) -> Drawn {
    const WIDTH: i32 = 200;
    const HEIGHT: i32 = 10;
    const STEPS: i32 = 100;
    page::write(area, label, x, y - 8, page::font(11.0), page::TEXT)?;
    for k in 0..STEPS {
        let (from, to) = (x + WIDTH * k / STEPS, x + WIDTH * (k + 1) / STEPS);
        let corners = [
            (from * UNITS, y * UNITS),
            (to * UNITS, (y + HEIGHT) * UNITS),
        ];
        let color = viridis(f64::from(k) / f64::from(STEPS - 1));
        area.draw(&Rectangle::new(corners, color.filled()))?;
    }
    for (tick, text) in scale.labelled() {
        let fraction = (tick - scale.from) / (scale.to - scale.from);
        let at = f64::from(x) + fraction * f64::from(WIDTH);
        let mark = [(at, f64::from(y + HEIGHT)), (at, f64::from(y + HEIGHT + 4))].map(in_units);
        area.draw(&PathElement::new(mark, page::stroke(page::TEXT, 1.0)))?;
        // The first label begins where the scale begins.
        let left = (at - 0.5 * text_width(&text, 11.0, false)).max(f64::from(x));
        page::write(
            area,
            &text,
            left.round() as i32,
            y + HEIGHT + 12,
            page::font(11.0),
            page::TEXT,
        )?;
    }
    Ok(())
}

/// A bar that shows the scale of lengths, and an arrow that shows the scale of forces, from (`x`, `y`) pixels on.
fn rulers(area: &Area, x: i32, y: i32, camera: &Camera, strongest: f64, per_newton: f64) -> Drawn {
    const LONGEST: f64 = 64.0;
    let per_metre = camera.scale / f64::from(UNITS);
    let length = round_below(LONGEST / per_metre);
    let force = round_below(strongest.max(SMALL_FORCE));
    let text = |text: String, end: f64, row: i32| {
        let left = end.round() as i32 + 10;
        page::write(area, &text, left, row, page::font(11.0), page::TEXT)
    };
    let start = f64::from(x);
    let (bar, row) = (start + length * per_metre, y + 14);
    let tick = |at: f64| [(at, f64::from(row - 4)), (at, f64::from(row + 4))].map(in_units);
    let line = [(start, f64::from(row)), (bar, f64::from(row))].map(in_units);
    for path in [line, tick(start), tick(bar)] {
        area.draw(&PathElement::new(path, page::stroke(page::TEXT, 1.5)))?;
    }
    text(format!("{} mm", plain(1e3 * length)), bar, row)?;
    let row = y + 38;
    let units = f64::from(UNITS);
    let end = start + force * per_newton;
    let ends = [start, end].map(|x| [x * units, f64::from(row) * units]);
    arrow(area, ends[0], ends[1], page::TEXT)?;
    text(format!("{} N", plain(force)), end, row)
}

/// The largest of 1, 2 and 5 times a power of ten that is not greater than `value`.
fn round_below(value: f64) -> f64 {
    if !(usable(value) && value > 0.0) {
        return 1.0;
    }
    let decade = libm::pow(10.0, libm::log10(value).floor());
    let factors = [5.0, 2.0, 1.0].into_iter();
    let found = factors.map(|factor| factor * decade);
    found
        .into_iter()
        .find(|round| *round <= value * (1.0 + 1e-9))
        .unwrap_or(decade)
}

/// A round number without useless digits.
fn plain(value: f64) -> String {
    if value >= 1e-3 {
        let text = format!("{value:.3}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.0e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_directions_of_the_picture_are_orthonormal() {
        let [right, up, towards] = [RIGHT, UP, TOWARDS].map(Vector3::from);
        assert!((right.cross(&up) - towards).norm() < 1e-9);
        assert!((right.norm() - 1.0).abs() < 1e-9 && right.dot(&up).abs() < 1e-9);
    }

    #[test]
    fn everything_fits_and_fills_the_view() {
        let shape = Shape {
            positions: vec![[0.0; 3], [0.3, 0.0, 0.0], [0.0, 0.0, 0.02], [f64::NAN; 3]],
            ..Shape::default()
        };
        let hand = HandMark {
            position: [0.3, 0.0, 0.0],
            force: [4.0, 0.0, 0.0],
            ..HandMark::default()
        };
        let inside = [100, 50, 400, 300];
        let camera = Camera::fitting(
            inside,
            (std::slice::from_ref(&shape), &[]),
            (std::slice::from_ref(&hand), &[]),
            16.0,
        );
        let [ax, ay] = camera.place(shape.positions[0]).expect("a place");
        let [bx, by] = camera.place(hand.position).expect("a place");
        let units = f64::from(UNITS);
        assert!(
            ax >= 100.0 * units && bx <= 500.0 * units && ay <= 350.0 * units && by >= 50.0 * units
        );
        // The picture and the arrow with its head take the whole width.
        let [fx, _] = flat(hand.force).expect("a force");
        let right = bx + (16.0 * fx + 10.0) * units;
        assert!((right - ax - 400.0 * units).abs() < 2.0, "{}", right - ax);
        assert_eq!(camera.place([f64::NAN; 3]), None);
    }

    #[test]
    fn an_obstacle_covers_what_is_behind_it_and_not_what_lies_on_it() {
        // A box whose top faces the viewer, in the order of its triangles: top, and bottom, which faces away.
        let corners = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]];
        let corners = corners.map(|[x, y]| [x, y, 0.0]);
        let obstacle = Obstacle {
            positions: corners.to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 9]],
            plane: false,
        };
        let inner = [0, 0, 400, 300];
        let camera = Camera::fitting(
            inner,
            (&[], std::slice::from_ref(&obstacle)),
            (&[], &[]),
            1.0,
        );
        let found = pieces(&camera, std::slice::from_ref(&obstacle));
        let area = |corners: &[[f64; 2]]| {
            let (a, b, c) = (corners[0], corners[1], corners[2]);
            0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
        };
        // The two triangles of the top, and no more: a square of 0.2 m, seen at 30 degrees.
        let total: f64 = found.iter().map(|facet| area(&facet.corners)).sum();
        let expected = 0.04 * 0.5 * camera.scale * camera.scale;
        assert!((total / expected - 1.0).abs() < 1e-6, "{total} {expected}");
        // A point on the top is in front of every piece that contains it, and a point below it by more than two sides of a
        // piece is behind.
        let side = PIECE * camera.across;
        for facet in &found {
            let [x, y] = [0, 1].map(|k| facet.corners.iter().map(|c| c[k]).sum::<f64>() / 3.0);
            let on = |z: f64| {
                // The depth of the point of the height z in the same place of the picture.
                let [dx, dy] = [(x - camera.middle[0]), (camera.middle[1] - y)];
                let flat = [
                    dx / camera.scale + camera.center[0],
                    dy / camera.scale + camera.center[1],
                ];
                let start = flat[0] * Vector3::from(RIGHT) + flat[1] * Vector3::from(UP);
                (z - start.z) / TOWARDS[2]
            };
            assert!(on(0.0) > facet.depth && on(-3.0 * side) < facet.depth);
        }
    }

    #[test]
    fn a_polygon_is_cut_at_the_border() {
        let unit = f64::from(UNITS);
        let big = [[-10.0, -10.0], [30.0, -10.0], [30.0, 30.0], [-10.0, 30.0]];
        let within = cut(big.map(|p| p.map(|x| x * unit)).to_vec(), [0, 5, 20, 10]);
        let mut found: Vec<_> = within
            .iter()
            .map(|p| p.map(|x| (x / unit).round() as i32))
            .collect();
        found.sort_unstable();
        assert_eq!(found, [[0, 5], [0, 15], [20, 5], [20, 15]]);
        assert!(cut(big.map(|p| p.map(|x| x * unit)).to_vec(), [40, 0, 5, 5]).is_empty());
    }

    #[test]
    fn scales_are_round() {
        for (value, expected) in [
            (0.9, 0.5),
            (1.0, 1.0),
            (4.99, 2.0),
            (73.0, 50.0),
            (f64::NAN, 1.0),
        ] {
            assert!(
                (round_below(value) / expected - 1.0).abs() < 1e-12,
                "{value}"
            );
        }
        assert_eq!(
            [plain(20.0), plain(0.5), plain(0.02)],
            ["20", "0.5", "0.02"]
        );
    }
}
