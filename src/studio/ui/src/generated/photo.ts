// Types of the photo workspace's messages, written by its test (REGENERATE=1).

export const BufferKind = {
  Source: 300,
  SourcePart: 301,
  Result: 302,
  Grid: 303,
  Marks: 304,
  Courses: 305,
  FoundCourses: 306,
  Carried: 307,
  FoundCarried: 308,
} as const;

export type Edit = { "do": "add_line", 
/**
 * Two or more.
 */
points: Array<[number, number]>, 
/**
 * Default: free.
 */
orientation?: OrientationSetting, } | { "do": "move_point", 
/**
 * Its line.
 */
line: number, 
/**
 * Its number.
 */
point: number, 
/**
 * px.
 */
x: number, 
/**
 * px.
 */
y: number, } | { "do": "set_points", 
/**
 * The line.
 */
line: number, 
/**
 * Two or more.
 */
points: Array<[number, number]>, } | { "do": "insert_point", 
/**
 * The line.
 */
line: number, 
/**
 * Its number.
 */
at: number, 
/**
 * px.
 */
x: number, 
/**
 * px.
 */
y: number, } | { "do": "remove_point", 
/**
 * The line.
 */
line: number, 
/**
 * Its number.
 */
point: number, } | { "do": "delete_lines", 
/**
 * Their numbers.
 */
lines: Array<number>, } | { "do": "orient", 
/**
 * Their numbers.
 */
lines: Array<number>, 
/**
 * How they shall lie.
 */
orientation: OrientationSetting, } | { "do": "rename_line", 
/**
 * The line.
 */
line: number, 
/**
 * Its name.
 */
name: string, } | { "do": "switch_lines", 
/**
 * Their numbers.
 */
lines: Array<number>, 
/**
 * Kept and not used.
 */
off: boolean, } | { "do": "snap_line", 
/**
 * The line.
 */
line: number, } | { "do": "adopt", 
/**
 * Their names.
 */
names: Array<string>, } | { "do": "switch_found", 
/**
 * Their names.
 */
names: Array<string>, 
/**
 * Not used.
 */
off: boolean, } | { "do": "set_lens", 
/**
 * `auto`, a file, or a model.
 */
lens: string, 
/**
 * Field of view, degrees.
 */
fov?: number, 
/**
 * Its direction: `h`, `v` or `d`.
 */
fov_axis?: string, } | { "do": "set", 
/**
 * `to`, `crop`, `view`, `view_field`, `size`, `border`, `interpolation`, `path`, `quality`.
 */
key: string, 
/**
 * As in the file.
 */
value: string, } | { "do": "add_face", 
/**
 * Left, top, width, height, px.
 */
rect: [number, number, number, number], } | { "do": "set_face", 
/**
 * The face.
 */
face: number, 
/**
 * Left, top, width, height, px.
 */
rect: [number, number, number, number], } | { "do": "rename_face", 
/**
 * The face.
 */
face: number, 
/**
 * Its name.
 */
name: string, } | { "do": "switch_faces", 
/**
 * Their numbers.
 */
faces: Array<number>, 
/**
 * Kept and not used.
 */
off: boolean, } | { "do": "delete_faces", 
/**
 * Their numbers.
 */
faces: Array<number>, } | { "do": "find_faces" } | { "do": "select", 
/**
 * Lines.
 */
lines: Array<number>, 
/**
 * A point of the last line.
 */
point?: number, 
/**
 * Faces.
 */
faces: Array<number>, };

export type OrientationSetting = string | number;

export type View = { 
/**
 * Pixels of the screen that the result has, width and height.
 */
size?: [number, number], 
/**
 * Part of the result that is seen: left, top, right and bottom as fractions of its sides.
 */
part?: [number, number, number, number], 
/**
 * The same of the source.
 */
source_part?: [number, number, number, number], 
/**
 * The grid of the map is shown.
 */
grid?: boolean, };

export type Ask = { "ask": "export" } | { "ask": "command" } | { "ask": "lens_files" };

