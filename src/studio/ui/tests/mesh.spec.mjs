// The mesh workspace as a user works with it: open, select, make handles, drag, type, undo, keys, play, save; then `plumbline run` on
// the saved file writes what the studio showed.
import assert from "node:assert/strict";
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { inBothThemes, picture, screenshot, test, until } from "./harness.mjs";

/** A tower of `levels` squares along y, as the text of an OBJ file: thin enough to bend. */
export function tower(levels = 24, side = 4, offset = [0, 0, 0]) {
  const lines = [];
  const ring = [];
  for (let k = 0; k < side; k++) ring.push([k / side, 0], [1, k / side], [1 - k / side, 1], [0, 1 - k / side]);
  const order = [0, 1, 2, 3].flatMap((s) => Array.from({ length: side }, (_, k) => 4 * k + s));
  const around = order.map((i) => ring[i]);
  for (let y = 0; y <= levels; y++) {
    for (const [x, z] of around) lines.push(`v ${x + offset[0]} ${(y * 4) / levels + offset[1]} ${z + offset[2]}`);
  }
  const n = around.length;
  for (let y = 0; y < levels; y++) {
    for (let k = 0; k < n; k++) {
      const [a, b] = [y * n + k + 1, y * n + ((k + 1) % n) + 1];
      lines.push(`f ${a} ${a + n} ${b + n} ${b}`);
    }
  }
  return { text: `${lines.join("\n")}\n`, ring: n, levels };
}

const positions = (text) => text.split("\n").filter((line) => line.startsWith("v ")).map((line) => line.split(/\s+/).slice(1, 4).map(Number));

function farthest(a, b) {
  assert.equal(a.length, b.length);
  return Math.max(...a.map((p, i) => Math.hypot(p[0] - b[i][0], p[1] - b[i][1], p[2] - b[i][2])));
}

const DIAGONAL = Math.hypot(1, 4, 1);

/** Opens a mesh that was written into the folder of the session. */
async function openMesh({ page, server }, name = "tower.obj", made = tower()) {
  await pick(page, server, name, made);
  await page.getByRole("application", { name: /3D view/ }).waitFor();
  await atRest(page);
  return made;
}

/** Opens the file by the picker. */
async function pick(page, server, name, made) {
  if (!existsSync(join(server.folder, name))) writeFileSync(join(server.folder, name), made.text);
  await page.locator(".shell[data-ready=true]").waitFor();
  await page.keyboard.press("Control+o");
  await page.getByRole("combobox", { name: "Find in this folder" }).fill(name);
  await page.getByRole("option", { name }).waitFor();
  await page.keyboard.press("Enter");
}

const atRest = (page) => until(async () => /At rest$/.test((await page.getByText(/^(At rest|At rest \(preview\)|Solves|Settles|Factors|Follows).*$/).first().textContent()) ?? ""), "rest", 20_000);

async function selectVertices(page, text) {
  const field = page.getByLabel("Vertices", { exact: true });
  await field.fill(text);
  await field.press("Enter");
}

const handles = (page) => page.getByRole("listbox", { name: "Handles" });

async function makeTowerHandles(page, made) {
  await selectVertices(page, `0-${made.ring - 1}`);
  await page.getByRole("button", { name: "Fixed", exact: true }).first().click();
  await until(async () => (await handles(page).getByRole("option").count()) === 1, "the first handle");
  const last = made.ring * (made.levels + 1) - 1;
  await selectVertices(page, `${last - made.ring + 1}-${last}`);
  await page.getByRole("button", { name: "Rigid", exact: true }).first().click();
  await until(async () => (await handles(page).getByRole("option").count()) === 2, "the second handle");
}

async function exported(page, label = "Mesh") {
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: label, exact: true }).click()]);
  return readFileSync(await download.path(), "utf8");
}

async function save(page) {
  await page.keyboard.press("Control+s");
  await until(async () => !(await page.title()).startsWith("•"), "the files to be saved");
}

const number = (page, label) => page.getByLabel(label, { exact: true });

async function type(page, label, value) {
  await number(page, label).fill(String(value));
  await number(page, label).press("Enter");
}

/** The value of an input once it has not changed for half a second. */
async function steady(input) {
  let [value, since] = [await input.inputValue(), Date.now()];
  return until(async () => {
    const now = await input.inputValue();
    if (now !== value) [value, since] = [now, Date.now()];
    return Date.now() - since > 500 && value;
  }, "a value that stays");
}

