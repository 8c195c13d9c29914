// Pages without the program: a script of the tests, bundled and served to the browser by the test itself.
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const bundles = new Map();

/** Nobody listens here: the test answers every request. */
export const ADDRESS = "http://127.0.0.1:1/";

async function bundle(name) {
  if (!bundles.has(name)) {
    const { outputFiles } = await build({
      entryPoints: [join(here, name)], bundle: true, write: false, format: "esm", jsx: "automatic", jsxImportSource: "preact", logLevel: "error",
    });
    bundles.set(name, outputFiles[0].text);
  }
  return bundles.get(name);
}

/** Shows a page with one script of this folder and the style sheet of the studio. `answers`: JSON by path, for requests of the script. */
export async function openAlone(page, name, answers = {}) {
  const html = '<!doctype html><html lang="en"><head><title>test</title><link rel="stylesheet" href="style.css"></head><body><div id="studio"></div><script type="module" src="main.js"></script></body></html>';
  const files = {
    "/": ["text/html", html],
    "/main.js": ["text/javascript", await bundle(name)],
    "/style.css": ["text/css", readFileSync(join(here, "../dist/style.css"), "utf8")],
  };
  for (const [path, value] of Object.entries(answers)) files[path] = ["application/json", JSON.stringify(value)];
  await page.route(`${ADDRESS}**`, (route) => {
    const [contentType, body] = files[new URL(route.request().url()).pathname] ?? ["text/plain", ""];
    return route.fulfill({ contentType, body });
  });
  await page.goto(ADDRESS);
}