export type State = { 
/**
 * The photo.
 */
photo: PhotoInfo, 
/**
 * Settings as in the pipeline.
 */
settings: SettingsInfo, 
/**
 * The lens that is in use.
 */
lens: LensInfo | null, 
/**
 * Why there is no result.
 */
problem: string | null, 
/**
 * Marked lines.
 */
lines: Array<LineInfo>, 
/**
 * Found lines; `None` while they are searched.
 */
found: Array<FoundInfo> | null, 
/**
 * Which lines the result is made with: `marked`, `found` or `none`.
 */
using: string, 
/**
 * Faces; `None` while they are searched.
 */
faces: Array<FaceInfo> | null, 
/**
 * Faces were corrected by hand.
 */
faces_marked: boolean, 
/**
 * The selection.
 */
selected: Selected, 
/**
 * The result.
 */
result: ResultInfo | null, };

export type PhotoInfo = { 
/**
 * Name of its file.
 */
name: string, 
/**
 * px.
 */
width: number, 
/**
 * px.
 */
height: number, 
/**
 * What EXIF says of camera and lens, as name and value.
 */
exif: Array<[string, string]>, 
/**
 * Large: details are shown from a smaller copy.
 */
reduced: boolean, };

export type SettingsInfo = { 
/**
 * Projection.
 */
to: string, 
/**
 * Lens: `auto`, a file, a model.
 */
lens: string, 
/**
 * Field of view of the lens, degrees.
 */
fov: number | null, 
/**
 * `h`, `v` or `d`.
 */
fov_axis: string, 
/**
 * View direction, degrees: yaw, pitch, roll.
 */
view: [number, number, number], 
/**
 * Field of view of the result: `WIDTH,HEIGHT`, degrees; empty: all.
 */
view_field: string, 
/**
 * Crop.
 */
crop: string, 
/**
 * Size; empty: as wide as the photo.
 */
size: string, 
/**
 * Border.
 */
border: string, 
/**
 * Kernel.
 */
interpolation: string, 
/**
 * The file that is written.
 */
path: string, 
/**
 * JPEG quality.
 */
quality: number, };

export type LensInfo = { 
/**
 * Where it comes from, in words.
 */
how: string, 
/**
 * Its projection.
 */
projection: string, 
/**
 * Focal lengths, px.
 */
focal_px: [number, number], 
/**
 * Its center, px.
 */
center_px: [number, number], 
/**
 * Fields of view, degrees: horizontal, vertical, diagonal.
 */
field_deg: [number | null, number | null, number | null], };

export type LineInfo = { 
/**
 * Its name.
 */
name: string, 
/**
 * How it shall lie.
 */
orientation: OrientationSetting, 
/**
 * Not used.
 */
off: boolean, 
/**
 * Number of its points.
 */
points: number, 
/**
 * How straight it became.
 */
report: Straightness | null, };

export type Straightness = { 
/**
 * Largest distance from the best straight line, px of the result.
 */
max_px: number, 
/**
 * Root mean square distance, px of the result.
 */
rms_px: number, 
/**
 * Difference to the wanted orientation, degrees.
 */
angle_error_deg: number | null, 
/**
 * Largest distance of a mark from what the lens makes of a straight edge, px of the source.
 */
off_lens_px: number | null, 
/**
 * Fraction of it that the result shows.
 */
shown: number, 
/**
 * It could not be made straight.
 */
bent: boolean, };

export type FoundInfo = { 
/**
 * Its name.
 */
name: string, 
/**
 * How it shall lie.
 */
orientation: OrientationSetting, 
/**
 * Switched off.
 */
off: boolean, 
/**
 * Length between its ends, px.
 */
length: number, };

export type FaceInfo = { 
/**
 * Its name.
 */
name: string, 
/**
 * Left, top, width, height, px.
 */
rect: [number, number, number, number], 
/**
 * Not used.
 */
off: boolean, 
/**
 * The crop does not show all of it.
 */
cut: boolean, };

export type Selected = { 
/**
 * Lines.
 */
lines: Array<number>, 
/**
 * A point of the last line.
 */
point: number | null, 
/**
 * Faces.
 */
faces: Array<number>, };

export type ResultInfo = { 
/**
 * px.
 */
width: number, 
/**
 * px.
 */
height: number, 
/**
 * As the pipeline makes it, not the quick one of a drag.
 */
exact: boolean, };
