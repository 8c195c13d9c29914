// The 3D view: what its gestures do, what it picks, and that it rests.
import assert from "node:assert/strict";
import { openAlone } from "./alone.mjs";
import { test, until } from "./harness.mjs";

const SIZE = { width: 800, height: 600 };
const CENTER = [400, 300];

const view3d = (title, body, options = {}) => test(title, { alone: true, size: SIZE, ...options }, async ({ page }) => {
  await openAlone(page, "view3d.tsx");
  await until(() => page.evaluate(() => window.view?.drawn > 0), "the view");
  await body(page);
});

const seen = (page) => page.evaluate(() => window.seen);
const grip = async (page) => (await page.getByRole("application").getAttribute("data-gizmo")).split(",").map(Number);

view3d("a click on the gizmo goes through it to the surface, and a drag is its own", async (page) => {
  const [x, y] = await grip(page);
  await page.mouse.click(x, y);
  const { clicks, changes } = await seen(page);
  assert.equal(clicks.length, 1);
  assert.notEqual(clicks[0], null, "the surface is behind the arrow");
  assert.equal(changes.length, 0);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 60, y, { steps: 4 });
  await page.mouse.up();
  const after = await seen(page);
  assert.equal(after.clicks.length, 1, "a drag is no click");
  assert.equal(after.ended, 1);
  const [dx, dy, dz] = after.changes.at(-1);
  assert.ok(dx > 0.1 && dy === 0 && dz === 0, `along x alone: ${dx}, ${dy}, ${dz}`);
});

view3d("Escape ends a drag of the gizmo where it began", async (page) => {
  const [x, y] = await grip(page);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 60, y, { steps: 3 });
  await page.keyboard.press("Escape");
  await page.mouse.up();
  assert.deepEqual((await seen(page)).changes.at(-1), [0, 0, 0]);
});

view3d("nothing is drawn while nothing changes", async (page) => {
  await page.waitForTimeout(300);
  const before = await page.evaluate(() => window.view.drawn);
  await page.waitForTimeout(700);
  assert.equal(await page.evaluate(() => window.view.drawn), before);
});

view3d("what is picked is the nearest vertex under the pointer, after positions have moved too", async (page) => {
  const pick = () => page.evaluate(([x, y]) => {
    const { view } = window;
    const rect = view.canvas.getBoundingClientRect();
    const hit = view.pick(view.pointers.at({ clientX: rect.left + x, clientY: rect.top + y }));
    return hit && { vertex: hit.vertex, point: hit.point.toArray() };
  }, CENTER);
  const first = await pick();
  assert.ok(first);
  await page.evaluate(() => window.view.surface.setPositions(window.positions.map((c) => 0.5 * c)));
  const second = await pick();
  assert.ok(Math.hypot(...second.point) < 0.8 * Math.hypot(...first.point), "the surface is smaller now");
  await page.evaluate(() => window.view.surface.setPositions(window.positions.map((c, i) => (i % 3 === 0 ? c + 50 : c))));
  assert.equal(await pick(), null);
});

view3d("a skinned surface is picked where it is drawn", async (page) => {
  const top = await page.evaluate(() => {
    const { view, count, three } = window;
    const joints = new Uint16Array(4 * count);
    const weights = new Float32Array(4 * count);
    for (let v = 0; v < count; v++) weights[4 * v] = 1;
    view.surface.setSkin({ joints, weights, jointCount: 1 });
    view.surface.setJointMatrices(Float32Array.from(new three.Matrix4().makeTranslation(0, 5, 0).elements));
    return [view.surface.drawnPositions()[1] - window.positions[1], view.surface.bounds().min.y];
  });
  assert.ok(Math.abs(top[0] - 5) < 1e-5 && top[1] > 3, String(top));
  await page.evaluate(() => window.view.surface.setSkin(null));
  assert.ok(await page.evaluate(() => window.view.surface.bounds().min.y) < 0, "without the skin the positions are those set");
});

