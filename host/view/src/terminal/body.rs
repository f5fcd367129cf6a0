//! The bodies in braille dots: orthographic, with a depth buffer, so that what lies behind is hidden.
//!
//! A surface is shaded by ordered dithering (Bayer, 1973) of Lambert's cosine, and its outline is drawn in full; or it
//! is drawn as the edges of its triangles. Obstacles are drawn as bodies are, fainter. Contacts are short lines along their
//! forces. Clusters of contact have a colour and a border each. Hands are crosses with a number, and their forces are arrows. So are the
//! forces on tools; a dotted line leads from a tool's hand to the tool, and dots are the points that it may touch.

use super::dots::{Dots, line};
use super::format::digits;
use super::model::Model;
use super::palette::Palette;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;

/// The viewpoint. The z axis of the scene points up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Rotation about the z axis (rad).
    pub yaw: f64,
    /// Height above the horizon (rad).
    pub pitch: f64,
    /// Magnification.
    pub zoom: f64,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            yaw: -0.4,
            pitch: 0.7,
            zoom: 1.0,
        }
    }
}

impl Camera {
    /// Turns the picture.
    pub fn turn(&mut self, yaw: f64, pitch: f64) {
        self.yaw = (self.yaw + yaw) % std::f64::consts::TAU;
        self.pitch = (self.pitch + pitch).clamp(-1.571, 1.571);
    }

    /// Magnifies the picture.
    pub fn magnify(&mut self, factor: f64) {
        self.zoom = (self.zoom * factor).clamp(0.1, 50.0);
    }

    /// The directions right, up and away from the person.
    fn axes(&self) -> [[f64; 3]; 3] {
        let ((sy, cy), (sp, cp)) = (self.yaw.sin_cos(), self.pitch.sin_cos());
        [
            [cy, sy, 0.0],
            [-sy * sp, cy * sp, cp],
            [-sy * cp, cy * cp, -sp],
        ]
    }
}

/// The map from the scene to the dots.
struct Projection {
    axes: [[f64; 3]; 3],
    centre: [f64; 2],
    scale: f64,
    middle: [f64; 2],
}

impl Projection {
    /// Fits the box of the model into the dots.
    fn new(model: &Model, camera: &Camera, width: usize, height: usize) -> Self {
        let axes = camera.axes();
        let bounds = model.bounds();
        let (mut least, mut most) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for corner in 0..8 {
            let corner: [f64; 3] = std::array::from_fn(|axis| {
                bounds.map_or(0.0, |bounds| {
                    if corner >> axis & 1 == 0 {
                        bounds.least[axis]
                    } else {
                        bounds.most[axis]
                    }
                })
            });
            for (k, direction) in axes.iter().take(2).enumerate() {
                least[k] = least[k].min(dot(&corner, direction));
                most[k] = most[k].max(dot(&corner, direction));
            }
        }
        let extent = |k: usize| (most[k] - least[k]).max(1e-6);
        // Room for arrows and numbers at the border.
        let scale = (0.84 * width as f64 / extent(0)).min(0.84 * height as f64 / extent(1));
        Self {
            axes,
            centre: [0, 1].map(|k| f64::midpoint(least[k], most[k])),
            scale: scale * camera.zoom,
            middle: [width as f64 / 2.0, height as f64 / 2.0],
        }
    }

    /// Dots right and down, and the depth (m).
    fn project(&self, point: &[f64; 3]) -> [f64; 3] {
        let [x, y, depth] = self.axes.map(|direction| dot(point, &direction));
        [
            self.middle[0] + (x - self.centre[0]) * self.scale,
            self.middle[1] - (y - self.centre[1]) * self.scale,
            depth,
        ]
    }

