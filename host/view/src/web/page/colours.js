/**
 * Colours. The hands have the colours of Okabe and Ito (2008), which the colour-blind can tell apart, and a shape each.
 * The map for quantities is viridis (Smith and van der Walt, 2015): its lightness rises evenly. It is interpolated
 * linearly between nine of its colours.
 */

const VIRIDIS = ["440154", "472d7b", "3b528b", "2c728e", "21918c", "28ae80", "5ec962", "addc30", "fde725"];
const HANDS = {
  light: ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#56b4e9", "#000000", "#7a4fa3"],
  dark: ["#56b4e9", "#e69f00", "#2fc79a", "#cc79a7", "#f0e442", "#0072b2", "#ffffff", "#b79be0"],
};

/** The shapes of the hands, by device. */
export const SHAPES = ["●", "▲", "■", "◆", "▼", "★", "○", "△"];

const bytes = (hex) => [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16));

/** The colour of the map at `t` from 0 to 1: three numbers from 0 to 255. */
export function viridis(t) {
  const along = Math.min(Math.max(t, 0), 1) * (VIRIDIS.length - 1);
  const at = Math.min(Math.floor(along), VIRIDIS.length - 2);
  const [from, to] = [bytes(VIRIDIS[at]), bytes(VIRIDIS[at + 1])];
  return from.map((value, i) => Math.round(value + (along - at) * (to[i] - value)));
}

/** The map as 256 pixels, four bytes each. */
export function table() {
  const pixels = new Uint8ClampedArray(4 * 256);
  for (let i = 0; i < 256; i += 1) pixels.set([...viridis(i / 255), 255], 4 * i);
  return pixels;
}

/** Whether the page is dark. */
export function isDark() {
  return document.documentElement.dataset.theme === "dark";
}

/** The colour of a hand. */
export function handColour(device) {
  const colours = isDark() ? HANDS.dark : HANDS.light;
  return colours[device % colours.length];
}

/** The value of a custom property of the style sheet. */
export function property(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

const listeners = [];

/** Registers a function to call after the theme changed. */
export function onTheme(listener) {
  listeners.push(listener);
}

/** Sets the theme. */
export function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  for (const listener of listeners) listener();
}
