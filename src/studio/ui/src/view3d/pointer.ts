// Pointers of a view: mouse, pen and fingers go to the gizmo, to the tool, or move the camera.
//
// A press belongs to the gizmo where it is under the pointer, else to the tool if that takes it, else to the camera. A press that is
// released where it began is a click, of the gizmo's too: the gizmo never swallows clicks.
import { Vector2, type Ray, Raycaster } from "three";
import type { OrbitCamera } from "./camera";

/** A pointer over the view. */
export interface Pointer {
  /** CSS pixels from the upper left corner of the view. */
  readonly x: number;
  readonly y: number;
  /** Normalized device coordinates. */
  readonly ndc: Vector2;
  readonly ray: Ray;
  readonly shift: boolean;
  readonly ctrl: boolean;
  /** 0 to 1; 0.5 without a sensor. */
  readonly pressure: number;
}

/** What a press does until it is released. */
export interface Gesture {
  move(at: Pointer): void;
  end(at: Pointer): void;
  /** A second finger came, or Escape: nothing shall have happened. */
  cancel(): void;
}

/** What the primary button, a finger or a pen does in the view. */
export interface Tool {
  /** CSS cursor. */
  cursor?: string;
  /** A press; null leaves it to the camera. */
  press?(at: Pointer): Gesture | null;
  /** A press that was not taken and released in place. */
  click?(at: Pointer): void;
  /** The pointer without a button; null: it left. */
  hover?(at: Pointer | null): void;
}

/** Pixels within which a press is a click. */
const CLICK = 5;

type Mode = "gizmo" | "tool" | "orbit" | "pan" | "pinch";

/** Routes the pointers of `canvas`. */
export class PointerRouter {
  tool: Tool = {};
  /** Whether the gizmo took the press that is being handled; asked right after its own listeners have run. */
  gizmoTook: () => boolean = () => false;
  private readonly down = new Map<number, { x: number; y: number }>();
  private mode: Mode | null = null;
  private gesture: Gesture | null = null;
  private start = { x: 0, y: 0 };
  private moved = false;

  constructor(private readonly canvas: HTMLCanvasElement, private readonly rig: OrbitCamera) {
    canvas.addEventListener("pointerdown", this.onDown);
    canvas.addEventListener("pointermove", this.onMove);
    canvas.addEventListener("pointerup", this.onUp);
    canvas.addEventListener("pointercancel", this.onCancel);
    canvas.addEventListener("pointerleave", () => this.tool.hover?.(null));
    canvas.addEventListener("wheel", this.onWheel, { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  /** Ends a gesture without effect. */
  cancel() {
    this.gesture?.cancel();
    this.gesture = null;
    if (this.mode === "tool") this.mode = null;
  }

  /** Whether the press has moved too far to be a click. */
  get dragged(): boolean {
    return this.moved;
  }

  get active(): boolean {
    return this.gesture !== null;
  }

  /** The pointer of an event. */
  at(event: { clientX: number; clientY: number; shiftKey?: boolean; ctrlKey?: boolean; metaKey?: boolean; pressure?: number }): Pointer {
    const rect = this.canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - rect.left, event.clientY - rect.top];
    const ndc = new Vector2((2 * x) / rect.width - 1, 1 - (2 * y) / rect.height);
    const caster = new Raycaster();
    caster.setFromCamera(ndc, this.rig.camera);
    const { shiftKey = false, ctrlKey = false, metaKey = false, pressure = 0.5 } = event;
    return { x, y, ndc, ray: caster.ray, shift: shiftKey, ctrl: ctrlKey || metaKey, pressure: pressure || 0.5 };
  }

  private readonly onDown = (event: PointerEvent) => {
    this.canvas.focus({ preventScroll: true });
    this.down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (this.down.size > 1) return this.beginPinch();
    this.canvas.setPointerCapture(event.pointerId);
    this.start = { x: event.clientX, y: event.clientY };
    this.moved = false;
    if (event.button === 1 || event.button === 2 || event.altKey) {
      this.mode = (event.button === 2) !== event.shiftKey ? "pan" : "orbit";
    } else if (this.gizmoTook()) {
      this.mode = "gizmo";
    } else {
      this.gesture = this.tool.press?.(this.at(event)) ?? null;
      this.mode = this.gesture ? "tool" : event.shiftKey ? "pan" : "orbit";
    }
  };

  private beginPinch() {
    if (this.mode === "gizmo") return;
    this.cancel();
    this.mode = "pinch";
    this.moved = true;
  }

  private readonly onMove = (event: PointerEvent) => {
    const last = this.down.get(event.pointerId);
    if (!last) {
      this.tool.hover?.(this.at(event));
      return;
    }
    const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
    if (Math.hypot(event.clientX - this.start.x, event.clientY - this.start.y) > CLICK) this.moved = true;
    if (this.mode === "pinch") this.pinch(event, dx, dy);
    this.down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (this.mode === "tool") {
      for (const sample of event.getCoalescedEvents?.() ?? [event]) this.gesture?.move(this.at(sample));
    } else if (this.moved && this.mode === "orbit") this.rig.orbit(dx, dy);
    else if (this.moved && this.mode === "pan") this.rig.pan(dx, dy);
  };

  private pinch(event: PointerEvent, dx: number, dy: number) {
    const other = [...this.down].find(([id]) => id !== event.pointerId)?.[1];
    if (!other) return;
    const last = this.down.get(event.pointerId) ?? other;
    const before = Math.hypot(last.x - other.x, last.y - other.y);
    const after = Math.hypot(event.clientX - other.x, event.clientY - other.y);
    if (before > 0 && after > 0) this.rig.zoom(after / before);
    this.rig.pan(dx / 2, dy / 2);
  }

  private readonly onUp = (event: PointerEvent) => {
    this.down.delete(event.pointerId);
    if (this.down.size > 0) return;
    const { mode, gesture } = this;
    this.mode = null;
    this.gesture = null;
    if (mode === "tool") gesture?.end(this.at(event));
    else if (mode !== "pinch" && mode !== null && !this.moved && event.button === 0) this.tool.click?.(this.at(event));
  };

  private readonly onCancel = (event: PointerEvent) => {
    this.down.delete(event.pointerId);
    this.cancel();
    if (this.down.size === 0) this.mode = null;
  };

  private readonly onWheel = (event: WheelEvent) => {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 24 : 1;
    this.rig.zoom(Math.exp(-event.deltaY * lines * 0.0015), this.at(event).ndc);
  };
}