    /// A direction in dots right and down, without the scale.
    fn direction(&self, vector: &[f64; 3]) -> [f64; 2] {
        [dot(vector, &self.axes[0]), -dot(vector, &self.axes[1])]
    }
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The nearest surface at each dot.
struct Raster {
    width: usize,
    height: usize,
    near: Vec<Near>,
}

/// The surface at a dot.
#[derive(Clone, Copy)]
struct Near {
    depth: f64,
    /// From zero to one.
    shade: f32,
    body: u8,
    /// Zero if clusters are not drawn.
    cluster: u32,
}

/// The mark of a dot without a body.
const NOTHING: u8 = u8::MAX;

impl Near {
    const NOTHING: Self = Self {
        depth: f64::INFINITY,
        shade: 0.0,
        body: NOTHING,
        cluster: 0,
    };
}

impl Raster {
    fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            near: vec![Near::NOTHING; width * height],
        }
    }

    fn put(&mut self, x: usize, y: usize, new: Near) {
        if let Some(near) = self.near.get_mut(y * self.width + x)
            && new.depth < near.depth
        {
            *near = new;
        }
    }

    /// Fills a triangle of projected corners. The depth of `of` is not used.
    fn triangle(&mut self, corners: [[f64; 3]; 3], of: Near) {
        let [a, b, c] = corners;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if !area.is_normal() {
            return;
        }
        let range = |axis: usize, end: usize| {
            let values = corners.map(|corner| corner[axis]);
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let first = (least - 0.5).ceil().max(0.0) as usize;
            // One past the last centre of a dot that the triangle can contain.
            let last = (most - 0.5).floor() + 1.0;
            first..(last.clamp(0.0, end as f64) as usize)
        };
        for y in range(1, self.height) {
            for x in range(0, self.width) {
                let (px, py) = (x as f64 + 0.5, y as f64 + 0.5);
                let part = |p: [f64; 3], q: [f64; 3]| {
                    ((p[0] - px) * (q[1] - py) - (q[0] - px) * (p[1] - py)) / area
                };
                let (u, v, w) = (part(b, c), part(c, a), part(a, b));
                // A dot on a common edge belongs to both triangles.
                if u >= -1e-9 && v >= -1e-9 && w >= -1e-9 {
                    let depth = u * a[2] + v * b[2] + w * c[2];
                    self.put(x, y, Near { depth, ..of });
                }
            }
        }
    }

    /// The surface at a dot, which may lie outside.
    fn at(&self, x: usize, y: usize) -> Near {
        let inside = x < self.width && y < self.height;
        let near = inside.then(|| self.near.get(y * self.width + x)).flatten();
        near.copied().unwrap_or(Near::NOTHING)
    }

    /// Whether a dot lies on the outline of a body or of a fold: something beside it is much farther away. Of two clusters
    /// the one with the smaller number has the border.
    fn is_outline(&self, x: usize, y: usize, jump: f64) -> bool {
        let own = self.at(x, y);
        let beside = [
            (x.wrapping_sub(1), y),
            (x + 1, y),
            (x, y.wrapping_sub(1)),
            (x, y + 1),
        ];
        beside.into_iter().any(|(x, y)| {
            let other = self.at(x, y);
            let is_of_another = other.body != own.body && other.depth > own.depth;
            let is_border = other.body == own.body && other.cluster > own.cluster;
            other.depth > own.depth + jump || is_of_another || is_border
        })
    }
}

/// What is drawn, beside the camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layers {
    /// Edges of triangles instead of surfaces.
    pub wire: bool,
    /// The forces of contacts.
    pub contacts: bool,
    /// The clusters of contact.
    pub clusters: bool,
}

/// A surface of the picture: the body or obstacle, triangles, lines and positions (m).
#[derive(Clone, Copy)]
struct Drawn<'a> {
    number: u8,
    style: Style,
    triangles: &'a [u32],
    lines: &'a [u32],
    positions: &'a [[f32; 3]],
    /// By vertex; empty if clusters are not drawn.
    clusters: &'a [u32],
}

