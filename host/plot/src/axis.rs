//! An axis: its range and its round tick marks, linear or logarithmic.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

use super::reduce::usable;

/// How an axis places values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Scale {
    /// Evenly.
    #[default]
    Linear,
    /// By their logarithms. Zero and negative values have no place.
    Logarithmic,
    /// By their logarithms, above this bound. Values at or below the bound, such as zero, are together at the beginning,
    /// before a break of the axis.
    LogarithmicAbove(f64),
}

/// An axis in drawn coordinates: the value itself, or its decimal logarithm.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) from: f64,
    pub(super) to: f64,
    kind: Kind,
    /// Positions of the labelled ticks.
    ticks: Vec<f64>,
    low: Option<Low>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Consecutive ticks are one step apart.
    Linear { step: f64 },
    /// Labels are plain numbers, or powers of ten if plain numbers would be long.
    Logarithmic { plain: bool },
}

/// The place of values that are too small for a logarithmic axis.
#[derive(Clone, Debug, PartialEq)]
struct Low {
    /// The largest of these values.
    bound: f64,
    place: f64,
    /// Where the axis is broken.
    broken: f64,
    label: String,
}

impl Axis {
    /// An axis over `values` with about `marks` ticks. A linear one has a margin (a fraction of their span) at both ends.
    pub(super) fn new(
        scale: Scale,
        values: impl Iterator<Item = f64> + Clone,
        margin: f64,
        marks: f64,
    ) -> Self {
        match scale {
            Scale::Linear => Self::linear(values, margin, marks),
            Scale::Logarithmic => Self::logarithmic(values, marks),
            Scale::LogarithmicAbove(bound) => Self::logarithmic_above(bound, values, marks),
        }
    }

    /// A linear axis over all of `values`, with a margin (a fraction of their span) at both ends and about
    /// `marks` ticks. Both ends are ticks, so that each end has its label.
    pub(super) fn linear(values: impl Iterator<Item = f64>, margin: f64, marks: f64) -> Self {
        let (mut from, mut to) = range(values).unwrap_or((0.0, 1.0));
        let pad = if to > from { margin * (to - from) } else { 0.0 };
        // Far from zero, the labels of ticks over a shorter span would be equal.
        let least = 1e-9_f64.max(1e-6 * from.abs().max(to.abs()));
        let short = if to - from < least {
            0.5_f64.max(least)
        } else {
            0.0
        };
        // An end that is a tick, such as zero or the whole of a fraction, needs no space beyond it.
        let step = round_step((to - from).max(least) / marks);
        let is_tick = |end: f64| (end / step - (end / step).round()).abs() < 1e-9;
        let beyond = |end: f64| if is_tick(end) { short } else { pad.max(short) };
        (from, to) = (from - beyond(from), to + beyond(to));
        let step = round_step((to - from) / marks);
        // The rounding of a sum of periods, or a last tick that is late, may lie beyond a round end. A hundredth of a step is
        // less than a line is thick.
        from = (from / step + 0.01).floor() * step;
        to = (to / step - 0.01).ceil() * step;
        let ticks = multiples(step, from, to);
        Self {
            from,
            to,
            kind: Kind::Linear { step },
            ticks,
            low: None,
        }
    }

    /// A logarithmic axis that ends at the least and the greatest of the positive ones of `values`: the drawing fills it.
    pub(super) fn logarithmic_to_the_edge(values: impl Iterator<Item = f64>, marks: f64) -> Self {
        let (from, to) = decades(values);
        let decades = round_step((to - from) / marks).max(1.0);
        Self::logarithmic_of(from, to, multiples(decades, from, to))
    }

    /// A logarithmic axis over the positive ones of `values`, with at most about `marks` ticks, which both ends are.
    fn logarithmic(values: impl Iterator<Item = f64>, marks: f64) -> Self {
        let (from, to) = decades(values);
        let fits = |ticks: &Vec<f64>| ticks.len() as f64 <= marks + 1.0;
        let fine = [&[1.0, 2.0, 5.0][..], &[1.0, 3.0], &[1.0]];
        let fine = fine.map(|factors| around(&within_decades(factors, from, to), from, to));
        let ticks = fine.into_iter().find(fits).unwrap_or_else(|| {
            let decades = round_step((to - from) / marks).max(1.0);
            let ends = (from.floor() - decades, to.ceil() + decades);
            around(&multiples(decades, ends.0, ends.1), from, to)
        });
        let ends = ticks.first().copied().zip(ticks.last().copied());
        let (from, to) = ends.unwrap_or((from, to));
        Self::logarithmic_of(from, to, ticks)
    }

    fn logarithmic_of(from: f64, to: f64, ticks: Vec<f64>) -> Self {
        let plain = ticks.iter().all(|tick| (-3.001..=4.8).contains(tick));
        Self {
            from,
            to,
            kind: Kind::Logarithmic { plain },
            ticks,
            low: None,
        }
    }

