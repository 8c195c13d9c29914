// What the pointer does in the skeleton: choose and move joints, add at the center of the volume, extrude, split, pin ends.
// A drag of a joint goes in the plane that faces the camera.
import { Vector3 } from "three";
import type { Gesture, JointLines, Pick, Pointer, Tool, Viewport } from "../../view3d";

export type SkeletonMode = "select" | "add" | "extrude" | "split" | "pin";

/** What the tools change. Positions are in the scene. */
export interface SkeletonActions {
  select(joint: number | null, more: boolean): void;
  /** A joint where the ray is in the middle of the volume. */
  addAlong(origin: Vector3, direction: Vector3): void;
  /** Where a joint is now. */
  position(joint: number): Vector3;
  /** A joint while it is dragged, then at rest. */
  move(joint: number, to: Vector3, final: boolean): void;
  /** A new child, which is then dragged; resolves to its index. */
  extrude(joint: number, to: Vector3): Promise<number | null>;
  split(joint: number, fraction: number): void;
  pin(vertex: number): void;
}

/** Pixels before a press is a drag. */
const DRAG = 4;

/** The tool of a mode. */
export function skeletonTool(view: Viewport, joints: JointLines, mode: () => SkeletonMode, actions: SkeletonActions): Tool {
  const click = (at: Pointer) => clicked(view, joints, mode(), actions, at);
  return {
    click,
    press(at): Gesture | null {
      const joint = joints.pickJoint(at, view);
      if (joint === null || (mode() !== "select" && mode() !== "extrude")) return null;
      return mode() === "extrude" ? extruding(view, actions, joint, at) : moving(view, actions, joint, at);
    },
  };
}

function clicked(view: Viewport, joints: JointLines, mode: SkeletonMode, actions: SkeletonActions, at: Pointer) {
  const joint = joints.pickJoint(at, view);
  const bone = joint === null ? joints.pickBone(at, view) : null;
  if (mode === "pin") return pinned(view.pick(at), actions);
  if (mode === "split" && bone) return actions.split(bone.joint, Math.min(0.95, Math.max(0.05, bone.along)));
  if (joint !== null) return actions.select(joint, at.shift || at.ctrl);
  if (mode === "add") return actions.addAlong(at.ray.origin.clone(), at.ray.direction.clone());
  if (bone) return actions.select(bone.joint, at.shift || at.ctrl);
  if (!view.pick(at)) actions.select(null, false);
}

function pinned(hit: Pick | null, actions: SkeletonActions) {
  if (hit) actions.pin(hit.vertex);
}

function moving(view: Viewport, actions: SkeletonActions, joint: number, at: Pointer): Gesture {
  const start = actions.position(joint);
  const translation = view.screenPlaneDrag(start);
  let moved = false;
  return {
    move(to) {
      moved ||= Math.hypot(to.x - at.x, to.y - at.y) >= DRAG;
      if (moved) actions.move(joint, start.clone().add(translation(to)), false);
    },
    end(to) {
      if (moved) actions.move(joint, start.clone().add(translation(to)), true);
      else actions.select(joint, at.shift || at.ctrl);
    },
    cancel() {
      if (moved) actions.move(joint, start, true);
    },
  };
}

/** The first movement makes the child; it is then moved until the pointer is released. */
function extruding(view: Viewport, actions: SkeletonActions, parent: number, at: Pointer): Gesture {
  const start = actions.position(parent);
  const translation = view.screenPlaneDrag(start);
  let child: number | null = null;
  let begun = false;
  let wanted = start.clone();
  let ended = false;
  const apply = (final: boolean) => {
    if (child !== null) actions.move(child, wanted, final);
  };
  return {
    move(to) {
      if (!begun && Math.hypot(to.x - at.x, to.y - at.y) < DRAG) return;
      wanted = start.clone().add(translation(to));
      if (begun) return apply(false);
      begun = true;
      void actions.extrude(parent, wanted).then((made) => {
        child = made;
        apply(ended);
      });
    },
    end(to) {
      ended = true;
      if (!begun) return actions.select(parent, at.shift || at.ctrl);
      wanted = start.clone().add(translation(to));
      apply(true);
    },
    cancel: () => undefined,
  };
}
