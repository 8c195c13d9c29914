// The connection of a document, with a server that the test plays: what is sent when, and what happens when it goes away.
import assert from "node:assert/strict";
import { ADDRESS, openAlone } from "./alone.mjs";
import { test, until } from "./harness.mjs";

/** Opens a page with a connection; gives what it sent, and the way to answer. */
async function connect(page) {
  const played = { sent: [], sockets: [] };
  await page.routeWebSocket(/\/ws/, (socket) => {
    played.sockets.push(socket);
    socket.onMessage((text) => played.sent.push(JSON.parse(text)));
    socket.send(JSON.stringify({ hello: { proto: 1, workspace: "mesh", document: "d", name: "a.ply" } }));
  });
  played.say = (message) => played.sockets.at(-1).send(message instanceof Buffer ? message : JSON.stringify(message));
  played.take = async (count) => {
    await until(() => played.sent.length >= count, `${count} messages`, 5000);
    return played.sent.splice(0);
  };
  await openAlone(page, "connection.ts", { "/api/open": { document: "d", workspace: "mesh", name: "a.ply", path: "/a.ply" } });
  await until(() => page.evaluate(() => window.connection?.connected.value), "the connection");
  return played;
}

function buffer(kind, item, values) {
  const bytes = Buffer.alloc(16 + 4 * values.length);
  [kind, item, 0, 4 * values.length].forEach((value, i) => bytes.writeUInt32LE(value, 4 * i));
  values.forEach((value, i) => bytes.writeFloatLE(value, 16 + 4 * i));
  return bytes;
}

const connection = (title, body) => test(title, { alone: true }, async ({ page }) => body(page, await connect(page)));

connection("of drags only the newest is sent once the one before is answered", async (page, server) => {
  await page.evaluate(() => [1, 2, 3, 4].forEach((x) => window.connection.drag({ do: "move", x })));
  const [first, ...rest] = await server.take(1);
  assert.deepEqual([first.edit, first.newest, rest.length], [{ do: "move", x: 1 }, true, 0]);
  server.say({ reply: first.id });
  const [second] = await server.take(1);
  assert.deepEqual(second.edit, { do: "move", x: 4 });
});

connection("the last drag is sent before the step ends", async (page, server) => {
  await page.evaluate(() => { [1, 2].forEach((x) => window.connection.drag({ x })); window.connection.seal(); });
  const messages = await server.take(3);
  assert.deepEqual(messages.map(({ edit, seal }) => edit?.x ?? seal), [1, 2, true]);
});

connection("an error reply rejects the edit and is shown", async (page, server) => {
  const outcome = page.evaluate(() => window.connection.edit({ do: "no" }).then(() => "applied", (error) => error.message));
  const [{ id }] = await server.take(1);
  server.say({ reply: id, error: "there is no vertex 9" });
  assert.equal(await outcome, "there is no vertex 9");
  assert.deepEqual(await page.evaluate(() => window.notices.value.map(({ level, text }) => [level, text])), [["error", "there is no vertex 9"]]);
});

connection("buffers are replayed to who listens later: the newest of each item", async (page, server) => {
  for (const message of [buffer(100, 0, [1]), buffer(100, 1, [2, 3]), buffer(100, 0, [4]), Buffer.from([1, 2, 3]), buffer(101, 0, [5]).subarray(0, 18)]) server.say(message);
  server.say({ state: {} });
  await until(() => page.evaluate(() => window.connection.state.value), "the state");
  const seen = await page.evaluate(() => {
    const found = [];
    const listen = (kind) => window.connection.onBuffer(kind, ({ item, payload }) => found.push([kind, item, ...new Float32Array(payload)]));
    listen(101);
    listen(100)();
    return found;
  });
  assert.deepEqual(seen, [[100, 0, 4], [100, 1, 2, 3]]);
});

connection("a lost connection rejects what waits, comes back, and sends the view again", async (page, server) => {
  await page.evaluate(() => { window.connection.view({ overlay: "energy" }); window.connection.view({ time: 2 }); });
  const outcome = page.evaluate(() => window.connection.edit({ do: "slow" }).catch((error) => error.message));
  await server.take(3);
  await server.sockets[0].close();
  assert.match(await outcome, /connection was lost/);
  const [again] = await server.take(1);
  assert.deepEqual(again.view, { overlay: "energy", time: 2 });
  assert.ok(await page.evaluate(() => window.connection.connected.value));
});

connection("a program of another version is not spoken to", async (page, server) => {
  server.say({ hello: { proto: 2, workspace: "mesh", document: "d", name: "a.ply" } });
  await until(() => page.evaluate(() => window.connection.outdated.value), "the message");
  assert.equal(new URL(page.url()).href, ADDRESS);
});
