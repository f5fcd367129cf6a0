// Opens the page in headless Chromium, and compares what the page shows with what the server sent.
// Arguments: the address of a run, and the address of a log. The variable NODE_PATH names a folder with playwright-core.
const assert = require("assert");
const fs = require("fs");
const net = require("net");
const { chromium } = require("playwright-core");

const ARGUMENTS = [
  "--no-sandbox", "--disable-gpu-sandbox", "--enable-unsafe-swiftshader", "--disable-quic",
  "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
];
/** Processor time of a process and its descendants (s). */
function processorTime(root) {
  const stats = fs.readdirSync("/proc").filter((name) => /^\d+$/.test(name)).flatMap((id) => {
    try {
      const fields = fs.readFileSync(`/proc/${id}/stat`, "utf8").replace(/^.*\) /, "").split(" ");
      return [{ id: Number(id), parent: Number(fields[1]), ticks: Number(fields[11]) + Number(fields[12]) }];
    } catch { return []; }
  });
  const within = new Set([root]);
  for (let before = -1; before !== within.size;) {
    before = within.size;
    for (const { id, parent } of stats) if (within.has(parent)) within.add(id);
  }
  return stats.filter(({ id }) => within.has(id)).reduce((sum, { ticks }) => sum + ticks, 0) / 100;
}

const LONG = 90_000;

/** A relay to the server that can be closed, opened and stalled, as the near end of an SSH tunnel. */
class Relay {
  constructor(port) {
    this.port = port;
    this.sockets = new Set();
    this.stalled = false;
  }

  open(at = 0) {
    this.server = net.createServer((near) => {
      const far = net.connect(this.port, "127.0.0.1");
      for (const [from, to] of [[near, far], [far, near]]) {
        this.sockets.add(from);
        from.on("error", () => {});
        from.on("close", () => to.destroy());
        from.on("end", () => to.end());
      }
      near.pipe(far);
      far.on("data", (bytes) => { if (!this.stalled) near.write(bytes); });
    });
    return new Promise((done) => this.server.listen(at, "127.0.0.1", () => done(this.server.address().port)));
  }

  async close() {
    this.server.close();
    for (const socket of this.sockets) socket.destroy();
    this.sockets.clear();
  }
}

async function open(browser, address, errors, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
  const page = await context.newPage();
  page.on("console", (message) => { if (["error", "warning"].includes(message.type())) errors.push(message.text()); });
  page.on("pageerror", (error) => errors.push(error.message));
  await page.addInitScript(() => {
    window.violations = [];
    addEventListener("securitypolicyviolation", (event) => window.violations.push(`${event.violatedDirective} ${event.blockedURI}`));
  });
  await page.goto(address);
  await until(page, () => window.__palpate?.counts.frames > 5 && window.__palpate.panel !== null);
  return page;
}

const until = (page, condition, argument) => page.waitForFunction(condition, argument, { timeout: LONG, polling: 50 });
const state = (page) => page.locator("#connection").getAttribute("data-state");

/** The number of pixels that differ from the background. */
const covered = (page) => page.evaluate(() => {
  const { width, height, pixels } = window.__palpate.pixels();
  const [r, g, b] = [pixels[0], pixels[1], pixels[2]];
  let count = 0;
  for (let i = 0; i < pixels.length; i += 4) count += Math.abs(pixels[i] - r) + Math.abs(pixels[i + 1] - g) + Math.abs(pixels[i + 2] - b) > 12;
  return count / (width * height);
});

