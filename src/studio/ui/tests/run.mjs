// Runs the tests of the page in a real browser: `npm test [-- WORD…]`; with words only files and titles that contain one.
// Needs the built page and program (PLUMBLINE_BIN, by default target/debug/plumbline) and any installed Chromium (CHROMIUM).
import { readdirSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { runAll, tests } from "./harness.mjs";

const here = dirname(fileURLToPath(import.meta.url));
const words = process.argv.slice(2);
for (const file of readdirSync(here).filter((name) => name.endsWith(".spec.mjs")).sort()) {
  const before = tests.length;
  await import(pathToFileURL(join(here, file)).href);
  for (const test of tests.slice(before)) test.file = file;
}
const chosen = tests.filter(({ file, title }) => words.length === 0 || words.some((word) => `${file} ${title}`.includes(word)));
const { passed, failed } = await runAll(chosen);
console.log(`${passed} passed, ${failed} failed`);
process.exit(failed === 0 && passed > 0 ? 0 : 1);
