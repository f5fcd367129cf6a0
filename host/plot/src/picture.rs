//! A picture: a page as a list of the calls that draw it.
//!
//! A page is drawn once, into the list. Its two forms play the list: [`Picture::svg`] into the SVG backend of `plotters`,
//! and [`Picture::png`] into pixels.

use std::convert::Infallible;
use std::io;

use plotters::prelude::*;
use plotters_backend::{BackendColor, BackendCoord as Point, BackendStyle as Style};
use plotters_backend::{BackendTextStyle, DrawingErrorKind};

use super::font::FAMILIES;
use super::page::UNITS;
use super::png::png;

/// A page, which is written as SVG or as PNG.
#[derive(Clone)]
pub struct Picture {
    /// Width and height (pixels).
    pub(super) size: (u32, u32),
    /// What is drawn, the later over the earlier.
    pub(super) calls: Vec<Call>,
}

/// One shape or one line of text. Coordinates are units of the page, from its upper left corner.
#[derive(Clone)]
pub(super) enum Call {
    Line([Point; 2], ShapeStyle),
    /// A line through points, or the polygon between them if it is filled.
    Path(Vec<Point>, ShapeStyle),
    /// The upper left and the lower right corner.
    Rectangle([Point; 2], ShapeStyle),
    /// The centre and the radius.
    Circle(Point, u32, ShapeStyle),
    /// The text and its anchor.
    Text(String, Point, TextStyle<'static>),
}

impl Picture {
    /// The picture as SVG.
    pub fn svg(&self) -> String {
        let (width, height) = self.size;
        let units = (width * UNITS as u32, height * UNITS as u32);
        let mut text = String::new();
        {
            let mut page = SVGBackend::with_string(&mut text, units);
            // Writing to a string cannot fail.
            let _ = self.calls.iter().try_for_each(|call| match call {
                Call::Line([from, to], style) => page.draw_line(*from, *to, style),
                Call::Path(points, style) if style.filled => {
                    page.fill_polygon(points.clone(), style)
                }
                Call::Path(points, style) => page.draw_path(points.clone(), style),
                Call::Rectangle([a, b], style) => page.draw_rect(*a, *b, style, style.filled),
                Call::Circle(at, radius, style) => {
                    page.draw_circle(*at, *radius, style, style.filled)
                }
                Call::Text(text, at, style) => page.draw_text(text, style, *at),
            });
        }
        let inner = format!("width=\"{}\" height=\"{}\"", units.0, units.1);
        // Without round joins, a noisy line would have long spikes.
        let outer = format!("width=\"{width}\" height=\"{height}\" stroke-linejoin=\"round\"");
        text.replacen(&inner, &outer, 1)
    }

    /// The picture as PNG, with two pixels for each pixel of the page in each direction, on white. The letters come from
    /// the font that the program contains, so that a picture is the same on every machine.
    ///
    /// # Errors
    /// The page has no pixels, or too many.
    pub fn png(&self) -> io::Result<Vec<u8>> {
        png(self)
    }
}

/// The backend that draws into the list of a picture.
pub(super) struct Recorder<'a>(pub(super) &'a mut Picture);

type Recorded = Result<(), DrawingErrorKind<Infallible>>;

fn recorded(style: &impl Style, filled: bool) -> ShapeStyle {
    let color = style.color();
    let (red, green, blue) = color.rgb;
    ShapeStyle {
        color: RGBAColor(red, green, blue, color.alpha),
        filled,
        stroke_width: style.stroke_width(),
    }
}

impl DrawingBackend for Recorder<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        let (width, height) = self.0.size;
        (width * UNITS as u32, height * UNITS as u32)
    }

    fn ensure_prepared(&mut self) -> Recorded {
        Ok(())
    }

    fn present(&mut self) -> Recorded {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): Point, color: BackendColor) -> Recorded {
        self.draw_rect((x, y), (x + 1, y + 1), &color, true)
    }

    fn draw_line<S: Style>(&mut self, from: Point, to: Point, style: &S) -> Recorded {
        let call = Call::Line([from, to], recorded(style, false));
        self.0.calls.push(call);
        Ok(())
    }

    fn draw_rect<S: Style>(&mut self, from: Point, to: Point, style: &S, fill: bool) -> Recorded {
        let call = Call::Rectangle([from, to], recorded(style, fill));
        self.0.calls.push(call);
        Ok(())
    }

    fn draw_path<S: Style, I: IntoIterator<Item = Point>>(
        &mut self,
        points: I,
        style: &S,
    ) -> Recorded {
        let call = Call::Path(points.into_iter().collect(), recorded(style, false));
        self.0.calls.push(call);
        Ok(())
    }

    fn draw_circle<S: Style>(
        &mut self,
        center: Point,
        radius: u32,
        style: &S,
        fill: bool,
    ) -> Recorded {
        let call = Call::Circle(center, radius, recorded(style, fill));
        self.0.calls.push(call);
        Ok(())
    }

    fn fill_polygon<S: Style, I: IntoIterator<Item = Point>>(
        &mut self,
        points: I,
        style: &S,
    ) -> Recorded {
        let call = Call::Path(points.into_iter().collect(), recorded(style, true));
        self.0.calls.push(call);
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(&mut self, text: &str, style: &S, at: Point) -> Recorded {
        // All text has the families of the page.
        let font = FontDesc::new(FontFamily::Name(FAMILIES), style.size(), style.style());
        let style = TextStyle {
            font: font.transform(style.transform()),
            color: style.color(),
            pos: style.anchor(),
        };
        let call = Call::Text(text.to_owned(), at, style);
        self.0.calls.push(call);
        Ok(())
    }
}
