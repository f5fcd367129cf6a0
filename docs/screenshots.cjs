// Makes pictures of the page. Arguments: the folder for the pictures, and the command that serves the page.
const { spawn } = require("child_process");
const path = require("path");
const { chromium } = require("playwright-core");

const PICTURES = [
  { name: "view_light", scheme: "light", keys: ["c"] },
  { name: "view_dark", scheme: "dark", keys: ["c", "w", "w"] },
  { name: "view_projector", scheme: "light", keys: ["c", "b"] },
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
  const [folder, program, ...options] = process.argv.slice(2);
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
      await page.waitForFunction(() => window.__palpate?.counts.frames > 20);
      for (const key of keys) await page.keyboard.press(key);
      // The curves fill their window, and the view is framed again at its present size.
      await page.waitForTimeout(12_000);
      await page.keyboard.press("0");
      await page.waitForTimeout(1500);
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
