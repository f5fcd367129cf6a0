/** The numbers: the loop, the hands, the bodies, the host and the events. */
import { handColour, onTheme, SHAPES } from "./colours.js";
import { calm, count, digits, quantity, seconds, words } from "./format.js";

/** Least time between two changes of the numbers (ms): a person cannot read faster ones. */
const EVERY = 250;
/** Events that are listed. */
const EVENTS = 200;

/** The mark and the seriousness of each state. The mark tells states apart without colour. */
const STATES = {
  normal: ["✓", "good"], live: ["✓", "good"], waiting: ["…", "plain"], recovering: ["↻", "warn"], fading: ["◐", "warn"],
  limited: ["▲", "warn"], slewed: ["▲", "warn"], held: ["■", "bad"], too_fast: ["▲", "bad"], out_of_reach: ["▲", "bad"],
  hot: ["▲", "warn"], engaging: ["↻", "warn"], hands_off: ["■", "bad"], disarmed: ["■", "plain"], stopped: ["■", "bad"],
  silent: ["✕", "bad"], let_go: ["✕", "bad"], device_fault: ["✕", "bad"], not_a_number: ["✕", "bad"],
};
const KINDS = { trip: ["▲", "trip"], missed_deadline: ["✕", "missed deadline"], stale_model: ["◐", "stale model"], worst_tick: ["◆", "worst tick"], tear: ["✂", "tear"], beyond: ["○", "beyond patch"] };

function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name === "text") made.textContent = value;
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

/** The panel. `seek` is called with the time (ns) of an event that the person chooses. */
export class Panel {
  constructor(root) {
    this.root = root;
    this.cells = new Map();
    this.events = [];
    this.number = -1;
    this.seek = null;
    this.last = 0;
    this.recent = [];
    onTheme(() => this.build());
  }

  begin(hello) {
    this.hello = hello;
    this.events = [];
    this.more = 0;
    this.recent = [];
    this.shown = null;
    this.whole = "";
    this.build();
  }

  /** Says that the times are those of the whole log, at every moment of the log. */
  wholeLog() {
    this.whole = "whole log";
    this.times.textContent = this.whole;
  }

  build() {
    const { hello } = this;
    if (!hello) return;
    this.cells.clear();
    this.root.replaceChildren();
    this.group("Loop", [
      ["ticks", "Ticks"], ["rate", "Rate"], ["missed", "Missed deadlines"], ["longest", "Longest in a row"], ["lost", "Records lost", "minor"],
      ["trips", "Trips"], ["stale", "Models too old"],
    ]);
    this.table("Times", ["", "p50", "p99", "max"], [["lateness", "Lateness"], ["duration", "Tick time"], ...hello.bodies.map(({ name }, i) => [`age${i}`, hello.bodies.length > 1 ? `Age, ${name}` : "Model age"])], this.whole);
    this.table("Hands", ["", "Force", "Peak", "Speed", "State"], hello.devices.map(({ name }, i) => [`hand${i}`, name, SHAPES[i], handColour(i)]), "N, N, m/s");
    for (const [i, { name, kind, vertices, elements }] of hello.bodies.entries()) {
      this.group(`${name}`, [
        [`state${i}`, "State"], [`model${i}`, "Model"], [`trust${i}`, "Trust"], [`withheld${i}`, "Withheld", "minor"],
        [`supplied${i}`, "Supplied"], [`stored${i}`, "Stored"], [`raised${i}`, "Raised", "minor"], [`credited${i}`, "Credited losses", "minor"],
        [`epoch${i}`, "Topology epoch", "minor"],
      ], `${kind === name ? "" : `${kind}, `}${count(vertices)} vertices, ${count(elements)} elements`);
    }
    this.group("Host", [
      ["steps", "Host steps"], ["step_rate", "Step rate"], ["skipped", "Left out"], ["publications", "Models"],
      ["solve", "Solve"], ["condense", "Condense"], ["iterations", "Iterations", "minor"], ["factors", "Refactorizations", "minor"], ["faults", "Failed"],
    ]);
    const list = element("ol", { class: "events", "aria-label": "Events, newest first" });
    this.list = list;
    list.addEventListener("keydown", (event) => {
      const item = event.target.closest("li");
      const other = { ArrowDown: item?.nextElementSibling, ArrowUp: item?.previousElementSibling }[event.key]?.querySelector("button");
      if (!other) return;
      event.preventDefault();
      item.querySelector("button").tabIndex = -1;
      other.tabIndex = 0;
      other.focus();
    });
    this.root.append(element("section", { class: "group wide" }, element("h2", { text: "Events" }), list));
    this.listEvents();
    this.show(true);
  }