    fn logarithmic_above(
        bound: f64,
        values: impl Iterator<Item = f64> + Clone,
        marks: f64,
    ) -> Self {
        let shown = values.clone().filter(|x| *x > bound);
        let mut axis = if shown.clone().next().is_some() {
            Self::logarithmic(shown, marks)
        } else {
            Self::logarithmic([bound, 10.0 * bound].into_iter(), marks)
        };
        let Some((_, most)) = range(values.filter(|x| *x <= bound)) else {
            return axis;
        };
        let span = axis.to - axis.from;
        let place = axis.from - 0.13 * span;
        axis.low = Some(Low {
            bound,
            place,
            broken: axis.from - 0.05 * span,
            label: if most > 0.0 {
                format!("<{}", log_label(libm::log10(bound), bound >= 1e-3))
            } else {
                "0".to_owned()
            },
        });
        // The label of the lowest place needs room.
        axis.ticks
            .retain(|tick| tick - place > if most > 0.0 { 0.24 } else { 0.12 } * span);
        axis.ticks.insert(0, place);
        axis.from = place - 0.05 * span;
        axis
    }

    /// Where the axis is broken.
    pub(super) fn broken(&self) -> Option<f64> {
        self.low.as_ref().map(|low| low.broken)
    }

    /// The labels of the ticks, in order.
    pub(super) fn labels(&self) -> Vec<String> {
        self.ticks.iter().map(|tick| self.label(*tick)).collect()
    }

    /// The places of the ticks, with their labels.
    pub(super) fn labelled(&self) -> impl Iterator<Item = (f64, String)> + '_ {
        self.ticks.iter().map(|tick| (*tick, self.label(*tick)))
    }

    /// The drawn coordinate of a value; `None` if the axis cannot show the value.
    pub(super) fn place(&self, value: f64) -> Option<f64> {
        if let Some(low) = self.low.as_ref().filter(|low| value <= low.bound) {
            return Some(low.place);
        }
        let place = match self.kind {
            Kind::Linear { .. } => value,
            Kind::Logarithmic { .. } => libm::log10(value),
        };
        usable(place).then_some(place)
    }

    /// The label of a tick.
    fn label(&self, tick: f64) -> String {
        if let Some(low) = self.low.as_ref().filter(|low| tick == low.place) {
            return low.label.clone();
        }
        let text = match self.kind {
            Kind::Linear { step } => linear_label(tick, step),
            Kind::Logarithmic { plain } => log_label(tick, plain),
        };
        text.replace('-', "−")
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, place: &f64, limit: (i32, i32)) -> i32 {
        let fraction = (place - self.from) / (self.to - self.from);
        (f64::from(limit.0) + fraction * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // Light lines between the ticks would clutter the picture.
        if hint.weight().allow_light_points() {
            Vec::new()
        } else {
            self.ticks.clone()
        }
    }

    fn range(&self) -> Range<f64> {
        self.from..self.to
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, tick: &f64) -> String {
        self.label(*tick)
    }
}

fn linear_label(tick: f64, step: f64) -> String {
    // Adding zero turns -0 into 0.
    let tick = tick + 0.0;
    if !(1e-6..1e6).contains(&step) {
        return format!("{tick:e}");
    }
    let decimals = (-libm::log10(step) - 1e-9).ceil().max(0.0) as usize;
    format!("{tick:.decimals$}")
}

fn log_label(tick: f64, plain: bool) -> String {
    let decade = (tick + 1e-9).floor();
    let factor = libm::exp10(tick - decade).round();
    if plain {
        let decimals = (-decade).max(0.0) as usize;
        return format!("{:.decimals$}", factor * libm::exp10(decade));
    }
    let power = power_of_ten(decade as i32);
    if factor == 1.0 {
        power
    } else {
        format!("{factor:.0}·{power}")
    }
}

/// Ten with a raised exponent.
pub(super) fn power_of_ten(exponent: i32) -> String {
    let raised: String = exponent.to_string().chars().map(superscript).collect();
    format!("10{raised}")
}

fn superscript(digit: char) -> char {
    match digit {
        '-' => '⁻',
        '0' => '⁰',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        other => {
            let above = other.to_digit(10).and_then(|d| char::from_u32(0x2070 + d));
            above.unwrap_or(other)
        }
    }
}

/// Smallest and largest of the usable values.
fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|x| usable(*x)).fold(None, |range, x| {
        let (from, to) = range.unwrap_or((x, x));
        Some((x.min(from), x.max(to)))
    })
}

/// The logarithms of the least and the greatest of the positive ones of `values`, never equal.
fn decades(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let logs = values.filter(|x| *x > 0.0).map(libm::log10);
    let (from, to) = range(logs).unwrap_or((0.0, 1.0));
    if from < to {
        (from, to)
    } else {
        (from - 0.05, to + 0.05)
    }
}

/// The smallest number at or above `step` that is 1, 2 or 5 times a power of ten.
fn round_step(step: f64) -> f64 {
    let power = libm::exp10(libm::log10(step).floor());
    let factor = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|f| f * power >= step * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * power
}

