// What a window of the character workspace knows and does: the tab, the selection, tools, and what the server sent.
import { batch, computed, effect, signal, type ReadonlySignal } from "@preact/signals";
import { Quaternion, Vector3 } from "three";
import type { Connection } from "../../connection";
import { createPlayback, type Playback } from "../../shell/components";
import { Actions } from "./actions";
import { Frames, skinMatrices, vectorDeg } from "./frames";
import type { ArcFrame, LimitShape } from "./limit_arcs";
import type { BrushOp, JointState, Limits, SkinningMethod, State, Target, Track, V3 } from "../../generated/character";
import { receive } from "./received";
import type { PoseActions } from "./pose_tools";
import type { Scene } from "./scene";
import type { SkeletonActions, SkeletonMode } from "./skeleton_tools";

export type TabName = "skeleton" | "weights" | "pose" | "animate" | "compare";
export const TABS: readonly { id: TabName; label: string }[] = [
  { id: "skeleton", label: "Skeleton" }, { id: "weights", label: "Weights" }, { id: "pose", label: "Pose" },
  { id: "animate", label: "Animate" }, { id: "compare", label: "Compare" },
];

export interface JointInfo extends JointState { index: number }
export interface Geometry { triangles: Uint32Array; rest: Float32Array }
export interface SkinBuffers { joints: Uint16Array; weights: Float32Array; jointCount: number }
export interface Shape { positions: Float32Array; normals?: Int16Array }
export interface OnionPose { frames: Frames; before: boolean; distance: number }

/** Names of the skinning methods. */
export const METHODS: Record<SkinningMethod, string> = {
  linear: "Linear blend", "dual-quaternion": "Dual quaternions", centers: "Centers of rotation", mixed: "Twist and swing", regression: "Regression",
};

const pages = new WeakMap<object, Page>();

/** The page of a connection: the same for its view and its commands. */
export function pageOf(connection: Connection<State>): Page {
  const known = pages.get(connection);
  if (known) return known;
  const made = new Page(connection);
  pages.set(connection, made);
  return made;
}

export class Page {
  readonly tab = signal<TabName>("skeleton");
  readonly selected = signal<readonly number[]>([]);
  readonly mode = signal<SkeletonMode>("select");
  readonly withChildren = signal(true);
  readonly brush = { op: signal<BrushOp>("add"), size: signal(0.04), strength: signal(0.3), value: signal(1), mirror: signal(false) };
  readonly wireframe = signal(false);
  readonly showJoints = signal(true);
  readonly onion = { on: signal(false), count: signal(2), spacing: signal(5) };
  readonly autoKey = signal(false);
  readonly curves = signal(true);
  /** The duration that the user asked for; a clip that is longer is shown whole. */
  readonly length = signal(2);
  /** The target that is moved by the gizmo. */
  readonly chosenTarget = signal<number | null>(null);
  readonly chosenPose = signal<string | null>(null);
  readonly selectedKeys = signal<readonly string[]>([]);
  readonly playback: Playback = createPlayback({ duration: 2, frameRate: 30 });

  // What the server sent.
  readonly geometry = signal<Geometry | null>(null);
  readonly influences = signal<{ joints: Uint16Array; weights: Float32Array } | null>(null);
  readonly rest = signal(new Frames());
  readonly posed = signal(new Frames());
  /** The surface in the pose, where the server skins it. */
  readonly positions = signal<Shape | null>(null);
  /** The weight of the active joint for each vertex. */
  readonly heat = signal<Float32Array | null>(null);
  readonly onionPoses = signal<readonly OnionPose[]>([]);
  readonly comparedShapes = signal<ReadonlyMap<string, Shape>>(new Map());
  readonly comparing = signal<readonly SkinningMethod[]>(["linear", "dual-quaternion", "centers", "mixed", "regression"]);

