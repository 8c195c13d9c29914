// The rectified picture: samples of the server, over them the grid of the map and the lines as it shows them.
import { effect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { colorsOf, GRID_COLOR } from "./colors";
import type { Placement } from "./camera";
import type { Grid, Point } from "./decode";
import type { PhotoPage } from "./page";

export function ResultView({ page }: { page: PhotoPage }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => (canvas.current ? attach(page, canvas.current) : undefined), [page]);
  return <canvas ref={canvas} class="photo-canvas" aria-label="Rectified picture" role="img" />;
}

/** Draws whenever something changes, asks the server for the part that is seen. */
function attach(page: PhotoPage, canvas: HTMLCanvasElement): () => void {
  let frame = 0;
  const scene = new ResultScene(page, canvas);
  const schedule = () => {
    cancelAnimationFrame(frame);
    frame = requestAnimationFrame(() => scene.draw());
  };
  const observer = new ResizeObserver(() => { scene.resize(); schedule(); });
  observer.observe(canvas.parentElement ?? canvas);
  scene.resize();
  const stops = [
    effect(() => { scene.dependencies(); schedule(); }),
    effect(() => scene.look()),
    scene.listen(),
  ];
  return () => { stops.forEach((stop) => stop()); observer.disconnect(); cancelAnimationFrame(frame); };
}

class ResultScene {
  private asked = "";
  private timer = 0;
  constructor(private readonly page: PhotoPage, private readonly canvas: HTMLCanvasElement) {}

  dependencies() {
    const { page } = this;
    return [page.result.value, page.grid.value, page.carried.value, page.foundCarried.value, page.state.value, page.selected.value, page.camera.zoom.value,
      page.camera.middle.value, page.showGrid.value, page.showCarried.value];
  }

  resize() {
    const parent = this.canvas.parentElement;
    const [width, height] = [parent?.clientWidth ?? 1, parent?.clientHeight ?? 1];
    this.canvas.width = Math.max(1, Math.round(width * devicePixelRatio));
    this.canvas.height = Math.max(1, Math.round(height * devicePixelRatio));
    this.look();
  }

  private get view() {
    return { width: this.canvas.width / devicePixelRatio, height: this.canvas.height / devicePixelRatio };
  }

  private placement(): Placement | null {
    const result = this.page.state.value.result;
    return result && this.page.camera.placement(result.width, result.height, this.view);
  }

