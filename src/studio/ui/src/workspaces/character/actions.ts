// What the page does, in words of the user; each becomes one message to the server.
import { signal } from "@preact/signals";
import { Quaternion, Vector3 } from "three";
import type { Edit, ExtractionOptions, InterpolationKind, Limits, SkinningMethod, Target, V3, WeightMethod } from "../../generated/character";
import { rotationOfDeg } from "./frames";
import type { Page } from "./page";
import { upload } from "../../shell/api";
import { notify } from "../../shell/notices";

export class Actions {
  constructor(private readonly page: Page) {}

  private edit(edit: Edit): Promise<void> {
    this.page.showTime();
    return this.page.connection.edit(edit);
  }

  /** A message of a drag; the last one ends the step. */
  private drag(edit: Edit, final: boolean) {
    this.page.showTime();
    this.page.connection.drag(edit);
    if (final) this.page.connection.seal();
  }

  private model(point: Vector3): V3 {
    const c = this.page.state.value.mesh.center;
    return [point.x + c[0], point.y + c[1], point.z + c[2]];
  }

  // Skeleton.

  extract(changed: { options?: ExtractionOptions; joints?: number | null; ends?: number[] | "extrema" | null }) {
    const { options, joints, ends } = this.page.state.value.extraction;
    void this.edit({ do: "extract", options, joints, ends, ...changed });
  }

  template(name: string) {
    void this.edit({ do: "template", name });
  }

  /** The skeleton of a file as a template. */
  chooseTemplate() {
    choose(".json,.glb,.gltf,.fbx,.bvh,.tgf,.skel", (path) => this.edit({ do: "template_file", path }));
  }

  addAlong(origin: Vector3, direction: Vector3) {
    void this.edit({ do: "add_along", origin: this.model(origin), direction: direction.toArray() as V3, parent: this.page.active?.index ?? null });
  }

  async extrude(joint: number, to: Vector3): Promise<number | null> {
    const before = this.page.joints.value.length;
    await this.edit({ do: "extrude", joint, at: this.model(to) });
    return this.page.joints.value.length > before ? this.page.joints.value.length - 1 : null;
  }

  moveTo(joint: number, to: V3) {
    void this.edit({ do: "move", joint, to, with_children: this.page.withChildren.value });
  }

  move(joint: number, to: Vector3, final: boolean) {
    this.drag({ do: "move", joint, to: this.model(to), with_children: this.page.withChildren.value }, final);
  }

  split = (joint: number, fraction: number) => void this.edit({ do: "split", joint, fraction });
  dissolve = (joints: readonly number[]) => void this.edit({ do: "dissolve", joints: [...joints] });
  remove = (joints: readonly number[]) => void this.edit({ do: "remove", joints: [...joints] });
  reparent = (joints: readonly number[], parent: number | null) => void this.edit({ do: "reparent", joints: [...joints], parent });
  rename = (joint: number, name: string) => void this.edit({ do: "rename", joint, name });
  mirror = (joint: number) => void this.edit({ do: "mirror", joint });
  roll = (joint: number, angle: number) => void this.edit({ do: "roll", joint, angle });
  limit = (joint: number, limits: Limits | null) => void this.edit({ do: "limit", joint, limits });

  // Weights.

  influences = (max: number) => void this.edit({ do: "influences", max });
  computeWeights = (options: { method: WeightMethod; influences: number; smooth: number }) =>
    void this.edit({ do: "compute_weights", method: options.method, influences: options.influences, smooth: options.smooth });

  // Pose.

  rotateTo(joint: number, rotation: Quaternion) {
    void this.edit({ do: "rotate", joint, rotation: [rotation.x, rotation.y, rotation.z, rotation.w] });
    this.keyPosed();
  }
  translate(joint: number, translation: V3) {
    void this.edit({ do: "translate", joint, translation });
    this.keyPosed();
  }
  dragJoint(joint: number, point: V3, to: Vector3, final: boolean) {
    this.drag({ do: "drag", joint, point, to: this.model(to) }, final);
    if (final) this.keyPosed();
  }
  /** What was posed becomes keys at the shown time, where that is wanted. */
  private keyPosed() {
    if (this.page.autoKey.value && this.page.tab.value === "animate" && this.page.state.value.clip !== null) this.keyUnkeyed(this.page.playback.time.value);
  }
  /** A change of the pose. */
  private pose(edit: Edit) {
    void this.edit(edit);
    this.keyPosed();
  }
  resetPose = (joints: readonly number[] | null) => this.pose({ do: "reset_pose", joints: joints && [...joints] });
  mirrorPose = () => this.pose({ do: "mirror_pose" });
  lock = (joints: readonly number[], locked: boolean) => void this.edit({ do: "lock", joints: [...joints], locked });
  /** All that are chosen are locked, or none where the last one is. */
  toggleLock = () => this.page.active && this.lock(this.page.selected.value, !this.page.active.locked);

