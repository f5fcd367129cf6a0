//! The mesh, the material, the supports and the handles of a drawn body, as the text of a scene.

use super::{Draw, DrawnHand, GRAVITY, Kind};
use std::fmt::Write as _;
use std::ops::RangeInclusive;

/// Largest sag under the own weight: of a block as a fraction of its height, of a slender body as a fraction of its length.
const MOST_SAG: [f64; 2] = [0.1, 0.03];
const POISSON: f64 = 0.4;

/// The geometry of a body. All lengths in metres.
pub(super) struct Shape {
    /// The source of the mesh.
    mesh: String,
    /// Supports.
    supports: String,
    /// Group or box of each handle.
    handles: Vec<String>,
    /// Largest displacement of a hand.
    pub(super) most: f64,
    /// Length of the body.
    length: f64,
    /// Height of a block, thickness of a sheet or of a slender block; cross-section of a thread (m^2).
    thickness: f64,
    /// The line of the material that states the thickness or the cross-section.
    thick: String,
}

/// The whole number at the fraction `fraction` between `low` and `high`.
fn whole(fraction: f64, low: u32, high: u32) -> u32 {
    low + (fraction * f64::from(high - low + 1)) as u32
}

/// The vertex along the body at which each of the hands holds it: each in a part of its own of the vertices `range`, with
/// at least one vertex between two hands.
fn along(hands: &[DrawnHand], range: RangeInclusive<u32>) -> Vec<u32> {
    let (first, last) = (*range.start(), *range.end());
    let count = hands.len() as u32;
    let whole = f64::from(last - first);
    let mut next = first;
    let each = hands.iter().zip(1_u32..);
    each.map(|(hand, number)| {
        let part = (f64::from(number - 1) + hand.place[0]) / f64::from(count);
        let vertex = first + (part * whole).round() as u32;
        // The hands that come still need two vertices each.
        let vertex = vertex.clamp(next, (last - 2 * (count - number)).max(next));
        next = vertex + 2;
        vertex
    })
    .collect()
}

/// The position of vertex `vertex` of `cells` cells of a side of length `side` that is centred at the origin.
fn at(vertex: u32, cells: u32, side: f64) -> f64 {
    side * (f64::from(vertex) / f64::from(cells) - 0.5)
}

/// A box around `centre` with the half sides `half`.
fn around(centre: [f64; 3], half: [f64; 3]) -> String {
    let low: [f64; 3] = std::array::from_fn(|axis| centre[axis] - half[axis]);
    let high: [f64; 3] = std::array::from_fn(|axis| centre[axis] + half[axis]);
    format!("box = [{low:?}, {high:?}]")
}

fn support(name: &str, place: &str, border: &str) -> String {
    format!("[[body.support]]\nname = \"{name}\"\n{place}\n{border}\n")
}

/// Whether a hand holds the end `right` of a body instead of its place.
fn takes_end(draw: &Draw, hand: usize) -> Option<&'static str> {
    let (first, last) = (hand == 0, hand + 1 == draw.hands.len());
    match draw.hands[hand].edge {
        true if last => Some("group = \"right\""),
        true if first && !draw.supported => Some("group = \"left\""),
        _ => None,
    }
}

pub(super) fn shape(draw: &Draw) -> Shape {
    match draw.kind {
        Kind::Thread => thread(draw),
        Kind::Sheet
        | Kind::Paper
        | Kind::Woven
        | Kind::WovenStVenantKirchhoff
        | Kind::Plate
        | Kind::Buckling => sheet(draw),
        Kind::Beam | Kind::Rod => slender(draw),
        _ => block(draw),
    }
}

fn thread(draw: &Draw) -> Shape {
    let segments = whole(draw.fineness, 8, 20);
    let length = 0.1 + 0.1 * draw.fineness;
    let cell = length / f64::from(segments);
    let area = 1e-8 + 3e-6 * draw.thickness;
    let first = if draw.supported { 2 } else { 0 };
    let vertices = along(&draw.hands, first..=segments);
    let each = vertices.iter().enumerate();
    let handles = each.map(|(hand, &vertex)| {
        let place = [at(vertex, segments, length), 0.0, 0.0];
        takes_end(draw, hand).map_or_else(|| around(place, [0.3 * cell; 3]), str::to_owned)
    });
    Shape {
        mesh: format!("thread = {{ length = {length:?}, segments = {segments} }}"),
        supports: if draw.supported {
            support("wall", "group = \"left\"", "")
        } else {
            String::new()
        },
        handles: handles.collect(),
        most: 0.1 * length,
        length,
        thickness: area,
        thick: format!("area = {area:?}\n"),
    }
}

