// What the pointer does on the source: draws, selects, moves, pans and zooms.
import type Konva from "konva";
import type { Placement } from "./camera";
import type { Point } from "./decode";
import type { PhotoPage } from "./page";

/** From here on a press that moves is a drag, px of the screen. */
const DRAG = 4;

interface Press { at: Point; screen: Point; name: string; moved: boolean; pointer: number; points: readonly Point[]; rect: readonly number[] | null; shift: boolean }

export class SourcePointer {
  private press: Press | null = null;
  private pan: Point | null = null;
  private readonly stops: (() => void)[] = [];

  constructor(private readonly page: PhotoPage, private readonly stage: Konva.Stage, private readonly placement: () => Placement) {
    const element = stage.container();
    const on = <K extends keyof HTMLElementEventMap>(type: K, listener: (event: HTMLElementEventMap[K]) => void, options?: AddEventListenerOptions) => {
      element.addEventListener(type, listener, options);
      this.stops.push(() => element.removeEventListener(type, listener, options));
    };
    on("pointerdown", (event) => this.down(event));
    on("pointermove", (event) => this.move(event));
    on("pointerup", (event) => this.up(event));
    on("pointercancel", () => this.cancel());
    on("dblclick", (event) => this.double(event));
    on("wheel", (event) => this.wheel(event), { passive: false });
    on("contextmenu", (event) => event.preventDefault());
  }

  dispose() {
    this.stops.forEach((stop) => stop());
  }