  group(title, rows, note = "") {
    const list = element("dl");
    for (const [key, name, kind = ""] of rows) {
      const value = element("dd", { "data-key": key, class: "number", text: "–" });
      list.append(element("div", { class: kind }, element("dt", { text: name }), value));
      this.cells.set(key, value);
    }
    const head = element("h2", { text: title });
    if (note) head.append(element("small", { text: note }));
    const section = element("section", { class: "group" }, head, list);
    this.root.append(section);
    if (title === "Host") this.host = section;
  }

  table(title, columns, rows, note = "") {
    const head = element("tr", {}, ...columns.map((text) => element("th", { scope: "col", text })));
    const body = rows.map(([key, name, shape, colour]) => {
      const first = element("th", { scope: "row" });
      if (shape) {
        const mark = element("b", { text: `${shape} ` });
        mark.style.color = colour;
        first.append(mark);
      }
      first.append(name);
      const cells = columns.slice(1).map((column) => {
        const name = `${key}.${column.toLowerCase().split(" ")[0]}`;
        const cell = element("td", { "data-key": name, class: "number", text: "–" });
        this.cells.set(name, cell);
        return cell;
      });
      return element("tr", {}, first, ...cells);
    });
    const small = element("small", { text: note });
    if (title === "Times") this.times = small;
    this.root.append(element("section", { class: "group wide" }, element("h2", { text: title }, small), element("table", {}, element("thead", {}, head), element("tbody", {}, ...body))));
  }

  /** Writes a value. `value` is the number itself, for programs that read the page. */
  set(key, text, value, level) {
    const cell = this.cells.get(key);
    if (!cell) return;
    if (cell.textContent !== text) cell.textContent = text;
    if (value !== undefined && value !== null) cell.dataset.value = value;
    if (level !== undefined && cell.dataset.level !== level) cell.dataset.level = level;
  }

  state(key, state) {
    const [mark, level] = STATES[state] ?? ["?", "plain"];
    this.set(key, `${mark} ${words(state)}`, state, level);
  }

  /** Takes a frame. The numbers change at most four times a second, and at once when nothing follows. */
  frame(frame) {
    this.latest = frame;
    const now = performance.now();
    this.recent.push([now, frame.totals.ticks, frame.time_ns]);
    while (this.recent.length > 2 && now - this.recent[0][0] > 2000) this.recent.shift();
    if (frame.events.length > 0 || frame.more_events > 0) {
      this.events.push(...frame.events);
      this.more += frame.more_events;
      if (this.events.length > EVENTS) this.events.splice(0, this.events.length - EVENTS);
      this.changedEvents = true;
    }
    const every = calm.matches ? 4 * EVERY : EVERY;
    clearTimeout(this.timer);
    if (now - this.last >= every) this.show();
    else this.timer = setTimeout(() => this.show(), every - (now - this.last));
  }

  /** Replaces the events by those of a log. */
  replaceEvents(events) {
    this.events = events.slice(-EVENTS);
    this.more = events.length - this.events.length;
    this.ofLog = true;
    this.listEvents();
  }

