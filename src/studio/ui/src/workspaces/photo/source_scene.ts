// The source with its lines and faces, drawn by Konva: what can be pointed at is a node of its stage.
import Konva from "konva";
import { effect, untracked } from "@preact/signals";
import { theme } from "../../shell/theme";
import type { Placement } from "./camera";
import { colorsOf, type Colors } from "./colors";
import type { Point } from "./decode";
import { SourcePointer } from "./source_pointer";
import type { PhotoPage } from "./page";

/** Radius of a mark, px of the screen; a finger needs more. */
const MARK = matchMedia("(pointer: coarse)").matches ? 9 : 5;

type Flat = number[];

export class SourceScene {
  readonly stage: Konva.Stage;
  private readonly image = new Konva.Layer({ listening: false });
  private readonly drawn = new Konva.Layer();
  private readonly stops: (() => void)[] = [];
  private readonly pointer: SourcePointer;
  private readonly photo = new Konva.Image({ image: undefined as unknown as CanvasImageSource, listening: false });
  private readonly part = new Konva.Image({ image: undefined as unknown as CanvasImageSource, listening: false });

  constructor(private readonly page: PhotoPage, container: HTMLDivElement) {
    this.stage = new Konva.Stage({ container, width: Math.max(1, container.clientWidth), height: Math.max(1, container.clientHeight) });
    this.image.add(this.photo, this.part);
    this.stage.add(this.image, this.drawn);
    this.pointer = new SourcePointer(page, this.stage, () => this.placement());
    const observer = new ResizeObserver(() => {
      this.stage.size({ width: Math.max(1, container.clientWidth), height: Math.max(1, container.clientHeight) });
      this.drawAll();
    });
    observer.observe(container);
    this.stops.push(() => observer.disconnect(), effect(() => this.drawImage()), effect(() => this.drawMarks()));
  }

  dispose() {
    this.stops.forEach((stop) => stop());
    this.pointer.dispose();
    this.stage.destroy();
  }

  placement(): Placement {
    const { width, height } = this.page.photo;
    return this.page.camera.placement(width, height, this.stage.size());
  }

  private drawAll() {
    untracked(() => { this.drawImage(); this.drawMarks(); });
  }

  private drawImage() {
    const { width, height } = this.page.photo;
    const { scale, x, y } = this.placement();
    const image = this.page.sourceImage.value;
    this.photo.visible(image !== null);
    if (image) this.photo.setAttrs({ image, x, y, width: width * scale, height: height * scale });
    const part = this.page.sourcePart.value;
    const shows = part !== null && this.page.camera.zoom.value > 1.5;
    this.part.visible(shows);
    if (part && shows) {
      const [left, top, right, bottom] = part.part;
      this.part.setAttrs({ image: part.canvas, x: x + left * scale, y: y + top * scale, width: (right - left) * scale, height: (bottom - top) * scale });
    }
    this.image.batchDraw();
  }

  private drawMarks() {
    void theme.value;
    const colors = colorsOf();
    const at = this.placement();
    this.drawn.destroyChildren();
    if (this.page.showFound.value) this.drawFound(at, colors);
    if (this.page.showFaces.value) this.drawFaces(at, colors);
    this.drawLines(at, colors);
    this.drawDrawing(at, colors);
    this.drawn.batchDraw();
  }

  private drawFound(at: Placement, colors: Colors) {
    const { found, using } = this.page.state.value;
    this.page.foundCourses.value.forEach((course, k) => {
      const info = found?.[k];
      if (!info || course.length < 2) return;
      const chosen = this.page.chosenFound.value.includes(info.name);
      const used = using === "found" && !info.off;
      const line = { points: flat(course, at), stroke: chosen ? colors.selected : colors.found, strokeWidth: chosen ? 2.5 : 1.5, opacity: info.off ? 0.35 : 0.95 };
      this.drawn.add(halo(line.points, info.off ? 0.1 : 0.3, 3));
      this.drawn.add(new Konva.Line({ ...line, dash: used ? [] : [6, 4], name: `found ${k}`, hitStrokeWidth: 10 }));
    });
  }