async function run(browser, address) {
  const errors = [];
  const target = new URL(address);
  const relay = new Relay(Number(target.port));
  const port = await relay.open();
  target.port = port;
  const page = await open(browser, target.href, errors);

  // The rate depends on the load of the machine; the processor time of a frame does not.
  const measure = () => page.evaluate(() => [performance.now(), window.__palpate.counts.frames]);
  const [begun, time] = [await measure(), processorTime(process.pid)];
  await page.waitForTimeout(4000);
  const [ended, spent] = [await measure(), processorTime(process.pid) - time];
  const rate = ((ended[1] - begun[1]) / (ended[0] - begun[0])) * 1000;
  const each = (1000 * spent) / (ended[1] - begun[1]);
  const cost = await page.evaluate(() => {
    const begun = performance.now();
    for (let i = 0; i < 10; i += 1) {
      for (const body of window.__palpate.view.bodies) body.stale = body.position.needsUpdate = true;
      window.__palpate.view.moved = performance.now();
      window.__palpate.pixels();
    }
    return (performance.now() - begun) / 10;
  });
  console.log(`RATE ${rate.toFixed(1)} frames/s, ${each.toFixed(1)} ms of processor time a frame, ${cost.toFixed(1)} ms for a drawing that is read back`);

  // The frame that is shown: its vertices, their places on the canvas, and the numbers of the page.
  relay.stalled = true;
  await until(page, () => window.__palpate.age > 1.5);
  assert.strictEqual(await state(page), "stalled");
  await until(page, () => window.__palpate.panel === window.__palpate.frame);
  const shown = await page.evaluate(() => {
    const { frame, bodies: [body], view } = window.__palpate;
    view.draw();
    const bits = [...new Uint32Array(body.positions.buffer, body.positions.byteOffset, body.positions.length)];
    // The place of each vertex by the matrices that were drawn with, without the page's own projection.
    const camera = view.camera;
    const [p, v] = [camera.projectionMatrix.elements, camera.matrixWorldInverse.elements];
    const times = (m, x) => [0, 1, 2, 3].map((row) => m[row] * x[0] + m[row + 4] * x[1] + m[row + 8] * x[2] + m[row + 12] * x[3]);
    let worst = 0;
    for (let i = 0; i < body.positions.length; i += 3) {
      const point = [...body.positions.slice(i, i + 3)];
      const clip = times(p, times(v, [...point, 1]));
      const [x, y] = window.__palpate.project(point);
      worst = Math.max(worst, Math.abs(x - (clip[0] / clip[3] + 1) * 0.5 * view.width), Math.abs(y - (1 - clip[1] / clip[3]) * 0.5 * view.height));
    }
    // Pixels: at the vertices inside the sheet the surface is drawn, and at the corners of the canvas it is not.
    const { width, height, pixels } = window.__palpate.pixels();
    const at = (x, y) => [...pixels.slice(4 * (Math.floor(y) * width + Math.floor(x)), 4 * (Math.floor(y) * width + Math.floor(x)) + 3)];
    const background = at(width - 1, 0);
    const edge = Math.round(Math.sqrt(body.positions.length / 3));
    let [hit, tested] = [0, 0];
    for (let row = 2; row < edge - 2; row += 3) {
      for (let column = 2; column < edge - 2; column += 3) {
        const vertex = row * edge + column;
        const [x, y] = window.__palpate.project([...body.positions.slice(3 * vertex, 3 * vertex + 3)]);
        const pixel = at((x / view.width) * width, (1 - y / view.height) * height);
        tested += 1;
        hit += pixel.some((value, i) => Math.abs(value - background[i]) > 12);
      }
    }
    const cell = (key) => Number(document.querySelector(`[data-key="${key}"]`).dataset.value);
    return { number: frame.number, step: body.step, sentStep: frame.bodies[0].vertices.step, bits, worst, hit, tested, totals: frame.totals, hands: frame.hands,
      page: { ticks: cell("ticks"), missed: cell("missed"), trips: cell("trips"), p99: cell("lateness.p99"), max: cell("duration.max"), force: cell("hand0.force"), peak: cell("hand1.peak") },
      text: document.querySelector('[data-key="lateness.p99"]').textContent };
  });
  console.log(`DRAWN ${JSON.stringify({ number: shown.number, step: shown.step, bits: shown.bits })}`);
  assert.strictEqual(shown.step, shown.sentStep);
  assert(shown.worst < 0.01, `projected vertices differ by ${shown.worst} pixels`);
  assert(shown.hit === shown.tested && shown.tested > 50, `${shown.hit} of ${shown.tested} vertices are drawn`);
  assert.deepStrictEqual(shown.page, {
    ticks: shown.totals.ticks, missed: shown.totals.missed, trips: shown.totals.trips, p99: shown.totals.lateness.p99, max: shown.totals.duration.max,
    force: Math.hypot(...shown.hands[0].force), peak: shown.hands[1].peak_force,
  });
  assert.strictEqual(shown.text, `${(shown.totals.lateness.p99 * 1e6).toFixed(1)} µs`);

  // Modes of the view: fewer pixels as wire, and other pixels in colour.
  const shaded = await covered(page);
  await page.keyboard.press("w");
  assert(await page.evaluate(() => { const [body] = window.__palpate.bodies; return body.wire && !body.mesh; }));
  const wire = await covered(page);
  assert(wire > 0.02 && wire < shaded, `wire ${wire}, shaded ${shaded}`);
  await page.locator('input[value="shaded"]').check();
  await page.locator('input[value="displacement"]').check();
  const colours = await page.evaluate(() => {
    const { pixels } = window.__palpate.pixels();
    const seen = new Set();
    for (let i = 0; i < pixels.length; i += 4) if (Math.max(pixels[i], pixels[i + 1], pixels[i + 2]) - Math.min(pixels[i], pixels[i + 1], pixels[i + 2]) > 60) seen.add(`${pixels[i] >> 5} ${pixels[i + 1] >> 5} ${pixels[i + 2] >> 5}`);
    return { seen: seen.size, ticks: document.getElementById("colour-ticks").textContent, range: window.__palpate.view.range[1],
      most: Math.max(...window.__palpate.view.bodies[0].values) };
  });
  assert(colours.seen > 10, `${colours.seen} colours`);
  assert(colours.most <= colours.range && colours.range <= 2 * colours.most && colours.ticks.endsWith("mm"), JSON.stringify(colours));

  // The camera by keyboard.
  await page.locator("#canvas").focus();
  const before = await page.evaluate(() => window.__palpate.view.camera.position.toArray());
  await page.keyboard.press("ArrowLeft");
  await page.keyboard.press("+");
  const after = await page.evaluate(() => window.__palpate.view.camera.position.toArray());
  assert(Math.hypot(...after) < Math.hypot(...before) && Math.abs(after[0] - before[0]) > 1e-3, `${before} ${after}`);
  await page.keyboard.press("?");
  assert(await page.locator("#help").isVisible());
  await page.keyboard.press("Escape");
  assert(!(await page.locator("#help").isVisible()));
  const dark = await page.evaluate(() => window.__palpate.dark);
  await page.keyboard.press("t");
  assert.strictEqual(await page.evaluate(() => window.__palpate.dark), !dark);
  await page.keyboard.press("b");
  assert.strictEqual(await page.locator("#projector").getAttribute("aria-pressed"), "true");
  await page.keyboard.press("b");

  // Nothing is drawn while nothing changes.
  await page.waitForTimeout(1500);
  const still = await page.evaluate(() => window.__palpate.counts.drawn);
  await page.waitForTimeout(800);
  assert.strictEqual(await page.evaluate(() => window.__palpate.counts.drawn), still);

  // The connection breaks off: the last state stays, greyed, with its age. Then the page connects again by itself.
  await relay.close();
  await until(page, () => document.getElementById("connection").dataset.state === "lost");
  assert(await page.evaluate(() => document.body.classList.contains("old") && window.__palpate.age > 1));
  const frames = await page.evaluate(() => window.__palpate.counts.frames);
  relay.stalled = false;
  await relay.open(port);
  await until(page, (frames) => window.__palpate.counts.frames > frames + 5 && window.__palpate.age < 10, frames);
  await until(page, () => document.getElementById("connection").dataset.state === "live");

  // A fifth viewer is told why it sees nothing.
  const others = [];
  for (let i = 0; i < 3; i += 1) {
    const socket = new WebSocketFrom(address);
    others.push(socket);
    await socket.opened;
  }
  const fifth = await browser.newPage();
  await fifth.goto(address);
  await until(fifth, () => document.getElementById("notice").textContent.startsWith("4 viewers are connected already"));
  await fifth.close();
  for (const socket of others) socket.end();

  assert.deepStrictEqual(await page.evaluate(() => window.violations), []);
  const unexpected = errors.filter((text) => !/WebSocket connection|ERR_CONNECTION|GPU stall due to ReadPixels/.test(text));
  assert.deepStrictEqual(unexpected, []);
  await page.context().close();
  await relay.close();
}

