//! Numbers as text: three significant digits, with the prefix of the unit.

/// A time, such as `12.3 µs`.
pub(super) fn time(seconds: f64) -> String {
    scaled(seconds, "s")
}

/// A quantity with the prefix that leaves one to three digits before the point, from nano to kilo.
pub(super) fn scaled(value: f64, unit: &str) -> String {
    const PREFIXES: [(f64, &str); 5] =
        [(1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")];
    let size = value.abs();
    if !value.is_finite() {
        return format!("- {unit}");
    }
    if size < 0.5e-12 {
        return format!("0 {unit}");
    }
    // 999.6e-6 has the digits of 1.00e-3.
    let fits = |(factor, _): &&(f64, &str)| size >= 0.9995 * factor;
    let &(factor, prefix) = PREFIXES.iter().find(fits).unwrap_or(&PREFIXES[4]);
    format!("{} {prefix}{unit}", digits(value / factor))
}

/// Three significant digits.
pub(super) fn digits(value: f64) -> String {
    match value.abs() {
        v if !v.is_finite() => "-".into(),
        v if v >= 1e5 => format!("{value:.1e}"),
        v if v >= 99.95 => format!("{value:.0}"),
        v if v >= 9.995 => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    }
}

/// A count, with a comma between thousands.
pub(super) fn count(value: u64) -> String {
    let text = value.to_string();
    let mut grouped = String::new();
    for (index, digit) in text.chars().enumerate() {
        if index > 0 && (text.len() - index).is_multiple_of(3) {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    grouped
}

/// An instant of the run, to the millisecond.
pub(super) fn instant(ns: u64) -> String {
    format!("{:.3} s", ns as f64 * 1e-9)
}

/// The text, or its beginning with an ellipsis if it is longer than `width`.
pub(super) fn fit(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.into();
    }
    let begin: String = text.chars().take(width.saturating_sub(1)).collect();
    if width == 0 { begin } else { begin + "…" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_the_prefix_of_their_unit() {
        assert_eq!(time(12.34e-6), "12.3 µs");
        assert_eq!(time(999.7e-6), "1.00 ms");
        assert_eq!(time(0.0), "0 s");
        assert_eq!(scaled(-3.3e-3, "J"), "-3.30 mJ");
        assert_eq!(scaled(f64::NAN, "N"), "- N");
        assert_eq!(digits(1e300), "1.0e300");
        assert_eq!(count(1_234_567), "1,234,567");
        assert_eq!(count(12), "12");
        assert_eq!(fit("a long name", 7), "a long…");
    }
}
