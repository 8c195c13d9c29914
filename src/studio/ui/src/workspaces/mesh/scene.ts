// The document in the view: surface, colors, marks, gizmo and tools.
import { effect } from "@preact/signals";
import { Quaternion } from "three";
import { BufferKind } from "../../generated/mesh";
import { cssColor, theme } from "../../shell/theme";
import {
  brushTool, categoryColor, categoryRgb, colorValues, combination, grabTool, lassoTool, type Tool, type VertexMarks, type Viewport,
} from "../../view3d";
import { type Drag, type MeshPage } from "./page";

/** Owners that are no handles. */
const FREE = 0;
const OUTSIDE = 0xffff;
/** Vertices of a handle or selection that are drawn as dots at most. */
const MAX_DOTS = 1500;

export class Scene {
  private readonly stops: (() => void)[] = [];
  private owners = new Uint16Array();
  private selection = new Uint32Array();
  private scalars = new Float32Array();
  private shown: ArrayBuffer | null = null;
  private readonly marks: Record<"selection" | "handles" | "active", VertexMarks>;
  private tool: (Tool & { dispose?(): void }) | null = null;
  private fitted = false;

  constructor(private readonly page: MeshPage, readonly view: Viewport) {
    page.view = view;
    const marks = (size: number) => view.addMarks(view.surface, "#000000", size);
    this.marks = { handles: marks(4), active: marks(6), selection: marks(5) };
    this.listen();
    this.follow();
  }

  private listen() {
    const { connection } = this.page;
    const on = (kind: number, listener: (payload: ArrayBuffer, item: number) => void) =>
      this.stops.push(connection.onBuffer(kind, ({ payload, item }) => listener(payload, item)));
    on(BufferKind.Triangles, (payload) => this.setTopology(new Uint32Array(payload)));
    on(BufferKind.Positions, (payload) => this.setPositions(payload));
    on(BufferKind.Selection, (payload) => { this.selection = new Uint32Array(payload); this.recolor(); });
    on(BufferKind.Owners, (payload) => { this.owners = new Uint16Array(payload); this.recolor(); });
    on(BufferKind.Scalars, (payload) => { this.scalars = new Float32Array(payload); this.recolor(); });
    on(BufferKind.Energies, (payload) => { this.page.energies.value = new Float32Array(payload); });
    on(BufferKind.Frame, (payload, item) => this.page.frames.set(item, payload));
  }

  private follow() {
    const { page } = this;
    const on = (body: () => void | (() => void)) => this.stops.push(effect(body));
    on(() => this.view.surface.setWireframe(page.wireframe.value));
    on(() => this.view.surface.setFlat(page.flat.value));
    on(() => { void theme.value; queueMicrotask(() => this.recolor()); });
    on(() => { void page.state.value.overlay; void page.state.value.active; this.recolor(); });
    on(() => this.attachGizmo());
    on(() => this.chooseTool());
    on(() => this.showFrame());
    // Frames of another motion are no longer true.
    on(() => { if (page.state.value.frames_ready === 0) page.frames.clear(); });
  }

  private setTopology(triangles: Uint32Array) {
    this.view.surface.setTopology(triangles, this.page.state.peek().mesh.vertices);
    if (this.shown) this.setPositions(this.shown);
  }

  private setPositions(payload: ArrayBuffer) {
    this.shown = payload;
    if (!this.page.playback.playing.peek()) this.draw(payload);
  }

  private draw(payload: ArrayBuffer) {
    const count = payload.byteLength / 20;
    this.view.surface.setPositions(new Float32Array(payload, 0, 3 * count), new Int16Array(payload, 12 * count, 4 * count));
    if (!this.fitted && this.view.surface.vertexCount > 0) {
      this.fitted = true;
      this.view.fit();
    }
  }

  /** While it plays: the frame at the time; then what the server shows. */
  private showFrame() {
    const { playback, frames, state } = this.page;
    if (!playback.playing.value) {
      if (this.shown) this.draw(this.shown);
      return;
    }
    const count = state.peek().frames;
    const frame = frames.get(Math.round((playback.time.value / playback.duration.value) * (count - 1)));
    if (frame) this.draw(frame);
  }

