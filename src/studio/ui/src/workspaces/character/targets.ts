// Targets of a pose in the view: a cross at each, a line to its joint.
import { Vector3 } from "three";
import type { LineOverlay, Viewport } from "../../view3d";

export class TargetMarks {
  private readonly lines: LineOverlay;

  constructor(private readonly view: Viewport, color: string) {
    this.lines = view.addLines(color);
  }

  /** Shows targets at points, each with the position of its joint. */
  show(targets: readonly { at: Vector3; joint: Vector3 }[], size: number) {
    const points: number[] = [];
    const line = (a: Vector3, b: Vector3) => points.push(a.x, a.y, a.z, b.x, b.y, b.z);
    for (const { at, joint } of targets) {
      for (let k = 0; k < 3; k++) {
        const arm = new Vector3().setComponent(k, size);
        line(at.clone().sub(arm), at.clone().add(arm));
      }
      if (at.distanceTo(joint) > size) line(at, joint);
    }
    this.lines.set(new Float32Array(points));
  }

  dispose() {
    this.view.remove(this.lines.lines);
  }
}
