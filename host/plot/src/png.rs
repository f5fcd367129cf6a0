//! A picture as PNG, drawn from the SVG of a page.
//!
//! It reads what the SVG backend of `plotters` writes, one element a line: rectangles, circles, lines, polylines, polygons
//! and single lines of text, with absolute coordinates and opaque or translucent colours. The letters come from the font
//! that the program contains, so that a picture is the same on every machine.

use std::io;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use tiny_skia::{
    Color, FillRule, LineJoin, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, Transform,
};

use super::font::Font;

/// Pixels of the PNG for each pixel of the page: 300 to the inch if a page of 720 pixels is printed 12 cm wide.
const SCALE: f32 = 2.0;

/// The picture `svg`, which a function of this module drew, as PNG: twice as large in each direction, on white.
///
/// # Errors
/// The text is not a page of this module.
pub fn png(svg: &str) -> io::Result<Vec<u8>> {
    let mut reader = Reader::from_str(svg);
    let mut page: Option<Canvas> = None;
    let mut text: Option<(Attributes, String)> = None;
    loop {
        match reader.read_event().map_err(io::Error::other)? {
            Event::Eof => break,
            Event::Start(tag) | Event::Empty(tag) => {
                let attributes = Attributes::read(&tag)?;
                match (tag.name().as_ref(), &mut page) {
                    ("svg", None) => page = Some(Canvas::new(&attributes)?),
                    ("text", Some(_)) => text = Some((attributes, String::new())),
                    (name, Some(canvas)) => canvas.draw(name, &attributes)?,
                    _ => return Err(unknown("an element outside of the page")),
                }
            }
            Event::Text(part) => {
                if let Some((_, line)) = &mut text {
                    line.push_str(&part);
                }
            }
            Event::GeneralRef(name) => {
                if let Some((_, line)) = &mut text {
                    line.push_str(&entity(&name)?);
                }
            }
            Event::End(tag) if tag.name().as_ref() == "text" => {
                if let Some(((attributes, line), canvas)) = text.take().zip(page.as_mut()) {
                    canvas.write(line.trim(), &attributes)?;
                }
            }
            _ => {}
        }
    }
    let canvas = page.ok_or_else(|| unknown("no page"))?;
    canvas.pixels.encode_png().map_err(io::Error::other)
}

fn unknown(what: &str) -> io::Error {
    io::Error::new(
        io::ErrorKind::InvalidData,
        format!("cannot draw the picture: {what}"),
    )
}

/// The character that a name such as `lt` stands for.
fn entity(name: &quick_xml::events::BytesRef) -> io::Result<String> {
    if let Some(c) = name.resolve_char_ref().map_err(io::Error::other)? {
        return Ok(c.to_string());
    }
    quick_xml::escape::resolve_predefined_entity(name)
        .map(str::to_owned)
        .ok_or_else(|| unknown("an unknown entity"))
}

/// The attributes of an element.
struct Attributes(Vec<(String, String)>);

impl Attributes {
    fn read(tag: &BytesStart) -> io::Result<Self> {
        let all = tag.attributes().map(|one| {
            let one = one.map_err(io::Error::other)?;
            Ok((one.key.as_ref().to_owned(), one.value.into_owned()))
        });
        all.collect::<io::Result<_>>().map(Self)
    }

    fn text(&self, name: &str) -> Option<&str> {
        let found = self.0.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_str())
    }

    fn number(&self, name: &str) -> io::Result<f32> {
        let value = self.text(name).and_then(|value| value.parse().ok());
        value.ok_or_else(|| unknown(&format!("no number {name}")))
    }

    /// The colour of `fill` or `stroke`; `None` if it is not drawn.
    fn paint(&self, name: &str) -> io::Result<Option<Paint<'static>>> {
        let hex = match self.text(name) {
            None | Some("none") => return Ok(None),
            Some(value) => value.strip_prefix('#').filter(|hex| hex.len() == 6),
        };
        let value = hex.and_then(|hex| u32::from_str_radix(hex, 16).ok());
        let value = value.ok_or_else(|| unknown("a colour in another form than #RRGGBB"))?;
        let opacity = self.number("opacity").unwrap_or(1.0).clamp(0.0, 1.0);
        let [_, red, green, blue] = value.to_be_bytes();
        let mut paint = Paint::default();
        paint.set_color_rgba8(red, green, blue, (255.0 * opacity).round() as u8);
        Ok(Some(paint))
    }

    /// The points of a polyline or a polygon.
    fn points(&self) -> io::Result<Vec<(f32, f32)>> {
        let text = self.text("points").unwrap_or_default();
        let point = |pair: &str| {
            let (x, y) = pair.split_once(',')?;
            x.parse().ok().zip(y.parse().ok())
        };
        let points = text.split_ascii_whitespace().map(point);
        points
            .collect::<Option<_>>()
            .ok_or_else(|| unknown("a point in another form than x,y"))
    }
}

