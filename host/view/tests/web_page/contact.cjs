// Opens a log with contact in headless Chromium, and checks that the obstacle is drawn and that a key shows the forces.
// Argument: the address of the log. The variable NODE_PATH names a folder with playwright-core.
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
    await until(() => window.__palpate.frame.contacts?.length > 0 && window.__palpate.state.playback.at_ns === window.__palpate.state.playback.to_ns);

    // The obstacle is where the frame has it, and covers pixels.
    const pose = await page.evaluate(() => {
      const { frame, view: { obstacles: [{ mesh }] } } = window.__palpate;
      return [frame.obstacles[0].pose, [...mesh.position.toArray(), ...mesh.quaternion.toArray()]];
    });
    assert.deepStrictEqual(pose[1], pose[0]);
    /** The number of pixels that another state of the view changes. */
    const changed = (act) => page.evaluate((act) => {
      const { view, pixels } = window.__palpate;
      const before = pixels().pixels;
      const { mesh } = view.obstacles[0];
      if (act === "hide") mesh.visible = !mesh.visible;
      else document.getElementById("contacts").click();
      const after = pixels().pixels;
      let count = 0;
      for (let i = 0; i < before.length; i += 4) count += Math.abs(before[i] - after[i]) + Math.abs(before[i + 1] - after[i + 1]) + Math.abs(before[i + 2] - after[i + 2]) > 12;
      return count;
    }, act);
    const hidden = await changed("hide");
    assert.strictEqual(await changed("hide"), hidden);
    assert(hidden > 1000, `the obstacle covers ${hidden} pixels`);

    // The key shows the forces, one line for each contact, and hides them again.
    assert(await page.locator("#contacts-label").isVisible());
    const forces = () => page.evaluate(() => {
      const { view: { pushes, contacts } } = window.__palpate;
      return { shown: pushes.visible, lines: pushes.geometry.drawRange.count / 2, contacts: contacts.length };
    });
    await page.locator("#canvas").focus();
    assert.strictEqual((await forces()).shown, false);
    await page.keyboard.press("f");
    await page.evaluate(() => window.__palpate.pixels());
    const seen = await forces();
    assert(seen.shown && seen.contacts > 0 && seen.lines === seen.contacts, JSON.stringify(seen));
    assert(await page.locator("#contacts").isChecked());
    const lines = await changed("forces");
    assert(lines > 50, `the forces cover ${lines} pixels`);
    assert.strictEqual((await forces()).shown, false);
    // The clusters in colour: as many colours as clusters, and pixels of many of them.
    await page.locator('input[value="clusters"]').check();
    const clusters = await page.evaluate(() => {
      const { view, pixels } = window.__palpate;
      pixels();
      const [values, { clusters }] = [view.bodies[0].values, view.hello.bodies[0]];
      return { colours: new Set(values).size, clusters: new Set(clusters).size, each: values.length === view.bodies[0].surface.vertices, bar: view.bar() };
    });
    assert(clusters.each && clusters.clusters > 10 && clusters.colours === clusters.clusters && clusters.bar === null, JSON.stringify(clusters));
    await page.locator("#canvas").focus();
    // The overlaps: a mark for each contact in the colour of its depth.
    await page.keyboard.press("c");
    assert(await page.locator('input[value="overlaps"]').isChecked());
    const overlaps = await page.evaluate(() => {
      const { view, pixels } = window.__palpate;
      const { overlaps } = view;
      const count = (a, b) => a.filter((x, i) => Math.abs(x - b[i]) > 12).length;
      const shown = pixels().pixels;
      overlaps.visible = false;
      const hidden = pixels().pixels;
      overlaps.visible = true;
      const depths = view.contacts.map(({ depth }) => depth);
      const red = overlaps.geometry.attributes.color.array.filter((_, i) => i % 3 === 0 && i < 3 * depths.length);
      return {
        depths, colours: new Set(red).size, marks: overlaps.geometry.drawRange.count, pixels: count(shown, hidden), range: view.range, bar: view.bar(), coloured: view.coloured,
      };
    });
    const deepest = Math.max(...overlaps.depths);
    assert(deepest > 0 && overlaps.range[1] >= deepest && overlaps.range[1] < 2 * deepest, JSON.stringify(overlaps));
    assert(overlaps.marks === seen.contacts && overlaps.colours > 1 && overlaps.pixels > 1000 && !overlaps.coloured, JSON.stringify(overlaps));
    assert(overlaps.bar.name === "Depth of contacts" && !overlaps.bar.empty && overlaps.bar.ticks.at(-1).endsWith("m"), JSON.stringify(overlaps.bar));
    await page.keyboard.press("c");
    assert(await page.locator('input[value="none"]').isChecked());
    assert.strictEqual(await page.evaluate(() => window.__palpate.view.overlaps.visible), false);
    assert.deepStrictEqual(errors, []);
    console.log(`CONTACTS ${seen.contacts}`);
  } finally {
    await browser.close();
  }
})().catch((error) => {
  console.error(error);
  process.exit(1);
});
