// Builds the page: `node build.mjs [--watch]`. Gives `dist/`: index.html, main.js, chunks loaded when a workspace opens, one style
// sheet of all `src/**/style.css`, and beside each file its gzip copy, which the program embeds.
import { build, context } from "esbuild";
import { gzipSync } from "node:zlib";
import { copyFileSync, existsSync, mkdirSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { dirname, join, relative } from "node:path";
import { fileURLToPath } from "node:url";

const root = dirname(fileURLToPath(import.meta.url));
const dist = join(root, "dist");
const MAX_COMPRESSED = 1.2e6;

const files = (folder) =>
  readdirSync(folder, { withFileTypes: true }).flatMap((entry) => {
    const path = join(folder, entry.name);
    return entry.isDirectory() ? files(path) : [path];
  });

/** All style sheets in one: the shell's first, so that workspaces may refine it. */
const styles = {
  name: "styles",
  setup(esbuild) {
    esbuild.onResolve({ filter: /^all-styles$/ }, () => ({ path: "all.css", namespace: "styles" }));
    esbuild.onLoad({ filter: /.*/, namespace: "styles" }, () => {
      const own = files(join(root, "src")).filter((path) => path.endsWith("style.css")).sort();
      const shell = join(root, "src/shell/style.css");
      const sheets = [join(root, "node_modules/uplot/dist/uPlot.min.css"), shell, ...own.filter((path) => path !== shell)];
      return {
        contents: sheets.map((path) => `@import ${JSON.stringify(path)};`).join("\n"),
        loader: "css",
        resolveDir: root,
        watchFiles: sheets,
      };
    });
  },
};

const options = {
  absWorkingDir: root,
  entryPoints: { main: "src/main.tsx", style: "all-styles" },
  outdir: dist,
  bundle: true,
  splitting: true,
  format: "esm",
  target: ["es2022"],
  minify: true,
  legalComments: "none", // they are in NOTICES.txt
  chunkNames: "chunks/[name]-[hash]",
  jsx: "automatic",
  jsxImportSource: "preact",
  define: { "process.env.NODE_ENV": '"production"' },
  logLevel: "warning",
  metafile: true,
  plugins: [styles, { name: "finish", setup: (esbuild) => esbuild.onEnd((result) => void finish(result)) }],
};

/** Name, version and license of every package that the page contains. */
function notices(metafile) {
  const folders = Object.keys(metafile.inputs).map((path) => path.match(/^node_modules\/(?:@[^/]+\/)?[^/]+/)?.[0]);
  return [...new Set(folders)].filter(Boolean).sort().map((folder) => {
    const { name, version, license } = JSON.parse(readFileSync(join(root, folder, "package.json"), "utf8"));
    const file = readdirSync(join(root, folder)).find((entry) => /^licen[cs]e/i.test(entry));
    const text = file ? readFileSync(join(root, folder, file), "utf8").trim() : "";
    return `${name} ${version} (${license})\n\n${text}\n`;
  }).join(`\n${"-".repeat(80)}\n\n`);
}

/** The page itself, compressed copies, and what they weigh. */
function finish(result) {
  if (result.errors.length > 0) return;
  const current = new Set(Object.keys(result.metafile.outputs).map((path) => join(root, path)));
  for (const name of ["index.html", "icon.svg"]) {
    copyFileSync(join(root, name), join(dist, name));
    current.add(join(dist, name));
  }
  writeFileSync(join(dist, "NOTICES.txt"), notices(result.metafile));
  current.add(join(dist, "NOTICES.txt"));
  let total = 0;
  for (const path of files(dist)) {
    if (path.endsWith(".gz")) continue;
    if (!current.has(path)) {
      rmSync(path);
      rmSync(`${path}.gz`, { force: true });
      continue;
    }
    const compressed = gzipSync(readFileSync(path), { level: 9 });
    writeFileSync(`${path}.gz`, compressed);
    total += compressed.length;
    if (process.argv.includes("--sizes")) console.log(`${String(compressed.length).padStart(8)}  ${relative(dist, path)}`);
  }
  console.log(`studio page: ${(total / 1e6).toFixed(3)} MB compressed (at most ${MAX_COMPRESSED / 1e6})`);
  if (total > MAX_COMPRESSED) process.exitCode = 1;
}

if (!existsSync(join(root, "node_modules"))) {
  console.error("studio page: packages are missing: npm ci --prefix src/studio/ui");
  process.exit(1);
}
mkdirSync(dist, { recursive: true });
if (process.argv.includes("--watch")) await (await context(options)).watch();
else await build(options).catch(() => process.exit(1));