fn sheet(draw: &Draw) -> Shape {
    let cells = whole(draw.fineness, 8, 14);
    // A plate is so thick that its stretching stiffness is not a thousand times its bending stiffness, and a buckling strip
    // so thick that it resists before it buckles.
    let (length, width, rows, thickness, most) = match draw.kind {
        Kind::Plate => {
            let thickness = 0.008 + 0.006 * draw.thickness;
            // Beyond a deflection of its thickness, a plate stretches more than it bends.
            (0.12, 0.12, cells, thickness, 0.7 * thickness)
        }
        Kind::Buckling => {
            let thickness = 0.005 + 0.004 * draw.thickness;
            let buckles = thickness * thickness / 0.12;
            (
                0.12,
                0.04,
                4,
                thickness,
                buckles * (3.0 + 7.0 * draw.fineness),
            )
        }
        Kind::Paper => (0.1, 0.06, cells * 2 / 3, 1e-4 + 2e-4 * draw.thickness, 0.02),
        _ => {
            let thickness = 0.0005 + 0.0015 * draw.thickness;
            (0.15, 0.1, cells * 2 / 3, thickness, 0.0075)
        }
    };
    let plate = draw.kind == Kind::Plate;
    let first = if draw.supported { 2 } else { 0 };
    let last = if plate { cells - 2 } else { cells };
    let vertices = along(&draw.hands, first..=last);
    let half = [
        0.55 * length / f64::from(cells),
        1.1 * width / f64::from(rows),
        0.01,
    ];
    let each = vertices.iter().enumerate();
    let handles = each.map(|(hand, &vertex)| {
        if let Some(end) = takes_end(draw, hand).filter(|_| !plate) {
            return end.to_owned();
        }
        let (low, high) = if plate { (2, rows - 2) } else { (0, rows) };
        let row = whole(draw.hands[hand].place[1], low, high).min(high);
        let place = [at(vertex, cells, length), at(row, rows, width), 0.0];
        around(place, half)
    });
    let clamped = matches!(draw.kind, Kind::Paper) && draw.thickness < 0.5;
    let border = if clamped {
        "border = \"clamped\"\n"
    } else {
        ""
    };
    let supports = match draw.kind {
        Kind::Plate => {
            let sides = ["left", "right", "bottom", "top"];
            let all = sides.map(|side| support(side, &format!("group = \"{side}\""), ""));
            all.concat()
        }
        _ if draw.supported => support("wall", "group = \"left\"", border),
        _ => String::new(),
    };
    Shape {
        mesh: format!(
            "sheet = {{ length = {length:?}, width = {width:?}, cells = [{cells}, {rows}], pattern = \"alternating\" }}"
        ),
        supports,
        handles: handles.collect(),
        most,
        length,
        thickness,
        thick: format!("thickness = {thickness:?}\n"),
    }
}

/// `box` with the order of its tetrahedra.
fn solid(size: [f64; 3], cells: [u32; 3], quadratic: bool) -> String {
    let order = if quadratic { 2 } else { 1 };
    format!("box = {{ size = {size:?}, cells = {cells:?} }}\norder = {order}")
}

/// A beam or a rod. The hands clamp its whole section.
fn slender(draw: &Draw) -> Shape {
    let cells = whole(draw.fineness, 8, 12);
    let (length, width, height) = if draw.kind == Kind::Beam {
        let height = 0.004 + 0.006 * draw.thickness;
        (0.08 + 0.06 * draw.fineness, 0.02, height)
    } else {
        let side = 0.006 + 0.009 * draw.thickness;
        (0.12 + 0.1 * draw.fineness, side, side)
    };
    let across = if draw.quadratic { 1 } else { 2 };
    let first = if draw.supported { 2 } else { 0 };
    let vertices = along(&draw.hands, first..=cells);
    let half = [0.3 * length / f64::from(cells), width, height];
    let each = vertices.iter().enumerate();
    let handles = each.map(|(hand, &vertex)| {
        let place = [at(vertex, cells, length), 0.0, 0.0];
        takes_end(draw, hand).map_or_else(|| around(place, half), str::to_owned)
    });
    Shape {
        mesh: solid(
            [length, width, height],
            [cells, across, across],
            draw.quadratic,
        ),
        supports: if draw.supported {
            support("wall", "group = \"left\"", "")
        } else {
            String::new()
        },
        handles: handles.collect(),
        most: 0.15 * length,
        length,
        thickness: height,
        thick: String::new(),
    }
}

