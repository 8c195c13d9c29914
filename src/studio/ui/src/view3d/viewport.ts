// A 3D view: scene, camera, pointers and gizmo on one canvas. It draws when something changed, never otherwise.
import { Box3, Color, DirectionalLight, HemisphereLight, Plane, Scene, Vector2, Vector3, WebGLRenderer, type Object3D } from "three";
import { cssColor } from "../shell/theme";
import { OrbitCamera } from "./camera";
import { Gizmo } from "./gizmo";
import { JointLines, LineOverlay, VertexMarks } from "./overlays";
import { PointerRouter, type Pointer, type Tool } from "./pointer";
import type { Pick } from "./picking";
import { Surface } from "./surface";

/** The browser has no WebGL 2, or it is switched off. */
export class NoWebGL2 extends Error {
  constructor() {
    super("This browser has no WebGL 2, which the 3D view needs. Switch on hardware acceleration, or use another browser.");
  }
}

/** A view on a canvas. */
export class Viewport {
  readonly scene = new Scene();
  readonly rig: OrbitCamera;
  readonly pointers: PointerRouter;
  readonly gizmo: Gizmo;
  /** The first surface; `addSurface` adds more. */
  readonly surface: Surface;
  width = 1;
  height = 1;
  private readonly renderer: WebGLRenderer;
  private readonly surfaces = new Set<Surface>();
  private readonly frameListeners = new Set<() => void>();
  private readonly resize: ResizeObserver;
  private requested = 0;
  private disposed = false;

