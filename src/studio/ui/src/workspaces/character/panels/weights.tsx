// Weights: how they are computed, the brush, and the color scale.
import { Button, NumberField, Panel, Segmented, Select, SliderField, Toggle } from "../../../shell/components";
import type { BrushOp, WeightMethod } from "../../../generated/character";
import type { Page } from "../page";

const METHODS: readonly { value: WeightMethod; label: string; title: string }[] = [
  { value: "heat", label: "Bone heat", title: "Diffusion from the nearest visible bones. Robust; the default" },
  { value: "biharmonic", label: "Bounded biharmonic", title: "Smoother at joints, several times slower" },
  { value: "distance", label: "Distance to bones", title: "Ignores the surface: for triangle soups" },
];
const BRUSHES: readonly { value: BrushOp; label: string; title: string }[] = [
  { value: "add", label: "Add", title: "Raises the weight towards 1" },
  { value: "subtract", label: "Subtract", title: "Lowers the weight towards 0" },
  { value: "replace", label: "Replace", title: "Sets the weight to a value" },
  { value: "smooth", label: "Smooth", title: "Averages the weight with that of the neighbors" },
];

export function WeightsPanel({ page }: { page: Page }) {
  return (
    <>
      <BrushPanel page={page} />
      <ComputedPanel page={page} />
    </>
  );
}

function BrushPanel({ page }: { page: Page }) {
  const { brush } = page;
  const joint = page.active;
  return (
    <Panel title="Brush">
      <div class="row"><Segmented label="Brush" bare value={brush.op.value} options={BRUSHES} onChange={(op) => (brush.op.value = op)} /></div>
      <SliderField label="Size" title="Radius, fraction of the diagonal of the mesh" value={brush.size.value} min={0.005} max={0.3} logarithmic
        onChange={(size) => (brush.size.value = size)} onInput={(size) => (brush.size.value = size)} />
      <SliderField label="Strength" value={brush.strength.value} min={0.01} max={1} step={0.01}
        onChange={(strength) => (brush.strength.value = strength)} onInput={(strength) => (brush.strength.value = strength)} />
      {brush.op.value === "replace" && (
        <SliderField label="Weight" value={brush.value.value} min={0} max={1} step={0.01}
          onChange={(value) => (brush.value.value = value)} onInput={(value) => (brush.value.value = value)} />
      )}
      <Toggle label="Mirrored" checked={brush.mirror.value} onChange={(mirror) => (brush.mirror.value = mirror)} title="The other side is painted too, for the joint of the other side" />
      <p class="hint">{joint ? `Paints the weight of ${joint.name}; the others are scaled so that all sum to 1.` : "Choose a joint to paint its weight."}</p>
    </Panel>
  );
}

function ComputedPanel({ page }: { page: Page }) {
  const { weights } = page.state.value;
  return (
    <Panel title="Computed weights">
      <Select label="Method" value={weights.method} options={METHODS} onChange={(method) => page.actions.computeWeights({ ...weights, method })} />
      <NumberField label="Influences" title="Joints per vertex at most" value={weights.influences} min={1} max={64} digits={0}
        onChange={(influences) => page.actions.influences(influences)} />
      <NumberField label="Smoothing" unit="×" value={weights.smooth} min={0} max={1000} digits={0}
        onChange={(smooth) => page.actions.computeWeights({ ...weights, smooth })} />
      <Button wide onClick={() => page.actions.computeWeights(weights)}>Compute again</Button>
      {weights.running !== null && <p class="hint" role="status">Computing weights{weights.running > 0 ? `: ${Math.round(100 * weights.running)} %` : "…"}</p>}
      <p class="hint">{weights.painted > 0 ? "Painted, or read from a file: computing again replaces them." : "As computed; nothing is painted."}</p>
    </Panel>
  );
}
