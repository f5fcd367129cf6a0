/**
 * The charts. A curve over time is a band between the least and the greatest value of the ticks of each frame, so that
 * a spike of a single tick is visible. The histograms have logarithmic axes: times, and numbers of ticks.
 */
import uPlot from "uplot";
import { handColour, onTheme, property, SHAPES } from "./colours.js";
import { calm, digits, quantity } from "./format.js";

/** Length of the curves (s). */
export const SPAN = 10;
/** Least time between two drawings of the charts (ms). */
const EVERY = 100;
const BIN = 2 ** 0.25;
const AXES = ["x", "y", "z"];
/** Dashes and gaps of the curves (pixels). */
const DASHES = [[], [9, 4], [3, 3], [10, 3, 2, 3], [6, 6], [2, 4]];

/** The history and its charts. */
export class Charts {
  constructor(root) {
    this.root = root;
    this.pieces = [];
    this.axis = -1;
    this.chosen = 0;
    this.plots = [];
    this.totals = null;
    this.last = 0;
    this.draws = 0;
    /** Whether the processor also draws the bodies; the charts then leave it more time. */
    this.sparing = false;
    new ResizeObserver(() => this.resize()).observe(root);
    onTheme(() => this.build());
  }

  /** Begins a run or a log. */
  begin(hello) {
    this.hello = hello;
    this.pieces = [];
    this.totals = null;
    this.build();
  }

  /** Replaces the history. */
  replace(pieces) {
    this.pieces = pieces.filter(({ ticks }) => ticks > 0);
    this.trim();
    this.request();
  }

  /** Adds a frame. */
  frame(frame) {
    const { folded } = frame;
    if (folded.ticks > 0) {
      if (this.pieces.length > 0 && folded.to_ns < this.pieces.at(-1).to_ns) this.pieces = [];
      this.pieces.push(folded);
      this.trim();
    }
    this.totals = frame.totals;
    this.request();
  }

  trim() {
    const oldest = (this.pieces.at(-1)?.to_ns ?? 0) - SPAN * 1e9;
    let first = 0;
    while (first < this.pieces.length && this.pieces[first].to_ns < oldest) first += 1;
    if (first > 0) this.pieces.splice(0, first);
  }

  /** Shows the next axis in the position chart. */
  nextAxis() {
    this.axis = (this.axis + 2) % 4 - 1;
    this.draw();
  }

  build() {
    for (const plot of this.plots) plot.destroy();
    this.root.replaceChildren();
    this.plots = [];
    if (!this.hello) return;
    const hands = this.hello.devices.map(({ name }, device) => ({ name, colour: handColour(device), shape: SHAPES[device] }));
    const neutral = (this.hello.bodies ?? []).map(({ name }, body) => ({ name, colour: handColour(body + 2), shape: SHAPES[body + 2] }));
    this.force = this.curves("force", "Force", "N", hands);
    this.position = this.curves("position", "Position", "mm", hands);
    this.age = this.curves("age", "Model age", "ms", neutral);
    this.lateness = this.histogram("lateness", "Lateness");
    this.duration = this.histogram("duration", "Tick time");
    this.draw();
    this.resize();
  }

  figure(id, title) {
    const figure = document.createElement("figure");
    figure.id = `chart-${id}`;
    const caption = document.createElement("figcaption");
    const name = document.createElement("span");
    name.className = "title";
    name.textContent = title;
    const values = document.createElement("span");
    values.className = "values";
    caption.append(name, values);
    const area = document.createElement("div");
    area.className = "area";
    figure.append(caption, area);
    this.root.append(figure);
    return { figure, area, name, values };
  }

  style() {
    const size = parseFloat(getComputedStyle(document.documentElement).fontSize);
    return {
      size,
      axis: {
        font: `${0.78 * size}px ${property("--font")}`, stroke: property("--quiet"), gap: 3,
        grid: { stroke: property("--rule"), width: 1 }, ticks: { show: false },
      },
    };
  }

  make(figure, options, data) {
    const { clientWidth: width, clientHeight: height } = figure.area;
    const plot = new uPlot({
      width: Math.max(width, 50), height: Math.max(height, 40), legend: { show: false }, padding: [4, 20, 0, 0],
      cursor: { show: false }, ...options,
    }, data, figure.area);
    figure.plot = plot;
    figure.area.firstChild?.setAttribute("aria-hidden", "true");
    this.plots.push(plot);
    return figure;
  }

