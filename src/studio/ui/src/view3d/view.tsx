// The 3D view as a component: canvas, camera buttons, legend, the outline of the lasso, a message without WebGL 2.
import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { useSignalEffect } from "@preact/signals";
import { formatNumber, ToolButton, ToolDivider, Toolbar } from "../shell/components";
import { theme } from "../shell/theme";
import type { NamedView } from "./camera";
import { scaleGradient, type ScaleName } from "./colors";
import { NoWebGL2, Viewport } from "./viewport";

/** A bar of colors with its ends. */
export interface LegendProps { title: string; low: number; high: number; scale: ScaleName; unit?: string }

export function Legend(props: LegendProps) {
  return (
    <figure class="view-legend" aria-label={`${props.title}: colors from ${formatNumber(props.low)} to ${formatNumber(props.high)}`}>
      <figcaption>{props.title}</figcaption>
      <div class="bar" style={{ background: scaleGradient(props.scale) }} />
      <div class="row num">
        <span class="grow">{formatNumber(props.low)}</span>
        <span>{formatNumber(props.high)}{props.unit ? ` ${props.unit}` : ""}</span>
      </div>
    </figure>
  );
}

const SIDES: readonly [NamedView, string, string][] = [
  ["front", "Front", "1"], ["right", "Right", "3"], ["top", "Top", "7"],
];

/**
 * A 3D view. `onReady` gets the viewport once, and may return what is to be done when the view goes.
 * `outline`: the line of a lasso, in pixels. Children are placed over the view.
 */
export function View3D(props: {
  label: string;
  onReady: (view: Viewport) => void | (() => void);
  outline?: readonly { x: number; y: number }[];
  legend?: LegendProps | null;
  children?: ComponentChildren;
}) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [view, setView] = useState<Viewport | null>(null);
  const [failure, setFailure] = useState<string | null>(null);
  useEffect(() => {
    if (!canvas.current) return;
    try {
      const made = new Viewport(canvas.current);
      const leave = props.onReady(made);
      setView(made);
      return () => {
        leave?.();
        made.dispose();
      };
    } catch (error) {
      if (!(error instanceof NoWebGL2)) throw error;
      setFailure(error.message);
      return undefined;
    }
  }, []);
  useSignalEffect(() => {
    void theme.value;
    // After the style of the page has changed.
    queueMicrotask(() => view?.themeChanged());
  });
  if (failure) return <div class="view-failure" role="alert"><p>{failure}</p></div>;
  const points = props.outline ?? [];
  return (
    <>
      <canvas ref={canvas} tabIndex={0} role="application" aria-roledescription="3D view" aria-label={props.label} />
      {points.length > 1 && (
        <svg class="view-outline" aria-hidden="true"><polygon points={points.map((p) => `${p.x},${p.y}`).join(" ")} /></svg>
      )}
      {view && <CameraButtons view={view} />}
      {props.legend && <Legend {...props.legend} />}
      {props.children}
    </>
  );
}

function CameraButtons({ view }: { view: Viewport }) {
  return (
    <Toolbar label="Camera" class="view-tools right" vertical>
      <ToolButton label="Show all" icon="fit" shortcut="Home" tip="left" onClick={() => view.fit()} />
      <ToolDivider />
      {SIDES.map(([side, label, key]) => (
        <ToolButton key={side} label={`${label} view`} path={FACES[side]} shortcut={key} tip="left" onClick={() => view.rig.look(side)} />
      ))}
    </Toolbar>
  );
}

/** A cube with one side marked. */
const CUBE = "M8 1.8 13.5 4.8v6.4L8 14.2l-5.5-3V4.8zM2.5 4.8 8 7.8l5.5-3M8 7.8v6.4";
const FACES: Partial<Record<NamedView, string>> = {
  front: `${CUBE}M4 7.4v2.8M5.3 8.1v2.8M6.6 8.8v2.8`,
  right: `${CUBE}M9.4 8.8v2.8M10.7 8.1v2.8M12 7.4v2.8`,
  top: `${CUBE}M5.5 4.8h5M6.5 3.9h3M6.5 5.7h3`,
};
