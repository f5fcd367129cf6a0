//! Fewer points for the same picture. Of all samples in one pixel column, only the smallest and the largest
//! are kept, in their order in time. No peak is lost, and a long run takes no more points than a short one.

/// Lines through the usable points of `samples`, whose x must not decrease. The lines are reduced for a picture
/// in which `column` gives the pixel column of an x. A line breaks if samples are missing over a whole column.
pub(super) fn reduce(
    samples: impl Iterator<Item = (f64, f64)>,
    column: impl Fn(f64) -> i64,
) -> Vec<Vec<(f64, f64)>> {
    let mut lines = vec![Vec::new()];
    let mut current: Option<Column> = None;
    let mut missing = false;
    for (x, y) in samples {
        if !(usable(x) && usable(y)) {
            missing = true;
            continue;
        }
        let at = column(x);
        match &mut current {
            Some(column) if column.at == at => column.add(x, y),
            _ => {
                if let Some(last) = current.replace(Column::new(at, x, y)) {
                    last.finish(&mut lines);
                    if missing && at.abs_diff(last.at) > 1 {
                        lines.push(Vec::new());
                    }
                }
                missing = false;
            }
        }
    }
    if let Some(last) = current {
        last.finish(&mut lines);
    }
    lines.retain(|line| !line.is_empty());
    lines
}

/// Whether a number can be drawn: it is finite, and so far from overflow that sums and spans are finite, too.
pub(super) fn usable(x: f64) -> bool {
    x.abs() < 1e100
}

/// The extremes of one pixel column.
#[derive(Clone, Copy)]
struct Column {
    at: i64,
    lowest: (f64, f64),
    highest: (f64, f64),
    lowest_first: bool,
}

impl Column {
    fn new(at: i64, x: f64, y: f64) -> Self {
        Self {
            at,
            lowest: (x, y),
            highest: (x, y),
            lowest_first: true,
        }
    }

    fn add(&mut self, x: f64, y: f64) {
        if y < self.lowest.1 {
            self.lowest = (x, y);
            self.lowest_first = false;
        } else if y > self.highest.1 {
            self.highest = (x, y);
            self.lowest_first = true;
        }
    }

    fn finish(self, lines: &mut [Vec<(f64, f64)>]) {
        let Some(line) = lines.last_mut() else { return };
        let (first, second) = if self.lowest_first {
            (self.lowest, self.highest)
        } else {
            (self.highest, self.lowest)
        };
        line.push(first);
        if second != first {
            line.push(second);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peaks_stay_and_their_order_too() {
        let samples = [(0.1, 1.0), (0.2, 5.0), (0.3, 2.0), (0.4, -1.0), (1.5, 3.0)];
        let lines = reduce(samples.into_iter(), |x| x as i64);
        assert_eq!(lines, [vec![(0.2, 5.0), (0.4, -1.0), (1.5, 3.0)]]);
    }

    #[test]
    fn a_line_breaks_where_samples_are_missing() {
        let samples = [
            (0.0, 1.0),
            (1.0, f64::NAN),
            (2.0, 2.0),
            (3.0, 3.0),
            (3.5, f64::INFINITY),
        ];
        let lines = reduce(samples.into_iter(), |x| x as i64);
        assert_eq!(lines, [vec![(0.0, 1.0)], vec![(2.0, 2.0), (3.0, 3.0)]]);
    }

    #[test]
    fn a_long_run_gives_two_points_a_column() {
        let samples = (0..600_000).map(|i| (f64::from(i), f64::from(i % 977)));
        let lines = reduce(samples, |x| (x / 1000.0) as i64);
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].len(), 1200);
    }
}