/// The page while it is drawn.
struct Canvas {
    pixels: Pixmap,
    /// From units of the page to pixels.
    place: Transform,
    fonts: [Font; 2],
}

impl Canvas {
    fn new(attributes: &Attributes) -> io::Result<Self> {
        let size = [
            attributes.number("width")? * SCALE,
            attributes.number("height")? * SCALE,
        ];
        let view: Vec<f32> = attributes
            .text("viewBox")
            .unwrap_or_default()
            .split_ascii_whitespace()
            .filter_map(|number| number.parse().ok())
            .collect();
        let [_, _, width, height] = view[..] else {
            return Err(unknown("no viewBox"));
        };
        let pixels = Pixmap::new(size[0].round() as u32, size[1].round() as u32);
        let mut pixels = pixels.ok_or_else(|| unknown("its size"))?;
        pixels.fill(Color::WHITE);
        Ok(Self {
            pixels,
            place: Transform::from_scale(size[0] / width, size[1] / height),
            fonts: [Font::new(false), Font::new(true)],
        })
    }

    fn draw(&mut self, name: &str, attributes: &Attributes) -> io::Result<()> {
        let number = |name| attributes.number(name);
        let path = match name {
            "rect" => {
                // A rectangle without area is not drawn.
                Rect::from_xywh(
                    number("x")?,
                    number("y")?,
                    number("width")?,
                    number("height")?,
                )
                .map(PathBuilder::from_rect)
            }
            "circle" => PathBuilder::from_circle(number("cx")?, number("cy")?, number("r")?),
            "line" => through(
                &[
                    (number("x1")?, number("y1")?),
                    (number("x2")?, number("y2")?),
                ],
                false,
            ),
            "polyline" => through(&attributes.points()?, false),
            "polygon" => through(&attributes.points()?, true),
            other => return Err(unknown(other)),
        };
        let Some(path) = path else { return Ok(()) };
        if let Some(paint) = attributes.paint("fill")? {
            self.pixels
                .fill_path(&path, &paint, FillRule::Winding, self.place, None);
        }
        if let Some(paint) = attributes.paint("stroke")? {
            let stroke = Stroke {
                width: attributes.number("stroke-width").unwrap_or(1.0),
                line_join: LineJoin::Round,
                ..Stroke::default()
            };
            self.pixels
                .stroke_path(&path, &paint, &stroke, self.place, None);
        }
        Ok(())
    }

    fn write(&mut self, text: &str, attributes: &Attributes) -> io::Result<()> {
        let Some(paint) = attributes.paint("fill")? else {
            return Ok(());
        };
        let bold = attributes.text("font-weight") == Some("bold");
        let font = &self.fonts[usize::from(bold)];
        let (x, y) = (attributes.number("x")?, attributes.number("y")?);
        let size = attributes.number("font-size")?;
        let width = size * font.width(text) as f32;
        let left = match attributes.text("text-anchor") {
            Some("middle") => -0.5 * width,
            Some("end") => -width,
            _ => 0.0,
        };
        let down = size * shift(attributes.text("dy").unwrap_or("0em"), font)?;
        let turn = turn(attributes.text("transform"))?;
        // The transform turns about the anchor of the text.
        let base = self.place.pre_translate(x, y).pre_rotate(turn);
        let pixels = &mut self.pixels;
        font.outlines(text, |at, units, outline| {
            let mut glyph = Glyph(PathBuilder::new());
            outline(&mut glyph);
            let Some(path) = glyph.0.finish() else { return };
            let scale = size / units as f32;
            let place = base
                .pre_translate(left + size * at as f32, down)
                .pre_scale(scale, -scale);
            pixels.fill_path(&path, &paint, FillRule::Winding, place, None);
        });
        Ok(())
    }
}

fn through(points: &[(f32, f32)], closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    for (k, (x, y)) in points.iter().enumerate() {
        match k {
            0 => path.move_to(*x, *y),
            _ => path.line_to(*x, *y),
        }
    }
    if closed {
        path.close();
    }
    path.finish()
}

