//! The font of all pictures: DejaVu Sans, a part of which the program contains.
//!
//! A PNG is drawn with it. An SVG names it first; if it is missing, the viewer takes Helvetica or Arial, whose letters
//! are narrower. The widths here are therefore upper bounds for both, and the layout of a page relies on them.

use plotters::style::text_anchor::VPos;
use ttf_parser::{Face, GlyphId, OutlineBuilder};

/// The families that an SVG names, in order of preference.
pub(super) const FAMILIES: &str = "DejaVu Sans, Helvetica, Arial, sans-serif";

/// `plotters` takes sizes of fonts as heights of lines, and its SVG backend divides them by this number.
pub(super) const LINE_HEIGHT: f64 = 1.24;

const BOOK: &[u8] = include_bytes!("font/DejaVuSans.ttf");
const BOLD: &[u8] = include_bytes!("font/DejaVuSans-Bold.ttf");

/// A weight of the font.
pub(super) struct Font(Option<Face<'static>>);

impl Font {
    pub(super) fn new(bold: bool) -> Self {
        // The program contains the files, and a test reads them.
        Self(Face::parse(if bold { BOLD } else { BOOK }, 0).ok())
    }

    /// The glyph of a character. A character that the font lacks has the glyph 0, an empty box.
    fn glyph(&self, c: char) -> GlyphId {
        let found = self.0.as_ref().and_then(|face| face.glyph_index(c));
        found.unwrap_or_default()
    }

    /// The width of a glyph, as a fraction of the size of the font.
    fn advance(&self, glyph: GlyphId) -> f64 {
        let face = self.0.as_ref();
        face.and_then(|face| face.glyph_hor_advance(glyph))
            .zip(face)
            .map_or(0.6, |(width, face)| {
                f64::from(width) / f64::from(face.units_per_em())
            })
    }

    /// The width of `text`, as a multiple of the size of the font.
    pub(super) fn width(&self, text: &str) -> f64 {
        text.chars().map(|c| self.advance(self.glyph(c))).sum()
    }

    /// The height of the letter x, as a fraction of the size of the font.
    fn x_height(&self) -> f64 {
        // The table of metrics of this font lacks the height.
        let face = self.0.as_ref();
        let outline = face.and_then(|face| face.glyph_bounding_box(self.glyph('x')));
        outline.zip(face).map_or(0.5, |(outline, face)| {
            f64::from(outline.y_max) / f64::from(face.units_per_em())
        })
    }

    /// The distance of the baseline below the anchor of a text, as a fraction of the size of the font, as the SVG backend
    /// of `plotters` places it.
    pub(super) fn baseline(&self, anchor: VPos) -> f64 {
        match anchor {
            VPos::Top => 0.76,
            VPos::Center => 0.5 * self.x_height(),
            VPos::Bottom => -0.5 * self.x_height(),
        }
    }

    /// Calls `draw` for each glyph with its distance from the start and a function that writes its outline. Distances are
    /// multiples of the size of the font; outlines have `units` for the size of the font, with y upwards.
    pub(super) fn outlines(
        &self,
        text: &str,
        mut draw: impl FnMut(f64, f64, &dyn Fn(&mut dyn OutlineBuilder)),
    ) {
        let Some(face) = &self.0 else { return };
        let mut at = 0.0;
        for c in text.chars() {
            let glyph = self.glyph(c);
            draw(at, f64::from(face.units_per_em()), &|builder| {
                face.outline_glyph(glyph, builder);
            });
            at += self.advance(glyph);
        }
    }
}

/// The width of `text` in the font of a page, of `size` pixels, in pixels.
pub(super) fn text_width(text: &str, size: f64, bold: bool) -> f64 {
    size * Font::new(bold).width(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_weights_have_the_signs_of_our_labels() {
        for bold in [false, true] {
            let font = Font::new(bold);
            assert!(font.0.is_some());
            // From the tables of DejaVu Sans: x is 0.547 em high, digits are 0.636 em (Book) and 0.696 em (Bold) wide.
            assert!(
                (font.x_height() - 0.547).abs() < 0.01,
                "{}",
                font.x_height()
            );
            let digit = if bold { 0.696 } else { 0.636 };
            assert!((font.width("00") - 2.0 * digit).abs() < 2e-3);
            for c in "aZ09 −·×±²³⁻⁰⁴⁹µδÉßЖ≤→".chars() {
                assert_ne!(font.glyph(c), GlyphId(0), "{c}");
            }
            assert_eq!(font.glyph('漢'), GlyphId(0));
        }
    }
}
