// What is drawn over a surface: marked vertices, joints and bones, lines, the circle of the brush.
import {
  BufferAttribute, BufferGeometry, Color, Group, LineBasicMaterial, LineLoop, LineSegments, Mesh, MeshPhongMaterial, Points, PointsMaterial, Quaternion,
  Vector3,
} from "three";
import type { OrbitCamera } from "./camera";
import type { Pointer } from "./pointer";
import type { Surface } from "./surface";

/** Vertices of a surface as dots that move with it. */
export class VertexMarks {
  readonly points: Points;
  private readonly geometry = new BufferGeometry();
  private readonly material = round(new PointsMaterial({ sizeAttenuation: false, transparent: true }), 4e-4);

  constructor(private readonly surface: Surface, private readonly invalidate: () => void, color: string, size: number) {
    this.material.size = size * devicePixelRatio;
    this.material.color = new Color(color);
    this.points = new Points(this.geometry, this.material);
    this.points.frustumCulled = false;
    this.points.renderOrder = 2;
    this.points.visible = false;
  }

  setColor(color: string) {
    this.material.color = new Color(color);
    this.invalidate();
  }

  set(vertices: Uint32Array) {
    // Without the positions: disposing them would take the buffer from the surface.
    this.geometry.deleteAttribute("position");
    this.geometry.dispose();
    this.points.visible = vertices.length > 0;
    if (vertices.length > 0) {
      this.geometry.setAttribute("position", this.surface.positionAttribute);
      this.geometry.setIndex(new BufferAttribute(vertices, 1));
    }
    this.invalidate();
  }
}

/** Dots as disks, moved towards the viewer by a fraction of the depth so that the surface they lie on does not cover them. */
function round(material: PointsMaterial, nearer = 0): PointsMaterial {
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader.replace("#include <logdepthbuf_vertex>",
      `gl_Position.z -= ${nearer.toFixed(6)} * gl_Position.w;\n#include <logdepthbuf_vertex>`);
    shader.fragmentShader = shader.fragmentShader.replace("#include <clipping_planes_fragment>",
      "if (length(gl_PointCoord - 0.5) > 0.5) discard;\n#include <clipping_planes_fragment>");
  };
  return material;
}

/** How joints are drawn. */
export interface JointStyle {
  /** CSS colors. */
  bone: string;
  joint: string;
  selected: string;
  /** Joints that are drawn as selected. */
  selection?: ReadonlySet<number>;
  /** A color of its own for some joints: pinned ones. */
  colors?: ReadonlyMap<number, string>;
}

/** A skeleton over everything else: bones as double pyramids with their edges, joints as dots. */
export class JointLines {
  readonly group = new Group();
  private readonly bodies = new Mesh(new BufferGeometry(),
    new MeshPhongMaterial({ vertexColors: true, flatShading: true, depthTest: false, depthWrite: false, transparent: true, opacity: 0.72 }));
  private readonly bones = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ vertexColors: true, depthTest: false, transparent: true }));
  private readonly dots = new Points(new BufferGeometry(),
    round(new PointsMaterial({ size: 9 * devicePixelRatio, sizeAttenuation: false, vertexColors: true, depthTest: false, transparent: true })));
  private positions: Float32Array = new Float32Array();
  private parents: Int32Array = new Int32Array();

  constructor(private readonly invalidate: () => void) {
    for (const [object, order] of [[this.bodies, 9.5], [this.bones, 10], [this.dots, 11]] as const) {
      object.frustumCulled = false;
      object.renderOrder = order;
      this.group.add(object);
    }
  }

  /** Joints: three coordinates each, and the parent of each, −1 for roots. */
  set(positions: Float32Array, parents: Int32Array, style: JointStyle) {
    this.positions = positions;
    this.parents = parents;
    this.setDots(style);
    this.setBones(style);
    this.invalidate();
  }

  private color(joint: number, style: JointStyle, plain: string): Color {
    return new Color(style.selection?.has(joint) ? style.selected : (style.colors?.get(joint) ?? plain));
  }

  private setDots(style: JointStyle) {
    const colors = new Float32Array(this.positions.length);
    for (let j = 0; j < this.positions.length / 3; j++) this.color(j, style, style.joint).toArray(colors, 3 * j);
    replace(this.dots.geometry, this.positions, colors);
  }

  private setBones(style: JointStyle) {
    const edges: Colored = { points: [], colors: [] };
    const faces: Colored = { points: [], colors: [] };
    this.parents.forEach((parent, joint) => {
      if (parent < 0) return;
      const color = this.color(parent, style, style.bone);
      const shape = bone(this.joint(parent), this.joint(joint));
      append(edges, shape.edges, color.clone().multiplyScalar(0.55));
      append(faces, shape.faces, color);
    });
    for (const [object, { points, colors }] of [[this.bones, edges], [this.bodies, faces]] as const) {
      replace(object.geometry, new Float32Array(points), new Float32Array(colors));
    }
  }

  joint(index: number): Vector3 {
    return new Vector3().fromArray(this.positions, 3 * index);
  }

  setVisible(visible: boolean) {
    this.group.visible = visible;
    this.invalidate();
  }

  /** The joint nearest to a pointer within so many pixels; null where there is none. */
  pickJoint(at: Pointer, view: { width: number; height: number; rig: OrbitCamera }, radius = 10): number | null {
    let [best, found]: [number, number | null] = [radius, null];
    for (let j = 0; j < this.positions.length / 3; j++) {
      const p = onScreen(this.joint(j), view);
      const distance = p ? Math.hypot(p.x - at.x, p.y - at.y) : Infinity;
      if (distance < best) [best, found] = [distance, j];
    }
    return found;
  }

  /** The joint at the lower end of the bone nearest to a pointer, and where along it from its parent, 0 to 1. */
  pickBone(at: Pointer, view: { width: number; height: number; rig: OrbitCamera }, radius = 8): { joint: number; along: number } | null {
    let [best, found]: [number, { joint: number; along: number } | null] = [radius, null];
    this.parents.forEach((parent, joint) => {
      const [a, b] = parent < 0 ? [null, null] : [onScreen(this.joint(parent), view), onScreen(this.joint(joint), view)];
      if (!a || !b) return;
      const [dx, dy] = [b.x - a.x, b.y - a.y];
      const along = Math.min(1, Math.max(0, ((at.x - a.x) * dx + (at.y - a.y) * dy) / (dx * dx + dy * dy || 1)));
      const distance = Math.hypot(a.x + along * dx - at.x, a.y + along * dy - at.y);
      if (distance < best) [best, found] = [distance, { joint, along }];
    });
    return found;
  }
}

