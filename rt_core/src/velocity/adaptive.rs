//! First-order adaptive windowing: a straight line through the last positions, as far back as one line describes them.
//!
//! F. Janabi-Sharifi, V. Hayward and C.-S. J. Chen, "Discrete-time adaptive windowing for velocity estimation" (2000).
//! A line leads from the newest position `y_0` to the position `n` ticks ago. The window grows as long as every
//! position between lies within a band about this line. Slow motion gets long windows, whose counts average out. Quick
//! motion gets short windows, which lag less. The line may connect the ends of the window (end fit) or be that of least
//! squares (best fit).
//!
//! For every `n`, the paper checks all points again. This module keeps the range of slopes that the points so far
//! permit: each point `i` permits `(y_0 - y_i -+ band) / i`. The result is the same, and takes one pass whose length
//! does not depend on the positions.

/// Largest length of a window (ticks).
pub const LONGEST: usize = 16;

/// The window of one axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    /// Earlier positions, newest first.
    past: [f64; LONGEST],
    filled: usize,
    longest: usize,
    band: f64,
    best: bool,
}

impl Window {
    /// A window of at most `longest` ticks, itself at most [`LONGEST`], with a `band` (m) about the line. `best`
    /// selects the line of least squares.
    pub(super) fn new(longest: usize, band: f64, best: bool) -> Self {
        Self {
            past: [0.0; LONGEST],
            filled: 0,
            longest: longest.clamp(1, LONGEST),
            band,
            best,
        }
    }

    /// Takes the next position (m). Returns the slope (m per tick) and the length of the window (ticks).
    pub(super) fn update(&mut self, position: f64) -> (f64, f64) {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        let (mut sum, mut moment) = (0.0, 0.0);
        let (mut slope, mut length) = (0.0, 0.0);
        let mut straight = true;
        let mut n = 0.0;
        for past in self.past.iter().take(self.filled) {
            n += 1.0;
            let rise = position - past;
            let steep = rise / n;
            straight &= low <= steep && steep <= high;
            sum += rise;
            moment += n * rise;
            let found = if self.best {
                // Least squares with a free intercept; the rise of `y_0` itself is zero.
                12.0 * (moment - 0.5 * n * sum) / (n * (n + 1.0) * (n + 2.0))
            } else {
                steep
            };
            if straight {
                (slope, length) = (found, n);
            }
            let slack = self.band / n;
            low = low.max(steep - slack);
            high = high.min(steep + slack);
        }
        let mut newer = position;
        for past in &mut self.past {
            core::mem::swap(past, &mut newer);
        }
        self.filled = self.filled.saturating_add(1).min(self.longest);
        (slope, length)
    }
}
