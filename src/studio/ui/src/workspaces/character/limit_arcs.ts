// The limits of a joint as arcs about it: the ellipse of the swing as a fan, the interval of the twist as a sector across its axis.
//
// A rotation from rest is a swing about an axis across `axis`, then a twist about it. The swing (a about `across`, b about
// axis × across) is allowed where (a / swing₀)² + (b / swing₁)² ≤ 1; the fan is where the axis then points.
import { BufferAttribute, BufferGeometry, DoubleSide, Group, Mesh, MeshBasicMaterial, Quaternion, Vector3 } from "three";
import type { LineOverlay, Viewport } from "../../view3d";

/** Limits in the frame of the joint at rest; angles in rad. */
export interface LimitShape { axis: Vector3; across: Vector3; swing: [number, number]; twist: [number, number] }

/** Where the arcs are drawn: the frame that the joint has where it is not rotated, in the scene. */
export interface ArcFrame { position: Vector3; quaternion: Quaternion }

/** A text beside an arc. */
export interface ArcLabel { text: string; at: Vector3 }

const STEPS = 48;
const degrees = (angle: number) => `${Math.round((angle * 180) / Math.PI)}°`;

/** Points of the rim of the swing, around. */
export function swingRim({ axis, across, swing }: LimitShape, radius: number): Vector3[] {
  const second = new Vector3().crossVectors(axis, across);
  return Array.from({ length: STEPS + 1 }, (_, i) => {
    const angle = (2 * Math.PI * i) / STEPS;
    const vector = across.clone().multiplyScalar(swing[0] * Math.cos(angle)).addScaledVector(second, swing[1] * Math.sin(angle));
    return axis.clone().applyQuaternion(rotationOf(vector)).multiplyScalar(radius);
  });
}

/** Points of the arc of the twist, from the smallest to the largest. */
export function twistArc({ axis, across, twist }: LimitShape, radius: number): Vector3[] {
  return Array.from({ length: STEPS + 1 }, (_, i) => {
    const angle = twist[0] + ((twist[1] - twist[0]) * i) / STEPS;
    return across.clone().applyAxisAngle(axis, angle).multiplyScalar(radius);
  });
}

function rotationOf(vector: Vector3): Quaternion {
  const angle = vector.length();
  return angle > 0 ? new Quaternion().setFromAxisAngle(vector.clone().divideScalar(angle), angle) : new Quaternion();
}

/** The arcs of one joint in a view. */
export class LimitArcs {
  private readonly group = new Group();
  private readonly swing: Mesh;
  private readonly twist: Mesh;
  private readonly lines: LineOverlay;

  constructor(private readonly view: Viewport, color: { swing: string; twist: string }) {
    this.swing = fan(color.swing);
    this.twist = fan(color.twist);
    this.group.add(this.swing, this.twist);
    this.lines = view.addLines(color.swing);
    view.add(this.group);
    this.show(null);
  }

  /** Draws the limits of a joint; gives the texts beside them. Null hides them. */
  show(joint: { frame: ArcFrame; limits: LimitShape; radius: number } | null): ArcLabel[] {
    this.group.visible = joint !== null;
    this.lines.set(new Float32Array());
    this.view.invalidate();
    if (!joint) return [];
    const { frame, limits, radius } = joint;
    const place = (points: Vector3[]) => points.map((p) => p.applyQuaternion(frame.quaternion).add(frame.position));
    const rim = place(swingRim(limits, radius));
    const arc = place(twistArc(limits, 0.6 * radius));
    setFan(this.swing.geometry, frame.position, rim);
    setFan(this.twist.geometry, frame.position, arc);
    this.lines.set(segments([rim, [frame.position, arc[0]!], arc, [arc[STEPS]!, frame.position]]));
    return [
      { text: `swing ${degrees(limits.swing[0])}`, at: rim[0]! },
      { text: `swing ${degrees(limits.swing[1])}`, at: rim[STEPS / 4]! },
      { text: `twist ${degrees(limits.twist[0])}`, at: arc[0]! },
      { text: `twist ${degrees(limits.twist[1])}`, at: arc[STEPS]! },
    ];
  }

  dispose() {
    this.view.remove(this.group);
    this.view.remove(this.lines.lines);
    for (const mesh of [this.swing, this.twist]) mesh.geometry.dispose();
  }
}

function fan(color: string): Mesh {
  const material = new MeshBasicMaterial({ color, side: DoubleSide, transparent: true, opacity: 0.22, depthTest: false, depthWrite: false });
  const mesh = new Mesh(new BufferGeometry(), material);
  mesh.frustumCulled = false;
  mesh.renderOrder = 8;
  return mesh;
}

/** Triangles from a center to each edge of a line of points. */
function setFan(geometry: BufferGeometry, center: Vector3, rim: readonly Vector3[]) {
  const points = [center, ...rim].flatMap((p) => [p.x, p.y, p.z]);
  const index = rim.slice(1).flatMap((_, i) => [0, i + 1, i + 2]);
  geometry.dispose();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
  geometry.setIndex(index);
}

/** Lines of points as pairs. */
function segments(lines: readonly (readonly Vector3[])[]): Float32Array {
  return new Float32Array(lines.flatMap((line) => line.slice(1).flatMap((to, i) => {
    const from = line[i]!;
    return [from.x, from.y, from.z, to.x, to.y, to.z];
  })));
}
