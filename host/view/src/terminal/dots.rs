//! A raster of braille dots, two by four a cell. The dots of a cell are about square on most terminals.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;

/// Dots over an area, and the style of each cell.
pub(super) struct Dots {
    area: Rect,
    cells: Vec<(u8, Style)>,
}

impl Dots {
    pub(super) fn new(area: Rect) -> Self {
        let cells = usize::from(area.width) * usize::from(area.height);
        Self {
            area,
            cells: vec![(0, Style::new()); cells],
        }
    }

    /// Number of dots across.
    pub(super) fn width(&self) -> usize {
        2 * usize::from(self.area.width)
    }

    /// Number of dots down.
    pub(super) fn height(&self) -> usize {
        4 * usize::from(self.area.height)
    }

    /// Sets a dot, counted from the top left corner. A dot outside is ignored.
    pub(super) fn set(&mut self, x: usize, y: usize, style: Style) {
        // Bits of U+2800: Unicode Standard, block Braille Patterns.
        const BITS: [[u8; 2]; 4] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];
        if x < self.width() && y < self.height() {
            let cell = (y / 4) * usize::from(self.area.width) + x / 2;
            if let Some((bits, old)) = self.cells.get_mut(cell) {
                *bits |= BITS[y % 4][x % 2];
                *old = style;
            }
        }
    }

    /// Sets the dots of a line between two points, ends included.
    pub(super) fn line(&mut self, from: [f64; 2], to: [f64; 2], style: Style) {
        for (x, y) in line(from, to, self.width(), self.height()) {
            self.set(x, y, style);
        }
    }

    /// Draws the cells that have dots.
    pub(super) fn draw(&self, buffer: &mut Buffer) {
        let width = usize::from(self.area.width).max(1);
        for (index, (bits, style)) in self.cells.iter().enumerate().filter(|(_, c)| c.0 != 0) {
            let x = self.area.x + (index % width) as u16;
            let y = self.area.y + (index / width) as u16;
            let symbol = char::from_u32(0x2800 + u32::from(*bits)).unwrap_or(' ');
            if let Some(cell) = buffer.cell_mut((x, y)) {
                cell.set_char(symbol).set_style(*style);
            }
        }
    }
}

/// The dots of a line that lie inside a raster.
pub(super) fn line(
    from: [f64; 2],
    to: [f64; 2],
    width: usize,
    height: usize,
) -> impl Iterator<Item = (usize, usize)> {
    let [x, y] = [to[0] - from[0], to[1] - from[1]];
    // A line that is far longer than the raster is cut rather than followed.
    let longest = 8.0 * (width + height) as f64;
    let steps = x.abs().max(y.abs()).ceil().clamp(1.0, longest.max(1.0));
    let steps = if steps.is_finite() { steps as usize } else { 0 };
    (0..=steps).filter_map(move |step| {
        let along = step as f64 / steps.max(1) as f64;
        let (x, y) = ((from[0] + along * x).floor(), (from[1] + along * y).floor());
        let inside = x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64;
        inside.then_some((x as usize, y as usize))
    })
}
