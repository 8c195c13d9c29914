// Tools over the view.
import { Segmented, SliderField, Toggle, ToolButton, ToolDivider, Toolbar } from "../../shell/components";
import type { GizmoMode } from "../../view3d";
import type { MeshPage, ToolName } from "./page";

const TOOLS: readonly [ToolName, string, string, "select" | "brush" | "lasso" | "move"][] = [
  ["select", "Select", "Q", "select"], ["brush", "Select by brush", "B", "brush"], ["lasso", "Select by lasso", "O", "lasso"],
  ["grab", "Grab and drag", "G", "move"],
];

const MODES: readonly [GizmoMode, string, string, "move" | "rotate" | "scale"][] = [
  ["translate", "Move gizmo", "W", "move"], ["rotate", "Rotate gizmo", "E", "rotate"], ["scale", "Scale gizmo", "R", "scale"],
];

const HANDS = "M5.5 8V3.8a1 1 0 0 1 2 0V7M7.5 7V3a1 1 0 0 1 2 0v4M9.5 7V4a1 1 0 0 1 2 0v5.5a4 4 0 0 1-4 4.5c-2 0-3-1-4-3L2.6 8.6a1 1 0 0 1 1.7-1L5.5 9";

export function Tools({ page }: { page: MeshPage }) {
  const tool = page.tool.value;
  return (
    <div class="mesh-tools">
      <Toolbar label="Tools" vertical class="view-tools">
        {TOOLS.map(([name, label, shortcut, icon]) => (
          <ToolButton key={name} label={label} icon={name === "grab" ? undefined : icon} path={name === "grab" ? HANDS : undefined}
            shortcut={shortcut} tip="right" pressed={tool === name} onClick={() => (page.tool.value = name)} />
        ))}
        <ToolDivider />
        {MODES.map(([mode, label, shortcut, icon]) => (
          <ToolButton key={mode} label={label} icon={icon} shortcut={shortcut} tip="right" pressed={page.mode.value === mode} onClick={() => (page.mode.value = mode)} />
        ))}
        <ToolButton label="Snap" path={MAGNET} shortcut="Shift+S" tip="right" pressed={page.snap.value} onClick={() => (page.snap.value = !page.snap.value)} />
      </Toolbar>
      <ToolOptions page={page} />
    </div>
  );
}

const MAGNET = "M3.5 3v5a4.5 4.5 0 0 0 9 0V3h-3v5a1.5 1.5 0 0 1-3 0V3zM3.5 5.5h3M9.5 5.5h3";

function ToolOptions({ page }: { page: MeshPage }) {
  const tool = page.tool.value;
  const snap = page.snapSteps.value;
  return (
    <>
      {tool === "brush" && (
        <section class="mesh-tool-options" aria-label="Brush">
          <SliderField label="Radius" unit="%" value={page.brushPercent.value} min={0.2} max={30} logarithmic digits={1}
            onInput={(v) => (page.brushPercent.value = v)} onChange={(v) => (page.brushPercent.value = v)} />
        </section>
      )}
      {tool === "lasso" && (
        <section class="mesh-tool-options" aria-label="Lasso">
          <Toggle label="Only what is visible" checked={page.visibleOnly.value} onChange={(on) => (page.visibleOnly.value = on)} />
        </section>
      )}
      {page.snap.value && (
        <section class="mesh-tool-options" aria-label="Snap">
          {page.mode.value === "rotate"
            ? <Segmented label="Step" value={String(snap.rotateDeg)} options={steps([5, 15, 45], "°")} onChange={(v) => (page.snapSteps.value = { ...snap, rotateDeg: Number(v) })} />
            : page.mode.value === "scale"
              ? <Segmented label="Step" value={String(snap.scale)} options={steps([5, 10, 25], " %")} onChange={(v) => (page.snapSteps.value = { ...snap, scale: Number(v) })} />
              : <Segmented label="Step" value={String(snap.translate)} options={steps([0.5, 1, 5], " %")} onChange={(v) => (page.snapSteps.value = { ...snap, translate: Number(v) })} />}
        </section>
      )}
    </>
  );
}

const steps = (values: number[], unit: string) => values.map((value) => ({ value: String(value), label: `${value}${unit}` }));

/** What the tool does, in a line. */
export function hintOf(page: MeshPage): string {
  const hints: Record<ToolName, string> = {
    select: "Click selects a vertex or a handle; Shift adds, Ctrl removes; drag orbits",
    brush: "Drag selects; Shift adds, Ctrl removes; drag beside the mesh orbits",
    lasso: "Draw around vertices; Shift adds, Ctrl removes; the middle button orbits",
    grab: "Drag a handle in the plane of the screen",
    region: "Drag paints what is fixed; Ctrl paints what moves",
  };
  return hints[page.tool.value];
}