impl Drawn<'_> {
    /// The cluster of a vertex. One that a tear made has none.
    fn cluster(&self, vertex: u32) -> u32 {
        self.clusters.get(vertex as usize).copied().unwrap_or(0)
    }

    /// The style of a cluster.
    fn style(&self, cluster: u32, palette: Palette) -> Style {
        if self.clusters.is_empty() {
            self.style
        } else {
            palette.hand(cluster as usize)
        }
    }
}

/// The surfaces of the bodies and the obstacles.
fn drawn(model: &Model, layers: Layers, palette: Palette) -> Vec<Drawn<'_>> {
    let bodies = (0..model.hello.bodies.len()).filter_map(|body| {
        let (surface, positions) = model.body(body)?;
        let own = &model.hello.bodies[body].clusters;
        Some(Drawn {
            number: body.min(usize::from(NOTHING) - 1) as u8,
            style: palette.body(body),
            triangles: &surface.triangles,
            lines: &surface.lines,
            positions,
            clusters: if layers.clusters { own } else { &[] },
        })
    });
    let first = model.hello.bodies.len();
    let obstacles = (0..model.hello.obstacles.len()).filter_map(|obstacle| {
        let (triangles, positions) = model.obstacle(obstacle)?;
        Some(Drawn {
            number: (first + obstacle).min(usize::from(NOTHING) - 1) as u8,
            style: palette.faint(),
            triangles,
            lines: &[],
            positions,
            clusters: &[],
        })
    });
    let all = bodies.chain(obstacles).take(usize::from(NOTHING));
    all.collect()
}

/// Draws bodies, obstacles and hands.
pub(super) fn draw(
    buffer: &mut Buffer,
    area: Rect,
    model: &Model,
    camera: &Camera,
    layers: Layers,
    palette: Palette,
) {
    if area.width < 4 || area.height < 2 {
        return;
    }
    let mut dots = Dots::new(area);
    let (width, height) = (dots.width(), dots.height());
    let projection = Projection::new(model, camera, width, height);
    let surfaces = drawn(model, layers, palette);
    let raster = fill(&surfaces, &projection, width, height, layers.wire);
    if !layers.wire {
        shade(&raster, &surfaces, &projection, palette, &mut dots);
    }
    edges(
        &surfaces,
        &projection,
        &raster,
        palette,
        &mut dots,
        layers.wire,
    );
    if layers.contacts {
        contacts(model, &projection, &mut dots, palette);
    }
    tools(model, &projection, &mut dots, palette);
    dots.draw(buffer);
    corner(buffer, area, &projection, palette);
    hands(buffer, area, model, &projection, palette);
    if (0..model.hello.bodies.len()).all(|body| model.body(body).is_none()) {
        let text = if model.frame.is_none() {
            "no frame yet"
        } else {
            "no surface of a body: hands alone"
        };
        let text = super::format::fit(text, usize::from(area.width));
        let _ = buffer.set_stringn(area.x, area.y, text, 80, palette.faint());
    }
}

/// The forces of contacts: lines from their places, as long as a sixth of the picture for the largest force.
fn contacts(model: &Model, projection: &Projection, dots: &mut Dots, palette: Palette) {
    let contacts = model.frame.iter().flat_map(|frame| &frame.contacts);
    let size = |force: [f64; 3]| dot(&force, &force).sqrt();
    let forces = contacts
        .clone()
        .map(|contact| size(contact.force.map(f64::from)));
    let most = forces.filter(|force| force.is_finite()).fold(0.0, f64::max);
    let longest = dots.width().min(dots.height()) as f64 / 6.0 / projection.scale;
    for contact in contacts {
        let (at, force) = (contact.at.map(f64::from), contact.force.map(f64::from));
        let end = std::array::from_fn(|k| at[k] + force[k] * longest / most);
        let [from, to] = [at, end].map(|point| projection.project(&point));
        if from.iter().chain(&to).all(|x| x.is_finite()) {
            dots.line([from[0], from[1]], [to[0], to[1]], palette.contact());
        }
    }
}

