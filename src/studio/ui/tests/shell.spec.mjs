// The shell: what every document has, on the documents of numbers that programs built for development open ("NAME.fake").
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { audit, inBothThemes, picture, screenshot, test, until } from "./harness.mjs";

const NUMBERS = JSON.stringify({ numbers: [1, 2, 3] });

/** Opens a document of numbers by its path, as the picker does. */
async function openNumbers(page, folder, name = "a.fake") {
  writeFileSync(join(folder, name), NUMBERS);
  await ready(page);
  await page.keyboard.press("Control+o");
  await page.getByRole("combobox", { name: "Find in this folder" }).fill(name);
  await page.getByRole("option", { name }).waitFor();
  await page.keyboard.press("Enter");
  await tab(page, name).waitFor();
  await saved(page, "Saved");
}
/** Until the program has answered: the shell listens to keys. */
const ready = (page) => page.locator(".shell[data-ready=true]").waitFor();
/** Until the top bar says so. */
const saved = (page, text) => page.locator(".saved-state").getByText(text, { exact: true }).waitFor();
const tab = (page, name) => page.getByRole("navigation", { name: "Documents" }).getByRole("button", { name: new RegExp(`^${name}`) });

/** Sends messages over a socket of its own, as another window does, and gives the answers. */
const send = (page, messages) => page.evaluate(async (texts) => {
  const token = sessionStorage.getItem("plumbline session");
  const { documents } = await (await fetch("/api/state", { headers: { "x-plumbline-session": token } })).json();
  const socket = new WebSocket(`ws://${location.host}/ws?document=${encodeURIComponent(documents[0].document)}`, ["plumbline", `token.${token}`]);
  const received = [];
  socket.onmessage = ({ data }) => { if (typeof data === "string") received.push(JSON.parse(data)); };
  await new Promise((resolve, reject) => { socket.onopen = resolve; socket.onerror = () => reject(new Error("no socket")); });
  for (const text of texts) socket.send(text);
  const answers = () => received.filter((message) => "reply" in message);
  const state = () => received.filter((message) => "state" in message).pop()?.state;
  for (let tries = 0; tries < 100 && (answers().length < texts.length || !state()); tries++) await new Promise((resolve) => setTimeout(resolve, 30));
  socket.close();
  return { answers: answers(), state: state() };
}, messages.map((message) => (typeof message === "string" ? message : JSON.stringify(message))));

/** What the browser says when files are dragged over the window and dropped: names and texts. */
const dropAll = (page, files, kinds) => page.evaluate(([files, kinds]) => {
  for (const kind of kinds) {
    const dataTransfer = new DataTransfer();
    for (const [name, text] of files) dataTransfer.items.add(new File([text], name));
    window.dispatchEvent(new DragEvent(kind, { dataTransfer, bubbles: true, cancelable: true }));
  }
}, [files, kinds]);
const drop = (page, name, text, kinds) => dropAll(page, [[name, text]], kinds);

/** A link for one more window. */
const newLink = (page) => page.evaluate(async () => {
  const headers = { "x-plumbline-session": sessionStorage.getItem("plumbline session"), "content-type": "application/json" };
  const { token } = await (await fetch("/api/link", { method: "POST", headers, body: "{}" })).json();
  return `${location.origin}/#token=${token}`;
});

const append = (page, ...numbers) => send(page, numbers.map((number, i) => ({ id: i + 1, edit: { do: "append", number } })));
const sum = async (page) => (await send(page, [{ id: 1, ask: { ask: "sum" } }])).answers[0].result;
const steps = (page) => page.getByRole("complementary", { name: "History" }).getByRole("listitem");

test("the start page offers files, recent documents and examples", { open: ".", media: ["giraffe.ply", "humanoid.glb", "room-kb-125.jpg"] }, async ({ page }) => {
  await page.getByRole("heading", { name: "plumbline studio" }).waitFor();
  for (const example of [/giraffe/, /humanoid/, /room/i]) await page.getByRole("button", { name: example }).first().waitFor();
  await inBothThemes(page, "start");
  await picture(page, "start");
  await page.setViewportSize({ width: 1920, height: 1080 });
  await screenshot(page, "start-large");
});

test("the token leaves the address, works once, and the session survives a reload", async ({ page, server, newPage }) => {
  await ready(page);
  assert.ok(!page.url().includes("token"), page.url());
  await page.reload();
  await page.getByText(/files of/).waitFor();
  const other = await newPage();
  await other.goto(server.url);
  await other.getByRole("heading", { name: "This window has no access" }).waitFor();
  await inBothThemes(other, "locked");
});

