// Jobs on photos, as a user does them: lines drawn and moved, found ones adopted, lens, faces, the saved file run.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { audit, inBothThemes, picture, screenshot, test, until } from "./harness.mjs";

const ROOM = "room-kb-125.jpg";
const WIDTH = 1200;
const HEIGHT = 900;
const MARGIN = 24;

const truth = JSON.parse(readFileSync(new URL("../../../../media/room-kb-125.lines.json", import.meta.url), "utf8")).lines;
/** Points along an edge of the room, `count` of them, as a user clicks them. */
const edge = (name, count = 5) => {
  const { points } = truth.find((line) => line.name === name);
  return Array.from({ length: count }, (_, k) => points[Math.round((k * (points.length - 1)) / (count - 1))]).map(([x, y]) => [Math.min(WIDTH - 1, Math.max(1, x)), Math.min(HEIGHT - 1, Math.max(1, y))]);
};

const source = (page) => page.getByTestId("source");
const list = (page, name) => page.getByRole("listbox", { name, exact: true });
const line = (page, name) => list(page, "Marked lines").getByRole("option", { name });
const exact = (page, timeout = 40_000) => until(async () => {
  const text = await page.getByRole("region", { name: "Result" }).locator(".view-facts").first().textContent({ timeout: 1000 });
  return / px$/.test(text ?? "") && !(await page.locator("[data-working=true]").count());
}, "the picture at rest", timeout);

/** Until nothing is computed, and the top bar has faded it out. */
const idle = async (page) => {
  await page.locator("[data-working=false]").waitFor({ timeout: 40_000, state: "attached" });
  await page.waitForTimeout(400);
};

/** Where a position of the photo is on the screen, the whole photo being shown. */
async function at(page, [x, y]) {
  const box = await source(page).boundingBox();
  const scale = Math.min((box.width - MARGIN) / WIDTH, (box.height - MARGIN) / HEIGHT);
  return [box.x + box.width / 2 + (x - WIDTH / 2) * scale, box.y + box.height / 2 + (y - HEIGHT / 2) * scale];
}

async function draw(page, name, count) {
  await page.getByRole("application").focus();
  await page.keyboard.press("l");
  for (const p of edge(name, count)) await page.mouse.click(...(await at(page, p)));
  await page.keyboard.press("Enter");
}

async function dragTo(page, from, to) {
  await page.mouse.move(...(await at(page, from)));
  await page.mouse.down();
  await page.mouse.move(...(await at(page, to)), { steps: 8 });
  await page.mouse.up();
}

/** What the page says a point is, from the list of points. */
const pointText = (page, name) => page.getByRole("listbox", { name: /^Points of/ }).getByRole("option", { name }).textContent();

const open = async (page) => {
  await page.getByText(`${WIDTH} × ${HEIGHT} px`).first().waitFor();
  await list(page, "Found lines").getByRole("option").nth(3).waitFor({ timeout: 40_000 });
};

const stepsOf = async (page) => {
  const history = page.getByRole("complementary", { name: "History" });
  if ((await history.count()) === 0) await page.keyboard.press("Alt+h");
  return history.getByRole("listitem").allTextContents();
};

