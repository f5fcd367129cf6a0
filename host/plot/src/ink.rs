//! The looks of lines: colour and dashes, by what the line shows. All curves of all pictures have one width.
//!
//! The colours are those of Okabe and Ito (2008), which colour-blind readers can tell apart. Lines that coincide are told
//! apart by their dashes: the line below shows in the gaps of the line above. The reference of other lines is a grey
//! band below them.

use plotters::style::RGBColor;

pub(super) const BLACK: RGBColor = RGBColor(34, 34, 34);
pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
pub(super) const VERMILLION: RGBColor = RGBColor(213, 94, 0);
pub(super) const GREEN: RGBColor = RGBColor(0, 158, 115);
pub(super) const PURPLE: RGBColor = RGBColor(204, 121, 167);
pub(super) const SKY: RGBColor = RGBColor(86, 180, 233);
pub(super) const YELLOW: RGBColor = RGBColor(240, 228, 66);

/// Width of every curve (pixels).
pub(super) const WIDTH: f64 = 1.6;
/// Width of the grey band below the curves that are compared to it (pixels).
const BAND: f64 = 5.0;

/// The quantity that a line shows. It determines the look of the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Role {
    /// One of several: its place in the list determines the look.
    #[default]
    Place,
    /// The look of this place, whatever the place in the list. Lines of one number look alike in every panel of a page.
    Number(usize),
    /// A scheme, by its name in scenes. It has the same look in every picture.
    Scheme(&'static str),
    /// The reference of the other lines: a grey band, drawn first, so that each line shows on it.
    Reference,
    /// A bound, such as the period of the ticks: grey and dashed.
    Limit,
}

/// The look of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ink {
    pub(super) color: RGBColor,
    /// Lengths of dashes and gaps in turn (pixels); empty for a solid line.
    pub(super) dash: &'static [f64],
    /// Width of the line (pixels).
    pub(super) width: f64,
}

impl Ink {
    /// The same look, half as strong.
    pub(super) fn pale(self) -> Self {
        let half = |part: u8| u8::MAX - (u8::MAX - part) / 2;
        let RGBColor(red, green, blue) = self.color;
        let color = RGBColor(half(red), half(green), half(blue));
        Self { color, ..self }
    }
}

const fn ink(color: RGBColor, dash: &'static [f64]) -> Ink {
    Ink {
        color,
        dash,
        width: WIDTH,
    }
}

/// The looks by place. The first is whole, as it is drawn first.
const PLACES: [Ink; 6] = [
    ink(BLUE, &[]),
    ink(VERMILLION, &[9.0, 4.0]),
    ink(GREEN, &[3.0, 3.0]),
    ink(BLACK, &[10.0, 3.0, 2.0, 3.0]),
    ink(PURPLE, &[6.0, 6.0]),
    ink(SKY, &[2.0, 4.0]),
];

impl Role {
    /// The look of a line with this role at a place in the list.
    pub(super) fn ink(self, place: usize) -> Ink {
        let at = match self {
            Self::Place => place,
            Self::Number(number) => number,
            Self::Reference => {
                return Ink {
                    width: BAND,
                    ..ink(RGBColor(185, 185, 185), &[])
                };
            }
            Self::Limit => return ink(RGBColor(120, 120, 120), &[4.0, 3.0]),
            Self::Scheme(name) => return scheme(name),
        };
        PLACES[at % PLACES.len()]
    }
}

/// The look of a scheme. `linear`, `classic` and `capped` often coincide; each one leaves gaps for those before it.
fn scheme(name: &str) -> Ink {
    match name {
        "hold" => ink(BLUE, &[]),
        "thesis" => ink(VERMILLION, &[9.0, 3.0]),
        "linear" => ink(GREEN, &[]),
        "classic" => ink(PURPLE, &[7.0, 7.0]),
        "proxy" => ink(SKY, &[8.0, 3.0, 2.0, 3.0]),
        _ => ink(BLACK, &[2.0, 5.0]),
    }
}

/// The pieces of a path that the dashes of a pattern cover. The pattern continues around the corners of the path.
pub(super) fn dashes(path: &[(i32, i32)], pattern: &[f64]) -> Vec<Vec<(i32, i32)>> {
    let total: f64 = pattern.iter().sum();
    if pattern.is_empty() || total <= 0.0 {
        return vec![path.to_vec()];
    }
    let mut pieces = Vec::new();
    let mut part = 0;
    let mut left = pattern[0];
    let mut current: Vec<(i32, i32)> = path.first().copied().into_iter().collect();
    for pair in path.windows(2) {
        let [from, to] = [pair[0], pair[1]].map(|(x, y)| (f64::from(x), f64::from(y)));
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let length = libm::hypot(dx, dy);
        let mut at = 0.0;
        while length - at > left {
            at += left;
            let fraction = at / length;
            let corner = (
                (from.0 + fraction * dx).round() as i32,
                (from.1 + fraction * dy).round() as i32,
            );
            if part % 2 == 0 {
                current.push(corner);
                pieces.push(std::mem::take(&mut current));
            } else {
                current = vec![corner];
            }
            part = (part + 1) % pattern.len();
            left = pattern[part];
        }
        left -= length - at;
        if part % 2 == 0 {
            current.push(pair[1]);
        }
    }
    if current.len() > 1 {
        pieces.push(current);
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dashes_continue_around_a_corner() {
        let path = [(0, 0), (10, 0), (10, 10)];
        let pieces = dashes(&path, &[6.0, 2.0]);
        assert_eq!(
            pieces,
            [
                vec![(0, 0), (6, 0)],
                vec![(8, 0), (10, 0), (10, 4)],
                vec![(10, 6), (10, 10)],
            ]
        );
        assert_eq!(dashes(&path, &[]), [path.to_vec()]);
        assert!(dashes(&[], &[1.0, 1.0]).is_empty());
    }

    #[test]
    fn the_looks_of_one_picture_differ_in_colour_and_in_dashes() {
        let schemes = ["hold", "thesis", "linear", "classic", "proxy", "capped"];
        let schemes = schemes.map(|name| Role::Scheme(name).ink(0));
        let places: [Ink; 6] = std::array::from_fn(|place| Role::Place.ink(place));
        for looks in [schemes, places] {
            for (k, a) in looks.iter().enumerate() {
                for b in &looks[..k] {
                    assert_ne!(a.color, b.color);
                }
            }
        }
        for (k, a) in places.iter().enumerate() {
            assert!(places[..k].iter().all(|b| a.dash != b.dash));
        }
        // These coincide, and are drawn in this order.
        let [linear, classic, capped] = [schemes[2], schemes[3], schemes[5]];
        assert!(linear.dash.is_empty());
        assert_ne!(classic.dash, capped.dash);
        assert!(places.iter().chain(&schemes).all(|ink| ink.width == WIDTH));
        assert_eq!(Role::Number(3).ink(0), Role::Place.ink(3));
    }
}