  /** The skin for the joints that there are; none while weights and joints of two skeletons are on their way. */
  readonly skin = computed<SkinBuffers | null>(() => {
    const [found, jointCount] = [this.influences.value, this.jointCount.value];
    return found && found.joints.every((j) => j < jointCount) ? { ...found, jointCount } : null;
  });
  private readonly jointCount = computed(() => this.rest.value.count);

  readonly state: ReadonlySignal<State>;
  readonly joints: ReadonlySignal<readonly JointInfo[]>;
  readonly treeOrder: ReadonlySignal<readonly JointInfo[]>;
  readonly actions: Actions;
  scene: Scene | null = null;
  /** Tells the server the shown time now, where it does not have it yet: what is edited is edited at that time. */
  showTime: () => void = () => undefined;

  constructor(readonly connection: Connection<State>) {
    this.state = computed(() => connection.state.value as State);
    this.joints = computed(() => this.state.value.joints.map((joint, index) => ({ ...joint, index })));
    this.treeOrder = computed(() => depthFirst(this.joints.value));
    this.actions = new Actions(this);
  }

  /** Follows the server until the view goes. */
  open(): () => void {
    const stops = receive(this);
    stops.push(effect(() => {
      this.playback.duration.value = Math.max(this.length.value, this.state.value.duration);
    }));
    stops.push(effect(() => {
      // Joints that are gone are not chosen any more.
      const count = this.joints.value.length;
      if (this.selected.value.some((j) => j >= count)) this.selected.value = this.selected.value.filter((j) => j < count);
    }));
    return () => {
      this.playback.pause();
      for (const stop of stops) stop();
    };
  }

  select(joints: readonly number[]) {
    this.selected.value = joints;
    this.chosenTarget.value = null;
  }

  /** A joint and all above it. */
  ancestors(joint: number): number[] {
    const found: number[] = [];
    for (let at: number | null = joint; at !== null && !found.includes(at); at = this.joints.value[at]?.parent ?? null) found.push(at);
    return found;
  }

  /** Frames of the clip, from its first key to its last. */
  readonly clipFrames = computed(() => {
    const first = Math.min(...this.state.value.tracks.map(({ times }) => times[0] ?? 0));
    const seconds = this.state.value.duration - (Number.isFinite(first) ? first : 0);
    return Math.round(seconds * this.playback.frameRate.value) + 1;
  });

  /** The rotation from rest of a key, degrees. */
  keyVector(track: Track, i: number): [number, number, number] {
    return vectorDeg(new Quaternion(...(track.rotations[i] ?? [0, 0, 0, 1])));
  }

  /** Where a new target of a joint is: where it is met already. */
  targetPoint(joint: number, kind: Target["kind"]): Vector3 {
    const frames = this.posed.value;
    const at = frames.position(joint);
    if (kind === "look_at") {
      const children = this.joints.value.filter((other) => other.parent === joint);
      const parent = this.joints.value[joint]?.parent ?? null;
      const along = children.length === 1 ? frames.position(children[0]!.index).sub(at) : parent === null ? new Vector3(0, 0, 1) : at.clone().sub(frames.position(parent));
      return at.addScaledVector(along.normalize(), 0.3 * this.diagonal);
    }
    const [, middle, root] = this.ancestors(joint);
    if (kind !== "pole" || middle === undefined || root === undefined) return at;
    const elbow = frames.position(middle);
    const out = elbow.clone().sub(at.clone().add(frames.position(root)).divideScalar(2));
    if (out.length() < 1e-3 * this.diagonal) out.set(0, 0, 1).applyQuaternion(frames.rotation(root));
    return elbow.add(out.normalize().multiplyScalar(0.25 * this.diagonal));
  }

  /** A point of the model in the scene. */
  scenePoint(at: V3): Vector3 {
    const c = this.state.value.mesh.center;
    return new Vector3(at[0] - c[0], at[1] - c[1], at[2] - c[2]);
  }

  choose(joint: number | null, more: boolean) {
    const others = more ? this.selected.value.filter((j) => j !== joint) : [];
    this.select(joint === null ? (more ? others : []) : [...others, joint]);
  }

