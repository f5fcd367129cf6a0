// Plays a log in headless Chromium by mouse, and prints what the page shows at each moment, as lines of JSON.
// Arguments: the address of the log, and how often to go to the next event. The variable NODE_PATH names a folder with playwright-core.
const assert = require("assert");
const fs = require("fs");
const { chromium } = require("playwright-core");

const ARGUMENTS = [
  "--no-sandbox", "--disable-gpu-sandbox", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking",
  "--disable-component-update", "--disable-sync",
];
const LONG = 45_000;

const until = (page, condition, argument) => page.waitForFunction(condition, argument, { timeout: LONG, polling: 20 });

/** Waits until the playback is paused and its tick is drawn, and prints what the page shows. */
async function shown(page, after, other = null) {
  await until(page, (other) => {
    const { state: { playback, frame, unconfirmed } } = window.__palpate;
    return playback && !playback.playing && frame && frame.folded.last === playback.tick && unconfirmed === 0 && playback.tick !== other
      && document.getElementById("tick").textContent === String(playback.tick);
  }, other);
  const facts = await page.evaluate(() => {
    const { frame, bodies: [{ step, positions }] } = window.__palpate;
    return {
      tick: Number(document.getElementById("tick").textContent), at: document.getElementById("at").textContent, step,
      bits: [...new Uint32Array(positions.buffer, positions.byteOffset, positions.length)], hands: frame.hands.map(({ position, force }) => [position, force]),
    };
  });
  console.log(`SHOWN ${JSON.stringify({ after, ...facts })}`);
  return facts.tick;
}

(async () => {
  const browser = await chromium.launch({ executablePath: "/usr/bin/chromium", args: ARGUMENTS });
  try {
    const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
    const errors = [];
    page.on("pageerror", (error) => errors.push(error.message));
    await page.goto(process.argv[2]);
    await until(page, () => window.__palpate?.state.playback && window.__palpate.frame);
    const click = (id) => page.locator(`#${id}`).click();
    const pause = async () => {
      if (await page.evaluate(() => window.__palpate.state.playback.playing)) await click("play");
    };

    // The log plays when it is opened. It may have reached its end; the button then plays it again.
    await page.locator("#speed").selectOption("0.1");
    await pause();
    await until(page, () => !window.__palpate.state.playback.playing);
    const home = async () => {
      await page.locator("#timeline").press("Home");
      await until(page, () => window.__palpate.state.playback.tick === 0);
      return shown(page, "start");
    };
    await home();
    await click("play");
    await until(page, () => window.__palpate.state.playback.playing && window.__palpate.state.playback.tick > 5);
    assert.strictEqual(await page.locator("#play").textContent(), "Pause");
    await click("play");
    const paused = await shown(page, "pause");
    await click("forth");
    const stepped = await shown(page, "forth", paused);
    await click("back");
    await shown(page, "back", stepped);
    const { width } = await page.locator("#timeline").boundingBox();
    await page.locator("#timeline").click({ position: { x: width / 2, y: 20 } });
    await shown(page, "scrub", paused);

    let tick = await home();
    for (let i = 0; i < Number(process.argv[3]); i += 1) {
      await click("next");
      tick = await shown(page, "next", tick);
    }

    await page.locator("#timeline").press("End");
    await until(page, () => { const { at_ns, to_ns } = window.__palpate.state.playback; return at_ns === to_ns; });
    await shown(page, "end");
    await until(page, () => window.__palpate.panel === window.__palpate.frame);
    const numbers = await page.evaluate(() => {
      const cell = (key) => Number(document.querySelector(`[data-key="${key}"]`).dataset.value);
      const text = (key) => document.querySelector(`[data-key="${key}"]`).textContent;
      const hands = window.__palpate.frame.hands.map((_, i) => i);
      for (const i of hands) if (text(`hand${i}.peak`) !== cell(`hand${i}.peak`).toFixed(2)) throw new Error("the text of a peak is another number");
      return {
        ticks: cell("ticks"), missed: cell("missed"), peaks: hands.map((i) => cell(`hand${i}.peak`)), age: ["p50", "p99", "max"].map((part) => cell(`age0.${part}`)),
      };
    });
    console.log(`NUMBERS ${JSON.stringify(numbers)}`);

    await page.locator('input[value="stress"]').check();
    await until(page, () => {
      const { view } = window.__palpate;
      return view.bodies[0].stress && view.bodies[0].values === view.bodies[0].stress && !document.getElementById("colour-bar").hidden && view.range[1] > 0;
    });
    const stress = await page.evaluate(() => {
      const { view, bodies: [{ step }] } = window.__palpate;
      const { values } = view.bodies[0];
      return {
        bits: [...new Uint32Array(values.buffer, values.byteOffset, values.length)], step, most: Math.max(...values), range: view.range[1],
        bar: document.getElementById("colour-ticks").textContent,
      };
    });
    console.log(`STRESS ${JSON.stringify(stress)}`);

    for (const [form, begins] of [["SVG", "<svg"], ["PNG", "\x89PNG"], ["CSV", ""]]) {
      const name = `still.${form.toLowerCase()}`;
      const response = await page.request.get(new URL(name, process.argv[2]).href);
      assert.strictEqual(response.status(), 200);
      const media = { SVG: "image/svg+xml", PNG: "image/png", CSV: "text/csv" }[form];
      assert(response.headers()["content-type"].startsWith(media), response.headers()["content-type"]);
      await page.locator("#save summary").click();
      const [download] = await Promise.all([page.waitForEvent("download"), page.getByText(`Still as ${form}`).click()]);
      assert.strictEqual(download.suggestedFilename(), name);
      const bytes = fs.readFileSync(await download.path());
      assert(bytes.length > 1000 && bytes.toString("latin1").includes(begins), `${name} has ${bytes.length} bytes`);
      // A table has a line for each vertex, and each line as many fields as the first.
      if (form === "CSV") {
        const lines = bytes.toString().trim().split("\n").filter((line) => !line.startsWith("#"));
        assert(lines.length > 100 && lines.every((line) => line.split(",").length === lines[0].split(",").length), lines.slice(0, 3).join("\n"));
      }
    }
    assert.deepStrictEqual(errors, []);
  } finally {
    await browser.close();
  }
})().catch((error) => {
  console.error(error);
  process.exit(1);
});