test("a file is found and opened with the keyboard, and is recent afterwards", async ({ page, folder }) => {
  await openNumbers(page, folder);
  assert.equal(await page.title(), "a.fake – plumbline studio");
  await page.getByRole("button", { name: "Start page" }).click();
  await page.getByRole("list", { name: "Open" }).getByText("a.fake").waitFor();
  await inBothThemes(page, "start-open");
  await page.getByRole("button", { name: "Close a.fake in all windows" }).click();
  await page.getByRole("region", { name: "Recent" }).getByText("a.fake").waitFor();
  await page.keyboard.press("Control+o");
  await page.getByRole("dialog", { name: "Open a file" }).waitFor();
  await inBothThemes(page, "picker");
  await page.keyboard.press("Escape");
  await until(async () => (await page.getByRole("dialog").count()) === 0, "the picker to close");
});

test("a file that is no document is refused with the reason, where it was chosen or dropped", async ({ page, folder }) => {
  writeFileSync(join(folder, "bad.fake"), "{ no numbers");
  await ready(page);
  await page.keyboard.press("Control+o");
  await page.getByRole("option", { name: "bad.fake" }).dblclick();
  await page.getByRole("alert").filter({ hasText: "bad.fake: key must be a string" }).waitFor();
  await inBothThemes(page, "refused");
  await page.getByRole("button", { name: "Cancel" }).click();
  await drop(page, "bad.fake", "{", ["drop"]);
  await page.getByRole("alert").filter({ hasText: "bad.fake" }).waitFor();
  await inBothThemes(page, "notice");
  for (let left = await page.getByRole("alert").count(); left > 0; left--) await page.getByRole("button", { name: "Dismiss" }).first().click();
  assert.equal(await page.getByRole("alert").count(), 0);
});

test("commands are found by a few letters and run by Enter", async ({ page }) => {
  await ready(page);
  await page.keyboard.press("Control+k");
  await page.getByRole("combobox", { name: "Find a command" }).waitFor();
  await page.keyboard.type("drk");
  await page.getByRole("option", { name: /Dark theme/ }).waitFor();
  await audit(page, "palette");
  await page.keyboard.press("Enter");
  await until(() => page.evaluate(() => document.documentElement.dataset.theme === "dark"), "the dark theme");
  await page.reload();
  await ready(page);
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), "dark");
  await page.getByRole("menuitem", { name: "View" }).click();
  await page.getByRole("menuitemradio", { name: "Theme of the system" }).click();
  await page.keyboard.press("Control+k");
  await inBothThemes(page, "palette");
});

test("shortcuts are listed, and shown in the menus", async ({ page }) => {
  await ready(page);
  await page.keyboard.press("?");
  const list = page.getByRole("dialog", { name: "Keyboard shortcuts" });
  await list.getByText("Ctrl+Shift+Z").waitFor();
  await inBothThemes(page, "shortcuts");
  await page.keyboard.press("Escape");
  await page.getByRole("menuitem", { name: "File" }).focus();
  await page.keyboard.press("ArrowDown");
  await page.getByRole("menu", { name: "File" }).getByText("Ctrl+O").waitFor();
  await inBothThemes(page, "menu");
  await page.keyboard.press("ArrowRight");
  await page.getByRole("menu", { name: "Edit" }).waitFor();
  await page.keyboard.press("Escape");
  assert.equal(await page.evaluate(() => document.activeElement?.textContent), "Edit");
});

test("steps are undone and done again by keyboard, and gone to in the history", async ({ page, folder }) => {
  await openNumbers(page, folder);
  await append(page, 10, 20, 30);
  await page.keyboard.press("Alt+h");
  await until(async () => (await steps(page).count()) === 4, "four steps");
  await inBothThemes(page, "history");
  await page.keyboard.press("Control+z");
  await page.keyboard.press("Control+z");
  await until(async () => (await sum(page)) === 16, "two steps back");
  await page.keyboard.press("Control+Shift+z");
  await until(async () => (await sum(page)) === 36, "one step forward");
  await page.keyboard.press("Control+y");
  await until(async () => (await sum(page)) === 66, "another step forward");
  assert.ok(await page.getByRole("button", { name: "Redo" }).isDisabled());
  await steps(page).first().getByRole("button").click();
  await until(async () => (await sum(page)) === 6, "the first step");
  assert.ok(await page.getByRole("button", { name: "Undo" }).isDisabled());
});

test("saving writes the file, and the tab shows what is not saved", async ({ page, folder }) => {
  await openNumbers(page, folder);
  await append(page, 4);
  await saved(page, "Not saved");
  assert.match(await page.title(), /^• /);
  await page.keyboard.press("Control+s");
  await saved(page, "Saved");
  assert.deepEqual(JSON.parse(readFileSync(join(folder, "a.fake"), "utf8")).numbers, [1, 2, 3, 4]);
});