/// The tools: a dotted line from where its device would lead each one to where the surface keeps it, and a dot for each point of the
/// surface among which the tick looks for contacts.
fn tools(model: &Model, projection: &Projection, dots: &mut Dots, palette: Palette) {
    for tool in model.frame.iter().flat_map(|frame| &frame.tools) {
        let style = palette.hand(tool.device as usize);
        for site in &tool.sites {
            let [x, y, _] = projection.project(&site.map(f64::from));
            // A dot is a line without a length.
            dots.line([x, y], [x, y], style);
        }
        let [x, y, z, ..] = tool.led;
        let Some(at) = model.tool(tool.device) else {
            continue;
        };
        let ends = [[x, y, z], at].map(|point| projection.project(&point));
        let [from, to] = ends.map(|[x, y, _]| [x, y]);
        for (x, y) in line(from, to, dots.width(), dots.height()).step_by(2) {
            dots.set(x, y, style);
        }
    }
}

/// Fills the depth buffer with all triangles.
fn fill(
    surfaces: &[Drawn<'_>],
    projection: &Projection,
    width: usize,
    height: usize,
    wire: bool,
) -> Raster {
    let mut raster = Raster::new(width, height);
    let [right, up, away] = projection.axes;
    let light: [f64; 3] = std::array::from_fn(|k| 0.45 * up[k] - 0.35 * right[k] - 0.8 * away[k]);
    for surface in surfaces {
        let positions = surface.positions.iter();
        let points: Vec<[f64; 3]> = positions.map(|p| p.map(f64::from)).collect();
        let drawn: Vec<[f64; 3]> = points.iter().map(|p| projection.project(p)).collect();
        for triangle in surface.triangles.as_chunks::<3>().0 {
            let corner = |list: &[[f64; 3]], k: usize| list.get(triangle[k] as usize).copied();
            let all =
                |list: &[[f64; 3]]| Some([corner(list, 0)?, corner(list, 1)?, corner(list, 2)?]);
            let (Some(at), Some(on)) = (all(&points), all(&drawn)) else {
                continue;
            };
            if on.iter().flatten().any(|x| !x.is_finite()) {
                continue;
            }
            let shade = if wire { 0.0 } else { lambert(&at, &light) };
            let of = Near {
                shade,
                body: surface.number,
                cluster: surface.cluster(triangle[0]),
                ..Near::NOTHING
            };
            raster.triangle(on, of);
        }
    }
    raster
}

/// Brightness of a triangle that is lit from both sides.
fn lambert(corners: &[[f64; 3]; 3], light: &[f64; 3]) -> f32 {
    let [a, b, c] = corners;
    let (u, v): ([f64; 3], [f64; 3]) = (
        std::array::from_fn(|k| b[k] - a[k]),
        std::array::from_fn(|k| c[k] - a[k]),
    );
    let normal = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    let length = dot(&normal, &normal).sqrt();
    let cosine = dot(&normal, light).abs() / length.max(f64::MIN_POSITIVE);
    // Never all dots, so that the outline stands out, and never none.
    (0.06 + 0.74 * cosine.min(1.0).powi(2)) as f32
}

/// Dithers the shades and draws the outlines.
fn shade(
    raster: &Raster,
    surfaces: &[Drawn<'_>],
    projection: &Projection,
    palette: Palette,
    dots: &mut Dots,
) {
    const BAYER: [[u8; 4]; 4] = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]];
    // Six dots deep is a fold.
    let jump = 6.0 / projection.scale;
    for y in 0..raster.height {
        for x in 0..raster.width {
            let near = raster.near[y * raster.width + x];
            let threshold = (f32::from(BAYER[y % 4][x % 4]) + 0.5) / 16.0;
            if near.body != NOTHING && (near.shade > threshold || raster.is_outline(x, y, jump)) {
                let surface = surfaces.iter().find(|surface| surface.number == near.body);
                let style = surface.map(|surface| surface.style(near.cluster, palette));
                dots.set(x, y, style.unwrap_or_default());
            }
        }
    }
}

