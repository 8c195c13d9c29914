// The character workspace: its page against a played server, then whole jobs with the program.
import assert from "node:assert/strict";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { openAlone } from "./alone.mjs";
import { readCharacter } from "./glb.mjs";
import { inBothThemes, test, until } from "./harness.mjs";

const root = join(dirname(fileURLToPath(import.meta.url)), "../../../..");
let humanoid = null;

const played = (title, body) => test(title, { alone: true }, async ({ page }) => {
  humanoid ??= readCharacter(join(root, "media/humanoid.glb"));
  await openAlone(page, "character.tsx", { "/humanoid.json": humanoid });
  await page.getByRole("tree", { name: "Joints" }).waitFor();
  await until(() => page.evaluate(() => window.character.scene?.view.drawn > 0), "the first picture");
  await body(page);
});
const tab = (page, name) => page.getByRole("tab", { name }).click();
/** Messages sent since the last look, of one sort. */
const sent = (page, sort) => page.evaluate((key) => window.sent.splice(0).map((message) => message[key]).filter((found) => found !== undefined), sort);
const joint = (page, name) => page.getByRole("treeitem", { name, exact: true }).or(page.getByRole("treeitem", { name: new RegExp(`^${name.replace(".", "\\.")} `) })).first();
/** Where a joint is drawn, in pixels of the page. */
const where = (page, name) => page.evaluate((wanted) => {
  const { character } = window;
  const { index } = character.joints.value.find((j) => j.name === wanted);
  const p = character.scene.view.project(character.shownFrames.position(index));
  const box = character.scene.view.canvas.getBoundingClientRect();
  return { x: box.left + p.x, y: box.top + p.y };
}, name);
async function drag(page, from, by, steps = 6) {
  await page.mouse.move(from.x, from.y);
  await page.mouse.down();
  for (let i = 1; i <= steps; i++) await page.mouse.move(from.x + (by[0] * i) / steps, from.y + (by[1] * i) / steps);
  await page.mouse.up();
}
const close = (a, b, tolerance) => a.every((x, k) => Math.abs(x - b[k]) < tolerance);

played("every mode of the character workspace has names and contrast in both themes", async (page) => {
  for (const [mode, chosen] of [["Skeleton", "forearm.L"], ["Weights", "chest"], ["Pose", "forearm.L"], ["Animate", "forearm.L"], ["Compare", "forearm.L"]]) {
    await tab(page, mode);
    await joint(page, chosen).click();
    await inBothThemes(page, `character-played-${mode.toLowerCase()}`);
  }
});

played("joints are chosen, renamed and re-parented in the tree by keyboard", async (page) => {
  const tree = page.getByRole("tree", { name: "Joints" });
  await joint(page, "hand.L").click();
  await sent(page, "edit");
  await tree.press("F2");
  await page.getByLabel("New name of hand.L").fill("wrist.L");
  await page.keyboard.press("Enter");
  await tree.press("Alt+ArrowLeft");
  await tree.press("Delete");
  const [rename, reparent, remove] = await sent(page, "edit");
  const index = await page.evaluate(() => window.character.active.index);
  assert.deepEqual(rename, { do: "rename", joint: index, name: "wrist.L" });
  assert.deepEqual([reparent.do, reparent.joints], ["reparent", [index]]);
  assert.deepEqual(remove, { do: "remove", joints: [index] });
});

played("a joint is dragged in the plane that faces the viewer, as one step", async (page) => {
  await page.getByRole("button", { name: "Front view" }).click();
  const from = await where(page, "hand.L");
  await sent(page, "drag");
  await drag(page, from, [30, -20]);
  const messages = await page.evaluate(() => window.sent.splice(0));
  const moves = messages.map((m) => m.drag).filter(Boolean);
  assert.ok(moves.length >= 2 && moves.every((m) => m.do === "move"));
  assert.ok(messages.some((m) => m.seal), "the step is sealed");
  const start = humanoid.skeleton.find(({ name }) => name === "hand.L").at;
  const { to } = moves[moves.length - 1];
  assert.ok(to[0] > start[0] && to[1] > start[1] && Math.abs(to[2] - start[2]) < 1e-3, `${to} from ${start}`);
  await drag(page, from, [0, 0], 1);
  assert.equal(await page.evaluate(() => window.character.active.name), "hand.L", "a click chooses");
});

