// How the surface is drawn, the region of influence, and how the solve goes.
import { useMemo } from "preact/hooks";
import { Button, formatNumber, Panel, Plot, Segmented, Select, SliderField, Toggle } from "../../shell/components";
import type { Overlay } from "../../generated/mesh";
import type { LegendProps } from "../../view3d";
import type { MeshPage } from "./page";

const OVERLAYS: readonly { value: Overlay; label: string }[] = [
  { value: "none", label: "Handles" }, { value: "distortion", label: "Distortion" }, { value: "energy", label: "Energy per vertex" },
  { value: "displacement", label: "Displacement" }, { value: "flipped", label: "Flipped faces" },
];

export function ViewPanel({ page }: { page: MeshPage }) {
  const { overlay } = page.state.value;
  return (
    <Panel title="View">
      <Select label="Colors" value={overlay.kind} options={OVERLAYS} onChange={(kind) => page.connection.view({ overlay: kind })} />
      <Toggle label="Wireframe" checked={page.wireframe.value} onChange={(on) => (page.wireframe.value = on)} />
      <Toggle label="Flat shading" checked={page.flat.value} onChange={(on) => (page.flat.value = on)} />
    </Panel>
  );
}

/** The legend of the overlay. */
export function legendOf(page: MeshPage): LegendProps | null {
  const { kind, high } = page.state.value.overlay;
  if (kind === "none") return null;
  const title = OVERLAYS.find((o) => o.value === kind)?.label ?? kind;
  if (kind === "flipped") return { title: `${title}: ${page.state.value.solve.flipped ?? 0}`, low: 0, high: 1, scale: "heat" };
  if (kind === "distortion") return { title: "Distortion of edges", low: 0, high: 100 * high, scale: "sequential", unit: "%" };
  return { title, low: 0, high, scale: "sequential" };
}

export function RegionPanel({ page }: { page: MeshPage }) {
  const { outside, selection, mesh } = page.state.value;
  const painting = page.tool.value === "region";
  return (
    <Panel title="Region of influence" folded>
      <p class="num">{outside === 0 ? "The whole surface may move" : `${formatNumber(outside, 0)} of ${formatNumber(mesh.vertices, 0)} vertices are fixed`}</p>
      <Segmented
        label="Brush paints"
        value={page.paintOutside.value ? "outside" : "inside"}
        options={[{ value: "outside", label: "Fixed" }, { value: "inside", label: "Moving" }]}
        onChange={(value) => (page.paintOutside.value = value === "outside")}
      />
      <SliderField label="Brush" unit="%" value={page.brushPercent.value} min={0.2} max={30} logarithmic digits={1} onInput={(v) => (page.brushPercent.value = v)} onChange={(v) => (page.brushPercent.value = v)} />
      <Button wide icon="brush" onClick={() => (page.tool.value = painting ? "select" : "region")}>{painting ? "Stop painting" : "Paint the region"}</Button>
      <Button wide disabled={selection.count === 0} onClick={() => void page.edit({ do: "region_from_selection" })}>Only the selection moves</Button>
      <Button wide disabled={outside === 0} onClick={() => void page.edit({ do: "clear_region" })}>The whole surface moves</Button>
    </Panel>
  );
}

/** Energies below this fraction of the squared diagonal are rounding: the surface is at rest. */
const NOTHING = 1e-14;

const PHASES: Record<string, string> = {
  prefactor: "Factors the method", follow: "Follows the handles", settle: "Settles", exact: "Solves", frames: "Solves the frames", rest: "At rest",
};

export function SolvePanel({ page }: { page: MeshPage }) {
  const { solve, frames, frames_ready, mesh } = page.state.value;
  const energies = page.energies.value;
  const [x, curves] = useMemo(() => {
    const values = [...energies];
    return [values.map((_, i) => i), [{ label: "Energy", values }]] as const;
  }, [energies]);
  const facts: [string, string][] = [
    ["Energy", shown(solve.energy, 6)],
    ["Iterations", solve.iterations === null ? "–" : String(solve.iterations)],
    ["Ended", solve.stop ?? "–"],
    ["Distance from targets", shown(solve.constraint_error)],
    ["Mean stretch (rms)", percent(solve.rms_stretch)],
    ["Worst stretch", percent(solve.worst_stretch)],
    ["Flipped faces", shown(solve.flipped, 0)],
    ["Volume", solve.volume_ratio === null ? "–" : percent(solve.volume_ratio)],
    ["Factorization", solve.prefactor_ms === null ? "–" : `${shown(solve.prefactor_ms, 1)} ms`],
    ["Last update", solve.follow_ms === null ? "–" : `${shown(solve.follow_ms, 1)} ms`],
  ];
  if (solve.fixed_components) facts.push(["Parts without a handle", shown(solve.fixed_components, 0)]);
  if (frames > 1) facts.push(["Frames solved", `${frames_ready} of ${frames}`]);
  return (
    <Panel title="Solve">
      <p role="status">{solve.error ? <span class="error-text">{solve.error}</span> : `${PHASES[solve.phase]}${solve.exact ? "" : " (preview)"}`}</p>
      {x.length > 1 && energies.every((e) => e > NOTHING * mesh.diagonal ** 2) && <Plot label="Energy of the running solve" x={x} curves={curves} logarithmic height={104} xLabel="iteration" />}
      <dl class="mesh-facts num">
        {facts.map(([name, value]) => <div key={name}><dt>{name}</dt><dd>{value}</dd></div>)}
      </dl>
      {mesh.repair.length + mesh.warnings.length > 0 && <Repair page={page} />}
    </Panel>
  );
}

function Repair({ page }: { page: MeshPage }) {
  const { repair, warnings } = page.state.value.mesh;
  return (
    <>
      <h3>For the solver the mesh was repaired</h3>
      <ul class="mesh-repair">{[...repair, ...warnings].map((line) => <li key={line}>{line}</li>)}</ul>
      <p class="hint">The file that is written keeps its vertices and faces.</p>
    </>
  );
}

function shown(value: number | null, digits = 4): string {
  return value === null ? "–" : formatNumber(value, digits);
}

function percent(value: number | null): string {
  return value === null ? "–" : `${formatNumber(100 * value, 2)} %`;
}