/** The center of the view in pixels of the page, and a point `dx`, `dy` from there. */
async function inView(page, dx = 0, dy = 0) {
  const box = await page.getByRole("application", { name: /3D view/ }).boundingBox();
  return { x: box.x + box.width / 2 + dx, y: box.y + box.height / 2 + dy, box };
}

async function dragMouse(page, from, to, steps = 8) {
  await page.mouse.move(from.x, from.y);
  await page.mouse.down();
  for (let k = 1; k <= steps; k++) await page.mouse.move(from.x + ((to.x - from.x) * k) / steps, from.y + ((to.y - from.y) * k) / steps);
  await page.mouse.up();
}

test("a tower is bent by hand, and plumbline run writes what was shown", { timeout: 120_000 }, async (context) => {
  const { page, server } = context;
  const made = await openMesh(context);
  await makeTowerHandles(page, made);

  // Lasso around the upper end selects what is there.
  await page.keyboard.press("Escape");
  await page.getByRole("button", { name: "Select by lasso" }).click();
  const { box } = await inView(page);
  const [left, right, top, middle] = [120, box.width - 120, 90, box.height / 2];
  await page.mouse.move(box.x + left, box.y + top);
  await page.mouse.down();
  for (const [x, y] of [[right, top], [right, middle], [left, middle], [left, top]]) await page.mouse.move(box.x + x, box.y + y, { steps: 4 });
  await page.mouse.up();
  await until(async () => Number((await page.getByText(/ of [\d,]+ vertices$/).first().textContent()).split(" ")[0]) > 20, "vertices in the lasso");
  await screenshot(page, "mesh-lasso");

  // The gizmo moves the upper end; one drag is one step.
  await page.getByRole("button", { name: "Select", exact: true }).click();
  const before = await number(page, "Translation x").inputValue();
  const arrow = await gizmoArrow(page);
  await dragMouse(page, arrow, { x: arrow.x + 80, y: arrow.y });
  await until(async () => (await number(page, "Translation x").inputValue()) !== before, "the handle to move");
  const moved = await steady(number(page, "Translation x"));
  await page.keyboard.press("Control+z");
  await until(async () => (await number(page, "Translation x").inputValue()) === before, "undo");
  await page.keyboard.press("Control+Shift+z");
  await until(async () => (await number(page, "Translation x").inputValue()) === moved, "redo");

  // Typed numbers are exact.
  await type(page, "Translation x", 1.5);
  await type(page, "Translation y", -0.5);
  await type(page, "Angle", 60);
  await until(async () => (await number(page, "Angle").inputValue()) === "60", "the typed angle");
  await steady(number(page, "Angle"));
  await atRest(page);
  await screenshot(page, "mesh-bent");

  await save(page);
  const shown = positions(await exported(page));
  await server.run("run", "tower.deform.toml");
  const written = positions(readFileSync(join(server.folder, "tower-deformed.obj"), "utf8"));
  assert.ok(farthest(shown, written) <= 1e-6 * DIAGONAL, `${farthest(shown, written)}`);
  assert.ok(farthest(shown, positions(made.text)) > 0.5, "the tower is bent");
});

/** The arrow along x of the gizmo, in pixels of the page. */
async function gizmoArrow(page) {
  const { box } = await inView(page);
  const text = await until(() => page.getByRole("application", { name: /3D view/ }).getAttribute("data-gizmo"), "the gizmo");
  const [x, y] = text.split(",").map(Number);
  return { x: box.x + x, y: box.y + y };
}

test("keys over time play as the frames that plumbline run writes", { timeout: 120_000 }, async (context) => {
  const { page, server } = context;
  const made = await openMesh(context);
  await makeTowerHandles(page, made);
  await type(page, "Translation x", 1);
  await type(page, "Angle", 90);
  await type(page, "Frames", 5);
  await until(async () => (await page.getByText("5 of 5").count()) > 0, "all frames", 20_000);
  await page.getByRole("button", { name: "To the previous key" }).click();
  await until(async () => (await number(page, "Translation x").inputValue()) === "0", "the first key");
  await page.getByRole("button", { name: "Play", exact: true }).click();
  await page.getByRole("button", { name: "Pause" }).waitFor();
  await page.getByRole("button", { name: "Pause" }).click();
  await screenshot(page, "mesh-timeline");
  await save(page);
  await server.run("run", "tower.deform.toml");
  const last = positions(readFileSync(join(server.folder, "tower-deformed_0004.obj"), "utf8"));
  await page.getByRole("button", { name: "To the next key" }).click();
  await until(async () => (await number(page, "Translation x").inputValue()) === "1", "the last key");
  await atRest(page);
  const shown = positions(await exported(page));
  assert.ok(farthest(shown, last) <= 1e-6 * DIAGONAL, `${farthest(shown, last)}`);
});

