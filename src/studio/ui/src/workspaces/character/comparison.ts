// Skinning methods side by side: one surface for each, in rows that face the viewer, with its name below.
import { Box3, Vector3 } from "three";
import type { Surface, Viewport } from "../../view3d";

/** A method and where its surface is. */
export interface Comparison { id: string; surface: Surface; offset: Vector3 }

/** Gap between neighbors, fraction of their size. */
const GAP = 0.12;

export class SideBySide {
  private shown: Comparison[] = [];

  constructor(private readonly view: Viewport) {}

  /** Shows so many surfaces of this topology, in rows that fit the view; none hides them. True where they are others than before. */
  show(ids: readonly string[], triangles: Uint32Array, rest: Float32Array): boolean {
    if (this.shown.map((s) => s.id).join() === ids.join()) return false;
    this.clear();
    const size = sizeOf(rest);
    const [across, up] = this.axes();
    const [width, height] = [extent(size, across) * (1 + GAP), extent(size, up) * (1 + 3 * GAP)];
    const columns = columnsFor(ids.length, width, height, this.view.width / this.view.height);
    const rows = Math.ceil(ids.length / columns);
    this.shown = ids.map((id, i) => {
      const offset = across.clone().multiplyScalar(((i % columns) - (columns - 1) / 2) * width)
        .addScaledVector(up, ((rows - 1) / 2 - Math.floor(i / columns)) * height);
      const surface = this.view.addSurface();
      surface.setTopology(triangles, rest.length / 3);
      surface.setPositions(rest);
      surface.setOffset(offset.x, offset.y, offset.z);
      return { id, surface, offset };
    });
    return true;
  }

  /** Axes of the scene nearest to right and up of the view. */
  private axes(): [Vector3, Vector3] {
    const { camera } = this.view.rig;
    const [x, y] = [new Vector3(), new Vector3()];
    camera.matrixWorld.extractBasis(x, y, new Vector3());
    const nearest = (v: Vector3) => {
      const parts = v.toArray().map(Math.abs);
      const k = parts.indexOf(Math.max(...parts));
      return new Vector3().setComponent(k, Math.sign(v.getComponent(k)) || 1);
    };
    const up = nearest(camera.up);
    return [nearest(x.addScaledVector(up, -x.dot(up))), up];
  }

  setPositions(id: string, positions: Float32Array, normals?: Int16Array) {
    this.shown.find((s) => s.id === id)?.surface.setPositions(positions, normals);
  }

  /** Where the label of each is: below its surface. */
  labels(): { id: string; at: Vector3 }[] {
    return this.shown.map(({ id, surface }) => {
      const box = surface.bounds();
      const at = box.getCenter(new Vector3());
      const { up } = this.view.rig.camera;
      return { id, at: at.addScaledVector(up, -0.5 * extent(box.getSize(new Vector3()), up)) };
    });
  }

  clear() {
    for (const { surface } of this.shown) this.view.removeSurface(surface);
    this.shown = [];
  }
}

/** As many columns as make the surfaces largest in a view of this shape. */
function columnsFor(count: number, width: number, height: number, aspect: number): number {
  const scale = (columns: number) => Math.min(aspect / (columns * width), 1 / (Math.ceil(count / columns) * height));
  const all = Array.from({ length: Math.max(1, count) }, (_, i) => i + 1);
  return all.reduce((best, columns) => (scale(columns) > scale(best) * 1.001 ? columns : best));
}

const extent = (size: Vector3, axis: Vector3) => Math.abs(size.x * axis.x) + Math.abs(size.y * axis.y) + Math.abs(size.z * axis.z);

function sizeOf(positions: Float32Array): Vector3 {
  const size = new Box3().setFromArray(positions as unknown as number[]).getSize(new Vector3());
  return size.length() > 0 ? size : new Vector3(1, 1, 1);
}