/// Draws the bars of threads, and the edges of triangles if `wire`, unless something hides them.
fn edges(
    surfaces: &[Drawn<'_>],
    projection: &Projection,
    raster: &Raster,
    palette: Palette,
    dots: &mut Dots,
    wire: bool,
) {
    for surface in surfaces {
        let positions = surface.positions;
        let mut edge = |a: u32, b: u32| {
            let style = surface.style(surface.cluster(a), palette);
            let point = |v: u32| positions.get(v as usize).map(|p| p.map(f64::from));
            let (Some(a), Some(b)) = (point(a), point(b)) else {
                return;
            };
            let (a, b) = (projection.project(&a), projection.project(&b));
            let (from, to) = ([a[0], a[1]], [b[0], b[1]]);
            let length = (to[0] - from[0]).hypot(to[1] - from[1]).max(1e-9);
            for (x, y) in line(from, to, raster.width, raster.height) {
                let along = (x as f64 + 0.5 - from[0]).hypot(y as f64 + 0.5 - from[1]) / length;
                let depth = a[2] + along.min(1.0) * (b[2] - a[2]);
                // The edge of a triangle lies on the triangle: two dots of tolerance.
                if depth <= raster.at(x, y).depth + 2.0 / projection.scale {
                    dots.set(x, y, style);
                }
            }
        };
        for pair in surface.lines.as_chunks::<2>().0 {
            edge(pair[0], pair[1]);
        }
        if wire {
            for [a, b, c] in surface.triangles.as_chunks::<3>().0 {
                for (a, b) in [(*a, *b), (*b, *c), (*c, *a)] {
                    edge(a, b);
                }
            }
        }
    }
}

/// The axes of the scene and a length, in the corners at the bottom.
fn corner(buffer: &mut Buffer, area: Rect, projection: &Projection, palette: Palette) {
    if area.width < 24 || area.height < 7 {
        return;
    }
    let bottom = area.y + area.height - 1;
    // A length of at most a third of the width.
    let most = f64::from(area.width) / 3.0 * 2.0 / projection.scale;
    let power = 10_f64.powf(most.log10().floor());
    let length = [5.0, 2.0, 1.0].map(|digit| digit * power);
    let length = length.into_iter().find(|l| *l <= most).unwrap_or(power);
    let cells = (length * projection.scale / 2.0).round().max(2.0) as usize;
    let name = super::format::scaled(length, "m")
        .replace(".00", "")
        .replace(".0", "");
    if length.is_finite() && cells + name.len() + 12 < usize::from(area.width) {
        let bar = format!("├{}┤ {name}", "─".repeat(cells.saturating_sub(2)));
        let _ = buffer.set_stringn(area.x, bottom, bar, 80, palette.faint());
    }
    let inset = Rect::new(area.x + area.width - 8, bottom - 2, 7, 3);
    let mut dots = Dots::new(inset);
    let centre = [7.0, 6.0];
    for axis in 0..3 {
        let mut unit = [0.0; 3];
        unit[axis] = 1.0;
        let toward = projection.direction(&unit);
        let end = [0, 1].map(|k| centre[k] + 4.0 * toward[k]);
        dots.line(centre, end, palette.axis(axis));
    }
    dots.draw(buffer);
    for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
        let mut unit = [0.0; 3];
        unit[axis] = 1.0;
        let toward = projection.direction(&unit);
        if toward[0].hypot(toward[1]) > 0.35 {
            let at = [0, 1].map(|k| centre[k] + 6.5 * toward[k]);
            let x = f64::from(inset.x) + (at[0] / 2.0).floor();
            let y = f64::from(inset.y) + (at[1] / 4.0).floor();
            let (x, y) = (x as u16, (y as u16).clamp(area.y, bottom));
            let x = x.clamp(area.x, area.x + area.width - 1);
            let _ = buffer.set_stringn(x, y, letter, 1, palette.axis(axis));
        }
    }
}