played("a click adds along the ray, a bone is split where it is clicked, a child is extruded by a drag", async (page) => {
  await page.getByRole("button", { name: "Front view" }).click();
  await page.getByRole("radio", { name: "Add" }).click();
  await sent(page, "edit");
  const [hand, elbow] = [await where(page, "hand.L"), await where(page, "forearm.L")];
  await page.mouse.click(hand.x - 25, hand.y - 14);
  const [add] = await sent(page, "edit");
  assert.equal(add.do, "add_along");
  assert.ok(Math.abs(Math.hypot(...add.direction) - 1) < 1e-6);
  await page.getByRole("radio", { name: "Split" }).click();
  await page.mouse.click((hand.x + elbow.x) / 2, (hand.y + elbow.y) / 2);
  const [split] = await sent(page, "edit");
  assert.equal(split.do, "split");
  assert.ok(Math.abs(split.fraction - 0.5) < 0.1, `at ${split.fraction}`);
  await page.getByRole("radio", { name: "Extrude" }).click();
  await drag(page, hand, [40, 0]);
  assert.equal((await sent(page, "edit"))[0].do, "extrude");
});

played("a brush paints what is under the pointer, by keyboard what is in the middle", async (page) => {
  await tab(page, "Weights");
  await joint(page, "chest").click();
  await page.getByRole("figure", { name: /Weight of chest/ }).waitFor();
  await page.getByRole("radio", { name: "Smooth" }).click();
  await sent(page, "drag");
  const at = await where(page, "chest");
  await drag(page, { x: at.x + 12, y: at.y + 20 }, [20, 10]);
  const strokes = await sent(page, "drag");
  assert.ok(strokes.length >= 3 && strokes.every((s) => s.do === "paint" && s.op === "smooth" && s.radius > 0));
  await page.keyboard.press("p");
  assert.equal((await sent(page, "drag")).length, 1, "P paints in the middle of the view");
});

played("a limb is dragged by its surface, a click gives rings, numbers rotate", async (page) => {
  await tab(page, "Pose");
  await page.getByRole("button", { name: "Front view" }).click();
  const hand = await where(page, "hand.L");
  await sent(page, "drag");
  await drag(page, hand, [-30, -40]);
  const pulls = (await sent(page, "drag")).filter((d) => d.do === "drag");
  assert.ok(pulls.length >= 2 && close(pulls[0].point, [0, 0, 0], 1e-9), "the joint itself is pulled");
  assert.equal(await page.evaluate(() => window.character.scene.view.gizmo.attached), true, "rings");
  const x = page.getByLabel("Rotation x");
  await x.fill("30");
  await x.press("Enter");
  const [rotate] = await sent(page, "edit");
  assert.equal(rotate.do, "rotate");
  assert.ok(close(rotate.rotation, [Math.sin(Math.PI / 12), 0, 0, Math.cos(Math.PI / 12)], 1e-6));
});

played("limits are numbers and arcs with numbers", async (page) => {
  await joint(page, "forearm.L").click();
  await page.getByText("twist 69°").waitFor();
  const swing = page.getByLabel("Swing 1", { exact: true });
  await swing.fill("30");
  await swing.press("Enter");
  const edit = (await sent(page, "edit")).pop();
  assert.ok(edit.do === "limit" && Math.abs(edit.limits.swing[0] - Math.PI / 6) < 1e-9);
});

played("keys are added and moved by keyboard, curves in time and in value", async (page) => {
  await tab(page, "Animate");
  await joint(page, "forearm.L").click();
  await sent(page, "edit");
  await page.getByRole("slider", { name: "Animation: time" }).press("ArrowRight");
  await page.keyboard.press("k");
  const [key] = await sent(page, "edit");
  assert.ok(key.do === "key" && key.joints.length === 1 && Math.abs(key.time - 1 / 30) < 1e-9);
  await page.getByRole("button", { name: "Play", exact: true }).click();
  await until(() => page.evaluate(() => window.character.playback.time.value > 0.2), "the time to run");
  await page.getByRole("button", { name: "Pause" }).click();
});
