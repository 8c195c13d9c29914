// Messages of the mesh workspace. Written by a test of `src/studio/mesh`: REGENERATE=1 cargo test -p plumbline-studio

/** Kinds of buffers. */
export const BufferKind = { Triangles: 100, Positions: 101, Scalars: 102, Selection: 103, Owners: 104, Energies: 105, Frame: 106 } as const;

export type Combine = "replace" | "add" | "remove" | "intersect";

export type HandleKind = "fixed" | "rigid" | "free";

export type KeyId = { 
/**
 * The handle.
 */
handle: number, 
/**
 * Its time.
 */
time: number, };

export type Edit = { "do": "select", vertices: Array<number>, how?: Combine, stroke?: boolean | null, } | { "do": "select_all" } | { "do": "select_none" } | { "do": "select_inverse" } | { "do": "select_connected" } | { "do": "select_rings", rings: number, } | { "do": "select_half_space", point: [number, number, number], normal: [number, number, number], how?: Combine, } | { "do": "select_set", name: string, how?: Combine, } | { "do": "select_handle", handle: number, how?: Combine, } | { "do": "name_selection", name: string, } | { "do": "rename_set", from: string, to: string, } | { "do": "delete_set", name: string, } | { "do": "add_handle", kind: HandleKind, name?: string | null, } | { "do": "activate", handle?: number | null, } | { "do": "rename_handle", handle: number, name: string, } | { "do": "delete_handles", handles: Array<number>, } | { "do": "reorder_handle", handle: number, to: number, } | { "do": "set_vertices", handle: number, } | { "do": "set_kind", handle: number, kind: HandleKind, } | { "do": "set_weight", handle: number, weight?: number | null, } | { "do": "set_pivot", handle: number, pivot: [number, number, number], } | { "do": "drag", handle: number, gesture: number, time: number, translation: [number, number, number], 
/**
 * `[w, x, y, z]`.
 */
rotation: [number, number, number, number], scale: [number, number, number], } | { "do": "place", handle: number, time: number, translation?: [number, number, number] | null, 
/**
 * Axis; the angle is beside it.
 */
axis?: [number, number, number] | null, angle_deg?: number | null, } | { "do": "reset", handle: number, time: number, } | { "do": "add_key", handle: number, time: number, } | { "do": "delete_keys", keys: Array<KeyId>, } | { "do": "move_keys", keys: Array<KeyId>, by: number, gesture: number, } | { "do": "set_interpolation", handle: number, smooth: boolean, } | { "do": "paint_region", vertices: Array<number>, inside: boolean, stroke?: boolean | null, } | { "do": "region_from_selection" } | { "do": "clear_region" } | { "do": "set_option", name: string, value: unknown, } | { "do": "set_frames", frames: number, seconds?: number | null, } | { "do": "set_output", name: string, };

export type Overlay = "none" | "distortion" | "energy" | "flipped" | "displacement";

export type View = { 
/**
 * The time that is shown.
 */
time?: number, 
/**
 * What colors mean.
 */
overlay?: Overlay, };

export type Ask = { "ask": "schema" } | { "ask": "export", format: string, ascii?: boolean, } | { "ask": "export_frames", format: string, seconds?: number, } | { "ask": "export_handles" } | { "ask": "report" } | { "ask": "command" };

export type MeshInfo = { 
/**
 * Name of its file.
 */
name: string, 
/**
 * Number of vertices of the file.
 */
vertices: number, 
/**
 * Number of triangles.
 */
triangles: number, 
/**
 * Diagonal of the bounding box.
 */
diagonal: number, 
/**
 * Origin of the positions in buffers.
 */
center: [number, number, number], 
/**
 * What repair did for the solver; nothing of it is written.
 */
repair: Array<string>, 
/**
 * What the file has that was not read.
 */
warnings: Array<string>, 
/**
 * Number of connected components.
 */
components: number, };

