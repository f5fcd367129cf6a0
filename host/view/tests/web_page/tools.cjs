// Opens a log with two tools in headless Chromium, and checks their ghosts, their forces and the points that they may touch.
// Arguments: the address of the log, and optionally a file for a picture. The variable NODE_PATH names a folder with playwright-core.
const assert = require("assert");
const { chromium } = require("playwright-core");

const ARGUMENTS = [
  "--no-sandbox", "--disable-gpu-sandbox", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking",
  "--disable-component-update", "--disable-sync",
];

(async () => {
  const browser = await chromium.launch({ executablePath: "/usr/bin/chromium", args: ARGUMENTS });
  try {
    const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
    const errors = [];
    page.on("pageerror", (error) => errors.push(error.message));
    const until = (condition) => page.waitForFunction(condition, undefined, { timeout: 45_000, polling: 20 });
    await page.goto(process.argv[2]);
    await until(() => window.__palpate?.state.playback && window.__palpate.frame);
    await page.locator("#timeline").focus();
    await page.keyboard.press("End");
    await until(() => window.__palpate.frame.tools?.length === 2 && window.__palpate.state.playback.at_ns === window.__palpate.state.playback.to_ns);
    await page.evaluate(() => window.__palpate.pixels());
    const tools = await page.evaluate(() => {
      const { frame, view } = window.__palpate;
      return view.tools.map(({ info, ghost, arrow, line, group }, index) => ({
        state: frame.tools[index], visible: group.visible,
        at: frame.obstacles[info.obstacle].pose.slice(0, 3), ghost: [...ghost.position.toArray(), ...ghost.quaternion.toArray()],
        arrow: arrow.group.visible && arrow.group.position.toArray(), line: [...line.geometry.attributes.position.array],
      }));
    });
    for (const { state, visible, at, ghost, arrow, line } of tools) {
      assert(visible);
      assert.deepStrictEqual(ghost, state.led);
      assert.deepStrictEqual(arrow, at);
      assert.deepStrictEqual(line, [...Float32Array.from([...state.led.slice(0, 3), ...at])]);
      assert(Math.hypot(...at.map((x, axis) => x - state.led[axis])) > 1e-4);
    }
    const sites = tools.flatMap(({ state }) => state.sites);
    const shown = await page.evaluate(() => {
      const { geometry } = window.__palpate.view.sites;
      return [...geometry.attributes.position.array.slice(0, 3 * geometry.drawRange.count)];
    });
    assert.deepStrictEqual(shown, [...Float32Array.from(sites.flat())]);
    /** The number of pixels that hiding a part changes. */
    const covered = (part) => page.evaluate((part) => {
      const { view, pixels } = window.__palpate;
      const parts = part === "sites" ? [view.sites] : view.tools.map((tool) => tool[part].group ?? tool[part]);
      const before = pixels().pixels;
      const draw = view.updateTools;
      view.updateTools = () => {};
      for (const each of parts) each.visible = false;
      const after = pixels().pixels;
      for (const each of parts) each.visible = true;
      view.updateTools = draw;
      let count = 0;
      for (let i = 0; i < before.length; i += 4) count += Math.abs(before[i] - after[i]) + Math.abs(before[i + 1] - after[i + 1]) + Math.abs(before[i + 2] - after[i + 2]) > 12;
      return count;
    }, part);
    for (const [part, least] of [["sites", 200], ["ghost", 500], ["arrow", 20]]) {
      const count = await covered(part);
      assert(count > least, `${part} covers ${count} pixels`);
    }
    if (process.argv[3]) await page.screenshot({ path: process.argv[3] });
    assert.deepStrictEqual(errors, []);
    console.log(`SITES ${sites.length}`);
  } finally {
    await browser.close();
  }
})().catch((error) => {
  console.error(error);
  process.exit(1);
});