  /** The joint that was chosen last. */
  get active(): JointInfo | null {
    const last = this.selected.value[this.selected.value.length - 1];
    return last === undefined ? null : this.joints.value[last] ?? null;
  }

  get inPose(): boolean {
    return this.tab.value === "pose" || this.tab.value === "animate";
  }

  get shownFrames(): Frames {
    return this.inPose ? this.posed.value : this.rest.value;
  }

  get diagonal(): number {
    return this.state.value.mesh.diagonal;
  }

  /** Of arrow keys in fields of positions. */
  get step(): number {
    return Number((this.diagonal / 200).toPrecision(1));
  }

  isBelow(joint: number, ancestor: number): boolean {
    for (let at: number | null = joint, n = 0; at !== null && n <= this.joints.value.length; at = this.joints.value[at]?.parent ?? null, n++) {
      if (at === ancestor) return true;
    }
    return false;
  }

  jointDetail(joint: number): string | undefined {
    const target = this.state.value.targets.find((t) => t.joint === joint);
    const { limits, locked } = this.joints.value[joint] ?? {};
    const held = target && { position: "pinned", orientation: "pinned", look_at: "looks", pole: "pole" }[target.kind];
    return [held, locked && "locked"].filter(Boolean).join(", ") || (limits ? "limited" : undefined);
  }

  jointColor(joint: number): string | null {
    return this.jointColors.value.get(joint) ?? null;
  }

  readonly jointColors = computed<ReadonlyMap<number, string>>(() =>
    new Map(this.inPose ? this.state.value.targets.map((t) => [t.joint, "#e0762f"] as const) : []));

  modelPosition(joint: number): V3 {
    const p = this.rest.value.position(joint);
    const c = this.state.value.mesh.center;
    return [p.x + c[0], p.y + c[1], p.z + c[2]];
  }

  /** The rotation from rest, degrees; what is stored is parent_from_joint. */
  poseVector(joint: number): [number, number, number] {
    return vectorDeg(this.local(this.rest.value, joint).invert().multiply(this.local(this.posed.value, joint)));
  }

  poseTranslation(joint: number): V3 {
    return this.posed.value.position(joint).sub(this.rest.value.position(joint)).toArray() as V3;
  }

  /** parent_from_joint. */
  local(frames: Frames, joint: number): Quaternion {
    const parent = this.joints.value[joint]?.parent ?? null;
    const own = frames.rotation(joint);
    return parent === null ? own : frames.rotation(parent).invert().multiply(own);
  }

  /** The frame that a joint has where it is not rotated from rest. */
  limitFrame(joint: number): ArcFrame {
    const frames = this.shownFrames;
    const parent = this.joints.value[joint]?.parent ?? null;
    const above = parent === null ? new Quaternion() : frames.rotation(parent);
    return { position: frames.position(joint), quaternion: above.multiply(this.local(this.rest.value, joint)) };
  }

  limitShape(limits: Limits): LimitShape {
    return { axis: new Vector3(...limits.axis), across: new Vector3(...limits.across), swing: limits.swing, twist: limits.twist };
  }

  /** A cone about the bone: to the only child, else from the parent. */
  defaultLimits(joint: number): Limits {
    const frames = this.rest.value;
    const children = this.joints.value.filter((other) => other.parent === joint);
    const at = frames.position(joint);
    const parent = this.joints.value[joint]?.parent ?? null;
    const along = children.length === 1 ? frames.position(children[0]!.index).sub(at) : parent === null ? new Vector3(0, 1, 0) : at.clone().sub(frames.position(parent));
    const axis = along.applyQuaternion(frames.rotation(joint).invert()).normalize();
    if (!(axis.length() > 0)) axis.set(0, 1, 0);
    const flat = [axis.x, axis.y, axis.z].map(Math.abs);
    const helper = new Vector3().setComponent(flat.indexOf(Math.min(...flat)), 1);
    const across = axis.clone().cross(helper).normalize();
    return { axis: axis.toArray() as V3, across: across.toArray() as V3, swing: [Math.PI / 3, Math.PI / 3], twist: [-Math.PI / 6, Math.PI / 6] };
  }

