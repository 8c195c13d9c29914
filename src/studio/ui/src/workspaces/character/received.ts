// Buffers of the server into the signals of the page, and what this window looks at to the server.
import { batch, computed, effect, type Signal } from "@preact/signals";
import { Frames } from "./frames";
import { KINDS } from "../../generated/character";
import type { Page, Shape } from "./page";

/** Begins; gives the ways to stop. */
export function receive(page: Page): (() => void)[] {
  const { connection } = page;
  const on = (kind: number, set: (payload: ArrayBuffer, item: number) => void) => connection.onBuffer(kind, ({ payload, item }) => batch(() => set(payload, item)));
  let triangles: Uint32Array | null = null;
  let rest: Float32Array | null = null;
  const mesh = () => {
    if (triangles && rest && page.geometry.peek()?.rest !== rest) page.geometry.value = { triangles, rest };
  };
  let weights: Float32Array | null = null;
  let joints: Uint16Array | null = null;
  const skin = () => {
    if (weights && joints && weights.length === joints.length) page.influences.value = weights.length === 0 ? null : { joints, weights };
  };
  const frames = (into: Signal<Frames>) => (payload: ArrayBuffer) => (into.value = new Frames(new Float32Array(payload)));
  return [
    on(KINDS.triangles, (payload) => { triangles = new Uint32Array(payload); mesh(); }),
    on(KINDS.rest, (payload) => { rest = new Float32Array(payload); mesh(); }),
    on(KINDS.restFrames, frames(page.rest)),
    on(KINDS.posedFrames, frames(page.posed)),
    on(KINDS.skinJoints, (payload) => { joints = new Uint16Array(payload); skin(); }),
    on(KINDS.skinWeights, (payload) => { weights = new Float32Array(payload); skin(); }),
    on(KINDS.heat, (payload) => (page.heat.value = payload.byteLength === 0 ? null : new Float32Array(payload))),
    on(KINDS.positions, (payload) => (page.positions.value = shape(payload))),
    on(KINDS.onion, (payload, item) => onion(page, item, payload)),
    on(KINDS.compared, (payload, item) => compared(page, item, payload)),
    ...look(page),
  ];
}

const shape = (payload: ArrayBuffer): Shape | null => (payload.byteLength === 0 ? null : { positions: new Float32Array(payload) });
function onion(page: Page, item: number, payload: ArrayBuffer) {
  const count = page.onion.count.peek();
  const before = item < count;
  const distance = before ? count - item : item - count + 1;
  const others = page.onionPoses.peek().filter((pose) => pose.distance <= count && (pose.before !== before || pose.distance !== distance));
  page.onionPoses.value = [...others, { frames: new Frames(new Float32Array(payload)), before, distance }];
}
function compared(page: Page, item: number, payload: ArrayBuffer) {
  const method = (["linear", "dual-quaternion", "centers", "mixed", "regression"] as const)[item];
  const found = shape(payload);
  if (method && found) page.comparedShapes.value = new Map(page.comparedShapes.peek()).set(method, found);
}

/** Milliseconds between two times that are asked for while a clip plays. */
const TIME_MS = 30;

/** At most one call in that time; the last value is never lost. */
function throttled<T>(send: (value: T) => void): { put: (value: T) => void; flush: () => void } {
  let [last, timer] = [-Infinity, 0];
  let waiting: { value: T } | null = null;
  const flush = () => {
    clearTimeout(timer);
    if (!waiting) return;
    const { value } = waiting;
    waiting = null;
    last = performance.now();
    send(value);
  };
  const put = (value: T) => {
    waiting = { value };
    clearTimeout(timer);
    const wait = TIME_MS - (performance.now() - last);
    if (wait <= 0) flush();
    else timer = window.setTimeout(flush, wait);
  };
  return { put, flush };
}

/** What this window looks at. */
function look(page: Page): (() => void)[] {
  const heated = computed(() => (page.tab.value === "weights" ? page.active?.index ?? null : null));
  const time = throttled((at: number) => page.connection.view({ time: at }));
  page.showTime = time.flush;
  return [effect(() => page.connection.view({ tab: page.tab.value, joint: heated.value })), effect(() => time.put(page.playback.time.value)),
    effect(() => {
      const on = page.tab.value === "animate" && page.onion.on.value;
      page.connection.view({ onion: on ? [page.onion.count.value, page.onion.spacing.value / page.playback.frameRate.value] : [0, 0] });
    })];
}