test("the keyboard alone bends a tower", { timeout: 120_000 }, async (context) => {
  const { page, server } = context;
  const made = await openMesh(context);
  const vertices = page.getByLabel("Vertices", { exact: true });
  const tabTo = async (locator, what) => {
    for (let k = 0; k < 80; k++) {
      if (await locator.evaluate((element) => element === document.activeElement)) return;
      await page.keyboard.press("Tab");
    }
    assert.fail(`the Tab key does not reach ${what}`);
  };
  await page.getByRole("application", { name: /3D view/ }).focus();
  await page.keyboard.press("a");
  await until(async () => (await page.getByText(`${made.ring * (made.levels + 1)} of ${made.ring * (made.levels + 1)} vertices`).count()) > 0, "all vertices");
  const fill = async (text) => {
    await page.keyboard.press("Control+a");
    await page.keyboard.type(text);
    await page.keyboard.press("Enter");
  };
  // What is typed is selected once the program has answered.
  const selected = () => until(async () => (await page.getByText(`${made.ring} of ${made.ring * (made.levels + 1)} vertices`).count()) > 0, "the ring to be selected");
  await tabTo(vertices, "the list of vertices");
  await fill(`0-${made.ring - 1}`);
  await selected();
  await page.getByRole("application", { name: /3D view/ }).focus();
  await page.keyboard.press("f");
  await until(async () => (await handles(page).getByRole("option").count()) === 1, "the fixed handle");
  const last = made.ring * (made.levels + 1) - 1;
  await tabTo(vertices, "the list of vertices");
  await fill(`${last - made.ring + 1}-${last}`);
  await selected();
  await page.getByRole("application", { name: /3D view/ }).focus();
  await page.keyboard.press("h");
  await until(async () => (await handles(page).getByRole("option").count()) === 2, "the rigid handle");
  for (let k = 0; k < 5; k++) await page.keyboard.press("6");
  await until(async () => Math.abs(Number((await number(page, "Translation x").inputValue()).replace("−", "-"))) > 0.05, "the handle to move");
  await atRest(page);
  await page.keyboard.press("Control+s");
  await until(async () => !(await page.title()).startsWith("•"), "the files to be saved");
  const shown = positions(await exported(page));
  await server.run("run", "tower.deform.toml");
  const written = positions(readFileSync(join(server.folder, "tower-deformed.obj"), "utf8"));
  assert.ok(farthest(shown, written) <= 1e-6 * DIAGONAL, `${farthest(shown, written)}`);
});

test("every panel passes the audit, in both themes", { timeout: 120_000 }, async (context) => {
  const { page } = context;
  const made = await openMesh(context);
  await makeTowerHandles(page, made);
  await type(page, "Translation x", 1);
  await page.getByLabel("Colors", { exact: true }).selectOption("distortion");
  await page.getByRole("figure", { name: /Distortion of edges/ }).waitFor();
  await atRest(page);
  await inBothThemes(page, "mesh");
  await picture(page, "mesh");
});

test("a mesh far from its origin looks and exports as one that is near", { timeout: 120_000 }, async (context) => {
  const { page } = context;
  const made = await openMesh(context, "far.obj", tower(24, 4, [1e6, 2e6, -1e6]));
  await makeTowerHandles(page, made);
  await type(page, "Translation x", 1);
  await atRest(page);
  const shown = positions(await exported(page));
  const rest = positions(made.text);
  const last = rest.length - 1;
  assert.ok(Math.abs(shown[last][0] - rest[last][0] - 1) < 1e-9, "exports have all digits");
  await screenshot(page, "mesh-far");
});

test("a browser without WebGL 2 is told so", { flags: ["--disable-3d-apis"], expect: ["WebGL"] }, async ({ page, server }) => {
  await pick(page, server, "tower.obj", tower());
  await page.getByText(/no WebGL 2/).waitFor();
});

test("a killed server and a reload lose no handle", { timeout: 120_000 }, async (context) => {
  const { page, server } = context;
  const made = await openMesh(context);
  await makeTowerHandles(page, made);
  await type(page, "Translation x", 1);
  await until(async () => (await number(page, "Translation x").inputValue()) === "1", "the typed number");
  await page.reload();
  await until(async () => (await handles(page).getByRole("option").count()) === 2, "both handles after a reload");
  // Unsaved changes are kept a second after the last one.
  await page.waitForTimeout(2500);
  await server.kill();
  await server.restart();
  await page.goto("about:blank");
  await page.goto(server.url);
  await pick(page, server, "tower.obj", made);
  await until(async () => (await handles(page).getByRole("option").count()) === 2, "both handles after a crash");
  await handles(page).getByRole("option", { name: /grip/ }).click();
  await number(page, "Translation x").waitFor();
  assert.equal(await number(page, "Translation x").inputValue(), "1");
});

