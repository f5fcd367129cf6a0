/** The timeline of a log: the greatest force over the whole log, the events, and the moment that is shown. */
import { onTheme, property } from "./colours.js";
import { seconds } from "./format.js";
import { send } from "./link.js";

const MARKS = { trip: "▲", missed_deadline: "✕", stale_model: "◐", worst_tick: "◆", tear: "✂", beyond: "○" };
/** Least time between two jumps while a person scrubs (ms). */
const EVERY = 40;
/** Least time between two drawings while the log plays (ms). */
const DRAWN_EVERY = 100;

/** The timeline. */
export class Timeline {
  constructor(canvas) {
    this.canvas = canvas;
    this.playback = null;
    this.overview = [];
    this.events = [];
    this.wanted = null;
    this.last = 0;
    this.drawn = -Infinity;
    const at = (event) => {
      const box = canvas.getBoundingClientRect();
      this.scrub((event.clientX - box.left) / box.width);
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      send({ do: "pause" });
      at(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (canvas.hasPointerCapture(event.pointerId)) at(event);
    });
    canvas.addEventListener("pointerup", () => { this.wanted = null; });
    canvas.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.draw()).observe(canvas);
    onTheme(() => this.draw());
  }

  /** Takes how the log is played. */
  take(playback) {
    this.playback = playback;
    if (playback.events.length > 0) this.events = playback.events;
    if (playback.overview.length > 0) this.overview = playback.overview;
    if (!playback.playing || this.wanted !== null) this.request();
    else this.later ||= setTimeout(() => this.request(), Math.max(0, this.drawn + DRAWN_EVERY - performance.now()));
  }

  /** Tells assistive programs where the log is. */
  describe() {
    const { canvas, playback } = this;
    canvas.setAttribute("aria-valuemin", "0");
    canvas.setAttribute("aria-valuemax", seconds(playback.to_ns - playback.from_ns));
    canvas.setAttribute("aria-valuenow", seconds(playback.at_ns - playback.from_ns));
    canvas.setAttribute("aria-valuetext", `${seconds(playback.at_ns)} s, tick ${playback.tick}`);
  }

  /** Goes to a part of the log from 0 to 1. */
  scrub(part) {
    if (!this.playback) return;
    const { from_ns, to_ns } = this.playback;
    const time_ns = Math.round(from_ns + Math.min(Math.max(part, 0), 1) * (to_ns - from_ns));
    this.wanted = time_ns;
    this.request();
    if (this.timer) return;
    const go = () => {
      this.timer = 0;
      if (this.wanted === null) return;
      this.last = performance.now();
      send({ do: "seek", time_ns: this.wanted });
    };
    const wait = this.last + EVERY - performance.now();
    if (wait <= 0) go();
    else {
      this.timer = setTimeout(() => {
        this.wanted ??= time_ns;
        go();
        this.wanted = null;
      }, wait);
    }
  }

  key(event) {
    if (!this.playback || event.altKey || event.ctrlKey || event.metaKey) return;
    const { from_ns, to_ns, at_ns } = this.playback;
    const part = (at_ns - from_ns) / Math.max(to_ns - from_ns, 1);
    const moves = { ArrowLeft: part - 0.01, ArrowRight: part + 0.01, ArrowDown: part - 0.01, ArrowUp: part + 0.01, PageDown: part - 0.1, PageUp: part + 0.1, Home: 0, End: 1 };
    if (!(event.key in moves)) return;
    event.preventDefault();
    event.stopPropagation();
    this.scrub(moves[event.key]);
    this.wanted = null;
  }

  request() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.asked = false;
    clearTimeout(this.later);
    this.later = 0;
    this.drawn = performance.now();
    const { canvas, playback } = this;
    const ratio = devicePixelRatio;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!playback) return;
    this.describe();
    if (width === 0) return;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const span = Math.max(playback.to_ns - playback.from_ns, 1);
    const x = (time_ns) => ((time_ns - playback.from_ns) / span) * width;
    const row = 0.3 * height;
    const peaks = this.overview.map(({ hands }) => Math.max(0, ...hands.map(({ force_norm }) => force_norm?.[1] ?? 0)));
    const most = Math.max(...peaks, 1e-9);
    context.fillStyle = property("--accent");
    context.globalAlpha = 0.45;
    this.overview.forEach(({ from_ns, to_ns }, i) => {
      const size = (peaks[i] / most) * (height - row);
      const left = x(from_ns);
      context.fillRect(left, height - size, Math.max(x(to_ns) - left, 1), size);
    });
    context.globalAlpha = 1;
    context.fillStyle = property("--warn");
    context.font = `${0.85 * row}px ${property("--font")}`;
    context.textAlign = "center";
    let free = -Infinity;
    for (const { kind, time_ns } of this.events) {
      const at = x(time_ns);
      if (at < free) continue;
      context.fillText(MARKS[kind] ?? "?", Math.min(Math.max(at, 5), width - 5), 0.85 * row);
      context.fillRect(at, row, 1, height - row);
      free = at + 2;
    }
    const at = x(this.wanted ?? playback.at_ns);
    context.fillStyle = property("--text");
    context.fillRect(at - 1, 0, 2, height);
    context.beginPath();
    context.arc(Math.min(Math.max(at, 5), width - 5), height - 5, 5, 0, 2 * Math.PI);
    context.fill();
  }
}