/// The hands: a cross, the number of the device, and an arrow along the force.
fn hands(
    buffer: &mut Buffer,
    area: Rect,
    model: &Model,
    projection: &Projection,
    palette: Palette,
) {
    let Some(frame) = &model.frame else {
        return;
    };
    let peaks = frame.hands.iter().map(|hand| hand.peak_force);
    let norms = frame
        .hands
        .iter()
        .map(|hand| dot(&hand.force, &hand.force).sqrt());
    let touches = frame.tools.iter().filter_map(|tool| {
        let at = model.tool(tool.device)?;
        Some((tool.device as usize, at, tool.force))
    });
    let touching = frame
        .tools
        .iter()
        .map(|tool| dot(&tool.force, &tool.force).sqrt());
    let most = peaks
        .chain(norms)
        .chain(touching)
        .filter(|f| f.is_finite())
        .fold(0.5, f64::max);
    let mut dots = Dots::new(area);
    let (width, height) = (dots.width() as f64, dots.height() as f64);
    let longest = 0.3 * width.min(height);
    let scaled = |force: [f64; 2]| force.map(|f| f / most * longest);
    for (index, at, force) in touches {
        let [x, y, _] = projection.project(&at);
        let force = scaled(projection.direction(&force));
        arrow(&mut dots, [x, y], force, palette.hand(index));
    }
    let mut numbers: Vec<(u16, u16, String, Style)> = Vec::new();
    for (index, hand) in frame.hands.iter().enumerate() {
        let style = palette.hand(index);
        let at = projection.project(&hand.position);
        if at.iter().any(|x| !x.is_finite()) {
            continue;
        }
        let at = [at[0], at[1]];
        for arm in [[3.0, 0.0], [0.0, 3.0]] {
            let end = |sign: f64| [at[0] + sign * arm[0], at[1] + sign * arm[1]];
            dots.line(end(-1.0), end(1.0), style);
        }
        arrow(
            &mut dots,
            at,
            scaled(projection.direction(&hand.force)),
            style,
        );
        if at[0] >= 0.0 && at[1] >= 0.0 && at[0] < width && at[1] < height {
            let (x, y) = (area.x + (at[0] / 2.0) as u16, area.y + (at[1] / 4.0) as u16);
            let x = if x + 2 < area.x + area.width {
                x + 2
            } else {
                x.saturating_sub(2)
            };
            numbers.push((x, y, format!("{}", index + 1), style));
        }
    }
    dots.draw(buffer);
    for (x, y, number, style) in numbers {
        let style = style.add_modifier(ratatui::style::Modifier::BOLD);
        let left = usize::from((area.x + area.width).saturating_sub(x));
        let _ = buffer.set_stringn(x, y, number, left, style);
    }
    let legend = format!("arrow to {} N", digits(most));
    if area.width >= 24 && !frame.hands.is_empty() {
        let x = area.x + area.width - legend.chars().count() as u16;
        let _ = buffer.set_stringn(x, area.y, legend, usize::from(area.width), palette.faint());
    }
}

/// An arrow of this length in dots, if it is long enough to be seen.
fn arrow(dots: &mut Dots, at: [f64; 2], force: [f64; 2], style: Style) {
    let length = force[0].hypot(force[1]);
    if !(at.iter().all(|x| x.is_finite()) && length.is_finite() && length > 4.0) {
        return;
    }
    let tip = [at[0] + force[0], at[1] + force[1]];
    dots.line(at, tip, style);
    for turn in [2.6_f64, -2.6] {
        let (sine, cosine) = turn.sin_cos();
        let barb = [
            tip[0] + 4.0 * (force[0] * cosine - force[1] * sine) / length,
            tip[1] + 4.0 * (force[0] * sine + force[1] * cosine) / length,
        ];
        dots.line(tip, barb, style);
    }
}