/** A viewer without a page, which holds one of the places. */
class WebSocketFrom {
  constructor(address) {
    const { hostname, port, pathname } = new URL(address);
    this.socket = net.connect(Number(port), hostname);
    this.socket.write(`GET ${pathname}socket HTTP/1.1\r\nHost: ${hostname}:${port}\r\nOrigin: http://${hostname}:${port}\r\nUpgrade: websocket\r\n`
      + "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n");
    this.opened = new Promise((done) => this.socket.once("data", done));
    this.socket.on("error", () => {});
  }

  end() {
    this.socket.destroy();
  }
}

async function log(browser, address) {
  const errors = [];
  const page = await open(browser, address, errors, { colorScheme: "dark", reducedMotion: "reduce" });
  assert(await page.evaluate(() => window.__palpate.dark));
  await page.locator("#play").click();
  await until(page, () => window.__palpate.state.playback.playing === false);
  assert.strictEqual(await page.locator("#play").textContent(), "Play");
  const tick = await page.evaluate(() => window.__palpate.state.playback.tick);
  await page.keyboard.press(".");
  await until(page, (tick) => window.__palpate.state.playback.tick === tick + 1, tick);
  assert.strictEqual(await page.locator("#tick").textContent(), String(tick + 1));
  await page.keyboard.press(",");
  await until(page, (tick) => window.__palpate.state.playback.tick === tick, tick);
  await page.locator("#timeline").click({ position: { x: 200, y: 20 } });
  const width = await page.locator("#timeline").evaluate((canvas) => canvas.getBoundingClientRect().width);
  await until(page, (part) => Math.abs(window.__palpate.state.playback.at_ns / 60e9 - part) < 0.01, 200 / width);
  await page.locator("#timeline").focus();
  await page.keyboard.press("End");
  await until(page, () => window.__palpate.state.playback.at_ns === 60e9);
  assert.strictEqual(await page.locator("#timeline").getAttribute("aria-valuenow"), "60.000");
  await page.keyboard.press("[");
  await until(page, () => window.__palpate.state.playback.speed === 0.5);
  await page.locator("#speed").selectOption("2");
  await until(page, () => window.__palpate.state.playback.speed === 2);
  await page.locator(".events button").first().click();
  await until(page, () => window.__palpate.state.playback.at_ns < 60e9);
  await page.locator("#save summary").click();
  const [csv] = await Promise.all([page.waitForEvent("download"), page.getByText("Still as CSV").click()]);
  assert.strictEqual(csv.suggestedFilename(), "still.csv");
  const [png] = await Promise.all([page.waitForEvent("download"), page.keyboard.press("s")]);
  assert(png.suggestedFilename().endsWith(".png"));
  await page.locator("#timeline").press(" ");
  await until(page, () => window.__palpate.state.playback.playing);
  // Every control can be reached by the keyboard, and its focus is visible.
  const reached = new Set();
  for (let i = 0; i < 60; i += 1) {
    await page.keyboard.press("Tab");
    const focus = await page.evaluate(() => {
      const { activeElement: node } = document;
      const shown = node.matches("fieldset input") ? node.nextElementSibling : node;
      return { id: node === document.body ? "BODY" : node.id || node.name || node.className || node.tagName, outline: getComputedStyle(shown).outlineStyle };
    });
    if (focus.id !== "BODY") assert.notStrictEqual(focus.outline, "none", focus.id);
    reached.add(focus.id);
  }
  for (const id of ["theme", "projector", "help-open", "mode", "colour", "hold", "reset", "canvas", "panel", "play", "speed", "timeline"]) assert(reached.has(id), `${id} is not reached: ${[...reached]}`);
  assert.deepStrictEqual(await page.evaluate(() => window.violations), []);
  assert.deepStrictEqual(errors.filter((text) => !/GPU stall due to ReadPixels/.test(text)), []);
}

(async () => {
  const browser = await chromium.launch({ executablePath: "/usr/bin/chromium", args: ARGUMENTS });
  try {
    await run(browser, process.argv[2]);
    await log(browser, process.argv[3]);
  } finally {
    await browser.close();
  }
})().catch((error) => {
  console.error(error);
  process.exit(1);
});
