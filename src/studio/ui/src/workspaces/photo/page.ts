// What the photo page knows: state and buffers of the server, tool, view; and the actions that buttons, keys and pointer share.
import { computed, effect, signal, type ReadonlySignal, type Signal } from "@preact/signals";
import type { Connection, Incoming } from "../../connection";
import { BufferKind, type Edit, type FaceInfo, type LineInfo, type OrientationSetting, type Selected, type State } from "../../generated/photo";
import { remembered } from "../../shell/remembered";
import { Camera } from "./camera";
import { curvesOf, gridOf, marksOf, pictureOf, type Curves, type Grid, type Picture, type Point } from "./decode";

export type Tool = "select" | "line" | "face";

/** What is hovered or moved by keys: a point of a line, or a corner of a face. */
export class PhotoPage {
  readonly tool = signal<Tool>("select");
  /** Points of a line that is being drawn, px of the source. */
  readonly drawing = signal<readonly Point[]>([]);
  /** Orientation of new lines. */
  readonly newOrientation: Signal<OrientationSetting> = signal<OrientationSetting>("free");
  readonly showFound = remembered("photo found", true);
  readonly showFaces = remembered("photo faces", true);
  readonly showGrid = remembered("photo grid", false);
  readonly showCarried = remembered("photo carried", true);
  /** Found lines chosen in their list. */
  readonly chosenFound = signal<readonly string[]>([]);

  readonly sourceImage = signal<ImageBitmap | null>(null);
  readonly sourcePart = signal<Picture | null>(null);
  readonly result = signal<Picture | null>(null);
  readonly grid = signal<Grid | null>(null);
  readonly marks = signal<Curves>([]);
  readonly courses = signal<Curves>([]);
  readonly foundCourses = signal<Curves>([]);
  readonly carried = signal<Curves>([]);
  readonly foundCarried = signal<Curves>([]);
  /** Points that the pointer moves, before the server answers: shown in place of `marks`. */
  readonly moving = signal<{ line: number; points: Point[] } | null>(null);
  readonly movingFace = signal<{ face: number; rect: [number, number, number, number] } | null>(null);

  /** Zoom and place, the same for both pictures. */
  readonly camera = new Camera();
  readonly state: ReadonlySignal<State>;
  /** Selected here, before the server answers: the next key counts from it. */
  private readonly selecting = signal<Selected | null>(null);
  readonly selected = computed(() => this.selecting.value ?? this.state.value.selected);
  readonly line = computed(() => last(this.selected.value.lines));
  readonly face = computed(() => last(this.selected.value.faces));

  constructor(readonly connection: Connection<State>) {
    this.state = computed(() => connection.state.value as State);
  }

  /** Listens to the server; gives the way to stop. */
  open(): () => void {
    const on = (kind: number, listener: (buffer: Incoming) => void) => this.connection.onBuffer(kind, listener);
    const stops = [
      on(BufferKind.Source, ({ payload }) => void this.decodeSource(payload)),
      on(BufferKind.SourcePart, ({ payload }) => (this.sourcePart.value = pictureOf(payload))),
      on(BufferKind.Result, ({ payload }) => (this.result.value = pictureOf(payload))),
      on(BufferKind.Grid, ({ payload }) => (this.grid.value = gridOf(payload))),
      on(BufferKind.Marks, ({ payload }) => this.receiveMarks(marksOf(payload))),
      on(BufferKind.Courses, ({ payload }) => (this.courses.value = curvesOf(payload))),
      on(BufferKind.FoundCourses, ({ payload }) => (this.foundCourses.value = curvesOf(payload))),
      on(BufferKind.Carried, ({ payload }) => (this.carried.value = curvesOf(payload))),
      on(BufferKind.FoundCarried, ({ payload }) => (this.foundCarried.value = curvesOf(payload))),
      effect(() => this.connection.view({ grid: this.showGrid.value })),
      effect(() => { if (!this.state.value.result) this.result.value = null; }),
    ];
    return () => stops.forEach((stop) => stop());
  }

  /** Marks of the server take the place of those that keys or the pointer moved, once they are the same. */
  private receiveMarks(marks: Curves) {
    this.marks.value = marks;
    const moving = this.moving.value;
    const there = moving && marks[moving.line];
    if (moving && (!there || moving.points.every((p, i) => near(p, there[i])))) this.moving.value = null;
  }

