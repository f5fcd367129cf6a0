//! Finds texts of a picture that collide or are cut, for the tests of pictures.

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::font::{Font, LINE_HEIGHT};
use super::page::UNITS;
use super::picture::{Call, Picture};

/// A text of a picture and the rectangle that its letters may cover (pixels of the page).
struct Written {
    text: String,
    x: [f64; 2],
    y: [f64; 2],
}

/// Describes each text of the picture that reaches beyond the page, and each pair of texts that overlap. The widths are
/// those of the widest font that a viewer shows. An empty list is a sound page.
pub fn collisions(picture: &Picture) -> Vec<String> {
    let (width, height) = picture.size;
    let (width, height) = (f64::from(width), f64::from(height));
    let texts: Vec<Written> = picture.calls.iter().filter_map(written).collect();
    let mut found = Vec::new();
    for (k, a) in texts.iter().enumerate() {
        // Rounding to units may move a text by a quarter of a pixel.
        if a.x[0] < -0.3 || a.y[0] < -0.3 || a.x[1] > width + 0.3 || a.y[1] > height + 0.3 {
            found.push(format!("\"{}\" reaches beyond the page", a.text));
        }
        for b in &texts[..k] {
            let apart = |p: [f64; 2], q: [f64; 2]| p[1] <= q[0] || q[1] <= p[0];
            if !apart(a.x, b.x) && !apart(a.y, b.y) {
                found.push(format!("\"{}\" collides with \"{}\"", a.text, b.text));
            }
        }
    }
    found
}

fn written(call: &Call) -> Option<Written> {
    let Call::Text(text, (x, y), style) = call else {
        return None;
    };
    let text = text.trim().to_owned();
    if text.is_empty() {
        return None;
    }
    let pixels = |units: f64| units / f64::from(UNITS);
    let size = pixels(style.font.get_size() / LINE_HEIGHT);
    let font = Font::new(matches!(style.font.get_style(), FontStyle::Bold));
    let length = size * font.width(&text);
    let along = match style.pos.h_pos {
        HPos::Left => [0.0, length],
        HPos::Center => [-0.5 * length, 0.5 * length],
        HPos::Right => [-length, 0.0],
    };
    let base = size * font.baseline(style.pos.v_pos);
    // From the top of capitals to the bottom of most letters; descenders may come near the next line.
    let across = [base - 0.75 * size, base + 0.05 * size];
    let (x, y) = (pixels(f64::from(*x)), pixels(f64::from(*y)));
    // Turned by a quarter against the clock, the text goes upwards.
    let upright = matches!(style.font.get_transform(), FontTransform::Rotate270);
    let (x, y) = if upright {
        (across.map(|a| x + a), [y - along[1], y - along[0]])
    } else {
        (along.map(|a| x + a), across.map(|a| y + a))
    };
    Some(Written { text, x, y })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page;

    #[test]
    fn collisions_and_cut_texts_are_found() {
        let page = |texts: &[(&str, i32, i32)]| {
            let picture = page::picture(200, 100, |area| {
                for (text, x, y) in texts {
                    page::write(area, text, *x, *y, page::font(12.0), page::TEXT)?;
                }
                Ok(())
            });
            collisions(&picture)
        };
        assert!(page(&[("left", 10, 20), ("right", 100, 20), ("below", 10, 34)]).is_empty());
        // "left" is 19.7 pixels wide in this font at this size.
        assert!(page(&[("left", 10, 20), ("right", 31, 20)]).is_empty());
        assert_eq!(page(&[("left", 10, 20), ("right", 28, 20)]).len(), 1);
        assert_eq!(page(&[("left", 10, 20), ("below", 10, 26)]).len(), 1);
        assert_eq!(
            page(&[("<cut>", 180, 20)]),
            ["\"<cut>\" reaches beyond the page"]
        );
        assert_eq!(page(&[("cut", 10, 3)]).len(), 1);
    }
}