  /** @throws {NoWebGL2} */
  constructor(readonly canvas: HTMLCanvasElement) {
    const context = canvas.getContext("webgl2", { antialias: true, alpha: false, powerPreference: "high-performance" });
    if (!context) throw new NoWebGL2();
    this.renderer = new WebGLRenderer({ canvas, context });
    this.rig = new OrbitCamera(() => this.invalidate());
    // The gizmo listens before the router, which asks whether it took the press.
    this.gizmo = new Gizmo(this.rig.camera, canvas, this.scene, () => this.invalidate());
    this.pointers = new PointerRouter(canvas, this.rig);
    this.pointers.gizmoTook = () => this.gizmo.dragging;
    this.gizmo.isDrag = () => this.pointers.dragged;
    this.surface = this.addSurface();
    this.addLights();
    this.resize = new ResizeObserver(() => this.fitCanvas());
    this.resize.observe(canvas);
    canvas.addEventListener("keydown", this.onKeyDown);
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => this.invalidate());
    this.themeChanged();
  }

  private addLights() {
    const key = new DirectionalLight(0xffffff, 1.9);
    key.position.set(0.4, 0.8, 1);
    this.rig.camera.add(key, key.target);
    key.target.position.set(0, 0, -1);
    this.scene.add(this.rig.camera, new HemisphereLight(0xffffff, 0x8a8f99, 1.35));
  }

  addSurface(): Surface {
    const surface = new Surface(() => this.invalidate());
    paint(surface);
    this.surfaces.add(surface);
    this.scene.add(surface.group);
    return surface;
  }

  removeSurface(surface: Surface) {
    this.surfaces.delete(surface);
    this.remove(surface.group);
    surface.dispose();
  }

  addMarks(surface: Surface, color: string, size = 5): VertexMarks {
    const marks = new VertexMarks(surface, () => this.invalidate(), color, size);
    this.add(marks.points);
    return marks;
  }

  addJoints(): JointLines {
    const joints = new JointLines(() => this.invalidate());
    this.add(joints.group);
    return joints;
  }

  addLines(color: string, onTop = true): LineOverlay {
    const lines = new LineOverlay(() => this.invalidate(), color, onTop);
    this.add(lines.lines);
    return lines;
  }

  /** Any object of three, over the surfaces. */
  add(object: Object3D) {
    this.scene.add(object);
    this.invalidate();
  }

  remove(object: Object3D) {
    this.scene.remove(object);
    this.invalidate();
  }

  set tool(tool: Tool) {
    this.pointers.cancel();
    this.pointers.tool.hover?.(null);
    this.pointers.tool = tool;
    this.canvas.style.cursor = tool.cursor ?? "default";
  }

  /** The nearest hit on any surface. */
  pick(at: Pointer): (Pick & { surface: Surface }) | null {
    let best: (Pick & { surface: Surface }) | null = null;
    for (const surface of this.surfaces) {
      const hit = surface.picker.pick(at.ray);
      if (hit && (!best || hit.distance < best.distance)) best = { ...hit, surface };
    }
    return best;
  }

  /** Where a pointer goes in the plane through a point that faces the camera: the translation from there. */
  screenPlaneDrag(point: Vector3): (at: Pointer) => Vector3 {
    const normal = this.rig.camera.getWorldDirection(new Vector3());
    const plane = new Plane().setFromNormalAndCoplanarPoint(normal, point);
    const last = new Vector3();
    return (at) => {
      const hit = at.ray.intersectPlane(plane, new Vector3());
      if (hit) last.subVectors(hit, point);
      return last.clone();
    };
  }

  /** A translation by so many pixels to the right and up, at a point: for arrow keys. */
  screenStep(point: Vector3, right: number, up: number): Vector3 {
    const scale = this.rig.unitsPerPixel(point);
    const [x, y] = [new Vector3(), new Vector3()];
    this.rig.camera.matrixWorld.extractBasis(x, y, new Vector3());
    return x.multiplyScalar(right * scale).addScaledVector(y, up * scale);
  }

  /** Looks at all surfaces, or at a box. */
  fit(box?: Box3) {
    const all = new Box3();
    if (box) all.copy(box);
    else for (const surface of this.surfaces) if (surface.group.visible) all.union(surface.bounds());
    this.rig.fit(all);
  }

  /** Draws at the next frame. */
  invalidate() {
    if (this.requested || this.disposed) return;
    this.requested = requestAnimationFrame(() => {
      this.requested = 0;
      this.draw();
    });
  }

  private draw() {
    if (this.disposed) return;
    this.renderer.render(this.scene, this.rig.camera);
    this.drawn++;
    // Where the gizmo can be grabbed, in pixels: for tests, which cannot see it.
    const grip = this.gizmo.grip();
    const at = grip && this.project(grip);
    if (at) this.canvas.dataset.gizmo = `${Math.round(at.x)},${Math.round(at.y)}`;
    else delete this.canvas.dataset.gizmo;
    for (const listener of this.frameListeners) listener();
  }

  /** Frames drawn so far. */
  drawn = 0;

  /** Calls `listener` after each frame: for labels over the view. Returns the way to stop. */
  onFrame(listener: () => void): () => void {
    this.frameListeners.add(listener);
    return () => this.frameListeners.delete(listener);
  }

  /** Pixels from the upper left corner; null behind the camera. */
  project(point: Vector3): { x: number; y: number } | null {
    const p = point.clone().project(this.rig.camera);
    return p.z > 1 ? null : { x: ((p.x + 1) / 2) * this.width, y: ((1 - p.y) / 2) * this.height };
  }

  /** Reads the colors of the page again. */
  themeChanged() {
    this.scene.background = new Color(cssColor("--view") || "#dfe3e8");
    this.surfaces.forEach(paint);
    this.invalidate();
  }

  /** The view as a PNG, without the gizmo. */
  async captureImage(): Promise<Blob> {
    const helper = this.scene.children.filter((child) => child.type === "TransformControlsRoot" || "isTransformControlsRoot" in child);
    helper.forEach((child) => (child.visible = false));
    this.renderer.render(this.scene, this.rig.camera);
    const blob = new Promise<Blob>((resolve, reject) =>
      this.canvas.toBlob((found) => (found ? resolve(found) : reject(new Error("the browser gave no picture"))), "image/png"));
    helper.forEach((child) => (child.visible = true));
    this.invalidate();
    return blob;
  }

  private fitCanvas() {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    [this.width, this.height] = [clientWidth, clientHeight];
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.rig.setSize(clientWidth, clientHeight);
    // At once: a canvas that was resized is empty.
    this.draw();
  }

  private readonly onKeyDown = (event: KeyboardEvent) => {
    if (event.key === "Escape" && (this.pointers.active || this.gizmo.dragging)) {
      this.pointers.cancel();
      this.gizmo.cancel();
    } else if (event.key === "Home") this.fit();
    else if (!this.rig.onKey(event)) return;
    event.preventDefault();
    event.stopPropagation();
  };

  /** The middle of the view as a pointer: for keys that act "under the pointer". */
  center(): Pointer {
    const rect = this.canvas.getBoundingClientRect();
    return this.pointers.at({ clientX: rect.left + rect.width / 2, clientY: rect.top + rect.height / 2 });
  }

  /** A polygon of the view in normalized device coordinates. */
  normalized(points: readonly { x: number; y: number }[]): Vector2[] {
    return points.map(({ x, y }) => new Vector2((2 * x) / this.width - 1, 1 - (2 * y) / this.height));
  }

  dispose() {
    this.disposed = true;
    cancelAnimationFrame(this.requested);
    this.resize.disconnect();
    this.gizmo.dispose();
    for (const surface of this.surfaces) surface.dispose();
    this.renderer.dispose();
  }
}

/** Gives a surface the colors of the page. */
function paint(surface: Surface) {
  surface.setColor(cssColor("--view-surface") || "#b9c0c8");
  surface.setLineColor(cssColor("--text") || "#000000");
}
