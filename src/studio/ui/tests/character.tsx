// The character workspace against a played server: it has a character, records what it is sent, and changes nothing.
import { h, render } from "preact";
import { signal } from "@preact/signals";
import type { Connection, Incoming } from "../src/connection";
import { commandsOf } from "../src/workspaces/character/commands";
import { page as workspace } from "../src/workspaces/character/index";
import { KINDS, type State } from "../src/generated/character";
import { pageOf } from "../src/workspaces/character/page";
import { matches, taken } from "../src/shell/shortcuts";

interface Played { positions: number[]; triangles: number[]; joints: number[]; weights: number[]; skeleton: { name: string; parent: number | null; at: number[] }[] }

const played = (await (await fetch("/humanoid.json")).json()) as Played;
const center = [0, 0.87, 0];
const sent: unknown[] = [];
const listeners = new Map<number, Set<(buffer: Incoming) => void>>();
const newest = new Map<number, Map<number, Incoming>>();

function play(kind: number, item: number, values: Float32Array | Uint32Array | Uint16Array) {
  const buffer = { kind, item, edit: 0, payload: values.buffer as ArrayBuffer };
  newest.set(kind, (newest.get(kind) ?? new Map<number, Incoming>()).set(item, buffer));
  listeners.get(kind)?.forEach((listener) => listener(buffer));
}

const frames = () => new Float32Array(played.skeleton.flatMap(({ at }) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, at[0]! - center[0]!, at[1]! - center[1]!, at[2]! - center[2]!, 1]));

const HINGE = { axis: [1, 0, 0], across: [0, 1, 0], swing: [0.8, 0.5], twist: [-0.4, 1.2] };
const state = signal({
  name: "humanoid.glb", mesh: { vertices: played.positions.length / 3, triangles: played.triangles.length / 3, diagonal: 2.5, center, up: "y" },
  joints: played.skeleton.map(({ name, parent }) => ({ name, parent, limits: name.startsWith("forearm") ? HINGE : null, locked: name === "head" })), templates: ["humanoid", "quadruped"],
  extraction: { options: { contraction: 0.7, attraction: 0.1, medial: 0.3, prune: 1.5, iterations: 12 }, joints: null, ends: [3, 5], running: null, report: null },
  weights: { method: "heat", influences: 4, smooth: 0, painted: 0, running: null }, skinning: "linear",
  targets: [{ joint: 4, kind: "look_at", at: [0, 1.6, 3], weight: 1 }], poses: ["T pose"], clips: ["walk"], clip: "walk", duration: 2,
  tracks: [0, 1, 7].map((joint) => ({ joint, times: [0, 0.5, 2], interpolation: "spline", rotations: [[0, 0, 0, 1], [0.4794, 0, 0, 0.8776], [0, 0, 0, 1]] })),
  unkeyed: [{ time: 1, joints: ["head", "neck"] }], run: { clip: null, frames: 1 }, model: null,
  compare: [{ method: "linear", volume: 0.93, stretch: 1.4 }, { method: "dual-quaternion", volume: 1.01, stretch: 1.3 }],
} as unknown as State);

const connection: Connection<State> = {
  document: "d", workspace: "character", state, history: signal({ steps: [], at: 0, savedAt: 0 }), working: signal(false), connected: signal(true),
  edit: (edit) => { sent.push({ edit }); return Promise.resolve(); },
  drag: (edit) => sent.push({ drag: edit }),
  seal: () => sent.push({ seal: true }),
  view: (view) => sent.push({ view }),
  ask: <T,>(ask: unknown) => { sent.push({ ask }); return Promise.resolve("plumbline run humanoid.toml" as T); },
  undo: () => sent.push({ undo: true }), redo: () => undefined, goTo: () => undefined, save: () => Promise.resolve(),
  onBuffer(kind, listener) {
    listeners.set(kind, (listeners.get(kind) ?? new Set()).add(listener));
    newest.get(kind)?.forEach((buffer) => listener(buffer));
    return () => void listeners.get(kind)?.delete(listener);
  },
};

play(KINDS.triangles, 0, new Uint32Array(played.triangles));
play(KINDS.rest, 0, new Float32Array(played.positions.map((x, i) => x - center[i % 3]!)));
play(KINDS.restFrames, 0, frames());
play(KINDS.posedFrames, 0, frames());
play(KINDS.skinJoints, 0, new Uint16Array(played.joints));
play(KINDS.skinWeights, 0, new Float32Array(played.weights));
const chest = Float32Array.from({ length: played.positions.length / 3 }, (_, v) =>
  [0, 1, 2, 3].reduce((sum, k) => sum + (played.joints[4 * v + k] === 2 ? played.weights[4 * v + k]! : 0), 0));
play(KINDS.heat, 0, chest);
for (let k = 0; k < 4; k++) play(KINDS.compared, k, new Float32Array(played.positions.map((x, i) => x - center[i % 3]!)));

const page = pageOf(connection);
window.addEventListener("keydown", (event) => {
  const command = commandsOf(page).find(({ shortcut, enabled }) => shortcut && matches(event, shortcut) && !taken(event, shortcut) && (enabled?.() ?? true));
  if (!command || event.defaultPrevented) return;
  event.preventDefault();
  command.run();
});
Object.assign(window, { sent, character: page });
render(<div class="shell" style={{ gridTemplateRows: "1fr" }}><div class="workspace">{h(workspace.View, { connection })}</div></div>, document.getElementById("studio")!);
