// Tools that every 3D workspace shares: click, brush and lasso. Each reports vertices; what becomes of them is the caller's.
import { Vector3 } from "three";
import { BrushCircle } from "./overlays";
import type { Pick } from "./picking";
import type { Gesture, Pointer, Tool } from "./pointer";
import type { Surface } from "./surface";
import type { Viewport } from "./viewport";

/** What a set of vertices does to a selection: Shift adds, Ctrl removes. */
export type Combine = "replace" | "add" | "remove";

export function combination(at: Pointer): Combine {
  return at.ctrl ? "remove" : at.shift ? "add" : "replace";
}

/** A tool that is told what was clicked; null: the background. Presses elsewhere move the camera. */
export function clickTool(view: Viewport, onClick: (hit: (Pick & { surface: Surface }) | null, at: Pointer) => void): Tool {
  return { click: (at) => onClick(view.pick(at), at) };
}

/** A brush on the surface: `onStroke` is called for each sample with the vertices in the ball. */
export function brushTool(view: Viewport, options: {
  /** In units of the scene; asked for each sample. */
  radius: () => number;
  color: string;
  onStart?: (at: Pointer) => void;
  onStroke: (vertices: Uint32Array, hit: Pick, at: Pointer) => void;
  onEnd?: () => void;
}): Tool & { dispose(): void } {
  const circle = new BrushCircle(() => view.invalidate(), options.color);
  view.add(circle.loop);
  const show = (at: Pointer | null): (Pick & { surface: Surface }) | null => {
    const hit = at && view.pick(at);
    circle.show(hit ? hit.point : null, hit?.normal, options.radius());
    return hit;
  };
  const stroke = (at: Pointer) => {
    const hit = show(at);
    if (hit) options.onStroke(hit.surface.picker.inBall(hit.point, options.radius()), hit, at);
  };
  return {
    cursor: "crosshair",
    hover: (at) => void show(at),
    press(at): Gesture | null {
      if (!view.pick(at)) return null;
      options.onStart?.(at);
      stroke(at);
      return { move: stroke, end: () => options.onEnd?.(), cancel: () => options.onEnd?.() };
    },
    dispose: () => view.remove(circle.loop),
  };
}

/** A lasso: a line drawn over the view, and the vertices inside. */
export function lassoTool(view: Viewport, options: {
  /** The overlay that the line is drawn in; see `View3D`. */
  outline: (points: readonly { x: number; y: number }[]) => void;
  /** Only vertices that nothing hides. */
  visible: () => boolean;
  onSelect: (vertices: Uint32Array, how: Combine) => void;
  /** A press that was released in place. */
  onClick?: (hit: Pick | null, at: Pointer) => void;
}): Tool {
  return {
    cursor: "crosshair",
    press(first): Gesture {
      const points = [{ x: first.x, y: first.y }];
      const draw = (at: Pointer) => {
        const last = points[points.length - 1]!;
        if (Math.hypot(at.x - last.x, at.y - last.y) >= 2) points.push({ x: at.x, y: at.y });
        options.outline(points);
      };
      return {
        move: draw,
        end(at) {
          options.outline([]);
          if (points.length < 3) options.onClick?.(view.pick(at), at);
          else options.onSelect(view.surface.picker.inLasso(view.normalized(points), view.rig.camera, options.visible()), combination(first));
        },
        cancel: () => options.outline([]),
      };
    },
  };
}

/** A drag in the plane that faces the camera, of what `grab` names under the pointer; null leaves the press to the camera. */
export function grabTool<T>(view: Viewport, options: {
  grab: (hit: (Pick & { surface: Surface }) | null, at: Pointer) => { what: T; point: Vector3 } | null;
  onStart?: (what: T) => void;
  onMove: (what: T, translation: Vector3) => void;
  onEnd: (what: T, translation: Vector3 | null) => void;
  onClick?: (hit: (Pick & { surface: Surface }) | null, at: Pointer) => void;
}): Tool {
  return {
    cursor: "grab",
    click: (at) => options.onClick?.(view.pick(at), at),
    press(at): Gesture | null {
      const hit = view.pick(at);
      const grabbed = options.grab(hit, at);
      if (!grabbed) return null;
      const translation = view.screenPlaneDrag(grabbed.point);
      let moved = false;
      return {
        move(to) {
          if (!moved && Math.hypot(to.x - at.x, to.y - at.y) < 4) return;
          if (!moved) options.onStart?.(grabbed.what);
          moved = true;
          options.onMove(grabbed.what, translation(to));
        },
        end(to) {
          if (moved) options.onEnd(grabbed.what, translation(to));
          else options.onClick?.(hit, at);
        },
        cancel() {
          if (!moved) return;
          options.onMove(grabbed.what, new Vector3());
          options.onEnd(grabbed.what, null);
        },
      };
    },
  };
}
