// The skeleton: tools of the pointer, the chosen joint and its limits, extraction, templates.
import { Button, NumberField, Panel, Segmented, Select, SliderField, TextField, Toggle } from "../../../shell/components";
import type { ExtractionOptions, Limits } from "../../../generated/character";
import { extracting } from "../joint_tree";
import type { JointInfo, Page } from "../page";
import type { SkeletonMode } from "../skeleton_tools";
import { VectorField } from "../vector_field";

const MODES: readonly { value: SkeletonMode; label: string; title: string }[] = [
  { value: "select", label: "Move", title: "Click chooses, drag moves" },
  { value: "add", label: "Add", title: "Click adds a joint in the middle of the volume, below the chosen joint" },
  { value: "extrude", label: "Extrude", title: "Drag from a joint makes a child" },
  { value: "split", label: "Split", title: "Click on a bone adds a joint there" },
];
const degrees = (rad: number) => (rad * 180) / Math.PI;
const radians = (deg: number) => (deg * Math.PI) / 180;

export function SkeletonPanel({ page }: { page: Page }) {
  const joint = page.active;
  return (
    <>
      <Panel title="Tool">
        <div class="row"><Segmented label="Tool" bare value={page.mode.value} options={MODES} onChange={(mode) => (page.mode.value = mode)} /></div>
        <Toggle label="Children move along" checked={page.withChildren.value} onChange={(on) => (page.withChildren.value = on)} />
      </Panel>
      {joint && <JointPanel page={page} joint={joint} />}
      {joint && <LimitsPanel page={page} joint={joint} />}
      <ExtractionPanel page={page} />
      <TemplatePanel page={page} />
    </>
  );
}

function JointPanel({ page, joint }: { page: Page; joint: JointInfo }) {
  const { actions, joints } = page;
  const parents = [{ value: "", label: "None: a root" }, ...joints.value
    .filter((other) => !page.isBelow(other.index, joint.index))
    .map((other) => ({ value: String(other.index), label: other.name }))];
  return (
    <Panel title="Joint">
      <TextField label="Name" value={joint.name} onChange={(name) => actions.rename(joint.index, name)} />
      <Select label="Parent" value={joint.parent === null ? "" : String(joint.parent)} options={parents}
        onChange={(parent) => actions.reparent([joint.index], parent === "" ? null : Number(parent))} />
      <VectorField label="Position" value={page.modelPosition(joint.index)} step={page.step} digits={4} onChange={(to) => actions.moveTo(joint.index, to)} />
      <NumberField label="Roll by" unit="°" value={0} step={5} min={-180} max={180} onChange={(angle) => actions.roll(joint.index, radians(angle))} />
      <div class="button-row">
        <Button icon="extrude" onClick={() => actions.extrudeSelected()}>Extrude</Button>
        <Button icon="split" disabled={joint.parent === null} onClick={() => actions.split(joint.index, 0.5)}>Split</Button>
        <Button icon="mirror" onClick={() => actions.mirror(joint.index)}>Mirror</Button>
        <Button onClick={() => actions.dissolve(page.selected.value)}>Dissolve</Button>
        <Button kind="danger" icon="trash" onClick={() => actions.remove(page.selected.value)}>Delete</Button>
      </div>
    </Panel>
  );
}

function LimitsPanel({ page, joint }: { page: Page; joint: JointInfo }) {
  const { limits, index } = joint;
  const set = (changed: Partial<Limits>) => limits && page.actions.limit(index, { ...limits, ...changed });
  return (
    <Panel title="Limits">
      <Toggle label="Limited rotation" checked={limits !== null} onChange={(on) => page.actions.limit(index, on ? page.defaultLimits(index) : null)} />
      {limits && (
        <>
          {([0, 1] as const).map((k) => (
            <SliderField key={k} label={`Swing ${k + 1}`} unit="°" digits={1} min={0} max={180} step={1} value={degrees(limits.swing[k])}
              onChange={(angle) => set({ swing: k === 0 ? [radians(angle), limits.swing[1]] : [limits.swing[0], radians(angle)] })} />
          ))}
          <SliderField label="Twist from" unit="°" digits={1} min={-180} max={180} step={1} value={degrees(limits.twist[0])}
            onChange={(angle) => set({ twist: [radians(Math.min(angle, degrees(limits.twist[1]))), limits.twist[1]] })} />
          <SliderField label="Twist to" unit="°" digits={1} min={-180} max={180} step={1} value={degrees(limits.twist[1])}
            onChange={(angle) => set({ twist: [limits.twist[0], radians(Math.max(angle, degrees(limits.twist[0])))] })} />
        </>
      )}
    </Panel>
  );
}

const OPTIONS: readonly { key: keyof ExtractionOptions; label: string; min: number; max: number; logarithmic?: boolean; step?: number; title: string }[] = [
  { key: "contraction", label: "Contraction", min: 0.05, max: 10, logarithmic: true, title: "Below 0.3 wide parts stay sheets, above 2 limbs shorten" },
  { key: "attraction", label: "Attraction", min: 0.001, max: 10, logarithmic: true, title: "Weight of the positions of the last iteration" },
  { key: "medial", label: "Medial", min: 0.001, max: 10, logarithmic: true, title: "Weight of the centers of the largest balls inside" },
  { key: "prune", label: "Prune", min: 0, max: 10, step: 0.05, title: "Terminal branches shorter than this many local radii are removed" },
  { key: "iterations", label: "Iterations", min: 1, max: 50, step: 1, title: "Contraction iterations at most" },
];

function ExtractionPanel({ page }: { page: Page }) {
  const { extraction } = page.state.value;
  const ends = extraction.ends;
  return (
    <Panel title="Extraction" folded={page.joints.value.length > 0}>
      {OPTIONS.map(({ key, ...range }) => (
        <SliderField key={key} {...range} value={extraction.options[key]} onChange={(value) => page.actions.extract({ options: { ...extraction.options, [key]: value } })} />
      ))}
      <NumberField label="Joints" value={extraction.joints} placeholder="automatic" min={1} max={1000} digits={0} onChange={(joints) => page.actions.extract({ joints })} />
      <p class="hint">{Array.isArray(ends) ? `${ends.length} ends pinned` : ends === "extrema" ? "Tips are kept" : "No ends are pinned"}</p>
      <div class="button-row">
        <Button icon="pin" onClick={() => (page.mode.value = "pin")}>Pin ends</Button>
        <Button onClick={() => page.actions.extract({ ends: null })}>Unpin all</Button>
      </div>
      <Button wide kind="primary" disabled={extraction.running !== null} onClick={() => page.actions.extract({})}>Extract skeleton</Button>
      {extraction.running !== null && <p class="hint" role="status">{extracting(page)}. Another option stops it.</p>}
    </Panel>
  );
}

function TemplatePanel({ page }: { page: Page }) {
  return (
    <Panel title="Template" folded>
      <div class="button-row">
        {page.state.value.templates.map((name) => <Button key={name} onClick={() => page.actions.template(name)}>Fit {name}</Button>)}
        <Button icon="upload" title="A skeleton of a .json, .glb, .fbx, .bvh, .tgf or .skel file" onClick={() => page.actions.chooseTemplate()}>Fit a file…</Button>
      </div>
      <p class="hint">The joints of a template are put onto the curve that the extraction finds; names, parents and limits stay.</p>
    </Panel>
  );
}