/// A block on a table, held at patches of its top or of its front.
fn block(draw: &Draw) -> Shape {
    let (width, height) = (0.1, 0.03 + 0.03 * draw.thickness);
    let cells = match (draw.quadratic, draw.hands.len()) {
        (true, 1) => whole(draw.fineness, 2, 3),
        (true, _) => 4,
        (false, 1) => whole(draw.fineness, 3, 6),
        (false, _) => whole(draw.fineness, 5, 6),
    };
    let layers = if draw.quadratic {
        2
    } else {
        (cells / 2).max(2)
    };
    let cell = width / f64::from(cells);
    let vertices = along(&draw.hands, 0..=cells);
    let each = vertices.iter().zip(&draw.hands);
    let handles = each.map(|(&vertex, hand)| {
        let x = at(vertex, cells, width);
        let (place, half) = if hand.edge {
            // On the front, above the table.
            let layer = whole(hand.place[1], 1, layers).min(layers);
            let rise = height / f64::from(layers);
            let place = [x, -0.5 * width, at(layer, layers, height)];
            (place, [0.55 * cell, 1e-3, 0.55 * rise])
        } else {
            let row = whole(hand.place[1], 0, cells).min(cells);
            let place = [x, at(row, cells, width), 0.5 * height];
            (place, [0.55 * cell, 1.1 * cell, 1e-3])
        };
        around(place, half)
    });
    Shape {
        mesh: solid(
            [width, width, height],
            [cells, cells, layers],
            draw.quadratic,
        ),
        supports: support("table", "group = \"bottom\"", ""),
        handles: handles.collect(),
        most: 0.2 * height,
        length: height,
        thickness: height,
        thick: String::new(),
    }
}

impl Shape {
    /// The body of `draw` with a Young's modulus of `young` (Pa): the rest of its table.
    pub(super) fn body(&self, draw: &Draw, young: f64) -> String {
        let mut density: f64 = 1000.0;
        if draw.weight {
            density = density.min(if draw.kind.is_block() {
                MOST_SAG[0] * young / (GRAVITY * self.thickness)
            } else {
                // A cantilever's q L^4 / (8 E I).
                let slenderness = self.length / self.thickness;
                let sag = MOST_SAG[1] * young / 1.5;
                sag / (GRAVITY * self.length * slenderness * slenderness)
            });
        }
        let law = match draw.kind {
            Kind::Linear => "law = \"linear\"\n",
            Kind::StVenantKirchhoff | Kind::WovenStVenantKirchhoff => {
                "law = \"st_venant_kirchhoff\"\n"
            }
            Kind::StableNeoHookean => "law = \"stable_neo_hookean\"\n",
            Kind::Corotational | Kind::Woven | Kind::Beam | Kind::Rod => "law = \"corotational\"\n",
            _ => "",
        };
        let weave = if matches!(draw.kind, Kind::Woven | Kind::WovenStVenantKirchhoff) {
            let (weft, shear) = (0.5 * young, 0.1 * young);
            format!(
                "\n[body.material.weave]\nwarp = [1.0, 0.3, 0.0]\nyoung_weft = {weft:?}\nshear = {shear:?}\n"
            )
        } else {
            String::new()
        };
        let mut text = format!(
            "\n[body.mesh]\n{}\n\n[body.material]\n{law}young = {young:?}\npoisson = {POISSON}\ndensity = {density:?}\n{}{weave}\n{}",
            self.mesh, self.thick, self.supports
        );
        for (index, place) in self.handles.iter().enumerate() {
            let _ = write!(
                text,
                "[[body.handle]]\nname = \"hand {index}\"\n{place}\ndevice = \"device {index}\"\n\n"
            );
        }
        text
    }
}