  /** The joint with most influence on a vertex. */
  jointOf(vertex: number): number | null {
    const skin = this.skin.value;
    if (!skin) return null;
    const weights = [...skin.weights.subarray(4 * vertex, 4 * vertex + 4)];
    return skin.joints[4 * vertex + weights.indexOf(Math.max(...weights))] ?? null;
  }

  readonly onionGeometry = computed(() => {
    const [mesh, skin] = [this.geometry.value, this.skin.value];
    return mesh && skin ? { ...mesh, skin } : null;
  });

  readonly compared = computed(() => this.comparing.value.filter((method) => this.available(method)));
  available(method: SkinningMethod): boolean {
    const { model } = this.state.value;
    return method !== "regression" || (model !== null && model.fault === null);
  }
  compare(methods: readonly SkinningMethod[]) {
    this.comparing.value = methods;
  }
  comparedText(id: string): { text: string; note?: string } {
    const measured = this.state.value.compare.find((c) => c.method === id);
    return { text: METHODS[id as SkinningMethod] ?? id, note: measured && `volume ${Math.round(1000 * measured.volume) / 10} %` };
  }

  readonly skeletonActions: SkeletonActions = {
    select: (joint, more) => this.choose(joint, more),
    addAlong: (origin, direction) => this.actions.addAlong(origin, direction),
    position: (joint) => this.rest.peek().position(joint),
    move: (joint, to, final) => this.actions.move(joint, to, final),
    extrude: (joint, to) => this.actions.extrude(joint, to),
    split: (joint, fraction) => this.actions.split(joint, fraction),
    pin: (vertex) => this.actions.togglePin(vertex),
  };

  readonly poseActions: PoseActions = {
    select: (joint, more) => this.choose(joint, more),
    jointOf: (vertex) => this.jointOf(vertex),
    position: (joint) => this.posed.peek().position(joint),
    grabbed: (joint, point) => point.clone().applyMatrix4(this.posed.peek().matrix(joint).invert()).toArray() as V3,
    drag: (joint, point, to, final) => this.actions.dragJoint(joint, point, to, final),
    begin: (joint) => batch(() => this.choose(joint, false)),
    cancel: () => this.actions.cancelDrag(),
  };

  /** A joint along the ray through the middle of the view: what a click there adds. */
  addAtCenter() {
    const at = this.scene?.view.center();
    if (at) this.actions.addAlong(at.ray.origin, at.ray.direction);
  }

  /** Moves the active joint in the plane that faces the viewer, by pixels: what a drag does. */
  nudge(right: number, up: number) {
    const view = this.scene?.view;
    const joint = this.active;
    if (!view || !joint) return;
    const from = this.shownFrames.position(joint.index);
    const to = from.clone().add(view.screenStep(from, right, up));
    if (this.tab.value === "skeleton") this.actions.move(joint.index, to, true);
    else if (this.inPose) this.actions.dragJoint(joint.index, [0, 0, 0], to, true);
  }

  paintAtCenter() {
    const view = this.scene?.view;
    const hit = view?.pick(view.center());
    if (hit) {
      this.actions.paint(hit.point, 0.5, false, false);
      this.actions.endDrag();
    }
  }

  skinMatrices(): Float32Array {
    return skinMatrices(this.posed.value, this.rest.value);
  }
}

/** Depth first from the roots. */
function depthFirst(joints: readonly JointInfo[]): JointInfo[] {
  const children = new Map<number | null, JointInfo[]>();
  for (const joint of joints) children.set(joint.parent, [...(children.get(joint.parent) ?? []), joint]);
  const order: JointInfo[] = [];
  const waiting = [...(children.get(null) ?? [])].reverse();
  for (let joint = waiting.pop(); joint && order.length < joints.length; joint = waiting.pop()) {
    order.push(joint);
    waiting.push(...[...(children.get(joint.index) ?? [])].reverse());
  }
  return order;
}