  curves(id, title, unit, lines) {
    const figure = this.figure(id, title);
    figure.items = lines.map(({ shape, colour, name }) => {
      const item = document.createElement("span");
      item.className = "item";
      item.style.setProperty("--colour", colour);
      const mark = document.createElement("b");
      mark.textContent = `${shape} `;
      mark.title = name;
      const value = document.createElement("span");
      value.className = "number";
      item.append(mark, value);
      figure.values.append(item);
      return value;
    });
    const { size, axis } = this.style();
    const series = [{}];
    const bands = [];
    lines.forEach(({ colour }, index) => {
      const width = property("--line") / 1;
      // As in the figures of the program: a curve shows in the gaps of those that coincide with it.
      const line = { stroke: colour, width, dash: DASHES[index % DASHES.length], points: { show: false } };
      series.push(line, { ...line });
      bands.push({ series: [2 * index + 1, 2 * index + 2], fill: `${colour}66` });
    });
    const least = { N: 0.1, mm: 1, ms: 1 }[unit];
    return this.make(figure, {
      series, bands,
      scales: {
        x: { time: false, range: () => this.window() },
        y: { range: (_, low, high) => bounds(low, high, least, unit !== "mm") },
      },
      axes: [
        { ...axis, size: 1.5 * size, values: (_, ticks) => ticks.map((tick) => `${+tick.toFixed(3)} s`), space: 5 * size },
        { ...axis, size: 3.6 * size, space: 1.8 * size, values: (_, ticks) => ticks.map((tick, i) => (i === ticks.length - 1 ? `${+tick.toFixed(3)} ${unit}` : `${+tick.toFixed(3)}`)) },
      ],
    }, [[], ...lines.flatMap(() => [[], []])]);
  }

  histogram(id, title) {
    const figure = this.figure(id, title);
    figure.item = document.createElement("span");
    figure.item.className = "number";
    figure.values.append(figure.item);
    const { size, axis } = this.style();
    const colour = property("--accent");
    const marks = (plot) => {
      const times = figure.times;
      if (!times) return;
      const { ctx, bbox } = plot;
      ctx.save();
      ctx.font = `${0.75 * size * devicePixelRatio}px ${property("--font")}`;
      ctx.textAlign = "left";
      ctx.strokeStyle = property("--text");
      const lines = [["p50", times.p50], ["p99", times.p99], ["max", times.max]]
        .map(([name, value]) => [name, plot.valToPos(value * 1e9, "x", true)])
        .filter(([, x]) => Number.isFinite(x));
      for (const [name, x] of lines) {
        ctx.setLineDash(name === "max" ? [] : [3 * devicePixelRatio, 3 * devicePixelRatio]);
        ctx.beginPath();
        ctx.moveTo(x, bbox.top);
        ctx.lineTo(x, bbox.top + bbox.height);
        ctx.stroke();
      }
      // Each name has a row of its own, on ground that hides the lines of the others.
      const [gap, row] = [3 * devicePixelRatio, size * devicePixelRatio];
      lines.forEach(([name, x], index) => {
        const width = ctx.measureText(name).width + 2 * gap;
        const at = x + gap + width > bbox.left + bbox.width ? x - width - 1 : x + 1;
        ctx.fillStyle = property("--card");
        ctx.fillRect(at, bbox.top + index * row, width, row);
        ctx.fillStyle = property("--text");
        ctx.fillText(name, at + gap, bbox.top + (index + 0.8) * row);
      });
      ctx.restore();
    };
    return this.make(figure, {
      series: [{}, { stroke: colour, fill: `${colour}59`, width: property("--line") / 1, paths: uPlot.paths.stepped({ align: 1 }), points: { show: false }, fillTo: 0.5 }],
      scales: {
        x: { time: false, distr: 3, range: (_, low, high) => (low > 0 ? [Math.min(low, 1e3) / 1.2, Math.max(high, 1e5, 1e9 * (figure.times?.max ?? 0)) * 1.5] : [1e3, 1e5]) },
        y: { distr: 3, range: (_, low, high) => [0.5, Math.max(10, 2 * (high || 1))] },
      },
      axes: [
        { ...axis, size: 1.5 * size, splits: decades, filter: (_, ticks) => ticks, values: (_, ticks) => ticks.map((tick) => quantity(tick * 1e-9, "s", 1)), grid: { ...axis.grid, filter: (_, ticks) => ticks } },
        { ...axis, size: 3.6 * size, splits: decades, filter: (plot, ticks) => thinned(ticks, (0.6 * plot.height) / size), values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : power(tick))), grid: { ...axis.grid, filter: (_, ticks) => ticks } },
      ],
      hooks: { draw: [marks] },
    }, [[], []]);
  }

  window() {
    if (this.pieces.length === 0) return [0, SPAN];
    // A run or a log that is shorter than the window fills the window, from its first second on.
    const [begin, end] = [this.pieces[0].from_ns * 1e-9, this.pieces.at(-1).to_ns * 1e-9];
    return [Math.max(end - SPAN, Math.min(begin, end - 1)), end];
  }

  /** Asks for a drawing. The charts are drawn at most ten times a second, or twice where less motion is asked for. */
  request() {
    if (this.timer) return;
    const every = EVERY * (calm.matches ? 5 : this.sparing ? 2.5 : 1);
    const wait = Math.max(0, this.last + every - performance.now());
    this.timer = setTimeout(() => requestAnimationFrame(() => this.draw()), wait);
  }

  draw() {
    this.timer = 0;
    this.last = performance.now();
    if (!this.force) return;
    this.draws += 1;
    const { pieces } = this;
    // Two points for each piece, at its first and at its last tick: a long piece is a box, and not a slope.
    const times = pieces.flatMap(({ from_ns, to_ns }) => [from_ns * 1e-9, to_ns * 1e-9]);
    const columns = (number, of, scale) => {
      const data = [times];
      for (let i = 0; i < number; i += 1) {
        for (const bound of [1, 0]) {
          data.push(pieces.flatMap((piece) => {
            const range = of(piece, i);
            const value = range ? range[bound] * scale : null;
            return [value, value];
          }));
        }
      }
      return data;
    };
    const show = (figure, data) => {
      figure.plot.setData(data);
      figure.items.forEach((item, i) => {
        const [high, low] = [data[2 * i + 1].at(-1), data[2 * i + 2].at(-1)];
        item.textContent = high === undefined || high === null ? "–" : digits(Math.abs(high) >= Math.abs(low) ? high : low);
      });
    };
    const devices = this.hello.devices.length;
    show(this.force, columns(devices, (piece, i) => piece.hands[i]?.force_norm, 1));
    const axis = this.axis < 0 ? this.widest() : this.axis;
    this.position.name.textContent = `Position ${AXES[axis]}`;
    show(this.position, columns(devices, (piece, i) => piece.hands[i]?.position[axis], 1000));
    show(this.age, columns(this.hello.bodies.length, (piece, i) => piece.bodies[i]?.age, 1000));
    this.bars(this.lateness, this.totals?.lateness, this.totals?.lateness_bins);
    this.bars(this.duration, this.totals?.duration, this.totals?.duration_bins);
  }

  /** The axis along which the hands moved most. */
  widest() {
    const extents = [0, 1, 2].map((axis) => {
      let extent = 0;
      for (let i = 0; i < this.hello.devices.length; i += 1) {
        let [low, high] = [Infinity, -Infinity];
        for (const piece of this.pieces) {
          const range = piece.hands[i]?.position[axis];
          if (range) [low, high] = [Math.min(low, range[0]), Math.max(high, range[1])];
        }
        extent = Math.max(extent, high - low);
      }
      return extent;
    });
    const best = extents.indexOf(Math.max(...extents));
    // The axis stays until another is clearly wider.
    if (extents[best] > 2 * extents[this.chosen]) this.chosen = best;
    return this.chosen;
  }

  bars(figure, times, bins) {
    const hidden = !bins?.length;
    if (figure.figure.hidden !== hidden) {
      figure.figure.hidden = hidden;
      this.resize();
    }
    if (hidden) return;
    figure.times = times;
    figure.item.textContent = times ? `p99 ${quantity(times.p99, "s")}, max ${quantity(times.max, "s")}` : "";
    const [xs, ys] = [[], []];
    let end = 0;
    for (const [upper, ticks] of bins) {
      const lower = Math.max(upper / BIN, end);
      if (end > 0 && lower > end * 1.01) {
        xs.push(end);
        ys.push(0.5);
      }
      xs.push(lower);
      ys.push(ticks);
      end = upper;
    }
    xs.push(end);
    ys.push(0.5);
    figure.plot.setData([xs, ys]);
  }

  resize() {
    for (const figure of [this.force, this.position, this.age, this.lateness, this.duration]) {
      if (!figure) continue;
      const { clientWidth: width, clientHeight: height } = figure.area;
      if (width > 0 && height > 0 && (width !== figure.plot.width || height !== figure.plot.height)) {
        figure.plot.setSize({ width, height });
      }
    }
  }
}