  private async decodeSource(payload: ArrayBuffer) {
    const image = await createImageBitmap(new Blob([payload], { type: "image/jpeg" }), { imageOrientation: "none" } as ImageBitmapOptions);
    this.sourceImage.value = image;
  }

  edit = (edit: Edit) => this.connection.edit(edit);
  drag = (edit: Edit) => this.connection.drag(edit);
  seal = () => this.connection.seal();

  get photo() {
    return this.state.value.photo;
  }
  lineInfo(line: number | null): LineInfo | null {
    return line === null ? null : this.state.value.lines[line] ?? null;
  }
  faceInfo(face: number | null): FaceInfo | null {
    return face === null ? null : this.state.value.faces?.[face] ?? null;
  }

  /** Points of a line as they are shown. */
  points(line: number): readonly Point[] {
    const moving = this.moving.value;
    return moving?.line === line ? moving.points : this.marks.value[line] ?? [];
  }

  select(lines: number[], point: number | null = null, faces: number[] = []) {
    const selected = this.selected.value;
    if (same(selected.lines, lines) && selected.point === point && same(selected.faces, faces)) return;
    const selecting: Selected = { lines, point, faces };
    this.selecting.value = selecting;
    const done = () => { if (this.selecting.value === selecting) this.selecting.value = null; };
    this.edit({ do: "select", lines, point: point ?? undefined, faces }).then(done, done);
  }

  setTool(tool: Tool) {
    this.tool.value = tool;
    this.drawing.value = [];
  }

  /** Ends the line that is being drawn. */
  finishLine() {
    const points = this.drawing.value;
    this.drawing.value = [];
    if (points.length < 2) return;
    void this.edit({ do: "add_line", points: points.map(([x, y]) => [x, y]), orientation: this.newOrientation.value });
  }

  /** Moves the selected point, line or face by px of the source. */
  nudge(dx: number, dy: number) {
    const { line: at, face } = { line: this.line.value, face: this.face.value };
    const { point } = this.selected.value;
    if (at !== null && point !== null) {
      const p = this.points(at)[point];
      if (p) this.movePoint(at, point, p[0] + dx, p[1] + dy);
    } else if (at !== null) {
      const points = this.points(at).map(([x, y]) => [x + dx, y + dy] as [number, number]);
      this.settle(at, points, this.edit({ do: "set_points", line: at, points }));
    } else if (face !== null) {
      const rect = this.faceRect(face);
      if (rect) this.setFace(face, [rect[0] + dx, rect[1] + dy, rect[2], rect[3]]);
    }
  }

  /** A point to a position, by keys or numbers: seen at once, and the base of the next key. */
  movePoint(line: number, point: number, x: number, y: number) {
    const { width, height } = this.photo;
    const to: Point = [Math.min(width, Math.max(0, x)), Math.min(height, Math.max(0, y))];
    const points = this.points(line).map((p, i) => (i === point ? to : p));
    this.settle(line, points, this.edit({ do: "move_point", line, point, x: to[0], y: to[1] }));
  }

  private settle(line: number, points: readonly Point[], edit: Promise<void>) {
    const moving = { line, points: [...points] };
    this.moving.value = moving;
    edit.catch(() => undefined).finally(() => setTimeout(() => { if (this.moving.value === moving) this.moving.value = null; }, 500));
  }

  /** Makes the selected face larger or smaller. */
  grow(dw: number, dh: number) {
    const face = this.face.value;
    const rect = this.faceRect(face);
    if (face !== null && rect) this.setFace(face, [rect[0], rect[1], Math.max(1, rect[2] + dw), Math.max(1, rect[3] + dh)]);
  }

  /** The box of a face as it is shown. */
  faceRect(face: number | null) {
    const moving = this.movingFace.value;
    return moving && moving.face === face ? moving.rect : this.faceInfo(face)?.rect;
  }

  private setFace(face: number, rect: [number, number, number, number]) {
    const moving = { face, rect };
    this.movingFace.value = moving;
    const done = () => { if (this.movingFace.value === moving) this.movingFace.value = null; };
    this.edit({ do: "set_face", face, rect }).then(done, done);
  }