  copyPose() {
    void this.page.connection.ask<string>({ ask: "copy_pose" }).then((text) => {
      copiedPose.value = text;
      notify("info", "The pose is copied");
    });
  }
  /** The copied pose, also of another document; for some joints, or all. */
  pastePose(mirrored: boolean, joints: readonly number[] | null) {
    if (copiedPose.value !== null) this.pose({ do: "paste_pose", text: copiedPose.value, mirrored, joints: joints && [...joints] });
  }
  takePose = () => void this.edit({ do: "take_pose" }).then(() => notify("info", "This is the pose of the mode Pose now"));
  bakePose = () => void this.edit({ do: "bake_pose" });
  pin = (joint: number, orientation: boolean) => void this.edit({ do: "pin", joint, orientation });
  /** A target where the pose already meets it, so that nothing jumps. */
  addTarget(joint: number, kind: Target["kind"]) {
    const at = this.model(this.page.targetPoint(joint, kind));
    void this.edit({ do: "add_target", target: { joint, kind, at, weight: 1 } }).then(() => (this.page.chosenTarget.value = this.page.state.value.targets.length - 1));
  }
  dragTarget = (index: number, target: Target, to: Vector3) => this.drag({ do: "set_target", index, target: { ...target, at: this.model(to) } }, false);
  setTarget = (index: number, target: Target) => void this.edit({ do: "set_target", index, target });
  removeTarget = (index: number) => void this.edit({ do: "remove_target", index });
  storePose = (name: string) => void this.edit({ do: "store_pose", name });
  applyPose = (name: string) => this.pose({ do: "apply_pose", name });
  removePose = (name: string) => void this.edit({ do: "remove_pose", name });
  skinning = (method: SkinningMethod) => void this.edit({ do: "skinning", method });

  // Animation.

  addClip = () => void this.edit({ do: "add_clip", name: `clip ${this.page.state.value.clips.length + 1}` });
  selectClip = (name: string) => void this.edit({ do: "select_clip", name });
  renameClip = (name: string) => void this.edit({ do: "rename_clip", name });
  removeClip = () => void this.edit({ do: "remove_clip", name: this.page.state.value.clip ?? "" });
  key = (joints: readonly number[], time: number) => void this.edit({ do: "key", joints: [...joints], time });
  keyUnkeyed = (time: number) => void this.edit({ do: "key_unkeyed", time });
  discardUnkeyed = (time: number) => void this.edit({ do: "discard_unkeyed", time });
  /** What a run of the saved file writes: frames of the clip, or the pose. */
  runWrites = (frames: number | null) => void this.edit({ do: "run_writes", frames });
  interpolation = (kind: InterpolationKind) => void this.edit({ do: "interpolation", joints: [...this.page.selected.value], kind });

  /** Keys of the chosen joints, of all where none is chosen, at the shown time. */
  keySelected() {
    const { selected, joints, playback } = this.page;
    this.key(selected.value.length > 0 ? selected.value : joints.value.map((j) => j.index), playback.time.value);
  }
  removeKeys(ids: readonly string[]) {
    for (const id of ids.filter(isUnkeyed)) this.discardUnkeyed(parseKey(id)[1]);
    const keys = ids.filter((id) => !isUnkeyed(id)).map(parseKey);
    if (keys.length > 0) void this.edit({ do: "remove_keys", keys });
    this.page.selectedKeys.value = [];
  }
  moveKeys(ids: readonly string[], by: number, final: boolean) {
    const keys = ids.filter((id) => !isUnkeyed(id)).map(parseKey);
    if (final && keys.length > 0) void this.edit({ do: "move_keys", keys, by });
  }
  moveCurveKey(id: string, time: number, value: number, final: boolean) {
    const [joint, from] = parseKey(id);
    const track = this.page.state.value.tracks.find((t) => t.joint === joint);
    const i = track?.times.indexOf(from) ?? -1;
    if (!track || i < 0) return;
    const vector = this.page.keyVector(track, i);
    vector["xyz".indexOf(id[0]!)] = value;
    const { x, y, z, w } = rotationOfDeg(vector);
    this.drag({ do: "set_key", joint, time: from, rotation: [x, y, z, w] }, final);
    if (!final || time === from) return;
    void this.edit({ do: "move_keys", keys: [[joint, from]], by: time - from });
    this.page.selectedKeys.value = [`${id[0]}:${joint}@${time}`];
  }