test("two windows on one document show the same handles", { timeout: 120_000 }, async (context) => {
  const { page, server, newPage } = context;
  const made = await openMesh(context);
  const link = await page.evaluate(async () => {
    const headers = { "x-plumbline-session": sessionStorage.getItem("plumbline session"), "content-type": "application/json" };
    const { token } = await (await fetch("/api/link", { method: "POST", headers, body: "{}" })).json();
    return `${location.origin}/#token=${token}`;
  });
  const other = await newPage();
  await other.goto(link);
  await pick(other, server, "tower.obj", made);
  await other.getByRole("application", { name: /3D view/ }).waitFor();
  await makeTowerHandles(page, made);
  await type(page, "Translation x", 0.75);
  await until(async () => (await number(other, "Translation x").inputValue()) === "0.75", "the other window to follow");
  await other.getByRole("application", { name: /3D view/ }).focus();
  await other.keyboard.press("Control+z");
  await until(async () => (await number(page, "Translation x").inputValue()) === "0", "undo by the other window");
});

test("brush, named sets, free handles, grabbing, every method, a painted region", { timeout: 120_000 }, async (context) => {
  const { page } = context;
  const made = await openMesh(context);
  const count = async () => Number((await page.getByText(/ of [\d,]+ vertices$/).first().textContent()).split(" ")[0]);
  await selectVertices(page, `0-${made.ring - 1}`);
  await page.getByRole("button", { name: "Fixed", exact: true }).first().click();
  await until(async () => (await count()) === 0, "the selection to become a handle");

  await page.getByRole("button", { name: "Select by brush" }).click();
  const middle = await inView(page, 20, -60);
  await dragMouse(page, middle, { x: middle.x, y: middle.y - 60 });
  await until(async () => (await count()) > 3, "brushed vertices");
  await screenshot(page, "mesh-brush");
  await page.getByLabel("Name", { exact: true }).fill("belly");
  await page.getByLabel("Name", { exact: true }).press("Enter");
  await page.getByRole("button", { name: "Name the selection" }).click();
  await page.getByRole("listbox", { name: "Named sets" }).getByText("belly").waitFor();

  await page.getByRole("button", { name: "Free", exact: true }).first().click();
  await until(async () => (await handles(page).getByRole("option").count()) === 2, "the free handle");
  await page.getByRole("button", { name: "Grab and drag" }).click();
  await dragMouse(page, { x: middle.x, y: middle.y - 30 }, { x: middle.x + 70, y: middle.y - 30 });
  await until(async () => /Move free/.test((await lastStep(page)) ?? ""), "the drag in the plane of the screen");
  await atRest(page);

  const methods = await page.getByRole("combobox", { name: "Method", exact: true }).locator("option").evaluateAll((all) => all.map((o) => o.value));
  assert.equal(methods.length, 7);
  for (const method of methods) {
    await page.getByRole("combobox", { name: "Method", exact: true }).selectOption(method);
    await until(async () => (await page.getByRole("combobox", { name: "Method", exact: true }).inputValue()) === method, method);
    await atRest(page);
  }
  await page.getByLabel("Colors", { exact: true }).selectOption("displacement");
  await page.getByRole("figure", { name: /Displacement/ }).waitFor();
  await screenshot(page, "mesh-primo");

  await page.getByRole("button", { name: "Region of influence" }).click();
  await page.getByRole("button", { name: "Paint the region" }).click();
  const low = await inView(page, 20, 120);
  await dragMouse(page, low, { x: low.x, y: low.y + 40 });
  await page.getByText(/vertices are fixed$/).waitFor();
  await screenshot(page, "mesh-region");
  await page.getByRole("button", { name: "The whole surface moves" }).click();
  await page.getByText("The whole surface may move").waitFor();
  await page.getByRole("button", { name: "Copy as command" }).click();
  assert.match(await page.getByLabel("Equivalent command").inputValue(), /^plumbline deform .*tower\.obj --handles .* --method primo -o .*$/);
});

/** The last step of the history list. */
async function lastStep(page) {
  const history = page.getByRole("complementary", { name: "History" });
  if ((await history.count()) === 0) await page.keyboard.press("Alt+h");
  return history.getByRole("listitem").last().textContent();
}
