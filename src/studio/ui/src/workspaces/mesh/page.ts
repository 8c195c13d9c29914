// What the page of a mesh document knows beside the document: the tool in hand, the look of the view, buffers of the server.
import { computed, effect, signal, type ReadonlySignal } from "@preact/signals";
import { Quaternion, Vector3 } from "three";
import type { Connection } from "../../connection";
import type { Edit, HandleState, State } from "../../generated/mesh";
import { createPlayback } from "../../shell/components";
import { remembered } from "../../shell/remembered";
import type { GizmoChange, GizmoMode, Viewport } from "../../view3d";

export type ToolName = "select" | "brush" | "lasso" | "grab" | "region";

/** A drag that began: its number, and the handle that it moves. */
export interface Drag { gesture: number; handle: number; time: number }

/** Numbers of gestures: of this window alone. */
let gestures = Math.floor(Math.random() * 2 ** 30);
export const nextGesture = () => (gestures = (gestures + 1) % 2 ** 31);

const IDENTITY = { translation: [0, 0, 0], rotation: [1, 0, 0, 0], scale: [1, 1, 1] } as const;

/** The page of one document. */
export class MeshPage {
  readonly state: ReadonlySignal<State>;
  readonly tool = signal<ToolName>("select");
  readonly mode = remembered<GizmoMode>("mesh gizmo", "translate");
  readonly snap = remembered<boolean>("mesh snap", false);
  /** Percent of the diagonal, degrees, percent. */
  readonly snapSteps = remembered("mesh snap steps", { translate: 1, rotateDeg: 15, scale: 10 });
  readonly brushPercent = remembered<number>("mesh brush", 3);
  readonly visibleOnly = remembered<boolean>("mesh visible only", true);
  readonly wireframe = remembered<boolean>("mesh wireframe", false);
  readonly flat = remembered<boolean>("mesh flat", false);
  readonly paintOutside = signal(true);
  readonly outline = signal<readonly { x: number; y: number }[]>([]);
  readonly energies = signal<Float32Array>(new Float32Array());
  readonly selectedKeys = signal<string[]>([]);
  readonly problem = signal<string | null>(null);
  /** Poses of frames as they came. */
  readonly frames = new Map<number, ArrayBuffer>();
  readonly playback = createPlayback({ duration: 1, frameRate: 24 });
  readonly active: ReadonlySignal<HandleState | null>;
  /** The schema of the settings, once it came. */
  readonly schema = signal<Schema | null>(null);
  view: Viewport | null = null;
  private stops: (() => void)[] = [];

  constructor(readonly connection: Connection<State>) {
    this.state = computed(() => connection.state.value as State);
    this.active = computed(() => {
      const { active, handles } = this.state.value;
      return active === null ? null : (handles[active] ?? null);
    });
  }

  /** Begins what goes on while the document is shown; returns its end. */
  open(): () => void {
    this.connection.ask<Schema>({ ask: "schema" }).then((found) => (this.schema.value = found), () => undefined);
    this.stops = [this.followClock(), this.followTime()];
    return () => {
      this.playback.pause();
      this.stops.forEach((stop) => stop());
    };
  }

  /** The range of the timeline is that of the keys. */
  private followClock() {
    return effect(() => {
      const { times, frames } = this.state.value;
      const duration = Math.max(times[1] - times[0], 1e-9);
      this.playback.duration.value = duration;
      this.playback.frameRate.value = frames > 1 ? (frames - 1) / duration : 24;
    });
  }

  /** The clock and the server show the same time: the user's where the clock is moved, else the server's. */
  private followTime() {
    let sent: number | null = null;
    const same = (a: number, b: number) => Math.abs(a - b) <= 1e-9 * (1 + Math.abs(a));
    const fromServer = effect(() => {
      const { time, times } = this.state.value;
      if (sent !== null && !same(sent, time)) return;
      sent = null;
      if (!this.playback.playing.peek() && !same(this.time.peek(), time)) this.playback.time.value = time - times[0];
    });
    const fromClock = effect(() => {
      const at = this.time.value;
      if (this.playback.playing.value || same(at, sent ?? this.state.peek().time)) return;
      sent = at;
      this.connection.view({ time: at });
    });
    return () => {
      fromServer();
      fromClock();
    };
  }

