/** Buttons and keys. */
import { isDark, onTheme, setTheme } from "./colours.js";
import { send } from "./link.js";

const SPEEDS = [0.001, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100];

const get = (id) => document.getElementById(id);

/** Connects the buttons and the keys with the view, the charts and the server. */
export function control({ view, charts, state, rescale }) {
  const playing = () => state.playback?.playing === true;
  const actions = {
    play: () => send({ do: playing() ? "pause" : "play" }),
    back: () => send({ do: "step", ticks: -1 }),
    forth: () => send({ do: "step", ticks: 1 }),
    next: () => send({ do: "next" }),
    previous: () => send({ do: "previous" }),
  };
  for (const [id, act] of Object.entries(actions)) get(id).addEventListener("click", act);

  const speed = get("speed");
  for (const factor of SPEEDS) speed.append(new Option(`${factor} ×`, factor));
  speed.addEventListener("change", () => send({ do: "speed", factor: Number(speed.value) }));
  const faster = (steps) => {
    const present = state.playback?.speed ?? 1;
    const at = SPEEDS.findIndex((factor) => factor >= present * 0.999);
    const factor = SPEEDS[Math.min(Math.max((at < 0 ? SPEEDS.length - 1 : at) + steps, 0), SPEEDS.length - 1)];
    send({ do: "speed", factor });
  };

  const radios = (id, choose) => {
    const inputs = [...get(id).querySelectorAll("input")];
    const set = (input) => {
      input.checked = true;
      choose(input.value);
    };
    for (const input of inputs) input.addEventListener("change", () => choose(input.value));
    return () => {
      const shown = inputs.filter((input) => !input.parentElement.hidden);
      set(shown[(shown.findIndex((input) => input.checked) + 1) % shown.length]);
    };
  };
  const nextMode = radios("mode", (mode) => view.setMode(mode));
  const nextColour = radios("colour", (colour) => {
    state.colour = colour;
    send({ do: "stress", on: colour === "stress" });
    view.setColour(colour);
  });
  const hold = get("hold");
  hold.addEventListener("change", () => view.setHold(hold.checked));
  const contacts = get("contacts");
  contacts.addEventListener("change", () => view.setContacts(contacts.checked));
  const saveView = () => view.save(`palpate_${(state.frame?.time_ns ?? 0) / 1e6}ms.png`);
  get("save-view").addEventListener("click", () => {
    saveView();
    get("save").open = false;
  });
  for (const link of get("save").querySelectorAll("a")) link.addEventListener("click", () => { get("save").open = false; });
  get("reset").addEventListener("click", () => view.reset());

  const theme = () => setTheme(isDark() ? "light" : "dark");
  get("theme").addEventListener("click", theme);
  const system = matchMedia("(prefers-color-scheme: dark)");
  setTheme(system.matches ? "dark" : "light");
  system.addEventListener("change", () => setTheme(system.matches ? "dark" : "light"));
  onTheme(() => { get("theme").textContent = isDark() ? "Light" : "Dark"; });
  get("theme").textContent = isDark() ? "Light" : "Dark";
  const projector = () => {
    const root = document.documentElement;
    root.toggleAttribute("data-projector");
    get("projector").setAttribute("aria-pressed", String(root.hasAttribute("data-projector")));
    rescale();
  };
  get("projector").addEventListener("click", projector);
  const help = get("help");
  get("help-open").addEventListener("click", () => help.showModal());
  get("help-close").addEventListener("click", () => help.close());

  get("canvas").addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    const step = 0.1;
    const turns = { ArrowLeft: { turn: -step }, ArrowRight: { turn: step }, ArrowUp: { tilt: -step }, ArrowDown: { tilt: step } };
    const moves = { ArrowLeft: { right: -0.05 }, ArrowRight: { right: 0.05 }, ArrowUp: { rise: 0.05 }, ArrowDown: { rise: -0.05 } };
    const move = (event.shiftKey ? moves : turns)[event.key];
    if (!move) return;
    event.preventDefault();
    view.move(move);
  });

  const keys = {
    "?": () => (help.open ? help.close() : help.showModal()),
    t: theme, b: projector, w: nextMode, c: nextColour, s: saveView, x: () => charts.nextAxis(),
    h: () => hold.click(), f: () => contacts.click(),
    0: () => view.reset(), 1: () => view.reset(1), 2: () => view.reset(2), 3: () => view.reset(3),
    "+": () => view.move({ zoom: 1 / 1.15 }), "=": () => view.move({ zoom: 1 / 1.15 }), "-": () => view.move({ zoom: 1.15 }),
  };
  const logKeys = {
    " ": actions.play, ",": actions.back, ".": actions.forth, n: actions.next, p: actions.previous,
    "[": () => faster(-1), "]": () => faster(1),
  };
  addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey || event.defaultPrevented) return;
    const { target, key } = event;
    const name = key.length === 1 ? key.toLowerCase() : key;
    if (help.open && name !== "?") return;
    if (target.tagName === "SELECT") return;
    // The space bar presses the button in focus.
    if (name === " " && (target.tagName === "BUTTON" || target.tagName === "INPUT" || target.tagName === "SUMMARY" || target.tagName === "A")) return;
    const act = keys[name] ?? (state.playback ? logKeys[name] : undefined);
    if (!act) return;
    event.preventDefault();
    act();
  });
}

/** Shows how the log is played. */
export function showPlayback(playback, fromStart) {
  get("playback").hidden = false;
  const play = get("play");
  play.textContent = playback.playing ? "Pause" : "Play";
  play.setAttribute("aria-pressed", String(playback.playing));
  get("at").textContent = (playback.at_ns * 1e-9).toFixed(3);
  get("length").textContent = (playback.to_ns * 1e-9).toFixed(3);
  get("tick").textContent = String(playback.tick);
  const speed = get("speed");
  const known = [...speed.options].find(({ value }) => Number(value) === playback.speed);
  if (!known && fromStart) speed.append(new Option(`${playback.speed} ×`, playback.speed));
  speed.value = String(playback.speed);
}
