// The gizmo: arrows, rings and boxes at a frame. Clicks go through it: only a drag is its own.
import { Object3D, Quaternion, Vector3, type Camera, type PerspectiveCamera, type Scene } from "three";
import { TransformControls } from "three/examples/jsm/controls/TransformControls.js";

export type GizmoMode = "translate" | "rotate" | "scale";

/** What a drag did since it began: in the scene's axes. `rotation` then `translation`, about the frame's origin at the start. */
export interface GizmoChange { translation: Vector3; rotation: Quaternion; scale: Vector3 }

/** What a gizmo is for. */
export interface GizmoTarget {
  position: Vector3;
  quaternion: Quaternion;
  onStart?: () => void;
  onChange: (change: GizmoChange) => void;
  onEnd?: () => void;
}

/** Steps that a drag snaps to; null: none. Degrees for rotations. */
export interface Snap { translate: number; rotateDeg: number; scale: number }

/** A gizmo of a view. */
export class Gizmo {
  private readonly controls: TransformControls;
  private readonly frame = new Object3D();
  private target: GizmoTarget | null = null;
  private started = false;
  /** Whether the press has moved far enough to be a drag. */
  isDrag: () => boolean = () => true;
  private readonly start = { position: new Vector3(), quaternion: new Quaternion() };

  constructor(camera: Camera, canvas: HTMLElement, scene: Scene, invalidate: () => void) {
    this.controls = new TransformControls(camera, canvas);
    this.controls.setSize(0.8);
    scene.add(this.frame, this.controls.getHelper());
    this.controls.addEventListener("change", invalidate);
    this.controls.addEventListener("mouseDown", () => this.begin());
    this.controls.addEventListener("objectChange", () => this.moved());
    this.controls.addEventListener("mouseUp", () => this.end());
  }

  /** Whether it has the pointer. */
  get dragging(): boolean {
    return this.controls.dragging;
  }

  get attached(): boolean {
    return this.target !== null;
  }

  /** Shows it at a frame; null hides it. While it is dragged, its frame is the user's. */
  attach(target: GizmoTarget | null) {
    this.target = target;
    if (!target) {
      this.controls.detach();
      return;
    }
    if (!this.controls.dragging) {
      this.frame.position.copy(target.position);
      this.frame.quaternion.copy(target.quaternion);
      this.frame.scale.set(1, 1, 1);
      this.frame.updateMatrixWorld(true);
    }
    if (this.controls.object !== this.frame) this.controls.attach(this.frame);
  }

  setMode(mode: GizmoMode, space: "world" | "local" = "local") {
    this.controls.setMode(mode);
    this.controls.setSpace(space);
  }

  setSnap(snap: Snap | null) {
    this.controls.setTranslationSnap(snap?.translate ?? null);
    this.controls.setRotationSnap(snap ? (snap.rotateDeg * Math.PI) / 180 : null);
    this.controls.setScaleSnap(snap?.scale ?? null);
  }

  /** A point of the arrow, ring or box along x, in the scene; null where it is hidden. */
  grip(): Vector3 | null {
    if (!this.target) return null;
    const camera = this.controls.camera as PerspectiveCamera;
    const distance = this.frame.position.distanceTo(camera.position);
    const unit = (distance * Math.min(1.9 * Math.tan((camera.fov * Math.PI) / 360), 7) * this.controls.size) / 4;
    return new Vector3(0.4 * unit, 0, 0).applyQuaternion(this.frame.quaternion).add(this.frame.position);
  }

  /** Ends a drag where it began. */
  cancel() {
    if (!this.controls.dragging) return;
    this.controls.reset();
    if (this.started) this.target?.onChange(this.change());
    this.controls.pointerUp(null as never);
  }

  private begin() {
    this.start.position.copy(this.frame.position);
    this.start.quaternion.copy(this.frame.quaternion);
    this.frame.scale.set(1, 1, 1);
    this.started = false;
  }

  /** A drag begins where the press is no click any more. */
  private moved() {
    if (!this.started && !this.isDrag()) return;
    if (!this.started) this.target?.onStart?.();
    this.started = true;
    this.target?.onChange(this.change());
  }

  private end() {
    if (this.started) {
      this.target?.onEnd?.();
    } else {
      this.frame.position.copy(this.start.position);
      this.frame.quaternion.copy(this.start.quaternion);
    }
    this.frame.scale.set(1, 1, 1);
  }

  private change(): GizmoChange {
    return {
      translation: this.frame.position.clone().sub(this.start.position),
      rotation: this.frame.quaternion.clone().multiply(this.start.quaternion.clone().invert()),
      scale: this.frame.scale.clone(),
    };
  }

  dispose() {
    this.controls.dispose();
  }
}