/// The logarithms of these multiples of powers of ten, from a decade below the range to a decade above it.
fn within_decades(factors: &[f64], from: f64, to: f64) -> Vec<f64> {
    let decades = from.floor() as i32 - 1..=to.floor() as i32 + 1;
    let each = decades.flat_map(|decade| {
        let ticks = factors.iter();
        ticks.map(move |x| f64::from(decade) + libm::log10(*x))
    });
    each.collect()
}

/// Those of `ticks`, which are in ascending order and reach beyond the range, that hold the range between the first and
/// the last of them.
fn around(ticks: &[f64], from: f64, to: f64) -> Vec<f64> {
    // A bound that is a tick but for the rounding is that tick.
    let first = ticks.iter().rposition(|tick| *tick <= from + 1e-9);
    let last = ticks.iter().position(|tick| *tick >= to - 1e-9);
    ticks[first.unwrap_or(0)..=last.unwrap_or(ticks.len() - 1)].to_vec()
}

fn multiples(step: f64, from: f64, to: f64) -> Vec<f64> {
    let (first, last) = ((from / step - 1e-9).ceil(), (to / step + 1e-9).floor());
    // By construction there are about ten at most. The bound keeps rounding errors of extreme ranges harmless.
    let count = (last - first).clamp(-1.0, 50.0) as i32;
    (0..=count).map(|i| (first + f64::from(i)) * step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn logarithmic(values: &[f64]) -> Axis {
        Axis::new(Scale::Logarithmic, values.iter().copied(), 0.05, 7.0)
    }

    #[test]
    fn ticks_are_round() {
        let axis = Axis::linear([-3.1, 3.2, f64::NAN].into_iter(), 0.05, 6.0);
        assert_eq!(axis.labels(), ["−4", "−2", "0", "2", "4"]);
        let axis = Axis::linear([0.0, 5.999].into_iter(), 0.0, 6.0);
        assert_eq!(axis.labels(), ["0", "1", "2", "3", "4", "5", "6"]);
        let axis = Axis::linear([0.0, 0.35].into_iter(), 0.0, 6.0);
        assert_eq!(axis.labels(), ["0.0", "0.1", "0.2", "0.3", "0.4"]);
        // The whole of a fraction is the end of its axis.
        let axis = Axis::linear([0.0, 1.0].into_iter(), 0.05, 6.0);
        assert_eq!(axis.labels().last().map(String::as_str), Some("1.0"));
    }

    #[test]
    fn decades_are_labelled() {
        let axis = logarithmic(&[1e-5, 0.0, -2.0, 2.0]);
        assert_eq!(
            axis.labels(),
            ["10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹", "10⁰", "10¹"]
        );
        let axis = logarithmic(&[0.002, 30.0]);
        assert_eq!(axis.labels(), ["0.001", "0.01", "0.1", "1", "10", "100"]);
        let axis = logarithmic(&[20.0, 450.0]);
        assert_eq!(axis.labels(), ["20", "50", "100", "200", "500"]);
    }

    #[test]
    fn any_values_give_a_range_and_few_ticks() {
        let cases: [&[f64]; 7] = [
            &[],
            &[f64::NAN],
            &[0.0],
            &[1e90, -1e90],
            &[1e15, 1e15 + 0.5],
            &[f64::INFINITY, 3.0],
            &[1e-300, 2e-300],
        ];
        for values in cases {
            let linear = Axis::linear(values.iter().copied(), 0.05, 6.0);
            let log = logarithmic(values);
            for axis in [linear, log] {
                assert!(axis.from < axis.to, "{values:?}: {axis:?}");
                assert!(axis.ticks.len() < 20, "{values:?}: {axis:?}");
                assert!(axis.ticks.iter().all(|tick| !axis.label(*tick).is_empty()));
                // Both ends have labels.
                let end = |tick: Option<&f64>, end: f64| {
                    (tick.expect("a tick") - end).abs() < 1e-9 * (axis.to - axis.from)
                };
                assert!(
                    end(axis.ticks.first(), axis.from) && end(axis.ticks.last(), axis.to),
                    "{axis:?}"
                );
            }
        }
    }

    #[test]
    fn zero_has_a_place_of_its_own_on_a_logarithmic_axis() {
        let scale = Scale::LogarithmicAbove(1e-3);
        let axis = |values: &[f64]| Axis::new(scale, values.iter().copied(), 0.05, 7.0);
        let broken = axis(&[0.0, 0.5, 30.0]);
        assert_eq!(
            broken.labels(),
            ["0", "0.5", "1", "2", "5", "10", "20", "50"]
        );
        let [zero, half] = [0.0, 0.5].map(|x| broken.place(x).expect("a place"));
        assert!(broken.from < zero && zero < half);
        let at = broken.broken().expect("a break");
        assert!(zero < at && at < half);
        // A value below the bound is not zero, and the label says so.
        assert_eq!(axis(&[1e-4, 0.5, 30.0]).labels()[0], "<0.001");
        assert_eq!(axis(&[0.0]).labels()[0], "0");
        let unbroken = axis(&[0.5, 30.0]);
        assert_eq!(
            (unbroken.broken(), unbroken.labels()[0].as_str()),
            (None, "0.5")
        );
    }
}