  show() {
    const frame = this.latest;
    if (!frame || !this.hello) return;
    this.last = performance.now();
    this.number = frame.number;
    this.shown = frame;
    const { totals } = frame;
    const [first, now] = [this.recent[0], this.recent.at(-1)];
    const rate = now && now[2] > first[2] ? ((now[1] - first[1]) / (now[2] - first[2])) * 1e9 : null;
    this.set("ticks", count(totals.ticks), totals.ticks);
    this.set("rate", rate ? `${count(Math.round(rate))} Hz` : "–", rate, rate && rate < 0.99 * this.hello.tick_rate ? "warn" : "plain");
    this.set("missed", count(totals.missed), totals.missed, totals.missed > 0 ? "warn" : "plain");
    this.set("longest", count(totals.longest_miss), totals.longest_miss);
    this.set("lost", count(totals.lost), totals.lost, totals.lost > 0 ? "warn" : "plain");
    this.set("trips", count(totals.trips), totals.trips, totals.trips > 0 ? "warn" : "plain");
    this.set("stale", count(totals.stale), totals.stale, totals.stale > 0 ? "warn" : "plain");
    const times = (key, distribution) => {
      for (const column of ["p50", "p99", "max"]) {
        this.set(`${key}.${column}`, distribution ? quantity(distribution[column], "s") : "–", distribution?.[column]);
      }
    };
    times("lateness", totals.lateness);
    times("duration", totals.duration);
    totals.model_age.forEach((age, i) => times(`age${i}`, age));
    frame.hands.forEach((hand, i) => {
      const [force, speed] = [Math.hypot(...hand.force), Math.hypot(...hand.velocity)];
      this.set(`hand${i}.force`, force.toFixed(2), force);
      this.set(`hand${i}.peak`, hand.peak_force.toFixed(2), hand.peak_force);
      this.set(`hand${i}.speed`, speed.toFixed(2), speed);
      this.state(`hand${i}.state`, hand.fresh ? hand.safety : "silent");
    });
    frame.bodies.forEach((body, i) => {
      this.state(`state${i}`, body.state);
      this.set(`model${i}`, `no. ${count(body.sequence)}, ${quantity(body.age, "s")} old`, body.sequence);
      this.set(`trust${i}`, body.trust.toFixed(2), body.trust, body.trust < 1 ? "warn" : "plain");
      this.set(`withheld${i}`, `${digits(body.withheld)} N`, body.withheld);
      this.set(`epoch${i}`, count(body.epoch), body.epoch);
      for (const name of ["supplied", "stored", "raised", "credited"]) {
        const value = body.energy[name];
        this.set(`${name}${i}`, quantity(value, "J"), value);
      }
    });
    const { host } = frame;
    if (this.host) this.host.hidden = !host;
    if (host) {
      this.set("steps", count(host.steps), host.steps);
      const slow = host.step_rate < 0.95 * this.hello.step_rate;
      this.set("step_rate", `${host.step_rate.toFixed(0)} of ${this.hello.step_rate.toFixed(0)} Hz`, host.step_rate, slow ? "warn" : "plain");
      this.set("skipped", count(host.skipped), host.skipped, host.skipped > 0 ? "warn" : "plain");
      this.set("publications", count(host.publications), host.publications);
      ["solve", "condense"].forEach((stage, i) => {
        const [last, median] = [host.stages[i], host.medians[i]];
        this.set(stage, `${last === null ? "none" : quantity(last, "s")} (median ${quantity(median, "s")})`, last);
      });
      this.set("iterations", count(host.iterations), host.iterations);
      this.set("factors", count(host.factors), host.factors);
      this.set("faults", count(host.faults), host.faults, host.faults > 0 ? "bad" : "plain");
    }
    if (this.changedEvents && !this.ofLog) this.listEvents();
  }

  listEvents() {
    this.changedEvents = false;
    if (!this.list) return;
    const items = this.events.toReversed().map(({ kind, time_ns, text }, index) => {
      const [mark, name] = KINDS[kind] ?? ["?", words(kind)];
      const parts = [
        element("b", { class: "mark", text: mark, title: name }),
        element("span", { class: "number", text: `${seconds(time_ns)} s` }),
        element("span", { text: kind === "missed_deadline" ? `missed ${text}` : text }),
      ];
      if (!this.ofLog) return element("li", { "data-kind": kind }, ...parts);
      // The Tab key reaches the list once; arrow keys move in the list.
      const button = element("button", { type: "button", title: "Go to this event", tabindex: index === 0 ? "0" : "-1" }, ...parts);
      button.addEventListener("click", () => this.seek?.(time_ns));
      return element("li", { "data-kind": kind }, button);
    });
    if (this.more > 0) items.push(element("li", { text: `${count(this.more)} earlier or further events are not listed.` }));
    if (items.length === 0) items.push(element("li", { class: "none", text: "None so far." }));
    this.list.replaceChildren(...items);
  }
}
