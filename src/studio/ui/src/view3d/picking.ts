// What is under a pointer, a brush or a lasso: rays and boxes through a tree of the triangles.
import { BufferAttribute, BufferGeometry, DoubleSide, Matrix4, Ray, Vector2, Vector3, type Camera } from "three";
import { MeshBVH } from "three-mesh-bvh";
import type { Surface } from "./surface";

/** A hit of a ray. */
export interface Pick {
  /** In the scene. */
  point: Vector3;
  /** Of the triangle, towards the viewer. */
  normal: Vector3;
  triangle: number;
  /** The corner of the triangle nearest to the point. */
  vertex: number;
  distance: number;
}

/** Ray casts, brush and lasso on a surface. The tree is built at first use and refitted when vertices have moved. */
export class SurfacePicker {
  private tree: MeshBVH | null = null;
  private readonly geometry = new BufferGeometry();
  private moved = true;

  constructor(private readonly surface: Surface) {}

  topologyChanged() {
    this.tree = null;
    this.moved = true;
  }

  positionsChanged() {
    this.moved = true;
  }

  private current(): MeshBVH | null {
    const triangles = this.surface.triangles;
    if (triangles.length === 0) return null;
    if (this.moved || !this.tree) {
      this.geometry.setAttribute("position", new BufferAttribute(this.surface.drawnPositions(), 3));
      if (this.tree) this.tree.refit();
    }
    if (!this.tree) {
      this.geometry.setIndex(new BufferAttribute(triangles, 1));
      this.tree = new MeshBVH(this.geometry, { indirect: true });
    }
    this.moved = false;
    return this.tree;
  }

  private get origin(): Vector3 {
    return this.surface.group.position;
  }

  /** The first hit of a ray. */
  pick(ray: Ray): Pick | null {
    const tree = this.current();
    if (!tree || !this.surface.group.visible) return null;
    const local = new Ray(ray.origin.clone().sub(this.origin), ray.direction);
    const hit = tree.raycastFirst(local, DoubleSide);
    if (!hit || hit.faceIndex === undefined || hit.faceIndex === null) return null;
    const normal = hit.face?.normal.clone() ?? new Vector3(0, 0, 1);
    if (normal.dot(ray.direction) > 0) normal.negate();
    return {
      point: hit.point.clone().add(this.origin),
      normal,
      triangle: hit.faceIndex,
      vertex: this.nearestCorner(hit.faceIndex, hit.point),
      distance: hit.distance,
    };
  }

  private nearestCorner(triangle: number, point: Vector3): number {
    const p = this.surface.drawnPositions();
    const corners = [...this.surface.triangles.subarray(3 * triangle, 3 * triangle + 3)];
    const distance = (v: number) => point.distanceToSquared(new Vector3(p[3 * v], p[3 * v + 1], p[3 * v + 2]));
    return corners.reduce((best, v) => (distance(v) < distance(best) ? v : best));
  }

  /** Vertices within a ball: a brush on the surface. Ascending. */
  inBall(center: Vector3, radius: number): Uint32Array {
    const tree = this.current();
    const found = new Set<number>();
    if (!tree) return new Uint32Array();
    const c = center.clone().sub(this.origin);
    const p = this.surface.drawnPositions();
    const triangles = this.surface.triangles;
    const inside = (v: number) => (p[3 * v]! - c.x) ** 2 + (p[3 * v + 1]! - c.y) ** 2 + (p[3 * v + 2]! - c.z) ** 2 <= radius * radius;
    tree.shapecast({
      intersectsBounds: (box) => box.distanceToPoint(c) <= radius,
      intersectsTriangle: (_, triangle) => {
        for (let k = 3 * triangle; k < 3 * triangle + 3; k++) if (inside(triangles[k]!)) found.add(triangles[k]!);
        return false;
      },
    });
    return Uint32Array.from(found).sort();
  }

  /** Vertices inside a polygon of the view (normalized device coordinates); `visible`: only those that nothing hides. Ascending. */
  inLasso(polygon: readonly Vector2[], camera: Camera, visible: boolean): Uint32Array {
    const p = this.surface.drawnPositions();
    const project = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    const [box, at] = [bounds(polygon), new Vector3()];
    const found: number[] = [];
    for (let v = 0; v < p.length / 3; v++) {
      at.set(p[3 * v]!, p[3 * v + 1]!, p[3 * v + 2]!).add(this.origin).applyMatrix4(project);
      const outside = at.x < box.low.x || at.x > box.high.x || at.y < box.low.y || at.y > box.high.y || at.z > 1 || at.z < -1;
      if (!outside && contains(polygon, at.x, at.y)) found.push(v);
    }
    return Uint32Array.from(visible ? this.unhidden(found, camera) : found);
  }

  /** Those of the vertices that the camera sees: the ray to each meets the surface there first. */
  private unhidden(vertices: number[], camera: Camera): number[] {
    const tree = this.current();
    const p = this.surface.drawnPositions();
    const eye = new Vector3().setFromMatrixPosition(camera.matrixWorld).sub(this.origin);
    const [at, ray] = [new Vector3(), new Ray()];
    return vertices.filter((v) => {
      at.set(p[3 * v]!, p[3 * v + 1]!, p[3 * v + 2]!);
      const distance = at.distanceTo(eye);
      ray.origin.copy(eye);
      ray.direction.subVectors(at, eye).normalize();
      const hit = tree?.raycastFirst(ray, DoubleSide);
      return !hit || hit.distance >= distance * (1 - 1e-3);
    });
  }
}

function bounds(polygon: readonly Vector2[]) {
  const low = new Vector2(Infinity, Infinity);
  const high = new Vector2(-Infinity, -Infinity);
  for (const corner of polygon) {
    low.min(corner);
    high.max(corner);
  }
  return { low, high };
}

/** Whether a point is inside, by the even-odd rule. */
export function contains(polygon: readonly { x: number; y: number }[], x: number, y: number): boolean {
  let inside = false;
  for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i++) {
    const [a, b] = [polygon[i]!, polygon[j]!];
    if (a.y > y !== b.y > y && x < ((b.x - a.x) * (y - a.y)) / (b.y - a.y) + a.x) inside = !inside;
  }
  return inside;
}