test("a reload shows the same tabs, document and history", async ({ page, folder }) => {
  await openNumbers(page, folder);
  await append(page, 4);
  await openNumbers(page, folder, "b.fake");
  await tab(page, "a.fake").click();
  await page.reload();
  await tab(page, "b.fake").waitFor();
  await until(async () => (await tab(page, "a.fake").getAttribute("aria-current")) === "page", "the tab that was shown");
  await saved(page, "Not saved");
  await page.keyboard.press("Control+z");
  await saved(page, "Saved");
  await page.keyboard.press("Alt+w");
  await until(async () => (await tab(page, "a.fake").count()) === 0, "the tab to close");
});

test("a program that is killed loses nothing: the window says so, and goes on with the new link", async ({ page, folder, server }) => {
  await openNumbers(page, folder);
  await append(page, 4, 5);
  await new Promise((resolve) => setTimeout(resolve, 1500));
  await server.kill();
  await page.getByRole("alert").filter({ hasText: "The connection to plumbline is lost" }).waitFor();
  await inBothThemes(page, "lost");
  await server.restart();
  await page.getByRole("alert").filter({ hasText: "was started again" }).waitFor();
  await page.goto(server.url);
  await until(async () => (await page.locator(".banner").count()) === 0, "the banner to go");
  assert.equal(await sum(page), 15);
  await saved(page, "Not saved");
});

test("two windows on one document show the same", async ({ page, folder, newPage }) => {
  await openNumbers(page, folder);
  const link = await newLink(page);
  const other = await newPage();
  await other.goto(link);
  await tab(other, "a.fake").waitFor();
  await append(other, 4);
  for (const window of [page, other]) await saved(window, "Not saved");
  await page.keyboard.press("Control+z");
  for (const window of [page, other]) await saved(window, "Saved");
});

test("a file dropped on the window is opened", async ({ page }) => {
  await ready(page);
  await drop(page, "dropped.fake", NUMBERS, ["dragover"]);
  await page.getByText("Drop to open").waitFor();
  await screenshot(page, "drop");
  await drop(page, "dropped.fake", NUMBERS, ["drop"]);
  await tab(page, "dropped.fake").waitFor();
  await until(async () => (await sum(page)) === 6, "the numbers");
});

test("of files that are dropped together the one that names the others is opened, with them", async ({ page }) => {
  await ready(page);
  const scene = {
    asset: { version: "2.0" },
    buffers: [{ uri: "points.bin", byteLength: 36 }],
    bufferViews: [{ buffer: 0, byteLength: 36 }],
    accessors: [{ bufferView: 0, componentType: 5126, count: 3, type: "VEC3", min: [0, 0, 0], max: [2, 2, 0] }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }],
    nodes: [{ mesh: 0 }],
    scenes: [{ nodes: [0] }],
  };
  // (0, 0, 0), (2, 0, 0), (0, 2, 0) as 32-bit numbers: 2 is the bytes 0, 0, 0, "@".
  const two = "\0\0\0@", zero = "\0\0\0\0";
  const points = zero.repeat(3) + two + zero.repeat(3) + two + zero;
  await dropAll(page, [["points.bin", points], ["other.fake", NUMBERS], ["scene.gltf", JSON.stringify(scene)]], ["drop"]);
  await tab(page, "scene.gltf").waitFor();
});

test("an example opens as a copy", { media: ["giraffe.ply", "humanoid.glb"] }, async ({ page, server }) => {
  await page.getByRole("button", { name: /giraffe/ }).first().click();
  await tab(page, "giraffe.ply").waitFor();
  assert.equal(server.said.includes("panicked"), false);
});

test("malformed messages are answered with an error, and the program goes on", async ({ page, folder }) => {
  await openNumbers(page, folder);
  const texts = ["{", "[]", '"text"', JSON.stringify({ id: 1 }), JSON.stringify({ id: 2, edit: { do: "nothing" } }), JSON.stringify({ id: 3, edit: { do: "set", at: 99, to: 1 } }),
    JSON.stringify({ id: 4, undo: true, redo: true }), JSON.stringify({ id: 5, goto: 1e9 }), JSON.stringify({ id: 6, view: 7 })];
  const { answers } = await send(page, texts);
  assert.equal(answers.length, texts.length);
  for (const answer of answers) assert.equal(typeof answer.error, "string", JSON.stringify(answer));
  assert.equal(await sum(page), 6);
});

