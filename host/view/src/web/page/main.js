/**
 * The page. It shows a run or a log that `palpate view --web` serves.
 *
 * `link.js` receives messages and sends commands; `scene.js`, `charts.js`, `panel.js` and `timeline.js` each show a part
 * of a message. A further display registers for its kind of message with `on` and sends its commands with `send`.
 *
 * For tests, `window.__palpate` gives the state of the page; see the end of this file.
 */
import { Charts } from "./charts.js";
import { isDark, onTheme, property, table } from "./colours.js";
import { control, showPlayback } from "./controls.js";
import { connect, drawn, link, on, send } from "./link.js";
import { decode, Kind } from "./message.js";
import { Panel } from "./panel.js";
import { View } from "./scene.js";
import { Timeline } from "./timeline.js";

const get = (id) => document.getElementById(id);
const state = { hello: null, frame: null, playback: null, colour: "none", run: null };
const counts = { frames: 0, drawn: 0, surfaces: 0, gaps: 0 };
const times = [];
/** Least time between two changes of the numbers beside the timeline while a log plays (ms). */
const PLAYBACK_EVERY = 100;

setText(get("age-unit"), "");
document.documentElement.dataset.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
const view = new View(get("canvas"), get("labels"));
const charts = new Charts(get("charts"));
charts.sparing = view.software;
const panel = new Panel(get("panel"));
const timeline = new Timeline(get("timeline"));

function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** Shows a line to the person; an empty line hides it. */
function notice(line, seconds = 0) {
  const node = get("notice");
  node.hidden = line === "";
  setText(node, line);
  clearTimeout(notice.timer);
  if (seconds > 0) notice.timer = setTimeout(() => notice(""), 1000 * seconds);
}

on(Kind.HELLO, (hello) => {
  // A server that has restarted the same run keeps the camera.
  const same = state.hello?.run === hello.run && state.hello?.file === hello.file && JSON.stringify(state.hello?.bodies) === JSON.stringify(hello.bodies);
  state.hello = hello;
  state.playback = null;
  get("playback").hidden = true;
  setText(get("scene-name"), hello.scene || hello.file.split("/").at(-1) || "run");
  const facts = hello.source === "log" ? [`log ${hello.file.split("/").at(-1)}`] : ["run"];
  facts.push(`${hello.clock} clock`, `scheme ${hello.scheme}`, `${hello.tick_rate} Hz`);
  setText(get("facts"), facts.join(" · "));
  document.title = `${hello.scene || "Palpate"} – Palpate`;
  get("labels").dataset.log = String(hello.source === "log");
  for (const id of ["contacts-label", "clusters-label", "overlaps-label"]) get(id).hidden = !hello.touches;
  if (!same) view.begin(hello);
  charts.begin(hello);
  panel.begin(hello);
  if (state.colour === "stress") send({ do: "stress", on: true });
  notice("");
});

on(Kind.SURFACE, (surface) => {
  counts.surfaces += 1;
  view.surface(surface);
});

on(Kind.FRAME, (frame) => {
  counts.frames += 1;
  state.frame = frame;
  state.arrived = performance.now();
  times.push(state.arrived);
  if (times.length > 600) times.splice(0, 300);
  state.unconfirmed = (state.unconfirmed ?? 0) + 1;
  view.frame(frame);
  charts.frame(frame);
  panel.frame(frame);
});

on(Kind.HISTORY, (pieces) => charts.replace(pieces));

on(Kind.PLAYBACK, (playback) => {
  const first = state.playback === null;
  const turned = first || state.playback.playing !== playback.playing;
  state.playback = playback;
  timeline.take(playback);
  if (first) panel.wholeLog();
  if (playback.events.length > 0) panel.replaceEvents(playback.events);
  // While the log plays, its numbers change ten times a second: a person cannot read faster ones.
  clearTimeout(state.playbackTimer);
  const wait = (state.playbackShown ?? -Infinity) + PLAYBACK_EVERY - performance.now();
  const show = () => {
    state.playbackShown = performance.now();
    showPlayback(state.playback, first);
  };
  if (turned || !playback.playing || wait <= 0) show();
  else state.playbackTimer = setTimeout(show, wait);
  if (first) {
    const lacks = [...playback.notes];
    if (!playback.complete) lacks.unshift("The log has no end: its writer was killed.");
    get("view-note").hidden = lacks.length === 0;
    setText(get("view-note"), lacks.join(" "));
  }
  if (turned || !playback.playing) clock();
});

