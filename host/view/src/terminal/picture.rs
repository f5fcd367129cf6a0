//! A picture of the display as SVG, for documents. Dots, bars and rules are drawn as shapes, so that the picture does
//! not depend on the font.

use ratatui::buffer::Buffer;
use ratatui::style::{Color, Modifier};
use std::fmt::Write;

/// Size of a cell.
const CELL: (u32, u32) = (8, 16);
const INK: &str = "#d8d8d8";
const PAPER: &str = "#14161a";

/// The cells of a buffer as lines of text, without colours.
pub fn text(buffer: &Buffer) -> String {
    let rows = buffer.content.chunks(usize::from(buffer.area.width.max(1)));
    let row = |cells: &[ratatui::buffer::Cell]| {
        let row: String = cells.iter().map(ratatui::buffer::Cell::symbol).collect();
        row.trim_end().to_owned() + "\n"
    };
    rows.map(row).collect()
}

/// The cells of a buffer as SVG.
pub fn svg(buffer: &Buffer) -> String {
    let area = buffer.area;
    let (width, height) = (
        u32::from(area.width) * CELL.0,
        u32::from(area.height) * CELL.1,
    );
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-8 -8 {} {}\" width=\"{0}\" height=\"{1}\" \
         font-family=\"DejaVu Sans Mono, Menlo, Consolas, monospace\" font-size=\"13\">\n\
         <rect x=\"-8\" y=\"-8\" width=\"100%\" height=\"100%\" fill=\"{PAPER}\"/>\n",
        width + 16,
        height + 16
    );
    for y in 0..area.height {
        let mut x = 0;
        while x < area.width {
            let cell = &buffer[(area.x + x, area.y + y)];
            let reversed = cell.modifier.contains(Modifier::REVERSED);
            let bold = cell.modifier.contains(Modifier::BOLD);
            let (ink, paper) = if reversed {
                (PAPER.to_owned(), Some(colour(cell.fg)))
            } else {
                (colour(cell.fg), None)
            };
            let same = |other: &ratatui::buffer::Cell| {
                other.fg == cell.fg && other.modifier == cell.modifier
            };
            // A run of letters in one style is one text.
            let mut run = String::new();
            let mut end = x;
            while end < area.width {
                let other = &buffer[(area.x + end, area.y + y)];
                if !same(other) || shape(other.symbol()).is_some() {
                    break;
                }
                run.push_str(other.symbol());
                end += 1;
            }
            let (left, top) = (u32::from(x) * CELL.0, u32::from(y) * CELL.1);
            let cells = u32::from((end - x).max(1));
            if let Some(paper) = paper {
                let (width, height) = (cells * CELL.0, CELL.1);
                let _ = writeln!(
                    text,
                    "<rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"{paper}\"/>"
                );
            }
            if end > x {
                let trimmed = run.trim_end();
                let before = trimmed.chars().take_while(|c| *c == ' ').count();
                let trimmed = trimmed.trim_start();
                if !trimmed.is_empty() {
                    let x = left + before as u32 * CELL.0;
                    let length = trimmed.chars().count() as u32 * CELL.0;
                    let weight = if bold { " font-weight=\"bold\"" } else { "" };
                    let escaped = trimmed.replace('&', "&amp;").replace('<', "&lt;");
                    let _ = writeln!(
                        text,
                        "<text x=\"{x}\" y=\"{}\" textLength=\"{length}\" fill=\"{ink}\"{weight} \
                         xml:space=\"preserve\">{escaped}</text>",
                        top + 12
                    );
                }
                x = end;
            } else {
                if let Some(shape) = shape(cell.symbol()) {
                    let _ = writeln!(
                        text,
                        "<path transform=\"translate({left} {top})\" d=\"{shape}\" fill=\"{ink}\"/>"
                    );
                }
                x += 1;
            }
        }
    }
    text.push_str("</svg>\n");
    text
}

/// The outline of a dot pattern, a bar or a rule, in a cell of 8 by 16.
fn shape(symbol: &str) -> Option<String> {
    let mut chars = symbol.chars();
    let (symbol, None) = (chars.next()?, chars.next()) else {
        return None;
    };
    match symbol {
        '\u{2800}'..='\u{28ff}' => {
            const PLACES: [(u32, u32); 8] = [
                (0, 0),
                (0, 1),
                (0, 2),
                (1, 0),
                (1, 1),
                (1, 2),
                (0, 3),
                (1, 3),
            ];
            let bits = symbol as u32 - 0x2800;
            let mut path = String::new();
            for (bit, (x, y)) in PLACES.iter().enumerate() {
                if bits >> bit & 1 == 1 {
                    let _ = write!(path, "M{} {}h3v3h-3z", 4 * x, 4 * y);
                }
            }
            Some(path)
        }
        '▁'..='█' => {
            let high = 2 * (symbol as u32 - '▁' as u32 + 1);
            Some(format!("M0 {}h8v{high}h-8z", 16 - high))
        }
        '─' => Some("M0 7.5h8v1h-8z".into()),
        '│' => Some("M3.5 0h1v16h-1z".into()),
        '┊' => Some("M3.5 1h1v3h-1zM3.5 7h1v3h-1zM3.5 12h1v3h-1z".into()),
        '├' => Some("M3.5 4h1v8h-1zM4 7.5h4v1h-4z".into()),
        '┤' => Some("M3.5 4h1v8h-1zM0 7.5h4v1h-4z".into()),
        '╵' => Some("M3.5 0h1v6h-1z".into()),
        _ => None,
    }
}

/// A colour as SVG has it. The palette of a console is that of xterm.
fn colour(colour: Color) -> String {
    const CONSOLE: [&str; 16] = [
        "#000000", "#cd0000", "#00cd00", "#cdcd00", "#0000ee", "#cd00cd", "#00cdcd", "#e5e5e5",
        "#7f7f7f", "#ff0000", "#00ff00", "#ffff00", "#5c5cff", "#ff00ff", "#00ffff", "#ffffff",
    ];
    match colour {
        Color::Rgb(red, green, blue) => format!("#{red:02x}{green:02x}{blue:02x}"),
        Color::Indexed(index @ 232..) => {
            let grey = 8 + 10 * (index - 232);
            format!("#{grey:02x}{grey:02x}{grey:02x}")
        }
        Color::Indexed(index @ 16..) => {
            let level = |k: u8| if k == 0 { 0 } else { 55 + 40 * k };
            let index = index - 16;
            let (red, green, blue) = (index / 36, index / 6 % 6, index % 6);
            format!("#{:02x}{:02x}{:02x}", level(red), level(green), level(blue))
        }
        Color::Indexed(index) => CONSOLE[usize::from(index)].into(),
        _ => INK.into(),
    }
}
