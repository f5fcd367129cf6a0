//! Deformed bodies and hands, seen from a fixed direction: shaded triangles, coloured by a value at the vertices.
//!
//! The projection is orthographic, so one scale bar serves the whole picture. What lies farther away is drawn first (the
//! painter's algorithm, by the depth of the centres), which is exact enough for surfaces of many small triangles.

use nalgebra::Vector3;
use plotters::prelude::*;

use super::axis::Axis;
use super::font::text_width;
use super::page::{self, Area, Drawn, UNITS};
use super::reduce::usable;

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

/// Draws bodies and hands on the part of the page from (`x`, `y`) on, of this width and height (pixels), with the scale
/// of colours, a scale bar and an arrow that shows the scale of forces.
pub(super) fn draw(
    area: &Area,
    [x, y, width, height]: [i32; 4],
    label: &str,
    shapes: &[Shape],
    hands: &[HandMark],
) -> Drawn {
    let forces = hands.iter().map(|hand| Vector3::from(hand.force).norm());
    let strongest = forces.filter(|f| usable(*f)).fold(0.0, f64::max);
    let per_newton = ARROW / strongest.max(SMALL_FORCE);
    let inner = [x + 8, y + 8, width - 16, height - SCALES - 16];
    let camera = Camera::fitting(inner, shapes, hands, per_newton);
    let values = shapes.iter().flat_map(|shape| shape.values.iter().copied());
    let scale = Axis::linear(values.filter(|value| usable(*value)).chain([0.0]), 0.0, 6.0);
    draw_shapes(area, &camera, shapes, &scale)?;
    if shapes.iter().all(|shape| shape.positions.is_empty()) {
        let text = "this moment has no bodies";
        let at = x + (width - text_width(text, 12.0, false) as i32) / 2;
        page::write(area, text, at, y + 24, page::font(12.0), page::TEXT)?;
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
}

/// The coordinates of a point in the picture (m): to the right and upwards.
fn flat(point: [f64; 3]) -> Option<[f64; 2]> {
    let point = Vector3::from(point);
    let flat = [RIGHT, UP].map(|axis| point.dot(&Vector3::from(axis)));
    flat.iter().all(|x| usable(*x)).then_some(flat)
}

impl Camera {
    /// The largest picture in which all bodies, hands and arrows are inside of a rectangle (pixels).
    fn fitting(
        [x, y, width, height]: [i32; 4],
        shapes: &[Shape],
        hands: &[HandMark],
        per_newton: f64,
    ) -> Self {
        let bodies = shapes.iter().flat_map(|shape| shape.positions.iter());
        let mut points: Vec<([f64; 2], [f64; 2])> = bodies
            .filter_map(|point| Some((flat(*point)?, [0.0; 2])))
            .collect();
        for hand in hands {
            let Some((at, force)) = flat(hand.position).zip(flat(hand.force)) else {
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
}

fn draw_shapes(area: &Area, camera: &Camera, shapes: &[Shape], scale: &Axis) -> Drawn {
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
    facets.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let edges = facets.len() <= MOST_EDGES;
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
        if edges {
            let corners = facet.corners.iter().chain(facet.corners.first());
            let path: Vec<_> = corners.map(|corner| whole(*corner)).collect();
            area.draw(&PathElement::new(path, page::stroke(dark, 0.25)))?;
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
    let light = match vectors[..] {
        [a, b, c] => {
            let normal = (b - a).cross(&(c - a));
            // The side of a sheet that the viewer sees is lit.
            let seen = normal.dot(&Vector3::from(TOWARDS)).signum();
            let angle = seen * normal.dot(&Vector3::from(LIGHT).normalize());
            (angle / normal.norm().max(f64::MIN_POSITIVE)).max(0.0)
        }
        _ => 1.0,
    };
    Some(Facet {
        depth: middle.dot(&Vector3::from(TOWARDS)),
        corners: places,
        color: mixed(color, BLACK, 0.38 * (1.0 - light)),
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
            std::slice::from_ref(&shape),
            std::slice::from_ref(&hand),
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