test("a photo is made straight: lines drawn, moved, adopted and oriented, lens, face, saved and run", { media: [ROOM, "room-kb-125.lens.json"], open: ROOM, timeout: 200_000 }, async ({ page, server, folder }) => {
  await open(page);
  // Its edges tell the lens, and the result is made with the lines that are found under it.
  await exact(page);
  await page.getByLabel("Lens in use").getByText(/from \d+ of \d+ edges found in the picture/).waitFor();
  await page.getByText("The result is made with these until lines are marked").waitFor();
  await idle(page);
  await inBothThemes(page, "photo-lens-of-edges");
  // The first line keeps the found ones. Without them three curved lines determine the lens.
  const found = await list(page, "Found lines").getByRole("option").count();
  const [first, ...others] = ["beam 2 near", "floor joint across 5", "shelf 5", "ceiling left"];
  await draw(page, first, 7);
  await until(async () => (await list(page, "Marked lines").getByRole("option").count()) === found + 1, "the found lines, kept with the first");
  await page.keyboard.press("v");
  await list(page, "Marked lines").getByRole("option").nth(0).click();
  await list(page, "Marked lines").getByRole("option").nth(found - 1).click({ modifiers: ["Shift"] });
  await page.keyboard.press("Delete");
  await until(async () => (await list(page, "Marked lines").getByRole("option").count()) === 1, "the drawn line alone");
  for (const name of others) await draw(page, name, 7);
  await page.keyboard.press("v");
  await exact(page);
  await page.getByText(/from marked lines/).waitFor();
  await screenshot(page, "photo-lens-of-lines");
  // A lens file instead.
  await page.getByRole("radio", { name: "File" }).click();
  await page.getByLabel("Lens in use").getByText(/file .*room-kb-125.lens.json/).waitFor();
  await exact(page);
  // An end is moved by the pointer, then by keys.
  await line(page, "line 1").click();
  const start = edge("beam 2 near", 7)[0];
  const before = await pointText(page, "Start");
  await dragTo(page, start, [start[0] - 20, start[1] + 12]);
  await until(async () => (await pointText(page, "Start")) !== before, "the point to move");
  await page.keyboard.press("Control+z");
  await until(async () => (await pointText(page, "Start")) === before, "undo of the drag as one step");
  await page.getByRole("listbox", { name: /^Points of/ }).getByRole("option", { name: "Start" }).click();
  await page.getByRole("application").focus();
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Shift+ArrowDown");
  const [x, y] = before.match(/[\d.]+/g).map(Number);
  await until(async () => (await pointText(page, "Start")).includes(`${(x + 1).toFixed(1)}, ${(y + 10).toFixed(1)}`), "the point to move by keys");
  await page.keyboard.press("Control+z");
  await until(async () => (await pointText(page, "Start")) === before, "undo of both, which are one step");
  // Found ones are adopted, one gets an orientation.
  await list(page, "Found lines").getByRole("option").nth(0).click();
  await list(page, "Found lines").getByRole("option").nth(2).click({ modifiers: ["Control"] });
  await page.getByRole("button", { name: "Adopt 2" }).click();
  await until(async () => (await list(page, "Marked lines").getByRole("option").count()) === 6, "two adopted lines");
  await draw(page, "shelf side 2", 5);
  await page.keyboard.press("v");
  await line(page, "line 5").waitFor();
  await page.getByLabel("Orientation").selectOption("vertical");
  await exact(page);
  const straightness = page.getByLabel("Straightness of the line");
  await straightness.getByText("Off its orientation").waitFor();
  assert.match(await straightness.textContent(), /Off its orientation0\.0\d\d°/);
  // A face by a box, then by keys.
  await page.keyboard.press("f");
  await dragTo(page, [560, 480], [620, 560]);
  const face = list(page, "Faces").getByRole("option", { name: "face 1" });
  await face.waitFor();
  await page.getByRole("application").focus();
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("]");
  await until(async () => (await face.textContent()).includes("64 × 84"), "the face to grow");
  await page.keyboard.press("g");
  await exact(page);
  await idle(page);
  await inBothThemes(page, "photo");
  await picture(page, "photo");
  await page.keyboard.press("g");
  // Undo and redo of everything.
  const steps = (await stepsOf(page)).length;
  for (let k = 1; k < steps; k++) await page.keyboard.press("Control+z");
  await until(async () => (await list(page, "Marked lines").getByRole("option", { name: /px/ }).count()) === 0, "no lines after undo");
  for (let k = 1; k < steps; k++) await page.keyboard.press("Control+Shift+Z");
  await until(async () => (await list(page, "Marked lines").getByRole("option").count()) === 7, "all lines after redo");
  await page.keyboard.press("Alt+h");
  // Saved, exported, run: the same bytes.
  await page.keyboard.press("Control+s");
  await page.locator(".saved-state").getByText("Saved", { exact: true }).waitFor();
  await exact(page);
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Export picture" }).click()]);
  const exported = readFileSync(await download.path());
  assert.equal(download.suggestedFilename(), "room-kb-125-straight.jpg");
  await server.run("run", "room-kb-125.rectify.toml");
  const written = readFileSync(join(folder, "room-kb-125-straight.jpg"));
  assert.ok(exported.equals(written), `${exported.length} and ${written.length} bytes`);
  await exact(page);
  const off = await difference(page, written);
  assert.ok(off < 4, `what is shown differs from the file by ${off} of 255`);
});

/** Mean difference of what the result shows and a picture file laid over it. */
const difference = (page, bytes) => page.evaluate(async (base64) => {
  const data = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  const image = await createImageBitmap(new Blob([data], { type: "image/jpeg" }));
  const shown = document.querySelector("canvas[aria-label='Rectified picture']");
  const [w, h] = [shown.width, shown.height];
  const scale = Math.min((w / devicePixelRatio - 24) / image.width, (h / devicePixelRatio - 24) / image.height) * devicePixelRatio;
  const other = document.createElement("canvas");
  [other.width, other.height] = [w, h];
  const context = other.getContext("2d");
  context.imageSmoothingQuality = "high";
  context.drawImage(image, w / 2 - (image.width * scale) / 2, h / 2 - (image.height * scale) / 2, image.width * scale, image.height * scale);
  const [a, b] = [shown, other].map((canvas) => canvas.getContext("2d").getImageData(0, 0, w, h).data);
  // Lines are drawn over the result: the median of the differences is that of the picture.
  const off = [];
  for (let k = 0; k < a.length; k += 4) if (a[k + 3] > 0 && b[k + 3] > 0) off.push(Math.abs(a[k + 1] - b[k + 1]));
  off.sort((p, q) => p - q);
  return off[Math.floor(off.length / 2)];
}, bytes.toString("base64"));

