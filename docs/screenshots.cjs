// Makes pictures of the page. Arguments: the folder for the pictures, a moment of a log (s), and the command that serves
// the page of the log.
const { spawn } = require("child_process");
const path = require("path");
const { chromium } = require("playwright-core");

const PICTURES = [
  { name: "view_page", scheme: "light", keys: ["c"] },
  { name: "view_page_dark", scheme: "dark", keys: ["c", "w", "w"] },
];

/** The first address that the command prints. */
function address(server) {
  return new Promise((done, fail) => {
    let text = "";
    const read = (bytes) => {
      text += bytes;
      const found = /http:\S+\/[0-9a-f]{32}\//.exec(text);
      if (found) done(found[0]);
    };
    server.stdout.on("data", read);
    server.stderr.on("data", read);
    server.on("exit", (code) => fail(new Error(`the command ended with code ${code}:\n${text}`)));
  });
}

(async () => {
  const [folder, moment, program, ...options] = process.argv.slice(2);
  const server = spawn(program, options);
  const at = await address(server);
  server.removeAllListeners("exit");
  const browser = await chromium.launch({
    executablePath: "/usr/bin/chromium",
    args: ["--no-sandbox", "--disable-gpu-sandbox", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run"],
  });
  try {
    for (const { name, scheme, keys } of PICTURES) {
      const page = await browser.newPage({ viewport: { width: 1280, height: 800 }, colorScheme: scheme });
      await page.goto(at);
      await page.waitForFunction(() => window.__palpate?.frame && window.__palpate.state.playback);
      // The log stands still at the moment, with the curves before it.
      await page.evaluate((time_ns) => {
        window.__palpate.send({ do: "pause" });
        window.__palpate.send({ do: "seek", time_ns });
      }, Math.round(1e9 * moment));
      await page.waitForFunction((time_ns) => {
        const { playing, at_ns } = window.__palpate.state.playback;
        return !playing && at_ns === time_ns && window.__palpate.frame.time_ns === time_ns;
      }, Math.round(1e9 * moment));
      // The page is loaded again, so that it has not missed frames.
      await page.reload();
      await page.waitForFunction((time_ns) => window.__palpate?.frame?.time_ns === time_ns && window.__palpate.state.playback, Math.round(1e9 * moment));
      for (const key of keys) await page.keyboard.press(key);
      await page.keyboard.press("0");
      // A picture at rest is drawn again, with smooth edges, and the charts follow.
      await page.waitForTimeout(2500);
      await page.screenshot({ path: path.join(folder, `${name}.png`) });
      console.log(path.join(folder, `${name}.png`));
      await page.close();
    }
  } finally {
    await browser.close();
    server.kill();
  }
})().catch((error) => {
  console.error(error);
  process.exit(1);
});
