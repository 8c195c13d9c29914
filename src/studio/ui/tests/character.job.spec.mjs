// Whole jobs in the character workspace: skeleton, weights, pose, keys, undo, saving; then `plumbline run` on the saved file writes what
// the studio showed.
import assert from "node:assert/strict";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { audit, inBothThemes, picture, screenshot, test, until } from "./harness.mjs";

/** Of the humanoid's box. */
const DIAGONAL = 2.4;

const tree = (page) => page.getByRole("tree", { name: "Joints" });
const joint = (page, name) => tree(page).getByRole("treeitem", { name: new RegExp(`^${name.replace(".", "\\.")}( pinned| limited| looks| pole| locked)?$`) });
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
  await picture(page, "character");
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
  await number(page, "Rotation y", -40);
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
  await screenshot(page, "studio-character");
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

/** A time on the timeline, as a frame. */
async function frame(page, number) {
  const field = page.getByRole("region", { name: "Animation" }).getByLabel("Frame", { exact: true });
  await field.fill(String(number));
  await field.press("Enter");
}
/** Chooses a file where the page asks for one. */
async function choose(page, path, press) {
  const [chooser] = await Promise.all([page.waitForEvent("filechooser"), press()]);
  await chooser.setFiles(path);
}
const button = (page, name) => page.getByRole("button", { name, exact: true });

test("a pose that is not keyed waits at its time, frames of the clip are exported as a run writes them", { media: ["humanoid.glb"], open: "humanoid.glb", timeout: 180_000 }, async ({ page, server }) => {
  await ready(page);
  await tab(page, "Animate");
  await button(page, "New").click();
  await until(async () => (await state(page)).tracks.length === 0, "a clip without keys");
  await joint(page, "arm.L").click();
  await page.keyboard.press("k");
  await until(async () => (await state(page)).tracks.length === 1, "the first key");
  // Posed at another time, not keyed, and scrubbed away: it waits, and its time shows it again.
  await frame(page, 30);
  await joint(page, "hand.L").click();
  for (let i = 0; i < 6; i++) await page.keyboard.press("Alt+Shift+ArrowDown");
  await done(page, "Drag hand.L");
  const bar = page.getByRole("status").filter({ hasText: "Not keyed" });
  await bar.getByText(/Not keyed: .* at 1 s/).waitFor();
  await atRest(page);
  const posed = positions(await exportedObj(page));
  await frame(page, 10);
  await atRest(page);
  await inBothThemes(page, "character-unkeyed");
  const away = positions(await exportedObj(page));
  assert.ok(farthest(posed, away) > 0.01 * DIAGONAL, "at another time the keys are shown");
  await button(page, "Go to it").click();
  await atRest(page);
  assert.ok(farthest(posed, positions(await exportedObj(page))) < 1e-9 * DIAGONAL, "its time shows it");
  await page.keyboard.press("Control+s");
  await saved(page, "Saved");
  await page.reload();
  await ready(page);
  await tab(page, "Animate");
  await bar.getByRole("button", { name: "Key it" }).click();
  await until(async () => (await state(page)).tracks.some(({ times }) => times.length === 2 || times[0] === 1), "its keys");
  await bar.waitFor({ state: "hidden" });
  // Discarded: gone, and back by undo.
  await frame(page, 15);
  await joint(page, "leg.R").click();
  for (let i = 0; i < 4; i++) await page.keyboard.press("Alt+Shift+ArrowUp");
  await bar.waitFor();
  await bar.getByRole("button", { name: "Discard" }).click();
  await bar.waitFor({ state: "hidden" });
  await page.keyboard.press("Control+z");
  await bar.waitFor();
  await page.keyboard.press("Control+Shift+z");
  await bar.waitFor({ state: "hidden" });
  // With the toggle every pose is a key.
  await page.getByLabel("Key what is posed").check();
  const before = (await state(page)).tracks.find(({ joint: j }) => j === 0)?.times.length ?? 0;
  await joint(page, "hips").click();
  await page.keyboard.press("Alt+Shift+ArrowUp");
  await until(async () => ((await state(page)).tracks.find(({ joint: j }) => j === 0)?.times.length ?? 0) > before, "a key of the hips");
  await bar.waitFor({ state: "hidden" });
  // Frames.
  const [download] = await Promise.all([page.waitForEvent("download"), button(page, "Export OBJ frames").click()]);
  const files = untar(readFileSync(await download.path()));
  assert.equal(files.length, 31, "from the first key to the last, 30 a second");
  await button(page, "Write this clip").click();
  await page.getByText(/writes 31 poses of the clip/).waitFor();
  await page.keyboard.press("Control+s");
  await saved(page, "Saved");
  const pipeline = readdirSync(server.folder).find((name) => name.endsWith(".toml"));
  await server.run("run", pipeline, "--overwrite");
  for (const [k, name] of [[0, "0000"], [17, "0017"], [30, "0030"]]) {
    const written = positions(readFileSync(join(server.folder, `humanoid-posed_${name}.obj`), "utf8"));
    assert.ok(farthest(positions(files[k].text), written) <= 1e-6 * DIAGONAL, `frame ${k}`);
  }
});