  /** The time of the document that the timeline shows. */
  readonly time = computed(() => this.playback.time.value + this.firstKey.value);
  private readonly firstKey = computed(() => this.state.value.times[0]);

  /** Sends an edit; what is wrong is shown. */
  edit(edit: Edit): Promise<void> {
    return this.connection.edit(edit).then(
      () => { this.problem.value = null; },
      (error: unknown) => { this.problem.value = error instanceof Error ? error.message : String(error); },
    );
  }

  /** Edits one after another. */
  async edits(...all: Edit[]) {
    for (const edit of all) await this.edit(edit);
  }

  download(ask: unknown) {
    return this.connection.ask(ask).catch((error: unknown) => { this.problem.value = error instanceof Error ? error.message : String(error); });
  }

  /** A point of the document in the scene. */
  inScene(point: readonly number[]): Vector3 {
    const { center } = this.state.peek().mesh;
    return new Vector3(point[0]! - center[0], point[1]! - center[1], point[2]! - center[2]);
  }

  /** The radius of the brush, in units of the mesh. */
  brushRadius(): number {
    return (this.brushPercent.value / 100) * this.state.peek().mesh.diagonal;
  }

  beginDrag(handle: number): Drag {
    return { gesture: nextGesture(), handle, time: this.time.peek() };
  }

  drag(drag: Drag, change: Partial<GizmoChange>) {
    const { translation: t, rotation: r, scale: s } = change;
    this.connection.drag({
      do: "drag",
      ...drag,
      translation: t ? [t.x, t.y, t.z] : IDENTITY.translation,
      rotation: r ? [r.w, r.x, r.y, r.z] : IDENTITY.rotation,
      scale: s ? [s.x, s.y, s.z] : IDENTITY.scale,
    });
  }

  endDrag() {
    this.connection.seal();
  }

  /** One drag from a key or a typed number. */
  moveActive(change: Partial<GizmoChange>) {
    const { active } = this.state.peek();
    if (active === null) return;
    this.drag(this.beginDrag(active), change);
    this.endDrag();
  }

  /** Moves the active handle by pixels of the view: arrow keys. */
  nudge(right: number, up: number) {
    const handle = this.active.peek();
    if (!handle || handle.kind === "fixed" || !this.view) return;
    this.moveActive({ translation: this.view.screenStep(this.inScene(handle.position), right, up) });
  }

  /** Turns the active handle about the axis of sight. */
  turn(degrees: number) {
    const handle = this.active.peek();
    if (!handle || handle.kind === "fixed" || !this.view) return;
    const axis = this.view.rig.camera.getWorldDirection(new Vector3());
    this.moveActive({ rotation: new Quaternion().setFromAxisAngle(axis, (degrees * Math.PI) / 180) });
  }

  /** Poses for a playback, where there is one alone. */
  togglePlayback() {
    if (this.state.peek().frames < 2 && !this.playback.playing.peek()) void this.edit({ do: "set_frames", frames: 25 });
    this.playback.toggle();
  }
}

/** What of the schema is read. */
export interface Property {
  description?: string;
  default?: unknown;
  minimum?: number;
  maximum?: number;
  type?: string | string[];
  oneOf?: { const: string; description?: string }[];
  anyOf?: Property[];
}
export interface Schema { properties: Record<string, Property>; defaults: Record<string, unknown> }

const pages = new WeakMap<Connection<State>, MeshPage>();

/** The page of a document: one for all its parts. */
export function pageOf(connection: Connection<State>): MeshPage {
  const known = pages.get(connection);
  if (known) return known;
  const page = new MeshPage(connection);
  pages.set(connection, page);
  return page;
}
