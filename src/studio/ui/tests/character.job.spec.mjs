// Whole jobs in the character workspace: skeleton, weights, pose, keys, undo, saving; then `plumbline run` on the saved file writes what
// the studio showed.
import assert from "node:assert/strict";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { audit, inBothThemes, picture, test, until } from "./harness.mjs";

/** Of the humanoid's box. */
const DIAGONAL = 2.4;

const tree = (page) => page.getByRole("tree", { name: "Joints" });
const joint = (page, name) => tree(page).getByRole("treeitem", { name: new RegExp(`^${name.replace(".", "\\.")}( pinned| limited| looks| pole)?$`) });
const tab = (page, name) => page.getByRole("tab", { name }).click();
const saved = (page, text) => page.locator(".saved-state").getByText(text, { exact: true }).waitFor();
const atRest = async (page) => {
  await page.waitForTimeout(150);
  await until(async () => (await page.locator(".working").getAttribute("data-working")) === "false", "rest", 30_000);
};
/** State and history that the program sends to a window that opens now. */
const snapshot = (page) => page.evaluate(async () => {
  const token = sessionStorage.getItem("plumbline session");
  const { documents } = await (await fetch("/api/state", { headers: { "x-plumbline-session": token } })).json();
  const id = documents[0].document;
  const socket = new WebSocket(`ws://${location.host}/ws?document=${encodeURIComponent(id)}`, ["plumbline", `token.${token}`]);
  const found = await new Promise((resolve, reject) => {
    const known = {};
    socket.onmessage = ({ data }) => {
      Object.assign(known, typeof data === "string" ? JSON.parse(data) : {});
      if (known.state && known.history) resolve(known);
    };
    socket.onerror = () => reject(new Error("no socket"));
  });
  socket.close();
  return found;
});
const state = async (page) => (await snapshot(page)).state;
/** What was done last and is not undone. */
const lastStep = async (page) => {
  const { steps, at } = (await snapshot(page)).history;
  return steps[at]?.label ?? "";
};
const done = (page, label) => until(async () => (await lastStep(page)).startsWith(label), `"${label}" as the last step`);
const positions = (text) => text.split("\n").filter((line) => line.startsWith("v ")).map((line) => line.split(/\s+/).slice(1, 4).map(Number));
function farthest(a, b) {
  assert.equal(a.length, b.length, "as many vertices");
  return Math.max(...a.map((p, i) => Math.hypot(p[0] - b[i][0], p[1] - b[i][1], p[2] - b[i][2])));
}
async function ready(page) {
  await joint(page, "hips").waitFor();
  await page.getByRole("application", { name: /humanoid/ }).waitFor();
  await atRest(page);
}
/** A command by its title, through the palette. */
async function command(page, title) {
  await page.keyboard.press("Control+k");
  await page.getByRole("combobox", { name: "Find a command" }).fill(title);
  await page.getByRole("option", { name: new RegExp(`^${title}`) }).first().waitFor();
  await page.keyboard.press("Enter");
}
async function exportedObj(page) {
  const [download] = await Promise.all([page.waitForEvent("download"), command(page, "Export OBJ")]);
  return readFileSync(await download.path(), "utf8");
}
async function number(page, label, value) {
  const field = page.getByLabel(label, { exact: true });
  await field.fill(String(value));
  await field.press("Enter");
}
/** Tab until something has the focus. */
async function tabTo(page, target) {
  for (let tries = 0; tries < 120; tries++) {
    if (await target.evaluate((element) => element === document.activeElement)) return;
    await page.keyboard.press("Tab");
  }
  assert.fail("the Tab key does not reach it");
}
/** Drags in the middle of the view at a fraction of its width and height. */
async function dragInView(page, from, by) {
  const box = await page.getByRole("application").boundingBox();
  const [x, y] = [box.x + from[0] * box.width, box.y + from[1] * box.height];
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let i = 1; i <= 6; i++) await page.mouse.move(x + (by[0] * i) / 6, y + (by[1] * i) / 6);
  await page.mouse.up();
}
/** Saves, runs the saved file, and compares what it writes with the export of the studio. */
async function savedRunsAsShown(page, server) {
  await atRest(page);
  const shown = positions(await exportedObj(page));
  await page.keyboard.press("Control+s");
  await saved(page, "Saved");
  const pipeline = readdirSync(server.folder).find((name) => name.endsWith(".toml"));
  await server.run("run", pipeline, "--overwrite");
  const written = readdirSync(server.folder).find((name) => /posed.*\.obj$/.test(name));
  const distance = farthest(shown, positions(readFileSync(join(server.folder, written), "utf8")));
  assert.ok(distance <= 1e-6 * DIAGONAL, `${distance} from what was shown`);
  return distance;
}