/** Files of an archive. */
function untar(bytes) {
  const files = [];
  for (let at = 0; bytes[at] !== 0; ) {
    const size = parseInt(bytes.subarray(at + 124, at + 135).toString(), 8);
    files.push({ name: bytes.subarray(at, at + 100).toString().replace(/\0.*/, ""), text: bytes.subarray(at + 512, at + 512 + size).toString() });
    at += 512 + 512 * Math.ceil(size / 512);
  }
  return files;
}

test("onion skins are drawn where they are switched on", { media: ["humanoid.glb"], open: "humanoid.glb", timeout: 90_000 }, async ({ page }) => {
  await ready(page);
  await page.evaluate(() => {
    const send = WebSocket.prototype.send;
    window.sentViews = [];
    WebSocket.prototype.send = function (data) {
      if (typeof data === "string" && data.includes("\"view\"")) window.sentViews.push(JSON.parse(data).view);
      return send.call(this, data);
    };
  });
  await tab(page, "Animate");
  await frame(page, 12);
  await button(page, "Front view").click();
  await atRest(page);
  await page.getByRole("toolbar", { name: "Camera" }).getByRole("button", { name: "Show all" }).click();
  await atRest(page);
  await page.waitForTimeout(300);
  const canvas = page.getByRole("application");
  const without = await canvas.screenshot();
  await page.getByLabel("Show", { exact: true }).check();
  await atRest(page);
  await until(async () => (await page.evaluate(() => window.sentViews)).some(({ onion }) => onion?.[0] === 2 && Math.abs(onion[1] - 5 / 30) < 1e-9), "the message");
  await page.waitForTimeout(300);
  const withSkins = await canvas.screenshot();
  const colored = await coloredPixels(page, withSkins);
  assert.ok(colored.blue > 200 && colored.orange > 200, JSON.stringify(colored));
  const before = await coloredPixels(page, without);
  assert.ok(before.blue < colored.blue / 4, `without: ${JSON.stringify(before)}`);
  await inBothThemes(page, "character-onion");
  await page.getByLabel("On each side").fill("1");
  await page.keyboard.press("Enter");
  await until(async () => (await page.evaluate(() => window.sentViews)).some(({ onion }) => onion?.[0] === 1), "fewer of them");
});

/** Pixels in the colors of skins before and after. */
const coloredPixels = (page, png) => page.evaluate(async (base64) => {
  const image = await createImageBitmap(new Blob([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], { type: "image/png" }));
  const canvas = new OffscreenCanvas(image.width, image.height);
  const context = canvas.getContext("2d");
  context.drawImage(image, 0, 0);
  const { data } = context.getImageData(0, 0, image.width, image.height);
  const found = { blue: 0, orange: 0 };
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 2] - data[i] > 35) found.blue++;
    if (data[i] - data[i + 2] > 25) found.orange++;
  }
  return found;
}, png.toString("base64"));