  togglePin(vertex: number) {
    const { ends } = this.page.state.value.extraction;
    const pinned = Array.isArray(ends) ? ends : [];
    this.extract({ ends: pinned.includes(vertex) ? pinned.filter((v) => v !== vertex) : [...pinned, vertex] });
  }

  /** A child of the active joint, as far from it as that from its parent. */
  extrudeSelected() {
    const joint = this.page.active;
    if (!joint) return;
    const rest = this.page.rest.value;
    const at = rest.position(joint.index);
    const along = joint.parent === null ? new Vector3(0, 0.1 * this.page.diagonal, 0) : at.clone().sub(rest.position(joint.parent));
    void this.extrude(joint.index, at.add(along)).then((made) => made !== null && this.page.select([made]));
  }

  // Gestures.

  paint(at: Vector3, pressure: number, shift: boolean, ctrl: boolean) {
    const { brush, active, diagonal } = this.page;
    if (!active) return;
    const op = shift ? "smooth" : ctrl && brush.op.value === "add" ? "subtract" : brush.op.value;
    this.page.connection.drag({
      do: "paint", joint: active.index, op, center: this.model(at), radius: brush.size.value * diagonal, strength: brush.strength.value * pressure * 2,
      value: brush.value.value, mirror: brush.mirror.value,
    });
  }

  /** A world rotation of a joint; the parent's stays. */
  rotateWorld(joint: number, world: Quaternion, final: boolean) {
    const parent = this.page.joints.value[joint]?.parent ?? null;
    const above = parent === null ? new Quaternion() : this.page.posed.value.rotation(parent);
    const rest = this.page.local(this.page.rest.value, joint);
    const rotation = rest.invert().multiply(above.invert().multiply(world));
    this.drag({ do: "rotate", joint, rotation: [rotation.x, rotation.y, rotation.z, rotation.w] }, final);
  }

  endDrag(rotated?: number) {
    this.page.connection.seal();
    if (rotated !== undefined) this.keyPosed();
  }

  cancelDrag() {
    this.page.connection.seal();
    this.page.connection.undo();
  }

  // Files.

  chooseImport() {
    choose(".bvh,.fbx,.glb,.gltf,.json,.skel,.tgf,.skin", (path) => this.edit({ do: "import", path }));
  }

  /** A trained skin; it is refused where it is of another mesh or of other joints. */
  chooseModel() {
    choose(".skin", (path) => this.edit({ do: "import", path }));
  }

  export(format: "glb" | "bvh" | "obj") {
    void this.page.connection.ask({ ask: "export", format });
  }

  /** The clip as one OBJ file a frame, in an archive. */
  exportFrames() {
    void this.page.connection.ask({ ask: "export_frames", rate: this.page.playback.frameRate.value });
  }

  copyCommand() {
    void this.page.connection.ask<string>({ ask: "command" }).then(async (text) => {
      const copied = await navigator.clipboard?.writeText(text).then(() => true, () => false);
      notify("info", copied ? `In the clipboard: ${text}` : text);
    });
  }
}

/** The pose that was copied last, as the text of a pose file; for all documents of this page. */
export const copiedPose = signal<string | null>(null);

/** Lets the user choose a file, which the program then can read. */
function choose(accept: string, then: (path: string) => Promise<void>) {
  const input = document.createElement("input");
  input.type = "file";
  input.accept = accept;
  input.onchange = () => {
    const file = input.files?.[0];
    if (file) upload(file).then(({ path }) => void then(path), (error: Error) => notify("error", error.message));
  };
  input.click();
}

/** Marks of the timeline that are poses without keys. */
export const UNKEYED = "unkeyed";
const isUnkeyed = (id: string) => id.startsWith(`${UNKEYED}@`);

const parseKey = (id: string): [number, number] => {
  const [joint, time] = id.replace(/^[xyz]:/, "").split("@").map(Number);
  return [joint ?? 0, time ?? 0];
};
