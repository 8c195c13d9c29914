// The controls by themselves: what the keyboard does in each, and how they look.
import assert from "node:assert/strict";
import { openAlone } from "./alone.mjs";
import { inBothThemes, test, until } from "./harness.mjs";

const value = (page, name) => page.evaluate((key) => window.state.value[key], name);
const controls = (title, body) => test(title, { alone: true }, async ({ page }) => {
  await openAlone(page, "components.tsx");
  await page.getByRole("toolbar", { name: "Tools" }).waitFor();
  await body(page);
});

controls("controls have names and contrast in both themes", async (page) => {
  await inBothThemes(page, "controls");
  await page.setViewportSize({ width: 1920, height: 1080 });
  await inBothThemes(page, "controls-large");
});

controls("a number takes fractions and commas, steps by arrow keys, and refuses letters", async (page) => {
  const field = page.getByLabel("Offset");
  for (const [typed, expected] of [["1/4", 0.25], ["0,5", 0.5], ["−2", -2], ["1e-1", 0.1]]) {
    await field.fill(typed);
    await field.press("Enter");
    assert.equal(await value(page, "number"), expected, typed);
  }
  await field.press("ArrowUp");
  await field.press("Shift+ArrowUp");
  assert.equal(await value(page, "number"), 1.2);
  await field.fill("much");
  assert.equal(await field.getAttribute("aria-invalid"), "true");
  await field.press("Enter");
  assert.equal(await value(page, "number"), 1.2);
  assert.equal(await field.inputValue(), "1.2");
});

controls("a slider and its number are one value, within its ends", async (page) => {
  const number = page.getByLabel("Stiffness", { exact: true });
  await number.fill("7");
  await number.press("Enter");
  assert.equal(await value(page, "slider"), 1);
  const slider = page.getByLabel("Stiffness, slider");
  await slider.press("ArrowLeft");
  assert.equal(await value(page, "slider"), 0.99);
  await page.getByLabel("Weight, slider").press("Home");
  assert.equal(await value(page, "weight"), 1e-6);
});

controls("a list is chosen from by arrow keys, ranges and letters", async (page) => {
  const list = page.getByRole("listbox", { name: "Handles" });
  await list.focus();
  await list.press("ArrowDown");
  assert.deepEqual(await value(page, "chosen"), ["c"]);
  await list.press("Shift+ArrowDown");
  assert.deepEqual(await value(page, "chosen"), ["c", "d"]);
  await list.press("Control+a");
  assert.deepEqual(await value(page, "chosen"), ["a", "b", "c", "d"]);
  await list.press("Home");
  assert.deepEqual(await value(page, "chosen"), ["a"]);
  await page.getByRole("option", { name: /Handle 3/ }).click({ modifiers: ["Control"] });
  assert.deepEqual(await value(page, "chosen"), ["a", "c"]);
  await list.press("Delete");
  assert.deepEqual(await value(page, "chosen"), []);
  // A click in a view: the list goes on from there.
  await page.evaluate(() => { window.state.value = { ...window.state.value, chosen: ["b"] }; });
  await list.press("ArrowDown");
  assert.deepEqual(await value(page, "chosen"), ["c"]);
});

controls("a tree is folded, renamed and re-parented by keyboard", async (page) => {
  const tree = page.getByRole("tree", { name: "Joints" });
  await tree.focus();
  await tree.press("ArrowLeft");
  assert.equal(await page.getByRole("treeitem").count(), 1);
  await tree.press("ArrowRight");
  assert.equal(await page.getByRole("treeitem").count(), 5);
  await tree.press("ArrowDown");
  await tree.press("F2");
  const name = page.getByLabel("New name of Spine");
  await name.fill("Chest");
  await name.press("Enter");
  await page.getByRole("treeitem", { name: "Chest" }).waitFor();
  await page.getByRole("treeitem", { name: "Leg.L" }).click();
  await tree.press("Alt+ArrowRight");
  const parent = () => page.evaluate(() => window.nodes.value.find(({ id }) => id === "leg.l").parent);
  assert.equal(await parent(), "spine");
  await tree.press("Alt+ArrowLeft");
  assert.equal(await parent(), "hips");
  await page.getByRole("treeitem", { name: "Arm.L" }).dragTo(page.getByRole("treeitem", { name: "Hips" }));
  assert.equal(await page.evaluate(() => window.nodes.value.find(({ id }) => id === "arm.l").parent), "hips");
});

controls("choices and tabs move by arrow keys, toolbars are one stop", async (page) => {
  await page.getByRole("radio", { name: "Move" }).press("ArrowRight");
  assert.equal(await value(page, "mode"), "rotate");
  await page.getByRole("tab", { name: "One" }).press("ArrowRight");
  assert.equal(await value(page, "tab"), "two");
  await page.getByRole("button", { name: "Select", exact: true }).press("ArrowDown");
  assert.equal(await page.evaluate(() => document.activeElement?.getAttribute("aria-label")), "Lasso");
});

controls("keys of a timeline are moved, removed and gone to by keyboard and pointer", async (page) => {
  const time = page.getByRole("slider", { name: "Keys: time" });
  await time.press("ArrowRight");
  assert.equal(await time.getAttribute("aria-valuetext"), "0.04 s, frame 1");
  await time.press("End");
  assert.equal(await time.getAttribute("aria-valuenow"), "3");
  const key = page.getByRole("button", { name: "Key of Handle 1 at 1.2 s" });
  await key.press("Enter");
  assert.equal(await time.getAttribute("aria-valuenow"), "1.2");
  await key.press("ArrowRight");
  const moved = page.getByRole("button", { name: "Key of Handle 1 at 1.24 s" });
  await moved.waitFor();
  const box = await moved.boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + 60, box.y + 10, { steps: 4 });
  await page.mouse.up();
  const at = await page.evaluate(() => window.state.value.keys.find(({ id }) => id === "k1").time);
  assert.ok(at > 1.3 && Math.abs(at * 25 - Math.round(at * 25)) < 1e-9, `dragged to ${at}, a whole frame`);
  await page.getByRole("button", { name: /Key of Handle 1 at 2 s/ }).press("Delete");
  assert.equal(await page.evaluate(() => window.state.value.keys.length), 2);
});

controls("playback runs with the clock and loops", async (page) => {
  await page.getByRole("button", { name: "Play", exact: true }).click();
  await until(() => page.evaluate(() => window.playback.time.value > 0.3), "the time to run");
  await page.getByRole("button", { name: "Pause" }).click();
  const stopped = await page.evaluate(() => window.playback.time.value);
  assert.ok(Math.abs(stopped * 25 - Math.round(stopped * 25)) < 1e-6, "it stops on a frame");
  await page.evaluate(() => { window.playback.seek(2.96); window.playback.play(); });
  await until(() => page.evaluate(() => window.playback.time.value < 1 && window.playback.playing.value), "the loop");
});

controls("a dialog keeps the focus, and gives it back", async (page) => {
  const ask = page.getByRole("button", { name: "Ask" });
  await ask.click();
  await page.getByRole("dialog", { name: "Delete the handle?" }).waitFor();
  assert.equal(await page.evaluate(() => document.activeElement?.textContent), "Delete");
  await page.keyboard.press("Escape");
  await until(async () => (await page.getByRole("dialog").count()) === 0, "the dialog to close");
  assert.equal(await page.evaluate(() => document.activeElement?.textContent), "Ask");
});