view3d("a lasso selects what is inside and not hidden", async (page) => {
  await page.evaluate(() => window.useLasso(window.view));
  const [x, y] = CENTER;
  await page.mouse.move(x - 40, y - 40);
  await page.mouse.down();
  for (const [dx, dy] of [[40, -40], [40, 40], [-40, 40], [-40, -40]]) await page.mouse.move(x + dx, y + dy, { steps: 3 });
  await page.mouse.up();
  const { lasso } = await seen(page);
  assert.ok(lasso.length > 3, `${lasso.length}`);
  const facing = await page.evaluate((found) => {
    const { view, positions, three } = window;
    const eye = view.rig.camera.position;
    return found.every((v) => new three.Vector3(...positions.slice(3 * v, 3 * v + 3)).dot(eye) > 0);
  }, lasso);
  assert.ok(facing, "vertices at the back are hidden");
});

view3d("keys of the view orbit, pan, zoom and look from the sides", async (page) => {
  await page.getByRole("application").focus();
  const camera = () => page.evaluate(() => [window.view.rig.camera.position.toArray(), window.view.rig.target.toArray()]);
  await page.keyboard.press("1");
  const [front] = await camera();
  assert.ok(Math.abs(front[0]) < 1e-6 && front[2] > 1, String(front));
  await page.keyboard.press("ArrowLeft");
  assert.notEqual((await camera())[0][0], front[0]);
  await page.keyboard.press("7");
  assert.ok((await camera())[0][1] > 1);
  const before = await camera();
  await page.keyboard.press("+");
  assert.ok(Math.hypot(...(await camera())[0]) < Math.hypot(...before[0]));
  await page.keyboard.press("Shift+ArrowUp");
  assert.notDeepEqual((await camera())[1], before[1]);
  await page.keyboard.press("Home");
  assert.ok(Math.hypot(...(await camera())[1]) < 1e-6);
});

view3d("two fingers zoom and pan, one orbits", async (page) => {
  const touch = async (points, type) => {
    const client = (page.touchClient ??= await page.context().newCDPSession(page));
    await client.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  };
  const distance = () => page.evaluate(() => window.view.rig.camera.position.distanceTo(window.view.rig.target));
  const before = await distance();
  await touch([[360, 300], [440, 300]], "touchStart");
  await touch([[300, 300], [500, 300]], "touchMove");
  await touch([[240, 300], [560, 300]], "touchMove");
  await touch([], "touchEnd");
  assert.ok((await distance()) < 0.8 * before, "fingers apart come nearer");
  const position = await page.evaluate(() => window.view.rig.camera.position.toArray());
  await touch([[100, 500]], "touchStart");
  await touch([[160, 500]], "touchMove");
  await touch([[220, 500]], "touchMove");
  await touch([], "touchEnd");
  assert.notDeepEqual(await page.evaluate(() => window.view.rig.camera.position.toArray()), position);
  assert.equal((await seen(page)).clicks.length, 0);
}, { touch: true });

view3d("a picture of the view is a PNG of its size", async (page) => {
  const [type, width, height] = await page.evaluate(async () => {
    const blob = await window.view.captureImage();
    const picture = await createImageBitmap(blob);
    return [blob.type, picture.width, picture.height];
  });
  assert.deepEqual([type, width, height], ["image/png", SIZE.width, SIZE.height]);
});

view3d("lists of vertices are read as people type them", async (page) => {
  const read = (text) => page.evaluate((t) => window.lists.parseVertices(t, 100), text);
  assert.deepEqual(await read("3, 1-2;7"), [1, 2, 3, 7]);
  assert.deepEqual(await read("  "), []);
  for (const wrong of ["5-3", "100", "a", "1-", "-4"]) assert.equal(await read(wrong), null, wrong);
  assert.equal(await page.evaluate(() => window.lists.formatVertices([1, 2, 3, 7, 8, 10])), "1-3, 7, 8, 10");
});