test("the keyboard alone marks a line, moves its end, sets orientation, lens and face, and saves", { media: [ROOM], open: ROOM, timeout: 120_000 }, async ({ page, folder }) => {
  await open(page);
  await page.keyboard.press("Shift+L");
  await line(page, "line 1").waitFor();
  await page.getByText("arrow keys move the point", { exact: false }).first().waitFor();
  await page.keyboard.press(".");
  await page.keyboard.press(",");
  await until(async () => (await page.getByRole("listbox", { name: /^Points of/ }).getByRole("option", { selected: true }).textContent()).startsWith("Start"), "the start");
  const before = await pointText(page, "Start");
  await page.keyboard.press("Alt+ArrowUp");
  await page.keyboard.press("Alt+Shift+ArrowLeft");
  const [x, y] = before.match(/[\d.]+/g).map(Number);
  await until(async () => (await pointText(page, "Start")).includes(`${(x - 10).toFixed(1)}, ${(y - 1).toFixed(1)}`), "the end to move");
  await page.keyboard.press("i");
  await until(async () => (await page.getByRole("listbox", { name: /^Points of/ }).getByRole("option").count()) === 4, "a point more");
  await page.keyboard.press("2");
  await until(async () => (await page.getByLabel("Orientation").inputValue()) === "horizontal", "the orientation");
  // The lens: by Tab and arrow keys.
  await page.getByRole("radio", { name: "Automatic" }).focus();
  await page.keyboard.press("ArrowRight");
  const model = page.getByLabel("Model", { exact: true }).and(page.locator("select"));
  await model.waitFor();
  await model.selectOption("equidistant");
  await page.getByLabel("Lens in use").getByText(/equidistant, /).waitFor();
  await page.getByLabel("Field of view", { exact: true }).fill("125");
  await page.keyboard.press("Enter");
  await exact(page);
  await page.getByText("equidistant, 125.0°").waitFor();
  await page.getByRole("application").focus();
  await page.keyboard.press("Shift+F");
  const face = list(page, "Faces").getByRole("option", { name: "face 1" });
  await face.waitFor({ timeout: 20_000 });
  await page.keyboard.press("ArrowDown");
  await list(page, "Faces").focus();
  await page.keyboard.press("Delete");
  await until(async () => (await face.count()) === 0, "no face");
  await idle(page);
  await audit(page, "after keys");
  await page.keyboard.press("Control+s");
  await page.locator(".saved-state").getByText("Saved", { exact: true }).waitFor();
  const saved = JSON.parse(readFileSync(join(folder, "room-kb-125.lines.json"), "utf8"));
  const drawn = saved.lines.find((line) => line.name === "line 1");
  assert.equal(drawn.orientation, "horizontal");
  assert.equal(drawn.points.length, 4);
});

test("a reload and a killed program lose no mark, and two windows show one document", { media: [ROOM], open: ROOM, timeout: 120_000 }, async ({ page, server, newPage }) => {
  await open(page);
  await draw(page, "beam 2 near", 5);
  await draw(page, "shelf 5", 5);
  await line(page, "line 2").waitFor();
  await page.reload();
  await line(page, "line 2").waitFor();
  const link = await page.evaluate(async () => {
    const headers = { "x-plumbline-session": sessionStorage.getItem("plumbline session"), "content-type": "application/json" };
    const { token } = await (await fetch("/api/link", { method: "POST", headers, body: "{}" })).json();
    return `${location.origin}/#token=${token}`;
  });
  const other = await newPage();
  await other.goto(link);
  await line(other, "line 2").waitFor({ timeout: 20_000 });
  await other.keyboard.press("Shift+L");
  await line(page, "line 3").waitFor();
  await page.keyboard.press("Control+z");
  await until(async () => (await line(other, "line 3").count()) === 0, "undo in the other window");
  await page.waitForTimeout(1500);
  await server.kill();
  await server.restart();
  await page.goto(server.url);
  await line(page, "line 2").waitFor({ timeout: 30_000 });
});