  private drawLines(at: Placement, colors: Colors) {
    const { lines } = this.page.state.value;
    const selected = this.page.selected.value;
    lines.forEach((info, k) => {
      const points = this.page.points(k);
      if (points.length < 2) return;
      const moved = this.page.moving.value?.line === k;
      const course = moved ? points : this.page.courses.value[k] ?? points;
      const isSelected = selected.lines.includes(k);
      const color = info.off ? colors.off : colors.of(info.orientation);
      const shown = flat(course.length > 1 ? course : points, at);
      this.drawn.add(halo(shown, info.off ? 0.2 : 0.6));
      this.drawn.add(new Konva.Line({ points: shown, stroke: color, strokeWidth: isSelected ? 3 : 2, dash: info.off ? [3, 4] : [], lineCap: "round", lineJoin: "round", name: `line ${k}`, hitStrokeWidth: 12 }));
      if (isSelected) points.forEach((p, i) => this.drawMark(p, at, color, selected.point === i && k === this.page.line.value, `point ${k} ${i}`));
    });
  }

  private drawMark(p: Point, at: Placement, color: string, active: boolean, name: string) {
    const [x, y] = [at.x + p[0] * at.scale, at.y + p[1] * at.scale];
    this.drawn.add(new Konva.Circle({
      x, y, radius: active ? MARK + 2 : MARK, fill: active ? color : "#ffffff", stroke: active ? "#ffffff" : color, strokeWidth: 2, name, hitStrokeWidth: 12,
      shadowColor: "#000000", shadowBlur: 3, shadowOpacity: 0.5,
    }));
  }

  private drawFaces(at: Placement, colors: Colors) {
    const { faces } = this.page.state.value;
    const selected = this.page.selected.value;
    faces?.forEach((face, k) => {
      const moving = this.page.movingFace.value;
      const [x, y, w, h] = moving?.face === k ? moving.rect : face.rect;
      const box = { x: at.x + x * at.scale, y: at.y + y * at.scale, width: w * at.scale, height: h * at.scale };
      const color = face.off ? colors.off : face.cut ? colors.warning : colors.face;
      this.drawn.add(new Konva.Rect({ ...box, stroke: "#000000", opacity: 0.5, strokeWidth: 4, listening: false }));
      this.drawn.add(new Konva.Rect({ ...box, stroke: color, strokeWidth: 2, dash: face.off ? [3, 4] : [], name: `face ${k}`, hitStrokeWidth: 12 }));
      if (!selected.faces.includes(k)) return;
      [[0, 0], [1, 0], [0, 1], [1, 1]].forEach(([s = 0, t = 0], corner) =>
        this.drawMark([x + s * w, y + t * h], at, color, false, `corner ${k} ${corner}`));
    });
  }

  private drawDrawing(at: Placement, colors: Colors) {
    const points = this.page.drawing.value;
    const color = colors.of(this.page.newOrientation.value);
    if (points.length > 1) {
      this.drawn.add(halo(flat(points, at), 0.6));
      this.drawn.add(new Konva.Line({ points: flat(points, at), stroke: color, strokeWidth: 2, dash: [4, 3], listening: false }));
    }
    points.forEach((p, i) => this.drawMark(p, at, color, i === points.length - 1, "drawing"));
  }
}

const flat = (points: readonly Point[], { scale, x, y }: Placement): Flat => points.flatMap(([px, py]) => [x + px * scale, y + py * scale]);

/** A dark line below a colored one, so that it is seen on any photo. */
const halo = (points: Flat, opacity: number, strokeWidth = 4) =>
  new Konva.Line({ points, stroke: "#000000", opacity, strokeWidth, lineCap: "round", lineJoin: "round", listening: false });