  private recolor() {
    const { surface } = this.view;
    const count = this.page.state.peek().mesh.vertices;
    if (surface.vertexCount !== count) return;
    const rgb = new Uint8Array(3 * count);
    this.baseColors(rgb);
    const accent = bytes(cssColor("--accent"));
    for (const v of this.selection) mix(rgb, v, accent, 0.6);
    surface.setColors(rgb);
    this.setMarks();
  }

  private baseColors(rgb: Uint8Array) {
    const { overlay } = this.page.state.peek();
    const plain = bytes(cssColor("--view-surface") || "#b9c0c8");
    const outside = bytes(cssColor("--line-strong"));
    if (overlay.kind !== "none" && this.scalars.length === rgb.length / 3) {
      colorValues(this.scalars, 0, overlay.high, overlay.kind === "flipped" ? "heat" : "sequential", rgb);
      this.owners.forEach((owner, v) => { if (owner === OUTSIDE) mix(rgb, v, outside, 0.7); });
      return;
    }
    for (let v = 0; v < rgb.length / 3; v++) {
      const owner = this.owners[v] ?? FREE;
      rgb.set(owner === OUTSIDE ? outside : plain, 3 * v);
      if (owner !== FREE && owner !== OUTSIDE) mix(rgb, v, categoryRgb(owner - 1), 0.75);
    }
  }

  private setMarks() {
    const active = this.page.state.peek().active;
    const of = (test: (owner: number) => boolean) => {
      const found: number[] = [];
      this.owners.forEach((owner, v) => { if (test(owner)) found.push(v); });
      return Uint32Array.from(found);
    };
    // Dots of many vertices would cover the surface, which has the color of the handle anyway.
    const few = (all: Uint32Array) => (all.length <= MAX_DOTS ? all : new Uint32Array());
    const isHandle = (owner: number) => owner !== FREE && owner !== OUTSIDE;
    this.marks.handles.setColor(cssColor("--muted"));
    this.marks.handles.set(few(of((owner) => isHandle(owner) && owner - 1 !== active)));
    this.marks.active.setColor(categoryColor(active ?? 0));
    this.marks.active.set(active === null ? new Uint32Array() : few(of((owner) => owner - 1 === active)));
    this.marks.selection.setColor(cssColor("--accent-strong"));
    this.marks.selection.set(few(this.selection.slice()));
  }

  private attachGizmo() {
    const { page, view } = this;
    const handle = page.active.value;
    const mode = page.mode.value;
    const index = page.state.value.active;
    const { translate, rotateDeg, scale } = page.snapSteps.value;
    view.gizmo.setMode(mode, "local");
    view.gizmo.setSnap(page.snap.value
      ? { translate: (translate / 100) * page.state.value.mesh.diagonal, rotateDeg, scale: scale / 100 }
      : null);
    if (!handle || index === null || handle.kind === "fixed" || page.playback.playing.value || page.tool.value === "region") {
      view.gizmo.attach(null);
      return;
    }
    const [w, x, y, z] = handle.rotation;
    view.gizmo.attach({
      position: page.inScene(handle.position),
      // Scales are along the axes of the mesh.
      quaternion: mode === "scale" ? new Quaternion() : new Quaternion(x, y, z, w),
      onStart: () => { this.gizmoDrag = page.beginDrag(index); },
      onChange: (change) => { if (this.gizmoDrag) page.drag(this.gizmoDrag, change); },
      onEnd: () => { page.endDrag(); this.gizmoDrag = null; this.attachGizmo(); },
    });
  }
  private gizmoDrag: Drag | null = null;

  private chooseTool() {
    const { page, view } = this;
    this.tool?.dispose?.();
    const tools = {
      select: () => this.selectTool(),
      brush: () => this.selectionBrush(),
      lasso: () => this.lasso(),
      grab: () => this.grab(),
      region: () => this.regionBrush(),
    };
    this.tool = tools[page.tool.value]();
    view.tool = this.tool;
  }

