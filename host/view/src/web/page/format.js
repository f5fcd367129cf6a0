/** Numbers with units, as the page writes them. */

const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];

/** A number with three significant digits, without an exponent. */
export function digits(value, significant = 3) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.floor(Math.log10(Math.abs(value)));
  return value.toFixed(Math.min(Math.max(significant - 1 - size, 0), 6));
}

/** A quantity with a prefix, such as `12.0 µs`. */
export function quantity(value, unit, significant = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return `0 ${unit}`;
  const size = Math.abs(value);
  const [scale, prefix] = PREFIXES.find(([scale]) => size >= 0.9995 * scale) ?? PREFIXES.at(-1);
  return `${digits(value / scale, significant)} ${prefix}${unit}`;
}

/** A whole number with thin spaces between groups of three digits. */
export function count(value) {
  return String(value).replace(/\B(?=(\d{3})+$)/g, "\u2009");
}

/** Seconds of a time in nanoseconds, to the millisecond. */
export function seconds(time_ns) {
  return (time_ns * 1e-9).toFixed(3);
}

/** The next number of the form 1, 2 or 5 times a power of ten that is at most `value`. */
export function round125(value) {
  if (!(value > 0)) return 0;
  const power = 10 ** Math.floor(Math.log10(value));
  const step = value / power;
  return (step >= 5 ? 5 : step >= 2 ? 2 : 1) * power;
}

/** The words for a state, as the page shows them. */
export function words(state) {
  return String(state).replaceAll("_", " ");
}

/** Whether the person asked for less motion. */
export const calm = matchMedia("(prefers-reduced-motion: reduce)");
