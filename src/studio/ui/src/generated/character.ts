// Messages of the character workspace. Written by a test of `src/studio/character`: REGENERATE=1 cargo test -p plumbline-studio

export type V3 = [number, number, number];
export type Q4 = [number, number, number, number];

export type BrushOp = "add" | "subtract" | "smooth" | "replace";

export type WeightMethod = "heat" | "biharmonic" | "distance";

export type SkinningMethod = "linear" | "dual-quaternion" | "centers" | "mixed" | "regression";

export type InterpolationKind = "step" | "linear" | "spline";

export type ExtractionOptions = { 
/**
 * Weight of the contraction.
 */
contraction: number, 
/**
 * Weight of the last positions.
 */
attraction: number, 
/**
 * Weight of the medial axis.
 */
medial: number, 
/**
 * Branches shorter than so many local radii are pruned.
 */
prune: number, 
/**
 * Largest number of iterations.
 */
iterations: number, };

export type EndsWord = "extrema";

export type Ends = EndsWord | Array<number>;

export type Limits = { 
/**
 * Axis of the twist.
 */
axis: [number, number, number], 
/**
 * First axis of the swing.
 */
across: [number, number, number], 
/**
 * Largest swing about both axes.
 */
swing: [number, number], 
/**
 * Smallest and largest twist.
 */
twist: [number, number], };

export type TargetKind = "position" | "orientation" | "look_at" | "pole";

export type Target = { 
/**
 * The joint.
 */
joint: number, 
/**
 * What it does.
 */
kind: TargetKind, 
/**
 * The point; not used for an orientation.
 */
at: [number, number, number], 
/**
 * Weight relative to the others.
 */
weight: number, };

export type Edit = { "do": "extract", options: ExtractionOptions, joints?: number | null, ends?: Ends | null, } | { "do": "template", name: string, } | { "do": "template_file", path: string, } | { "do": "add_along", origin: [number, number, number], direction: [number, number, number], parent?: number | null, } | { "do": "add", at: [number, number, number], parent?: number | null, name?: string | null, } | { "do": "extrude", joint: number, at: [number, number, number], name?: string | null, } | { "do": "split", joint: number, fraction: number, } | { "do": "dissolve", joints: Array<number>, } | { "do": "remove", joints: Array<number>, } | { "do": "reparent", joints: Array<number>, parent?: number | null, } | { "do": "rename", joint: number, name: string, } | { "do": "mirror", joint: number, } | { "do": "move", joint: number, to: [number, number, number], with_children: boolean, } | { "do": "roll", joint: number, angle: number, } | { "do": "limit", joint: number, limits?: Limits | null, } | { "do": "compute_weights", method: WeightMethod, influences: number, smooth: number, } | { "do": "paint", joint: number, op: BrushOp, center: [number, number, number], radius: number, strength: number, value: number, mirror: boolean, } | { "do": "influences", max: number, } | { "do": "rotate", joint: number, rotation: [number, number, number, number], } | { "do": "drag", joint: number, point: [number, number, number], to: [number, number, number], } | { "do": "translate", joint: number, translation: [number, number, number], } | { "do": "pin", joint: number, orientation: boolean, } | { "do": "lock", joints: Array<number>, locked: boolean, } | { "do": "add_target", target: Target, } | { "do": "set_target", index: number, target: Target, } | { "do": "remove_target", index: number, } | { "do": "reset_pose", joints?: Array<number> | null, } | { "do": "mirror_pose" } | { "do": "paste_pose", text: string, mirrored: boolean, joints?: Array<number> | null, } | { "do": "take_pose" } | { "do": "bake_pose" } | { "do": "store_pose", name: string, } | { "do": "apply_pose", name: string, } | { "do": "remove_pose", name: string, } | { "do": "skinning", method: SkinningMethod, } | { "do": "add_clip", name: string, } | { "do": "rename_clip", name: string, } | { "do": "remove_clip", name: string, } | { "do": "select_clip", name: string, } | { "do": "key", joints: Array<number>, time: number, } | { "do": "key_unkeyed", time: number, } | { "do": "discard_unkeyed", time: number, } | { "do": "run_writes", frames?: number | null, } | { "do": "set_key", joint: number, time: number, rotation: [number, number, number, number], } | { "do": "move_keys", keys: Array<[number, number]>, by: number, } | { "do": "remove_keys", keys: Array<[number, number]>, } | { "do": "interpolation", joints: Array<number>, kind: InterpolationKind, } | { "do": "import", path: string, };

export type Tab = "skeleton" | "weights" | "pose" | "animate" | "compare";

export type View = { 
/**
 * The open panel.
 */
tab?: Tab, 
/**
 * The joint whose weights are shown.
 */
joint?: number | null, 
/**
 * Time in the clip, s.
 */
time?: number, 
/**
 * Poses before and after, and how far apart they are, s; 0 of them: none.
 */
onion?: [number, number], };

export type Format = "glb" | "bvh" | "obj";

export type Ask = { "ask": "export", 
/**
 * Its format.
 */
format: Format, } | { "ask": "export_frames", 
/**
 * Frames per second.
 */
rate: number, } | { "ask": "copy_pose" } | { "ask": "command" };

export type MeshState = { vertices: number, triangles: number, diagonal: number, center: [number, number, number], up: string, };

export type JointState = { name: string, parent: number | null, limits: Limits | null, locked: boolean, };

export type Track = { joint: number, times: Array<number>, rotations: Array<[number, number, number, number]>, interpolation: InterpolationKind, };

export type ExtractionState = { options: ExtractionOptions, joints: number | null, ends: Ends | null, 
/**
 * The fraction that is done of an extraction that runs.
 */
running: number | null, report: Record<string, number> | null, };

export type WeightsState = { method: WeightMethod, influences: number, smooth: number, 
/**
 * Whether they were painted or read: other than computed.
 */
painted: number, 
/**
 * The fraction that is done of a computation that runs.
 */
running: number | null, };

export type Compared = { method: SkinningMethod, 
/**
 * Volume over that at rest; 1 where the surface is open.
 */
volume: number, 
/**
 * Root mean square of relative changes of edge lengths.
 */
stretch: number, };

export type ModelState = { name: string, 
/**
 * Why it does not fit the mesh and the skeleton; none where it does.
 */
fault: string | null, };

export type UnkeyedState = { time: number, joints: Array<string>, };

export type RunState = { 
/**
 * The clip; none: the pose.
 */
clip: string | null, frames: number, };

export type State = { name: string, mesh: MeshState, joints: Array<JointState>, templates: Array<string>, extraction: ExtractionState, weights: WeightsState, skinning: SkinningMethod, targets: Array<Target>, poses: Array<string>, clips: Array<string>, clip: string | null, duration: number, tracks: Array<Track>, unkeyed: Array<UnkeyedState>, run: RunState, model: ModelState | null, compare: Array<Compared>, };

/** Kinds of buffers. */
export const KINDS = {
  triangles: 200,
  rest: 201,
  skinJoints: 202,
  skinWeights: 203,
  restFrames: 204,
  posedFrames: 205,
  heat: 206,
  positions: 207,
  onion: 208,
  compared: 209,
} as const;