test("a trained skin is imported, compared, used, and run as it was shown", { media: ["humanoid.glb"], open: "humanoid.glb", timeout: 180_000 }, async ({ page, server }) => {
  for (const k of [1, 2, 3]) {
    const joints = { "forearm.L": { turn_deg: [0, -25 * k, 0] }, "leg.R": { turn_deg: [15 * k, 0, 0] } };
    writeFileSync(join(server.folder, `pose${k}.json`), JSON.stringify({ format: "plumbline.pose", version: 1, joints }));
    await server.run("pose", "humanoid.glb", "--pose", `pose${k}.json`, "--skinning", "dqs", "-o", `example${k}.obj`);
  }
  await server.run("skin", "train", "humanoid.glb", "--examples", "example1.obj", "example2.obj", "example3.obj", "-o", "learnt.skin");
  await ready(page);
  await tab(page, "Pose");
  assert.deepEqual(await page.getByLabel("Skinning").locator("option").allTextContents(), ["Linear blend", "Dual quaternions", "Centers of rotation", "Twist and swing"]);
  await joint(page, "forearm.L").click();
  await number(page, "Rotation y", -40);
  await atRest(page);
  await tab(page, "Compare");
  await page.getByText("plumbline skin train").waitFor();
  assert.ok(await page.getByLabel("Regression").isDisabled());
  writeFileSync(join(server.folder, "other.skin"), "no skin");
  await choose(page, join(server.folder, "other.skin"), () => button(page, "Import trained skin…").click());
  await page.getByRole("alert").getByText(/not a trained skin/).waitFor();
  await choose(page, join(server.folder, "learnt.skin"), () => button(page, "Import trained skin…").click());
  await page.getByText("learnt.skin fits this mesh and skeleton.").waitFor();
  await atRest(page);
  await page.getByRole("row", { name: /Regression/ }).waitFor();
  await page.getByRole("toolbar", { name: "Camera" }).getByRole("button", { name: "Show all" }).click();
  await page.getByRole("button", { name: "Dismiss" }).first().click();
  await page.waitForTimeout(400);
  await inBothThemes(page, "character-regression");
  await page.getByLabel("Skinning").selectOption("Regression");
  await done(page, "Skinning: regression");
  await savedRunsAsShown(page, server);
  assert.ok(readdirSync(server.folder).includes("humanoid.skin"), "the skin is a side file");
});

test("a joint is locked, a pose is copied, pasted mirrored, and a skeleton file is fitted", { media: ["humanoid.glb"], open: "humanoid.glb", timeout: 120_000 }, async ({ page, server }) => {
  await ready(page);
  await tab(page, "Pose");
  await joint(page, "forearm.L").click();
  await page.getByLabel("Locked").check();
  await tree(page).getByRole("treeitem", { name: "forearm.L locked" }).waitFor();
  await joint(page, "hand.L").click();
  for (let i = 0; i < 4; i++) await page.keyboard.press("Alt+Shift+ArrowDown");
  await done(page, "Drag hand.L");
  await atRest(page);
  await tree(page).getByRole("treeitem", { name: "forearm.L locked" }).click();
  for (const axis of ["x", "y", "z"]) assert.ok(Math.abs(Number(await page.getByLabel(`Rotation ${axis}`).inputValue())) < 0.05, "a drag does not rotate it");
  await inBothThemes(page, "character-locked");
  const left = positions(await exportedObj(page));
  await page.keyboard.press("Control+c");
  await page.getByText("The pose is copied").waitFor();
  await button(page, "Reset all").click();
  await done(page, "Rest pose");
  await page.keyboard.press("Control+Shift+v");
  await done(page, "Paste the mirrored pose");
  await atRest(page);
  const right = positions(await exportedObj(page));
  assert.ok(farthest(left, right) > 0.02 * DIAGONAL);
  const reach = (points, sign) => Math.max(...points.filter(([, y]) => y > 0.5).map(([x]) => sign * x));
  assert.ok(Math.abs(reach(left, 1) - reach(right, -1)) < 0.02 * DIAGONAL, "the other side reaches as far");
  await page.keyboard.press("Control+v");
  await done(page, "Paste the pose");
  await atRest(page);
  assert.ok(farthest(left, positions(await exportedObj(page))) < 1e-9 * DIAGONAL);
  await page.keyboard.press("Control+s");
  await saved(page, "Saved");
  await tab(page, "Skeleton");
  await page.getByRole("button", { name: "Template", exact: true }).click();
  await choose(page, join(server.folder, "humanoid.skeleton.json"), () => button(page, "Fit a file…").click());
  await done(page, "Fit the template humanoid.skeleton");
  await until(async () => (await tree(page).getByRole("treeitem").count()) === 22, "the fitted joints", 60_000);
  await atRest(page);
  await inBothThemes(page, "character-fitted");
  // All joints go: a document without a skeleton again.
  await joint(page, "hips").click();
  await page.keyboard.press("Delete");
  await page.getByText("No skeleton yet").waitFor();
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
  // Messages meanwhile do not begin it again.
  const began = Date.now();
  for (let k = 0; (await state(page)).joints.length === 0; k++) {
    await tab(page, k % 2 === 0 ? "Weights" : "Skeleton");
    assert.ok(Date.now() - began < 60_000, "it comes to its end");
  }
  await tab(page, "Skeleton");
  assert.ok((await tree(page).getByRole("treeitem").count()) > 5);
  await atRest(page);
  await tree(page).getByRole("treeitem").nth(3).click();
  await inBothThemes(page, "character-extracted");
  await tab(page, "Pose");
  await number(page, "Rotation z", 20);
  await done(page, "Rotate");
  await savedRunsAsShown(page, server);
});