/** The powers of ten, at least one, between the bounds of an axis. */
function decades(_, axis, low, high) {
  const ticks = [];
  for (let tick = 10 ** Math.max(Math.ceil(Math.log10(low) - 1e-9), 0); tick <= high; tick *= 10) ticks.push(tick);
  return ticks;
}

/** Every second or third of the ticks, where all would not fit into `lines` lines. */
function thinned(ticks, lines) {
  const step = Math.ceil(ticks.filter((tick) => tick !== null).length / Math.max(lines, 1));
  let index = -1;
  return ticks.map((tick) => {
    if (tick !== null) index += 1;
    return tick !== null && index % step === 0 ? tick : null;
  });
}

function power(value) {
  return value < 1000 ? String(Math.round(value)) : `10${[...String(Math.round(Math.log10(value)))].map((digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit]).join("")}`;
}

/** Bounds of an axis: around the values, at least `least` wide, and from zero where the quantity has no sign. */
function bounds(low, high, least, fromZero) {
  if (low === null || low === undefined) return [0, least];
  const from = fromZero ? Math.min(low, 0) : low;
  const width = Math.max(high - from, least);
  return fromZero ? [from, from + 1.08 * width] : [(from + high - 1.16 * width) / 2, (from + high + 1.16 * width) / 2];
}
