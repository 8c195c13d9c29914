// Curves of a joint over time, with keys that move in time and in value, by pointer and by arrow keys.
import { useEffect, useRef, useState } from "preact/hooks";
import { formatNumber, type Playback } from "../../shell/components";

/** A key on a curve; ids are unique among all curves. */
export interface CurveKey { id: string; time: number; value: number }

/** A curve: what is drawn, and its keys. */
export interface CurveLine { id: string; label: string; color: string; samples: readonly (readonly [number, number])[]; keys: readonly CurveKey[] }

interface Props {
  label: string;
  unit: string;
  curves: readonly CurveLine[];
  playback: Playback;
  selected: readonly string[];
  onSelect: (id: string) => void;
  /** A key moved; `final` when the pointer is released or a key was pressed. */
  onMove: (id: string, time: number, value: number, final: boolean) => void;
}

/** The left and right ends are those of the timeline above. */
const MARGIN = { left: 44, right: 16, top: 10, bottom: 10 };
/** Value of one arrow key; Shift makes it ten times as large. */
const STEP = 1;

interface Scale { x: (time: number) => number; y: (value: number) => number; time: (x: number) => number; value: (y: number) => number }

function scaleOf(size: { width: number; height: number }, duration: number, low: number, high: number): Scale {
  const [w, h] = [size.width - MARGIN.left - MARGIN.right, size.height - MARGIN.top - MARGIN.bottom];
  const t = duration || 1;
  const v = high - low || 1;
  return {
    x: (time) => MARGIN.left + (time / t) * w,
    y: (value) => MARGIN.top + ((high - value) / v) * h,
    time: (x) => ((x - MARGIN.left) / (w || 1)) * t,
    value: (y) => high - ((y - MARGIN.top) / (h || 1)) * v,
  };
}

/** Ends of the value axis, a little beyond all values, and at least so far apart. */
function range(curves: readonly CurveLine[]): [number, number] {
  const values = curves.flatMap((curve) => [...curve.samples.map(([, v]) => v), ...curve.keys.map((key) => key.value)]).filter(Number.isFinite);
  const [low, high] = [Math.min(0, ...values), Math.max(0, ...values)];
  const margin = Math.max(5, 0.08 * (high - low));
  return [low - margin, high + margin];
}

/** Round values for lines of the grid, about four. */
function gridOf(low: number, high: number): number[] {
  const power = 10 ** Math.floor(Math.log10((high - low) / 4));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((width) => (high - low) / width <= 5) ?? high - low;
  const first = Math.ceil(low / step);
  return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, i) => (first + i) * step);
}

/** Curves in an area as large as its parent. */
export function CurveEditor(props: Props) {
  const box = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState({ width: 400, height: 120 });
  const [kept, setKept] = useState<[number, number] | null>(null);
  useEffect(() => {
    const element = box.current;
    if (!element) return;
    const observer = new ResizeObserver(() => setSize({ width: element.clientWidth || 400, height: element.clientHeight || 120 }));
    observer.observe(element);
    return () => observer.disconnect();
  }, []);
  const { playback, curves } = props;
  // While a key is dragged the axis stays.
  const [low, high] = kept ?? range(curves);
  const scale = scaleOf(size, playback.duration.value, low, high);
  return (
    <div ref={box} class="curves" role="group" aria-label={props.label}>
      <svg width={size.width} height={size.height}>
        {gridOf(low, high).map((value) => (
          <g key={value} aria-hidden="true">
            <line class="grid" x1={MARGIN.left} x2={size.width - MARGIN.right} y1={scale.y(value)} y2={scale.y(value)} />
            <text x={MARGIN.left - 6} y={scale.y(value) + 4} text-anchor="end">{formatNumber(value, 1)}{props.unit}</text>
          </g>
        ))}
        {curves.map((curve) => (
          <polyline key={curve.id} class="curve" stroke={curve.color} aria-hidden="true"
            points={curve.samples.map(([t, v]) => `${scale.x(t).toFixed(1)},${scale.y(v).toFixed(1)}`).join(" ")} />
        ))}
        <line class="now" aria-hidden="true" x1={scale.x(playback.time.value)} x2={scale.x(playback.time.value)} y1={0} y2={size.height} />
      </svg>
      {curves.flatMap((curve) => curve.keys.map((key) => (
        <KeyHandle key={key.id} curve={curve} curveKey={key} scale={scale} {...props} hold={(on) => setKept(on ? [low, high] : null)} />
      )))}
    </div>
  );
}

function KeyHandle(props: Props & { curve: CurveLine; curveKey: CurveKey; scale: Scale; hold: (on: boolean) => void }) {
  const { curve, curveKey: key, scale, unit, selected, onSelect, onMove, playback, hold } = props;
  const from = useRef<{ x: number; y: number; moved: boolean } | null>(null);
  const snapped = (time: number) => {
    const rate = playback.frameRate.peek();
    return Math.min(playback.duration.peek(), Math.max(0, Math.round(time * rate) / rate));
  };
  const base = useRef<{ time: number; value: number } | null>(null);
  const go = (event: PointerEvent, final: boolean) => {
    const origin = base.current;
    if (!from.current || !origin) return;
    const time = snapped(scale.time(scale.x(origin.time) + event.clientX - from.current.x));
    onMove(key.id, time, scale.value(scale.y(origin.value) + event.clientY - from.current.y), final);
  };
  const onKeyDown = (event: KeyboardEvent) => {
    const factor = event.shiftKey ? 10 : 1;
    const step: Record<string, [number, number]> = { ArrowLeft: [-factor, 0], ArrowRight: [factor, 0], ArrowUp: [0, factor * STEP], ArrowDown: [0, -factor * STEP] };
    const by = step[event.key];
    if (by) onMove(key.id, snapped(key.time + by[0] / playback.frameRate.peek()), key.value + by[1], true);
    else if (event.key === "Enter" || event.key === " ") onSelect(key.id);
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <button
      type="button"
      class="key curve-key"
      aria-pressed={selected.includes(key.id)}
      aria-label={`${curve.label}: ${formatNumber(key.value, 1)}${unit} at ${formatNumber(key.time, 2)} s`}
      style={{ left: `${scale.x(key.time)}px`, top: `${scale.y(key.value)}px`, color: curve.color }}
      onKeyDown={onKeyDown}
      onPointerDown={(event) => {
        (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
        from.current = { x: event.clientX, y: event.clientY, moved: false };
        base.current = { time: key.time, value: key.value };
        hold(true);
        onSelect(key.id);
      }}
      onPointerMove={(event) => {
        if (!from.current) return;
        from.current.moved ||= Math.hypot(event.clientX - from.current.x, event.clientY - from.current.y) > 3;
        if (from.current.moved) go(event, false);
      }}
      onPointerUp={(event) => {
        if (from.current?.moved) go(event, true);
        from.current = null;
        hold(false);
      }}
    />
  );
}