  private screen(event: MouseEvent): Point {
    const box = this.stage.container().getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  private inPhoto([x, y]: Point): Point {
    const at = this.placement();
    const { width, height } = this.page.photo;
    const inside = (v: number, side: number) => Math.round(Math.min(side, Math.max(0, v)) * 100) / 100;
    return [inside((x - at.x) / at.scale, width), inside((y - at.y) / at.scale, height)];
  }

  private nameAt([x, y]: Point): string {
    return this.stage.getIntersection({ x, y })?.name() ?? "";
  }

  private down(event: PointerEvent) {
    const screen = this.screen(event);
    this.stage.container().setPointerCapture(event.pointerId);
    if (event.button === 1 || event.button === 2 || (event.button === 0 && event.altKey)) {
      this.pan = screen;
      return;
    }
    if (event.button !== 0) return;
    const name = this.nameAt(screen);
    const [kind, a] = parts(name);
    const points = kind === "line" || kind === "point" ? this.page.marks.value[a] ?? [] : [];
    const rect = kind === "face" || kind === "corner" ? this.page.faceInfo(a)?.rect ?? null : null;
    this.press = { at: this.inPhoto(screen), screen, name, moved: false, pointer: event.pointerId, points, rect, shift: event.shiftKey || event.ctrlKey };
    if (this.page.tool.value === "select") this.selectPressed(kind, a, parts(name)[2]);
  }

  private selectPressed(kind: string, a: number, b: number) {
    const selected = this.page.selected.value;
    if (kind === "point") this.page.select(selected.lines.includes(a) ? [...selected.lines.filter((k) => k !== a), a] : [a], b);
    else if (kind === "line" && this.press?.shift) this.page.select([...selected.lines.filter((k) => k !== a), a]);
    else if (kind === "line" && !selected.lines.includes(a)) this.page.select([a]);
    else if (kind === "face" || kind === "corner") this.page.select([], null, [a]);
    else if (kind === "found") {
      const name = this.page.state.value.found?.[a]?.name;
      if (name) this.page.chosenFound.value = this.page.chosenFound.value.includes(name) ? this.page.chosenFound.value.filter((n) => n !== name) : [...this.page.chosenFound.value, name];
    }
  }

  private move(event: PointerEvent) {
    const screen = this.screen(event);
    if (this.pan) return this.panTo(screen);
    const press = this.press;
    if (!press) return this.hover(screen);
    if (!press.moved && Math.hypot(screen[0] - press.screen[0], screen[1] - press.screen[1]) < DRAG) return;
    const first = !press.moved;
    press.moved = true;
    const to = this.inPhoto(screen);
    if (this.page.tool.value === "line") return this.drawTo(press, to, first);
    if (this.page.tool.value === "face") return this.boxTo(press, to);
    // Keys that moved the same point before are a step of their own.
    if (first && press.name !== "") this.page.seal();
    this.dragTo(press, to, screen);
  }

  private hover(screen: Point) {
    const { tool } = this.page;
    const name = tool.value === "select" ? parts(this.nameAt(screen))[0] : "";
    const cursors: Record<string, string> = { point: "move", line: "pointer", face: "pointer", corner: "nwse-resize", found: "pointer" };
    this.stage.container().style.cursor = tool.value === "select" ? cursors[name] ?? "default" : "crosshair";
  }

  private dragTo(press: Press, to: Point, screen: Point) {
    const [kind, a, b] = parts(press.name);
    const by: Point = [to[0] - press.at[0], to[1] - press.at[1]];
    if (kind === "point") {
      const from = press.points[b];
      if (!from) return;
      const [x, y] = [from[0] + by[0], from[1] + by[1]];
      this.page.moving.value = { line: a, points: press.points.map((p, i) => (i === b ? [x, y] : p)) };
      this.page.drag({ do: "move_point", line: a, point: b, x, y });
    } else if (kind === "line") {
      const points = press.points.map(([x, y]) => [x + by[0], y + by[1]] as [number, number]);
      this.page.moving.value = { line: a, points };
      this.page.drag({ do: "set_points", line: a, points });
    } else if (press.rect) {
      const rect = kind === "corner" ? resized(press.rect, b, by) : moved(press.rect, by);
      this.page.movingFace.value = { face: a, rect };
      this.page.drag({ do: "set_face", face: a, rect });
    } else if (kind === "") {
      this.panTo(screen, press);
    }
  }

  private panTo(screen: Point, press?: Press) {
    const from = press ? press.screen : this.pan;
    if (!from) return;
    const { scale } = this.placement();
    const { width, height } = this.page.photo;
    this.page.camera.pan((from[0] - screen[0]) / (scale * width), (from[1] - screen[1]) / (scale * height));
    if (press) press.screen = screen;
    else this.pan = screen;
  }

  /** A press that moves draws a line of two points at once. */
  private drawTo(press: Press, to: Point, first: boolean) {
    const { drawing } = this.page;
    if (first) drawing.value = [...drawing.value, press.at, to];
    else drawing.value = [...drawing.value.slice(0, -1), to];
  }

  private boxTo(press: Press, to: Point) {
    this.page.drawing.value = [press.at, [to[0], press.at[1]], to, [press.at[0], to[1]], press.at];
  }

  private up(event: PointerEvent) {
    const press = this.press;
    this.press = null;
    this.pan = null;
    if (this.stage.container().hasPointerCapture(event.pointerId)) this.stage.container().releasePointerCapture(event.pointerId);
    if (!press) return;
    const { tool, drawing } = this.page;
    if (tool.value === "line") {
      if (!press.moved) drawing.value = [...drawing.value, press.at];
      else if (drawing.value.length === 2) this.page.finishLine();
    } else if (tool.value === "face") this.finishFace(press, this.inPhoto(this.screen(event)));
    else if (press.moved) this.release();
    else if (press.name === "") {
      this.page.select([]);
      this.page.chosenFound.value = [];
    }
  }

  private finishFace(press: Press, to: Point) {
    this.page.drawing.value = [];
    const rect: [number, number, number, number] = [Math.min(press.at[0], to[0]), Math.min(press.at[1], to[1]), Math.abs(to[0] - press.at[0]), Math.abs(to[1] - press.at[1])];
    if (rect[2] < 2 || rect[3] < 2) return;
    void this.page.edit({ do: "add_face", rect });
    this.page.setTool("select");
  }

  private release() {
    this.page.seal();
    // Until the server has answered the last position, the drawn one stays.
    const [moving, face] = [this.page.moving.value, this.page.movingFace.value];
    setTimeout(() => {
      if (this.page.moving.value === moving) this.page.moving.value = null;
      if (this.page.movingFace.value === face) this.page.movingFace.value = null;
    }, 150);
  }

  private cancel() {
    if (this.press?.moved) this.release();
    this.press = null;
    this.pan = null;
  }

  private double(event: MouseEvent) {
    if (this.page.tool.value === "line") {
      // The two presses of a double click added the last point twice.
      this.page.drawing.value = withoutRepeats(this.page.drawing.value);
      return this.page.finishLine();
    }
    const [kind, line] = parts(this.nameAt(this.screen(event)));
    if (kind === "line") this.insert(line, this.inPhoto(this.screen(event)));
    if (kind === "found") {
      const name = this.page.state.value.found?.[line]?.name;
      if (name) void this.page.edit({ do: "adopt", names: [name] });
      this.page.chosenFound.value = [];
    }
  }

  private insert(line: number, p: Point) {
    const points = this.page.marks.value[line] ?? [];
    const off = (i: number) => distance(p, points[i] ?? p, points[i + 1] ?? p);
    let best = 0;
    for (let i = 1; i + 1 < points.length; i++) if (off(i) < off(best)) best = i;
    void this.page.edit({ do: "insert_point", line, at: best + 1, x: p[0], y: p[1] });
  }

  private wheel(event: WheelEvent) {
    event.preventDefault();
    const [x, y] = this.inPhoto(this.screen(event));
    const { width, height } = this.page.photo;
    this.page.camera.zoomAt(1.0015 ** -event.deltaY, x / width, y / height);
  }
}

/** "point 3 1" as kind and numbers. */
function parts(name: string): [string, number, number] {
  const [kind = "", a, b] = name.split(" ");
  return [kind, Number(a ?? -1), Number(b ?? -1)];
}

function moved(rect: readonly number[], by: Point): [number, number, number, number] {
  const [x = 0, y = 0, w = 1, h = 1] = rect;
  return [x + by[0], y + by[1], w, h];
}

/** The box with one corner moved; the opposite one stays. */
function resized(rect: readonly number[], corner: number, by: Point): [number, number, number, number] {
  const [x = 0, y = 0, w = 1, h = 1] = rect;
  const right = corner % 2 === 1, bottom = corner >= 2;
  const [left, top] = [right ? x : Math.min(x + by[0], x + w - 1), bottom ? y : Math.min(y + by[1], y + h - 1)];
  return [left, top, right ? Math.max(1, w + by[0]) : x + w - left, bottom ? Math.max(1, h + by[1]) : y + h - top];
}

function distance(p: Point, a: Point, b: Point): number {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const t = Math.min(1, Math.max(0, ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy || 1)));
  return Math.hypot(p[0] - a[0] - t * dx, p[1] - a[1] - t * dy);
}

function withoutRepeats(points: readonly Point[]): readonly Point[] {
  return points.filter((p, i) => i === 0 || Math.hypot(p[0] - (points[i - 1]?.[0] ?? 0), p[1] - (points[i - 1]?.[1] ?? 0)) > 2);
}
