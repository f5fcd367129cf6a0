//! First-order adaptive windowing: a straight line through as many of the last positions as one
//! describes.
//!
//! F. Janabi-Sharifi, V. Hayward and C.-S. J. Chen, "Discrete-time adaptive windowing for velocity
//! estimation" (2000). The line from the newest position `y_0` to the one `n` ticks ago is
//! lengthened as long as every position between is within a band of it. Slow motion gets long
//! windows, whose counts average out; quick motion short ones, which lag less. The line may be the
//! one between the ends (end fit) or that of least squares (best fit).
//!
//! The paper checks every point anew for every `n`. It is the same to keep the slopes that the
//! points so far leave (each `i` leaves `(y_0 - y_i -+ band) / i`), which takes one pass of the
//! same length whatever the positions are.

/// Most ticks that a window is long.
pub const LONGEST: usize = 16;

/// One axis.
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
    /// Windows of `longest` ticks, at most [`LONGEST`], with a `band` (m) about the line; least
    /// squares if `best`.
    pub(super) fn new(longest: usize, band: f64, best: bool) -> Self {
        Self {
            past: [0.0; LONGEST],
            filled: 0,
            longest: longest.clamp(1, LONGEST),
            band,
            best,
        }
    }

    /// Takes the next position (m); returns the slope a tick (m), and over how many ticks.
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
                // Least squares with a free intercept; `y_0` itself rises by nothing.
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