/// The shift of a baseline below its anchor, as a fraction of the size of the font.
fn shift(dy: &str, font: &Font) -> io::Result<f32> {
    let (number, unit) = dy
        .strip_suffix("ex")
        .map(|number| (number, font.x_height() as f32))
        .or_else(|| dy.strip_suffix("em").map(|number| (number, 1.0)))
        .ok_or_else(|| unknown("a shift of text"))?;
    let number: f32 = number.parse().map_err(io::Error::other)?;
    Ok(number * unit)
}

/// The angle (degrees) of `rotate(angle, x, y)`.
fn turn(transform: Option<&str>) -> io::Result<f32> {
    let Some(transform) = transform else {
        return Ok(0.0);
    };
    transform
        .strip_prefix("rotate(")
        .and_then(|rest| rest.split(',').next())
        .and_then(|angle| angle.parse().ok())
        .ok_or_else(|| unknown("a transform other than rotate"))
}

/// The outline of a letter.
struct Glyph(PathBuilder);

impl ttf_parser::OutlineBuilder for Glyph {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.0.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.0.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.0.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.0.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tiny_skia::Pixmap;

    /// A page of 20 by 10 pixels, four units to a pixel.
    fn pixels(inside: &str) -> Pixmap {
        let svg = format!(
            "<svg width=\"20\" height=\"10\" viewBox=\"0 0 80 40\" xmlns=\"http://www.w3.org/2000/svg\">\n{inside}</svg>\n"
        );
        let decoded = Pixmap::decode_png(&png(&svg).expect("a picture"));
        decoded.expect("a PNG")
    }

    fn at(pixels: &Pixmap, x: u32, y: u32) -> [u8; 3] {
        let found = pixels.pixel(x, y).expect("a pixel").demultiply();
        [found.red(), found.green(), found.blue()]
    }

    #[test]
    fn shapes_are_where_the_svg_has_them() {
        let drawn = pixels(
            "<rect x=\"0\" y=\"0\" width=\"40\" height=\"20\" opacity=\"1\" fill=\"#FF0000\" stroke=\"none\"/>\n\
             <polygon opacity=\"0.5\" fill=\"#000000\" points=\"40,0 80,0 80,20 40,20 \"/>\n\
             <polyline fill=\"none\" opacity=\"1\" stroke=\"#0000FF\" stroke-width=\"8\" points=\"0,30 80,30 \"/>\n",
        );
        assert_eq!((drawn.width(), drawn.height()), (40, 20));
        assert_eq!(at(&drawn, 10, 5), [255, 0, 0]);
        let half = at(&drawn, 30, 5);
        assert!(half.iter().all(|c| c.abs_diff(127) <= 1), "{half:?}");
        // The line is 2 pixels of the page wide, around 7.5.
        assert_eq!([13, 15, 16].map(|y| at(&drawn, 20, y)), [[0, 0, 255]; 3]);
        assert_eq!([12, 18].map(|y| at(&drawn, 20, y)), [[255; 3]; 2]);
    }

    #[test]
    fn text_has_its_anchor_and_its_turn() {
        let text = |anchor: &str, turn: &str| {
            let drawn = pixels(&format!(
                "<text x=\"40\" y=\"20\" dy=\"0.5ex\" text-anchor=\"{anchor}\" font-family=\"any\" font-size=\"40\" \
                 opacity=\"1\" fill=\"#000000\"{turn}>\n&amp;\n</text>\n"
            ));
            let mut ink = [0, 0, 0, 0];
            for (x, y) in (0..40).flat_map(|x| (0..20).map(move |y| (x, y))) {
                if at(&drawn, x, y)[0] < 128 {
                    let sides = [x < 20, x >= 20, y < 10, y >= 10];
                    for (side, count) in sides.into_iter().zip(&mut ink) {
                        *count += u32::from(side);
                    }
                }
            }
            ink
        };
        let [left, right, ..] = text("start", "");
        assert!(left == 0 && right > 20, "{left} {right}");
        let [left, right, ..] = text("end", "");
        assert!(left > 20 && right == 0, "{left} {right}");
        // Turned by a quarter against the clock about its start, it goes upwards.
        let [_, _, up, down] = text("start", " transform=\"rotate(270, 40, 20)\"");
        assert!(up > 20 && down == 0, "{up} {down}");
    }

    #[test]
    fn what_a_page_does_not_hold_is_refused() {
        for svg in [
            "",
            "no page",
            "<svg width=\"2\" height=\"2\" viewBox=\"0 0 8 8\"><ellipse/></svg>",
            "<svg width=\"2\" height=\"2\"></svg>",
            "<svg width=\"2\" height=\"2\" viewBox=\"0 0 8 8\"><circle cx=\"1\"/></svg>",
        ] {
            assert!(png(svg).is_err(), "{svg}");
        }
    }
}