export type HandleState = { 
/**
 * Its name.
 */
name: string, 
/**
 * How it moves.
 */
kind: HandleKind, 
/**
 * Number of its vertices.
 */
vertices: number, 
/**
 * Weight of soft constraints.
 */
weight: number | null, 
/**
 * Position of its gizmo at the time that is shown.
 */
position: [number, number, number], 
/**
 * Orientation of its gizmo, `[w, x, y, z]`.
 */
rotation: [number, number, number, number], 
/**
 * Center of rotation of a rigid handle.
 */
pivot: [number, number, number] | null, 
/**
 * Translation from rest of a rigid handle.
 */
translation: [number, number, number] | null, 
/**
 * Axis of its rotation from rest, of length 1.
 */
axis: [number, number, number] | null, 
/**
 * Angle of its rotation from rest, degrees.
 */
angle_deg: number | null, 
/**
 * Times of its keys.
 */
keys: Array<number>, 
/**
 * Zero velocity at the keys.
 */
smooth: boolean, };

export type SelectionState = { 
/**
 * Their number.
 */
count: number, 
/**
 * The first of them.
 */
first: Array<number>, 
/**
 * Their centroid, as they are shown.
 */
centroid: [number, number, number] | null, };

export type SetState = { 
/**
 * Its name.
 */
name: string, 
/**
 * Number of vertices.
 */
vertices: number, };

export type SolveState = { 
/**
 * What is computed: `prefactor`, `follow`, `settle`, `exact`, `frames`, `rest`.
 */
phase: string, 
/**
 * The surface that is shown is the one that `plumbline run` writes.
 */
exact: boolean, 
/**
 * Energy of the surface that is shown.
 */
energy: number | null, 
/**
 * Iterations of the last solve.
 */
iterations: number | null, 
/**
 * Why it ended.
 */
stop: string | null, 
/**
 * Largest distance of a constrained vertex from its target.
 */
constraint_error: number | null, 
/**
 * Largest relative change of an edge length.
 */
worst_stretch: number | null, 
/**
 * Root mean square of the relative changes of all edge lengths.
 */
rms_stretch: number | null, 
/**
 * Faces that are inverted.
 */
flipped: number | null, 
/**
 * Volume over the rest volume.
 */
volume_ratio: number | null, 
/**
 * Edges with a negative weight.
 */
negative_weights: number | null, 
/**
 * Components without a handle, which stay.
 */
fixed_components: number | null, 
/**
 * Time of the last factorization, ms.
 */
prefactor_ms: number | null, 
/**
 * Time of the last slice that followed the handles, ms.
 */
follow_ms: number | null, 
/**
 * Why there is no solution.
 */
error: string | null, };

export type OverlayState = { 
/**
 * What colors mean.
 */
kind: Overlay, 
/**
 * The highest color; the lowest is 0.
 */
high: number, };

export type State = { 
/**
 * The mesh.
 */
mesh: MeshInfo, 
/**
 * The handles, in the order of the file.
 */
handles: Array<HandleState>, 
/**
 * The handle that is edited.
 */
active: number | null, 
/**
 * The selected vertices.
 */
selection: SelectionState, 
/**
 * Named sets: name and number of vertices.
 */
sets: Array<SetState>, 
/**
 * Vertices outside the region of influence.
 */
outside: number, 
/**
 * The time that is shown.
 */
time: number, 
/**
 * First and last key.
 */
times: [number, number], 
/**
 * Settings of the deformation, by their names in the pipeline file.
 */
options: Record<string, unknown>, 
/**
 * Number of poses that are written.
 */
frames: number, 
/**
 * Poses that are solved.
 */
frames_ready: number, 
/**
 * Duration of one file that moves.
 */
seconds: number | null, 
/**
 * The file that `plumbline run` writes.
 */
output: string | null, 
/**
 * The solve.
 */
solve: SolveState, 
/**
 * Overlay and its highest value.
 */
overlay: OverlayState, 
/**
 * Names of the pipeline file and of the file of handles.
 */
files: [string, string], };