test("a character is built, painted, posed by FK and IK, animated, undone and saved", { media: ["humanoid.glb"], open: "humanoid.glb", timeout: 180_000 }, async ({ page, server }) => {
  await ready(page);
  const before = (await state(page)).joints.length;
  // The skeleton by hand.
  await joint(page, "hand end.L").click();
  await page.getByRole("button", { name: "Extrude", exact: true }).click();
  await until(async () => (await state(page)).joints.length === before + 1, "the new joint");
  await page.getByLabel("Name", { exact: true }).fill("finger.L");
  await page.keyboard.press("Enter");
  await joint(page, "finger.L").waitFor();
  await page.getByRole("button", { name: "Mirror", exact: true }).click();
  await joint(page, "finger.R").waitFor();
  await page.keyboard.press("Control+z");
  await until(async () => (await state(page)).joints.length === before + 1, "undo of the mirror");
  await joint(page, "finger.L").click();
  await page.getByRole("button", { name: "Delete", exact: true }).click();
  await until(async () => (await state(page)).joints.length === before, "the joint to be gone");
  await joint(page, "forearm.L").click();
  await inBothThemes(page, "character-skeleton");
  // Weights.
  await tab(page, "Weights");
  await atRest(page);
  await page.getByRole("figure", { name: /Weight of forearm.L/ }).waitFor();
  await page.getByRole("button", { name: "Front view" }).click();
  await dragInView(page, [0.47, 0.34], [-8, 24]);
  await done(page, "Paint weights of");
  await atRest(page);
  await inBothThemes(page, "character-weights");
  const { at } = (await snapshot(page)).history;
  await page.keyboard.press("Control+z");
  await until(async () => (await snapshot(page)).history.at === at - 1, "undo of the whole stroke");
  await page.keyboard.press("Control+Shift+z");
  await done(page, "Paint weights of");
  // A pose by numbers, by a drag, with a pinned foot.
  await tab(page, "Pose");
  await joint(page, "foot.R").click();
  await page.getByRole("button", { name: "Pin", exact: true }).click();
  await until(async () => (await state(page)).targets.length === 1, "the pin");
  await joint(page, "forearm.L").click();
  await number(page, "Rotation y", 40);
  await atRest(page);
  await page.getByRole("button", { name: "Front view" }).click();
  await page.waitForTimeout(200);
  // The left arm as seen, by its surface, then the same hand by arrow keys.
  await dragInView(page, [0.26, 0.3], [20, -50]);
  await done(page, "Drag");
  await atRest(page);
  await joint(page, "hand.R").click();
  for (let i = 0; i < 4; i++) await page.keyboard.press("Alt+Shift+ArrowUp");
  await done(page, "Drag hand.R");
  await atRest(page);
  await inBothThemes(page, "character-pose");
  await picture(page, "studio-character");
  await savedRunsAsShown(page, server);
});