  /** The next point of the selected line, or the next line. */
  step(by: 1 | -1) {
    const { lines } = this.state.value;
    if (lines.length === 0) return;
    const at = this.line.value;
    if (at === null) return this.select([by > 0 ? 0 : lines.length - 1], 0);
    const count = lines[at]?.points ?? 0;
    const point = this.selected.value.point;
    const next = point === null ? (by > 0 ? 0 : count - 1) : point + by;
    if (next >= 0 && next < count) return this.select([at], next);
    const line = (at + by + lines.length) % lines.length;
    this.select([line], by > 0 ? 0 : (lines[line]?.points ?? 1) - 1);
  }

  deleteSelected() {
    const { lines, faces, point } = this.selected.value;
    const at = this.line.value;
    if (at !== null && point !== null && (this.lineInfo(at)?.points ?? 0) > 2) void this.edit({ do: "remove_point", line: at, point });
    else if (lines.length > 0) void this.edit({ do: "delete_lines", lines });
    else if (faces.length > 0) void this.edit({ do: "delete_faces", faces });
  }

  /** A further point in the middle of the piece after the selected point. */
  insertPoint() {
    const line = this.line.value;
    if (line === null) return;
    const points = this.marks.value[line] ?? [];
    const at = Math.min(this.selected.value.point ?? 0, points.length - 2);
    const [a, b] = [points[at], points[at + 1]];
    if (a && b) void this.edit({ do: "insert_point", line, at: at + 1, x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2 });
  }

  orient(orientation: OrientationSetting) {
    const { lines } = this.selected.value;
    if (lines.length > 0) void this.edit({ do: "orient", lines, orientation });
    else this.newOrientation.value = orientation;
  }

  switchSelected() {
    const { lines, faces } = this.selected.value;
    const infos = lines.map((k) => this.lineInfo(k));
    if (lines.length > 0) void this.edit({ do: "switch_lines", lines, off: infos.some((info) => info?.off === false) });
    else if (faces.length > 0) void this.edit({ do: "switch_faces", faces, off: faces.some((k) => this.faceInfo(k)?.off === false) });
  }

  /** Adopts the found lines that are chosen, or all that are not switched off. */
  adopt() {
    const chosen = this.chosenFound.value;
    const found = this.state.value.found ?? [];
    const names = found.filter(({ name, off }) => (chosen.length > 0 ? chosen.includes(name) : !off)).map(({ name }) => name);
    if (names.length > 0) void this.edit({ do: "adopt", names });
    this.chosenFound.value = [];
  }

  chosenAreOff(): boolean {
    const chosen = this.chosenFound.value;
    return (this.state.value.found ?? []).some(({ name, off }) => off && chosen.includes(name));
  }
  switchFound() {
    void this.edit({ do: "switch_found", names: [...this.chosenFound.value], off: !this.chosenAreOff() });
  }

  addFaceInMiddle() {
    const { width, height } = this.photo;
    const [x, y] = this.camera.center(width, height);
    const side = Math.max(16, Math.round(Math.min(width, height) / 8));
    void this.edit({ do: "add_face", rect: [Math.round(x - side / 2), Math.round(y - side / 2), side, side] });
  }

  addLineInMiddle() {
    const { width, height } = this.photo;
    const [x, y] = this.camera.center(width, height);
    const reach = Math.round(Math.min(width, height) / 4);
    const vertical = this.newOrientation.value === "vertical";
    const points: [number, number][] = vertical ? [[x, y - reach], [x, y], [x, y + reach]] : [[x - reach, y], [x, y], [x + reach, y]];
    void this.edit({ do: "add_line", points, orientation: this.newOrientation.value }).then(() => this.select([this.state.value.lines.length - 1], 0), () => undefined);
  }

  exportPicture = () => void this.connection.ask({ ask: "export" });
  async copyCommand() {
    await navigator.clipboard.writeText(await this.connection.ask<string>({ ask: "command" }));
  }
}

const pages = new WeakMap<Connection<State>, PhotoPage>();

/** The page of a document: one for its view and its commands. */
export function pageOf(connection: Connection<State>): PhotoPage {
  const page = pages.get(connection) ?? new PhotoPage(connection);
  pages.set(connection, page);
  return page;
}

const near = (a: Point, b: Point | undefined) => b !== undefined && Math.abs(a[0] - b[0]) + Math.abs(a[1] - b[1]) < 0.02;

function last(list: readonly number[]): number | null {
  return list[list.length - 1] ?? null;
}
function same(a: readonly number[], b: readonly number[]): boolean {
  return a.length === b.length && a.every((v, i) => v === b[i]);
}
