// What the pointer does in a pose: a click on a joint gives it rings for rotation (FK), a drag of a joint or of the surface moves the limb
// in the plane that faces the camera (IK). One tool for both, so that nothing has to be switched.
import { Vector3 } from "three";
import type { Gesture, JointLines, Pointer, Tool, Viewport } from "../../view3d";

/** What the tool changes. Positions are in the scene. */
export interface PoseActions {
  select(joint: number | null, more: boolean): void;
  /** The joint that has most influence on a vertex. */
  jointOf(vertex: number): number | null;
  /** Where a joint is now. */
  position(joint: number): Vector3;
  /** A point of the surface that moves with a joint: in its frame. */
  grabbed(joint: number, point: Vector3): [number, number, number];
  /** Moves a point of a joint towards a position; `final` when the pointer is released. */
  drag(joint: number, point: [number, number, number], to: Vector3, final: boolean): void;
  /** The end of a joint's bone or the joint itself moves: which joint is solved for. */
  begin(joint: number): void;
  cancel(): void;
}

/** Pixels before a press is a drag. */
const DRAG = 4;

/** The tool. */
export function poseTool(view: Viewport, joints: JointLines, actions: PoseActions): Tool {
  const under = (at: Pointer): { joint: number; point: Vector3 | null } | null => {
    const joint = joints.pickJoint(at, view);
    if (joint !== null) return { joint, point: null };
    const hit = view.pick(at);
    const owner = hit ? actions.jointOf(hit.vertex) : null;
    return hit && owner !== null ? { joint: owner, point: hit.point } : null;
  };
  return {
    cursor: "grab",
    click: (at) => actions.select(joints.pickJoint(at, view) ?? under(at)?.joint ?? null, at.shift || at.ctrl),
    press(at): Gesture | null {
      const found = under(at);
      return found ? dragging(view, actions, found.joint, found.point, at) : null;
    },
  };
}

function dragging(view: Viewport, actions: PoseActions, joint: number, point: Vector3 | null, at: Pointer): Gesture {
  const start = point ?? actions.position(joint);
  const local = point ? actions.grabbed(joint, point) : ([0, 0, 0] as [number, number, number]);
  const translation = view.screenPlaneDrag(start);
  let moved = false;
  const go = (to: Pointer, final: boolean) => actions.drag(joint, local, start.clone().add(translation(to)), final);
  return {
    move(to) {
      if (!moved && Math.hypot(to.x - at.x, to.y - at.y) < DRAG) return;
      if (!moved) actions.begin(joint);
      moved = true;
      go(to, false);
    },
    end(to) {
      if (moved) go(to, true);
      else actions.select(joint, at.shift || at.ctrl);
    },
    cancel() {
      if (moved) actions.cancel();
    },
  };
}
