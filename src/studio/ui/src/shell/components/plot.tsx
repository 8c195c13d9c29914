// Curves, drawn by uPlot in the colors of the theme, with their last values as text for those who do not see them.
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import { cssColor, theme } from "../theme";
import { formatNumber } from "./number";

/** A curve over the common x values; `null` leaves a gap. */
export interface Curve { label: string; values: readonly (number | null)[]; color?: string; dashed?: boolean }

export interface PlotProps {
  label: string;
  x: readonly number[];
  curves: readonly Curve[];
  xLabel?: string;
  /** Powers of ten evenly on the y axis; values must be positive. */
  logarithmic?: boolean;
  height?: number;
  /** A vertical line, such as the current time. */
  marker?: number | null;
  /** A click, in units of x. */
  onPick?: (x: number) => void;
}

/** A plot as wide as its panel. */
export function Plot(props: PlotProps) {
  const { label, x, curves, height = 120, marker = null } = props;
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const current = useRef({ marker, onPick: props.onPick });
  current.current = { marker, onPick: props.onPick };
  const look = JSON.stringify([theme.value, props.logarithmic, props.xLabel, height, curves.map(({ label, color, dashed }) => [label, color, dashed])]);
  useEffect(() => {
    const element = box.current;
    if (!element) return;
    plot.current = new uPlot(options(props, element, current), data(x, curves), element);
    const observer = new ResizeObserver(() => plot.current?.setSize({ width: Math.max(40, element.clientWidth), height }));
    observer.observe(element);
    return () => { observer.disconnect(); plot.current?.destroy(); plot.current = null; };
  }, [look]);
  useEffect(() => plot.current?.setData(data(x, curves)), [x, curves]);
  useEffect(() => plot.current?.redraw(false), [marker]);
  const last = curves.map((curve) => `${curve.label} ${formatNumber(curve.values[curve.values.length - 1], 4) || "none"}`).join(", ");
  return (
    <figure class="plot" role="img" aria-label={`${label}: ${last}`}>
      <div ref={box} style={{ height: `${height}px` }} />
      {curves.length > 1 && (
        <figcaption class="plot-legend">
          {curves.map((curve, i) => (
            <span key={curve.label} class="row"><span class="swatch" style={{ background: colorOf(curve, i) }} />{curve.label}</span>
          ))}
        </figcaption>
      )}
    </figure>
  );
}

const colorOf = (curve: Curve, i: number) => curve.color ?? cssColor(`--data-${(i % 6) + 1}`);

const data = (x: readonly number[], curves: readonly Curve[]) => [[...x], ...curves.map((curve) => [...curve.values])] as uPlot.AlignedData;

function options(props: PlotProps, element: HTMLElement, current: { current: { marker: number | null; onPick?: (x: number) => void } }): uPlot.Options {
  const axis = {
    stroke: cssColor("--muted"),
    font: "11px system-ui",
    grid: { stroke: cssColor("--line"), width: 1 },
    ticks: { show: false },
  };
  // Of a logarithmic axis only powers of ten.
  const filter = (_: uPlot, splits: number[]) => splits.map((at) => (!props.logarithmic || Number.isInteger(Math.round(Math.log10(at) * 1e9) / 1e9) ? at : null));
  const yAxis = { ...axis, size: 48, filter, grid: { ...axis.grid, filter }, values: (_: uPlot, splits: (number | null)[]) => splits.map((at) => (at === null ? "" : shortNumber(at))) };
  return {
    width: Math.max(40, element.clientWidth),
    height: props.height ?? 120,
    legend: { show: false },
    cursor: { y: false, points: { size: 5 }, drag: { x: false, y: false } },
    scales: { x: { time: false }, y: { distr: props.logarithmic ? 3 : 1 } },
    axes: [{ ...axis, size: 24, label: props.xLabel, labelSize: props.xLabel ? 16 : 0, labelFont: "11px system-ui" }, yAxis],
    series: [{}, ...props.curves.map((curve, i) => ({
      label: curve.label, stroke: colorOf(curve, i), width: 1.5, points: { show: curve.values.length === 1 }, dash: curve.dashed ? [4, 3] : undefined,
    }))],
    hooks: {
      draw: [(plot: uPlot) => drawMarker(plot, current.current.marker)],
      ready: [(plot: uPlot) => plot.over.addEventListener("click", (event) => current.current.onPick?.(plot.posToVal(event.offsetX, "x")))],
    },
  };
}

/** For an axis: 1000, 0.01, 1e-6. */
const shortNumber = (at: number) => (at !== 0 && (Math.abs(at) < 1e-3 || Math.abs(at) >= 1e5) ? at.toExponential(0).replace("+", "") : String(Number(at.toPrecision(6))));

function drawMarker(plot: uPlot, marker: number | null) {
  if (marker === null) return;
  const x = Math.round(plot.valToPos(marker, "x", true)) + 0.5;
  plot.ctx.strokeStyle = cssColor("--text");
  plot.ctx.lineWidth = 1;
  plot.ctx.beginPath();
  plot.ctx.moveTo(x, plot.bbox.top);
  plot.ctx.lineTo(x, plot.bbox.top + plot.bbox.height);
  plot.ctx.stroke();
}