test("files that another program changed: the user chooses", async ({ page, folder }) => {
  await openNumbers(page, folder);
  await append(page, 4);
  writeFileSync(join(folder, "a.fake"), JSON.stringify({ numbers: [100] }));
  const dialog = page.getByRole("dialog", { name: "Files changed on the disk" });
  await dialog.getByText("a.fake").waitFor();
  await inBothThemes(page, "disk");
  await page.getByRole("button", { name: "Read the files again" }).click();
  await until(async () => (await sum(page)) === 100, "the file as it is now");
  await page.keyboard.press("Control+z");
  await until(async () => (await sum(page)) === 10, "the document before");
  writeFileSync(join(folder, "a.fake"), JSON.stringify({ numbers: [200, 300] }));
  await page.getByRole("button", { name: "Keep mine" }).click();
  await page.keyboard.press("Control+s");
  await until(() => readFileSync(join(folder, "a.fake"), "utf8").includes("[1.0,2.0,3.0,4.0]"), "the file replaced");
});

test("a working program says so", async ({ page, folder }) => {
  await openNumbers(page, folder);
  await send(page, [{ id: 1, edit: { do: "slow", ms: 1500 } }]);
  await page.locator("[data-working=true]").waitFor();
  await page.locator("[data-working=false]").waitFor({ state: "attached" });
});

test("a download link works once", async ({ page, folder }) => {
  await openNumbers(page, folder);
  const { answers } = await send(page, [{ id: 1, ask: { ask: "export" } }]);
  const answer = () => page.evaluate((url) => fetch(url).then(async (found) => [found.status, found.headers.get("content-disposition")]), answers[0].download.url);
  assert.match((await answer())[1], /^attachment/);
  assert.equal((await answer())[0], 404);
});

test("a browser without WebGL 2 gets a clear message, and photos still open", {
  open: "giraffe.ply", media: ["giraffe.ply", "room-kb-125.jpg"], flags: ["--disable-3d-apis"],
}, async ({ page }) => {
  await page.getByText("This browser has no WebGL 2").waitFor();
  await inBothThemes(page, "no-webgl");
});

test("a file named at start is shown at once, and its tab is remembered", { open: "giraffe.ply", media: ["giraffe.ply"] }, async ({ page }) => {
  await until(async () => (await tab(page, "giraffe.ply").getAttribute("aria-current")) === "page", "the file that was named");
  await until(() => page.evaluate(() => JSON.parse(sessionStorage.getItem("plumbline tabs"))?.open.length === 1), "the tab to be kept");
});

test("a fault in a workspace stays in its tab", { open: "giraffe.ply", media: ["giraffe.ply"], expect: ["the view is broken"] }, async ({ newPage, page }) => {
  await tab(page, "giraffe.ply").waitFor();
  const link = await newLink(page);
  const other = await newPage();
  const body = 'export const page = { name: "mesh", commands: () => [], View: () => { throw new Error("the view is broken"); } };';
  await other.route("**/chunks/mesh-*.js", (route) => route.fulfill({ contentType: "text/javascript", body }));
  await other.goto(link);
  await other.getByRole("heading", { name: "This view has failed" }).waitFor();
  await inBothThemes(other, "fault");
  await other.getByRole("button", { name: "Start page" }).click();
  await other.getByRole("heading", { name: "plumbline studio" }).waitFor();
});

test("a document is closed in all windows from the start page", async ({ page, folder }) => {
  await openNumbers(page, folder);
  await append(page, 4);
  await page.getByRole("button", { name: "Start page" }).click();
  await page.getByRole("button", { name: "Close a.fake in all windows" }).click();
  await until(async () => (await tab(page, "a.fake").count()) === 0, "the tab to close");
  await page.getByRole("region", { name: "Recent" }).getByText("a.fake").click();
  await saved(page, "Not saved");
  assert.equal(await sum(page), 10);
});

test("many documents fit into the bar", { size: { width: 1280, height: 720 } }, async ({ page, folder }) => {
  for (let i = 0; i < 12; i++) await openNumbers(page, folder, `document-${i}.fake`);
  const box = await page.getByRole("button", { name: "Keyboard shortcuts" }).boundingBox();
  assert.ok(box.x + box.width <= 1280, "the tools are in the window");
  await inBothThemes(page, "many");
});

test("with a finger controls are larger", { open: "giraffe.ply", media: ["giraffe.ply"], touch: true }, async ({ page }) => {
  await tab(page, "giraffe.ply").waitFor();
  const { height } = await page.getByRole("button", { name: "Undo" }).boundingBox();
  assert.ok(height >= 36, `${height} px`);
  await screenshot(page, "touch");
});

test("a dropped file that was changed is there after the program was killed", async ({ page, server }) => {
  await ready(page);
  await drop(page, "dropped.fake", NUMBERS, ["drop"]);
  await tab(page, "dropped.fake").waitFor();
  await append(page, 4);
  await new Promise((resolve) => setTimeout(resolve, 1500));
  await server.kill();
  await server.restart();
  await page.locator(".banner").getByText("was started again").waitFor();
  await page.goto(server.url);
  await until(async () => (await page.locator(".banner").count()) === 0, "the banner to go");
  assert.equal(await sum(page), 10);
});