/** Pixels from the upper left corner; null behind the camera. */
export function onScreen(point: Vector3, view: { width: number; height: number; rig: OrbitCamera }): { x: number; y: number } | null {
  const p = point.clone().project(view.rig.camera);
  return p.z > 1 ? null : { x: ((p.x + 1) / 2) * view.width, y: ((1 - p.y) / 2) * view.height };
}

interface Colored { points: number[]; colors: number[] }

function append(to: Colored, points: readonly Vector3[], color: Color) {
  for (const point of points) {
    to.points.push(point.x, point.y, point.z);
    to.colors.push(color.r, color.g, color.b);
  }
}

/** A double pyramid from one joint to another: its edges as pairs of points, its faces as triples, counterclockwise from outside. */
function bone(from: Vector3, to: Vector3): { edges: Vector3[]; faces: Vector3[] } {
  const length = from.distanceTo(to);
  if (!(length > 0)) return { edges: [], faces: [] };
  const frame = new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), to.clone().sub(from).divideScalar(length));
  const corner = (x: number, z: number) => new Vector3(x, 1.5, z).multiplyScalar(0.08 * length).applyQuaternion(frame).add(from);
  const ring = [corner(1, 0), corner(0, 1), corner(-1, 0), corner(0, -1)];
  const next = (i: number) => ring[(i + 1) % 4]!;
  return {
    edges: ring.flatMap((c, i) => [from, c, c, to, c, next(i)]),
    faces: ring.flatMap((c, i) => [from, c, next(i), to, next(i), c]),
  };
}

/** Lines over a surface: pairs of points. */
export class LineOverlay {
  readonly lines: LineSegments;

  constructor(private readonly invalidate: () => void, color: string, onTop = true) {
    const material = new LineBasicMaterial({ color, depthTest: !onTop, transparent: true });
    this.lines = new LineSegments(new BufferGeometry(), material);
    this.lines.frustumCulled = false;
    this.lines.renderOrder = 9;
  }

  set(points: Float32Array) {
    replace(this.lines.geometry, points);
    this.invalidate();
  }
}

/** The circle of a brush on the surface. */
export class BrushCircle {
  readonly loop: LineLoop;

  constructor(private readonly invalidate: () => void, color: string) {
    const points = Array.from({ length: 64 }, (_, i) => new Vector3(Math.cos((i * Math.PI) / 32), Math.sin((i * Math.PI) / 32), 0));
    this.loop = new LineLoop(new BufferGeometry().setFromPoints(points), new LineBasicMaterial({ color, depthTest: false, transparent: true }));
    this.loop.renderOrder = 12;
    this.loop.visible = false;
  }

  show(center: Vector3 | null, normal?: Vector3, radius?: number) {
    this.loop.visible = center !== null;
    if (center && normal && radius) {
      this.loop.position.copy(center);
      this.loop.quaternion.setFromUnitVectors(new Vector3(0, 0, 1), normal.clone().normalize());
      this.loop.scale.setScalar(radius);
    }
    this.invalidate();
  }
}

function replace(geometry: BufferGeometry, positions: Float32Array, colors?: Float32Array) {
  const same = geometry.getAttribute("position")?.array.length === positions.length;
  for (const [name, values] of [["position", positions], ["color", colors]] as const) {
    if (!values) continue;
    const attribute = geometry.getAttribute(name) as BufferAttribute | undefined;
    if (same && attribute) {
      attribute.array.set(values);
      attribute.needsUpdate = true;
    } else {
      geometry.setAttribute(name, new BufferAttribute(values.slice(), 3));
    }
  }
  if (!same) geometry.dispose();
}
