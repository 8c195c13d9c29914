// What the tests of the page share. A test starts the program on a folder of its own and gets a page that has opened its link.
// After each test: no request went to another host, no script failed, and the content security policy refused nothing.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";
import { Server } from "./server.mjs";

const here = dirname(fileURLToPath(import.meta.url));
const root = join(here, "../../../..");
const screens = join(here, "screens");
const TEST_TIMEOUT = 90_000;

/** All tests, in the order in which they were declared. */
export const tests = [];

/**
 * A test. `body` gets `{ page, server, folder, newPage }`.
 * Options: `media` (files of media/ copied into the folder), `open` (one of them, named on the command line), `args`, `theme`, `size`,
 * `touch`, `timeout` in ms, `flags` of the browser, `expect` (words of faults that are expected), `alone` (no program is started).
 */
export function test(title, options, body = options) {
  tests.push({ title, options: body === options ? {} : options, body });
}

/** Waits until `condition` gives something true, and gives that; `what` says what was waited for. */
export async function until(condition, what = "the condition", timeout = 10_000) {
  const end = Date.now() + timeout;
  let last;
  for (;;) {
    try {
      last = await condition();
      if (last) return last;
    } catch (error) {
      last = error;
    }
    if (Date.now() > end) assert.fail(`waited ${timeout / 1000} s for ${what}; last: ${last instanceof Error ? last.message : JSON.stringify(last)}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

/** Fails where axe-core finds a serious or critical fault in what is shown. */
export async function audit(page, what) {
  await page.evaluate(readFileSync(join(here, "../node_modules/axe-core/axe.min.js"), "utf8"));
  const faults = await page.evaluate(async () => {
    const { violations } = await window.axe.run(document, { resultTypes: ["violations"] });
    return violations
      .filter(({ impact }) => impact === "serious" || impact === "critical")
      .map(({ id, nodes }) => `${id}: ${nodes.slice(0, 3).map(({ html, failureSummary }) => `${html.slice(0, 160)} (${failureSummary.split("\n")[1] ?? ""})`).join(" | ")}`);
  });
  assert.deepEqual(faults, [], `axe-core: ${what}`);
}

/** Both themes: `look(theme)` is called for each, then the page is audited and a picture stored as NAME-THEME.png. */
export async function inBothThemes(page, name, look = async () => {}) {
  for (const theme of ["light", "dark"]) {
    await page.emulateMedia({ colorScheme: theme });
    await until(async () => (await page.evaluate(() => document.documentElement.dataset.theme)) === theme, `the theme ${theme}`);
    await look(theme);
    await audit(page, `${name} (${theme})`);
    await screenshot(page, `${name}-${theme}`);
  }
  await page.emulateMedia({ colorScheme: "light" });
}

/** Stores what is shown in tests/screens/. */
export async function screenshot(page, name) {
  mkdirSync(screens, { recursive: true });
  const path = join(screens, `${name}.png`);
  await page.screenshot({ path });
  return path;
}

/** The same for the documentation, as docs/studio/NAME.webp, where PLUMBLINE_PICTURES is set; needs ffmpeg. */
export async function picture(page, name, width = 1280) {
  const path = await screenshot(page, name);
  if (!process.env.PLUMBLINE_PICTURES) return;
  mkdirSync(join(root, "docs/studio"), { recursive: true });
  const target = join(root, "docs/studio", `${name}.webp`);
  execFileSync("ffmpeg", ["-loglevel", "error", "-y", "-i", path, "-vf", `scale=${width}:-1:flags=lanczos`, "-c:v", "libwebp", "-quality", "80", target]);
}

function findBrowser() {
  const names = ["chromium", "chromium-headless-shell", "google-chrome", "google-chrome-stable", "chromium-browser"];
  const folders = (process.env.PATH ?? "").split(":");
  const found = names.flatMap((name) => folders.map((folder) => join(folder, name))).find((path) => existsSync(path));
  return process.env.CHROMIUM ?? found ?? assert.fail("no Chromium is installed: apt-get install chromium-headless-shell");
}

// Only WebGL is computed by the emulated GPU. What Chromium without a GPU draws on the processor by itself takes ten times as long
// there: a photo with fifty lines was still being drawn when its screenshot was given up.
const FLAGS = [
  "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-accelerated-2d-canvas", "--disable-gpu-rasterization",
  "--disable-background-networking", "--disable-component-update",
];

/** Runs tests one after another in one browser. */
export async function runAll(chosen) {
  const start = Date.now();
  const launch = (flags = []) => chromium.launch({ executablePath: findBrowser(), args: [...FLAGS, ...flags] });
  let browser = null;
  let passed = 0;
  const failed = [];
  for (const test of chosen) {
    const began = Date.now();
    const attempt = async () => {
      const own = test.options.flags ? await launch(test.options.flags) : null;
      if (!own && !browser?.isConnected()) browser = await launch();
      const error = await runOne(test, own ?? browser);
      await own?.close();
      return error;
    };
    let error = await attempt();
    // A browser that shares two cores with the program may miss a moment: what fails is tried again, and each failure is told.
    for (let again = 0; error && again < 2; again++) {
      console.log(`unsteady ${test.file}: ${test.title}: ${error.message}`);
      error = await attempt();
    }
    const seconds = ((Date.now() - began) / 1000).toFixed(1);
    console.log(`${error ? "FAILED" : "ok    "} ${test.file}: ${test.title} (${seconds} s)`);
    if (error) failed.push(test), console.log(String(error.stack ?? error).replace(/^/gm, "       "));
    else passed += 1;
  }
  await browser?.close();
  console.log(`${((Date.now() - start) / 1000).toFixed(0)} s`);
  return { passed, failed: failed.length };
}

async function runOne({ title, options, body, file }, browser) {
  const scratch = mkdtempSync(join(tmpdir(), "studio-test-"));
  const server = new Server(root, scratch);
  const watch = { hosts: new Set(), faults: [] };
  const contexts = [];
  const newPage = async () => {
    const context = await browser.newContext({
      viewport: options.size ?? { width: 1280, height: 720 }, colorScheme: options.theme ?? "light", hasTouch: options.touch ?? false, acceptDownloads: true,
    });
    contexts.push(context);
    context.setDefaultTimeout(15_000);
    const page = await context.newPage();
    observe(page, watch);
    return page;
  };
  let page = null;
  try {
    if (!options.alone) {
      server.prepare(options.media ?? []);
      await server.start(options.open, options.args ?? []);
    }
    page = await newPage();
    if (!options.alone) await page.goto(server.url);
    await withTimeout(body({ page, server, folder: server.folder, newPage }), options.timeout ?? TEST_TIMEOUT);
    assert.deepEqual(watch.faults.filter((fault) => !(options.expect ?? []).some((word) => fault.includes(word))), [], "faults of the page");
    assert.deepEqual([...watch.hosts].filter((host) => !host.startsWith("127.0.0.1:")), [], "requests to other hosts");
    return null;
  } catch (error) {
    if (page) await screenshot(page, `failed ${file} ${title}`.replace(/[^\w.]+/g, "-").slice(0, 100)).catch(() => {});
    error.stack = `${error.stack}\nthe program said:\n${server.said.slice(-2000)}`;
    return error;
  } finally {
    for (const context of contexts) await context.close().catch(() => {});
    await server.kill();
    rmSync(scratch, { recursive: true, force: true });
  }
}

function observe(page, watch) {
  const seen = (url) => { if (/^(https?|wss?):/.test(url)) watch.hosts.add(new URL(url).host); };
  page.on("request", (request) => seen(request.url()));
  page.on("websocket", (socket) => seen(socket.url()));
  page.on("pageerror", (error) => watch.faults.push(`script: ${error.message}`));
  page.on("console", (message) => {
    if (message.type() === "error" && !/ERR_CONNECTION_REFUSED|WebSocket connection|status of (4|5)\d\d/.test(message.text())) watch.faults.push(`console: ${message.text()}`);
  });
}

function withTimeout(promise, ms) {
  let timer;
  const late = new Promise((_, reject) => (timer = setTimeout(() => reject(new Error(`the test took longer than ${ms / 1000} s`)), ms)));
  return Promise.race([promise, late]).finally(() => clearTimeout(timer));
}
