// What this page sends and reads, until the types are generated from the server. Points and positions are those of the model (not relative
// to `center`); quaternions are [x, y, z, w]; angles in rad; joints are indices.
export type V3 = [number, number, number];
export type Q4 = [number, number, number, number];

export type Edit =
  // Skeleton.
  | { do: "extract"; options: ExtractionOptions; joints: number | null; ends: number[] | "extrema" | null }
  | { do: "template"; name: string }
  | { do: "add_along"; origin: V3; direction: V3; parent: number | null }
  | { do: "add"; at: V3; parent: number | null; name?: string }
  | { do: "extrude"; joint: number; at: V3; name?: string }
  | { do: "split"; joint: number; fraction: number }
  | { do: "dissolve"; joints: number[] }
  | { do: "remove"; joints: number[] }
  | { do: "reparent"; joints: number[]; parent: number | null }
  | { do: "rename"; joint: number; name: string }
  | { do: "mirror"; joint: number }
  | { do: "move"; joint: number; to: V3; with_children: boolean }
  | { do: "roll"; joint: number; angle: number }
  | { do: "limit"; joint: number; limits: Limits | null }
  // Weights.
  | { do: "compute_weights"; method: WeightMethod; influences: number; smooth: number }
  | { do: "paint"; joint: number; op: BrushOp; center: V3; radius: number; strength: number; value: number; mirror: boolean }
  | { do: "influences"; max: number }
  // Pose.
  | { do: "rotate"; joint: number; rotation: Q4 }
  | { do: "drag"; joint: number; point: V3; to: V3 }
  | { do: "translate"; joint: number; translation: V3 }
  | { do: "pin"; joint: number; orientation: boolean }
  | { do: "add_target"; target: Target }
  | { do: "set_target"; index: number; target: Target }
  | { do: "remove_target"; index: number }
  | { do: "reset_pose"; joints: number[] | null }
  | { do: "mirror_pose" }
  | { do: "bake_pose" }
  | { do: "store_pose"; name: string }
  | { do: "apply_pose"; name: string }
  | { do: "remove_pose"; name: string }
  | { do: "skinning"; method: SkinningMethod }
  // Animation.
  | { do: "add_clip"; name: string }
  | { do: "rename_clip"; name: string }
  | { do: "remove_clip"; name: string }
  | { do: "select_clip"; name: string }
  | { do: "key"; joints: number[]; time: number }
  | { do: "set_key"; joint: number; time: number; rotation: Q4 }
  | { do: "move_keys"; keys: [number, number][]; by: number }
  | { do: "remove_keys"; keys: [number, number][] }
  | { do: "interpolation"; joints: number[]; kind: InterpolationKind }
  | { do: "import"; path: string };

export type BrushOp = "add" | "subtract" | "smooth" | "replace";
export type WeightMethod = "heat" | "biharmonic" | "distance";
export type SkinningMethod = "linear" | "dual-quaternion" | "centers" | "mixed" | "regression";
export type InterpolationKind = "step" | "linear" | "spline";

export interface ExtractionOptions { contraction: number; attraction: number; medial: number; prune: number; iterations: number }
export interface Limits { axis: V3; across: V3; swing: [number, number]; twist: [number, number] }
export interface Target {
  joint: number;
  kind: "position" | "orientation" | "look_at" | "pole";
  at: V3;
  weight: number;
}

export interface JointState { name: string; parent: number | null; limits: Limits | null; locked?: boolean }
export interface Track { joint: number; times: number[]; rotations: Q4[]; interpolation: InterpolationKind }
export interface State {
  name: string;
  mesh: { vertices: number; triangles: number; diagonal: number; center: V3; up: "y" | "z" };
  joints: JointState[];
  templates: string[];
  extraction: { options: ExtractionOptions; joints: number | null; ends: number[] | "extrema" | null; report: Record<string, number> | null };
  weights: { method: WeightMethod; influences: number; smooth: number; painted: number };
  skinning: SkinningMethod;
  targets: Target[];
  poses: string[];
  clips: string[];
  clip: string | null;
  duration: number;
  tracks: Track[];
  compare: { method: SkinningMethod; volume: number; stretch: number }[];
}

/** Kinds of buffers. */
export const KINDS = { triangles: 200, rest: 201, skinJoints: 202, skinWeights: 203, restFrames: 204, posedFrames: 205, heat: 206, positions: 207, onion: 208, compared: 209 };
