//! Finds texts of a picture that collide or are cut, for the tests of pictures.

use super::font::Font;

/// A text of a picture and the rectangle that its letters may cover (pixels of the page).
struct Written {
    text: String,
    x: [f64; 2],
    y: [f64; 2],
}

/// Describes each text of the picture `svg` that reaches beyond the page, and each pair of texts that overlap. The widths
/// are those of the widest font that a viewer shows. An empty list is a sound page.
pub fn collisions(svg: &str) -> Vec<String> {
    let number = |name: &str| attribute(svg, name).and_then(|value| value.parse::<f64>().ok());
    let (Some(width), Some(height)) = (number("width"), number("height")) else {
        return vec!["the picture has no size".to_owned()];
    };
    let view = attribute(svg, "viewBox").unwrap_or_default();
    let units = view.split(' ').nth(2).and_then(|w| w.parse::<f64>().ok());
    let scale = width / units.unwrap_or(width);
    let texts: Vec<Written> = svg
        .split("<text ")
        .skip(1)
        .filter_map(|element| written(element, scale))
        .collect();
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

/// The value of the first attribute of this name.
fn attribute<'a>(element: &'a str, name: &str) -> Option<&'a str> {
    let start = format!("{name}=\"");
    // The name must be whole: `x` is no part of `cx`.
    let (at, _) = element
        .match_indices(&start)
        .find(|(at, _)| *at == 0 || element[..*at].ends_with(' '))?;
    element[at + start.len()..].split('"').next()
}

fn written(element: &str, scale: f64) -> Option<Written> {
    let (tag, rest) = element.split_once('>')?;
    let text = rest.split("</text>").next()?.trim();
    let text = [
        ("&lt;", "<"),
        ("&gt;", ">"),
        ("&quot;", "\""),
        ("&apos;", "'"),
    ]
    .iter()
    .fold(text.to_owned(), |text, (name, sign)| {
        text.replace(name, sign)
    })
    .replace("&amp;", "&");
    if text.is_empty() {
        return None;
    }
    let number = |name: &str| attribute(tag, name)?.parse::<f64>().ok();
    let size = scale * number("font-size")?;
    let font = Font::new(attribute(tag, "font-weight") == Some("bold"));
    let length = size * font.width(&text);
    let along = match attribute(tag, "text-anchor") {
        Some("middle") => [-0.5 * length, 0.5 * length],
        Some("end") => [-length, 0.0],
        _ => [0.0, length],
    };
    let base = match attribute(tag, "dy") {
        Some("0.76em") => 0.76 * size,
        Some("0.5ex") => 0.5 * font.x_height() * size,
        _ => -0.5 * font.x_height() * size,
    };
    // From the top of capitals to the bottom of most letters; descenders may come near the next line.
    let across = [base - 0.75 * size, base + 0.05 * size];
    let (x, y) = (scale * number("x")?, scale * number("y")?);
    // Turned by a quarter against the clock, the text goes upwards.
    let upright = attribute(tag, "transform").is_some_and(|turn| turn.starts_with("rotate(270"));
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
            let svg = page::svg(200, 100, |area| {
                for (text, x, y) in texts {
                    page::write(area, text, *x, *y, page::font(12.0), page::TEXT)?;
                }
                Ok(())
            });
            collisions(&svg)
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
        assert_eq!(collisions("no picture").len(), 1);
    }
}