  /** Click selects a vertex, or makes its handle the active one. */
  private clicked(vertex: number | null, how: "replace" | "add" | "remove") {
    const owner = vertex === null ? FREE : (this.owners[vertex] ?? FREE);
    if (owner !== FREE && owner !== OUTSIDE && how === "replace") {
      void this.page.edit({ do: "activate", handle: owner - 1 });
    } else if (vertex !== null) void this.page.edit({ do: "select", vertices: [vertex], how });
    else if (how === "replace" && this.selection.length > 0) void this.page.edit({ do: "select_none" });
  }

  private selectTool(): Tool {
    return { click: (at) => this.clicked(this.view.pick(at)?.vertex ?? null, combination(at)) };
  }

  private selectionBrush() {
    let how: "add" | "remove" = "add";
    return brushTool(this.view, {
      radius: () => this.page.brushRadius(),
      color: cssColor("--accent"),
      onStart: (at) => {
        how = at.ctrl ? "remove" : "add";
        if (!at.shift && !at.ctrl && this.selection.length > 0) void this.page.edit({ do: "select_none" });
      },
      onStroke: (vertices) => void this.page.edit({ do: "select", vertices: [...vertices], how, stroke: true }),
      onEnd: () => this.page.connection.seal(),
    });
  }

  private lasso(): Tool {
    return lassoTool(this.view, {
      outline: (points) => { this.page.outline.value = points.slice(); },
      visible: () => this.page.visibleOnly.peek(),
      onSelect: (vertices, how) => void this.page.edit({ do: "select", vertices: [...vertices], how }),
      onClick: (hit, at) => this.clicked(hit?.vertex ?? null, combination(at)),
    });
  }

  /** Drags the handle under the pointer in the plane of the screen; a free vertex becomes one. */
  private grab(): Tool {
    return grabTool<{ handle: number; drag: Drag | null }>(this.view, {
      grab: (hit) => {
        const owner = hit ? (this.owners[hit.vertex] ?? FREE) : FREE;
        const handle = owner === FREE || owner === OUTSIDE ? null : this.page.state.peek().handles[owner - 1];
        if (!hit || !handle || handle.kind === "fixed") return null;
        return { what: { handle: owner - 1, drag: null }, point: hit.point };
      },
      onStart: (what) => {
        what.drag = this.page.beginDrag(what.handle);
        void this.page.edit({ do: "activate", handle: what.handle });
      },
      onMove: (what, translation) => { if (what.drag) this.page.drag(what.drag, { translation }); },
      onEnd: () => this.page.endDrag(),
      onClick: (hit, at) => this.clicked(hit?.vertex ?? null, combination(at)),
    });
  }

  private regionBrush() {
    const paint = (vertices: Uint32Array, ctrl: boolean) => {
      const inside = this.page.paintOutside.peek() === ctrl;
      void this.page.edit({ do: "paint_region", vertices: [...vertices], inside, stroke: true });
    };
    return brushTool(this.view, {
      radius: () => this.page.brushRadius(),
      color: cssColor("--warning"),
      onStroke: (vertices, _, at) => paint(vertices, at.ctrl),
      onEnd: () => this.page.connection.seal(),
    });
  }

  dispose() {
    this.stops.forEach((stop) => stop());
    this.tool?.dispose?.();
    this.page.view = null;
  }
}

/** A color of CSS as bytes of sRGB. */
function bytes(color: string): [number, number, number] {
  const hex = /^#([0-9a-f]{6})$/i.exec(color.trim())?.[1];
  const value = hex ? parseInt(hex, 16) : 0xb9c0c8;
  return [(value >> 16) & 255, (value >> 8) & 255, value & 255];
}

function mix(rgb: Uint8Array, v: number, color: readonly number[], amount: number) {
  for (let c = 0; c < 3; c++) rgb[3 * v + c] = Math.round(rgb[3 * v + c]! * (1 - amount) + color[c]! * amount);
}