test("a clip is keyed, played and exported", { media: ["humanoid.glb"], open: "humanoid.glb", timeout: 120_000 }, async ({ page }) => {
  await ready(page);
  await tab(page, "Animate");
  await page.getByRole("button", { name: "New", exact: true }).click();
  await until(async () => (await state(page)).tracks.length === 0, "a clip without keys");
  await joint(page, "arm.L").click();
  await page.keyboard.press("k");
  await until(async () => (await state(page)).tracks.length === 1, "the first key");
  const time = page.getByRole("slider", { name: "Animation: time" });
  await time.press("PageUp");
  await time.press("PageUp");
  await joint(page, "hand.L").click();
  for (let i = 0; i < 5; i++) await page.keyboard.press("Alt+Shift+ArrowDown");
  await done(page, "Drag hand.L");
  await atRest(page);
  await joint(page, "arm.L").click();
  await page.keyboard.press("k");
  const track = await until(async () => (await state(page)).tracks.find(({ times }) => times.length === 2), "the second key");
  assert.ok(Math.abs(track.times[1] - 20 / 30) < 1e-6, `at ${track.times}`);
  assert.notDeepEqual(track.rotations[0], track.rotations[1]);
  await page.getByRole("button", { name: "Play", exact: true }).click();
  await page.waitForTimeout(500);
  await page.getByRole("button", { name: "Pause" }).click();
  await command(page, "Onion skins");
  await atRest(page);
  await inBothThemes(page, "character-animate");
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Export GLB" }).click()]);
  assert.equal(readFileSync(await download.path()).subarray(0, 4).toString(), "glTF");
  await tab(page, "Compare");
  await atRest(page);
  await page.getByText("Centers of rotation").first().waitFor();
  await inBothThemes(page, "character-compare");
});

test("the job is done by the keyboard alone", { media: ["humanoid.glb"], open: "humanoid.glb", timeout: 120_000 }, async ({ page, server }) => {
  await ready(page);
  await tabTo(page, tree(page));
  await page.keyboard.type("forearm.L".slice(0, 1));
  await page.keyboard.press("e");
  await until(async () => (await state(page)).joints.length === 23, "an extruded joint");
  await page.keyboard.press("Delete");
  await until(async () => (await state(page)).joints.length === 22, "it is deleted");
  await page.keyboard.press("Alt+t");
  await page.getByRole("tab", { name: "Weights", selected: true }).waitFor();
  await tabTo(page, tree(page));
  await page.keyboard.type("c");
  await page.keyboard.press("p");
  await done(page, "Paint weights of chest");
  await page.keyboard.press("Alt+p");
  await tabTo(page, tree(page));
  await page.keyboard.type("h");
  await tabTo(page, page.getByLabel("Rotation x"));
  await page.keyboard.type("15");
  await page.keyboard.press("Enter");
  await tabTo(page, tree(page));
  await page.keyboard.type("s");
  await page.keyboard.press("Alt+Shift+ArrowUp");
  await atRest(page);
  await savedRunsAsShown(page, server);
  await audit(page, "after the job");
});

const DOG = `version = 1

[stage.mesh]
use  = "mesh.load"
path = "dog.ply"

[stage.skeleton]
use  = "skeleton.load"
path = "dog.skeleton.json"

[stage.posed]
use    = "character.pose"
inputs = ["mesh", "skeleton"]

[stage.out]
use    = "mesh.save"
inputs = ["posed"]
path   = "dog-posed.obj"
`;

test("a skeleton is extracted from a mesh without one, and what is posed runs", { media: ["dog.ply"], open: ".", timeout: 120_000 }, async ({ page, server }) => {
  writeFileSync(join(server.folder, "dog.character.toml"), DOG);
  await page.locator(".shell[data-ready=true]").waitFor();
  await page.keyboard.press("Control+o");
  await page.getByRole("combobox", { name: "Find in this folder" }).fill("dog.character.toml");
  await page.getByRole("option", { name: "dog.character.toml" }).waitFor();
  await page.keyboard.press("Enter");
  await page.getByText("No skeleton yet").waitFor();
  await page.getByRole("application").waitFor();
  await page.getByRole("button", { name: "Extract skeleton" }).click();
  // Not by messages: each interrupts the slice that extracts.
  await until(async () => (await tree(page).getByRole("treeitem").count()) > 5, "the skeleton", 60_000);
  await atRest(page);
  await tree(page).getByRole("treeitem").nth(3).click();
  await inBothThemes(page, "character-extracted");
  await tab(page, "Pose");
  await number(page, "Rotation z", 20);
  await done(page, "Rotate");
  await savedRunsAsShown(page, server);
});