on(Kind.END, () => clock());
on(Kind.REFUSED, (line) => notice(line));
on("line", (line) => notice(line, 8));
on("state", () => {
  if (link.state === "lost") state.unconfirmed = 0;
  clock();
});

view.changed = () => {
  const bar = view.bar();
  get("colour-bar").hidden = bar === null;
  if (bar) {
    setText(get("colour-name"), bar.empty ? `${bar.name}: not in the frames` : bar.name);
    get("colour-scale").hidden = bar.empty;
    get("colour-ticks").hidden = bar.empty;
    const ticks = get("colour-ticks");
    if (ticks.dataset.text !== bar.ticks.join()) {
      ticks.dataset.text = bar.ticks.join();
      ticks.replaceChildren(...bar.ticks.map((text) => Object.assign(document.createElement("span"), { textContent: text })));
    }
  }
  setText(get("legend"), view.legend());
  counts.drawn += 1;
  while (state.unconfirmed > 0) {
    state.unconfirmed -= 1;
    drawn();
  }
};
const scale = get("colour-scale").getContext("2d");
scale.putImageData(new ImageData(table(), 256, 1), 0, 0);

/** Seconds since the frame that is shown arrived. */
function age() {
  return state.frame ? (performance.now() - state.arrived) / 1000 : null;
}

function inWords(seconds) {
  if (seconds < 10) return `${seconds.toFixed(2)} s`;
  if (seconds < 120) return `${seconds.toFixed(0)} s`;
  return seconds < 7200 ? `${(seconds / 60).toFixed(0)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

/** Shows the state of the connection, and how old the frame is. */
function clock() {
  const seconds = age();
  const paused = state.playback && !state.playback.playing;
  const ended = state.frame?.last || link.state === "ended";
  let [mark, text] = ["live", state.hello?.source === "log" ? "playing" : "live"];
  if (link.state === "connecting") [mark, text] = ["waiting", "connecting"];
  else if (link.state === "refused") [mark, text] = ["lost", "refused"];
  else if (link.state === "lost") [mark, text] = ["lost", "connection lost, connecting again"];
  else if (ended) [mark, text] = ["ended", "the run is over"];
  else if (paused) [mark, text] = ["paused", "paused"];
  else if (seconds === null) [mark, text] = ["waiting", "waiting for the first frame"];
  else if (seconds > 0.5) [mark, text] = ["stalled", "no new frame"];
  get("connection").dataset.state = mark;
  setText(get("connection-text"), text);
  const settled = (paused || ended) && link.state === "open";
  setText(get("age"), seconds === null ? "–" : settled || (link.state === "ended") ? `${(state.frame.time_ns * 1e-9).toFixed(3)} s` : inWords(seconds));
  setText(get("age-unit"), seconds === null ? "" : settled || link.state === "ended" ? "of the run" : "old");
  document.body.classList.toggle("old", mark === "lost" || mark === "stalled");
  setText(get("dropped"), String(state.frame?.dropped ?? 0));
}
setInterval(clock, 200);

panel.seek = (time_ns) => {
  send({ do: "pause" });
  send({ do: "seek", time_ns });
};
control({ view, charts, state, rescale: () => requestAnimationFrame(() => { charts.build(); view.restyle(); timeline.draw(); }) });
onTheme(() => view.request());
connect();

/**
 * For tests. `frame` is the last frame, decoded. `shown.bodies` has the positions that are drawn, with the step that they
 * belong to, and `project` gives the pixel of a point. `pixels()` draws and returns the pixels. `panel` is the frame
 * whose numbers the page shows.
 */
window.__palpate = Object.freeze({
  link, counts, state, view, charts, decode, send,
  get frame() { return state.frame; },
  get panel() { return panel.shown; },
  get age() { return age(); },
  get dark() { return isDark(); },
  background: () => property("--view"),
  /** Frames a second over the last `seconds`. */
  rate(seconds = 2) {
    const now = performance.now();
    return times.filter((time) => now - time < 1000 * seconds).length / seconds;
  },
  get bodies() {
    return view.bodies.map((body) => ({ ...body.shown, positions: body.position.array, triangles: body.surface.triangles, mesh: body.mesh.visible, wire: body.wire.visible }));
  },
  project: (point) => view.project(point),
  pixels: () => view.readPixels(),
});