  /** Tells the server what is seen, at most every 80 ms. */
  look() {
    const { result, photo } = this.page.state.value;
    const { width, height } = result ?? photo;
    const part = this.page.camera.part(width, height, this.view) ?? [0, 0, 1, 1];
    const view: Record<string, unknown> = { size: [this.canvas.width, this.canvas.height], part };
    const source = this.page.camera.part(photo.width, photo.height, this.view);
    if (source && this.page.camera.zoom.value > 1.5) view.source_part = source;
    const text = JSON.stringify(view);
    if (text === this.asked) return;
    this.asked = text;
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.page.connection.view(view), 80);
  }

  draw() {
    const context = this.canvas.getContext("2d");
    const at = this.placement();
    if (!context) return;
    context.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    const { result } = this.page.state.value;
    const picture = this.page.result.value;
    if (!at || !result || !picture) return;
    const [left, top, right, bottom] = picture.part;
    context.imageSmoothingQuality = "high";
    context.drawImage(picture.canvas, at.x + left * at.scale, at.y + top * at.scale, (right - left) * at.scale, (bottom - top) * at.scale);
    context.save();
    context.beginPath();
    context.rect(at.x, at.y, result.width * at.scale, result.height * at.scale);
    context.clip();
    if (this.page.showGrid.value && this.page.grid.value) drawGrid(context, this.page.grid.value, at);
    if (this.page.showCarried.value) this.drawLines(context, at);
    context.restore();
  }

  private drawLines(context: CanvasRenderingContext2D, at: Placement) {
    const colors = colorsOf();
    const { lines } = this.page.state.value;
    const selected = this.page.selected.value;
    this.page.foundCarried.value.forEach((course) => stroke(context, course, at, colors.found, 1.25));
    this.page.carried.value.forEach((course, k) => {
      const info = lines[k];
      if (!info || info.off) return;
      stroke(context, course, at, info.report?.bent ? colors.warning : colors.of(info.orientation), selected.lines.includes(k) ? 3 : 1.75);
    });
  }

  /** Click selects a carried line, the wheel zooms, a drag pans. */
  listen(): () => void {
    let press: { x: number; y: number; moved: boolean } | null = null;
    const down = (event: PointerEvent) => { press = { x: event.offsetX, y: event.offsetY, moved: false }; this.canvas.setPointerCapture(event.pointerId); };
    const move = (event: PointerEvent) => {
      const at = this.placement(), { result } = this.page.state.value;
      if (!press || !at || !result || (!press.moved && Math.hypot(event.offsetX - press.x, event.offsetY - press.y) < 4)) return;
      this.page.camera.pan((press.x - event.offsetX) / (at.scale * result.width), (press.y - event.offsetY) / (at.scale * result.height));
      press = { x: event.offsetX, y: event.offsetY, moved: true };
    };
    const up = (event: PointerEvent) => {
      if (press && !press.moved) this.selectAt(event.offsetX, event.offsetY);
      press = null;
    };
    const wheel = (event: WheelEvent) => {
      event.preventDefault();
      const at = this.placement(), { result } = this.page.state.value;
      if (!at || !result) return;
      const [u, v] = [(event.offsetX - at.x) / (at.scale * result.width), (event.offsetY - at.y) / (at.scale * result.height)];
      this.page.camera.zoomAt(1.0015 ** -event.deltaY, Math.min(1, Math.max(0, u)), Math.min(1, Math.max(0, v)));
    };
    this.canvas.addEventListener("pointerdown", down);
    this.canvas.addEventListener("pointermove", move);
    this.canvas.addEventListener("pointerup", up);
    this.canvas.addEventListener("wheel", wheel, { passive: false });
    return () => {
      this.canvas.removeEventListener("pointerdown", down);
      this.canvas.removeEventListener("pointermove", move);
      this.canvas.removeEventListener("pointerup", up);
      this.canvas.removeEventListener("wheel", wheel);
    };
  }

  private selectAt(x: number, y: number) {
    const at = this.placement();
    if (!at) return;
    let best = { line: -1, off: 8 };
    this.page.carried.value.forEach((course, line) => {
      for (const p of course) {
        const off = Math.hypot(at.x + p[0] * at.scale - x, at.y + p[1] * at.scale - y);
        if (off < best.off) best = { line, off };
      }
    });
    if (best.line >= 0) this.page.select([best.line]);
  }
}

function stroke(context: CanvasRenderingContext2D, course: readonly Point[], at: Placement, color: string, width: number) {
  if (course.length < 2) return;
  context.lineCap = "round";
  for (const [style, extra] of [["#00000088", 2], [color, 0]] as const) {
    context.beginPath();
    course.forEach(([x, y], i) => context[i === 0 ? "moveTo" : "lineTo"](at.x + x * at.scale, at.y + y * at.scale));
    context.strokeStyle = style;
    context.lineWidth = width + extra;
    context.stroke();
  }
}

function drawGrid(context: CanvasRenderingContext2D, { cols, rows, vertices }: Grid, at: Placement) {
  const step = Math.max(1, Math.round(Math.max(cols, rows) / 24));
  const to = (i: number, j: number) => {
    const k = 2 * (j * cols + i);
    return [at.x + (vertices[k] ?? 0) * at.scale, at.y + (vertices[k + 1] ?? 0) * at.scale] as const;
  };
  context.beginPath();
  for (let j = 0; j < rows; j += step) for (let i = 0; i < cols; i++) context[i === 0 ? "moveTo" : "lineTo"](...to(i, j));
  for (let i = 0; i < cols; i += step) for (let j = 0; j < rows; j++) context[j === 0 ? "moveTo" : "lineTo"](...to(i, j));
  for (const [style, width] of [["#00000055", 2.5], [`${GRID_COLOR}b0`, 1]] as const) {
    context.strokeStyle = style;
    context.lineWidth = width;
    context.stroke();
  }
}
