// Skinning methods side by side: one surface for each, placed along the axis to the right, with its name below.
import { Vector3 } from "three";
import type { Surface, Viewport } from "../../view3d";

/** A method and where its surface is. */
export interface Comparison { id: string; surface: Surface; offset: number }

/** Gap between neighbors, fraction of the width. */
const GAP = 0.15;

export class SideBySide {
  private shown: Comparison[] = [];

  constructor(private readonly view: Viewport) {}

  /** Shows so many surfaces of this topology; none hides them. */
  show(ids: readonly string[], triangles: Uint32Array, rest: Float32Array) {
    if (this.shown.map((s) => s.id).join() === ids.join()) return;
    this.clear();
    const width = widthOf(rest) * (1 + GAP);
    this.shown = ids.map((id, i) => {
      const surface = this.view.addSurface();
      const offset = (i - (ids.length - 1) / 2) * width;
      surface.setTopology(triangles, rest.length / 3);
      surface.setPositions(rest);
      surface.setOffset(offset, 0, 0);
      return { id, surface, offset };
    });
  }

  setPositions(id: string, positions: Float32Array, normals?: Int16Array) {
    this.shown.find((s) => s.id === id)?.surface.setPositions(positions, normals);
  }

  /** Where the label of each is: below its surface. */
  labels(): { id: string; at: Vector3 }[] {
    return this.shown.map(({ id, surface }) => {
      const box = surface.bounds();
      return { id, at: new Vector3((box.min.x + box.max.x) / 2, box.min.y, (box.min.z + box.max.z) / 2) };
    });
  }

  clear() {
    for (const { surface } of this.shown) this.view.removeSurface(surface);
    this.shown = [];
  }

  get surfaces(): readonly Comparison[] {
    return this.shown;
  }
}

function widthOf(positions: Float32Array): number {
  let [low, high] = [Infinity, -Infinity];
  for (let i = 0; i < positions.length; i += 3) {
    low = Math.min(low, positions[i]!);
    high = Math.max(high, positions[i]!);
  }
  return high > low ? high - low : 1;
}
