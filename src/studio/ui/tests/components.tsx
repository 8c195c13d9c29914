// A page with the controls alone, for components.spec.mjs.
import { signal } from "@preact/signals";
import { render } from "preact";
import {
  Button, createPlayback, Dialog, Icon, ICONS, Layout, List, NumberField, Panel, Plot, Segmented, Select, SliderField, Tabs, TextField, Timeline, Toggle, ToolButton,
  ToolDivider, Toolbar, Tree, type IconName, type Node, type TimelineKey,
} from "../src/shell/components";
import "../src/shell/theme";

const state = signal({
  number: 0.25, slider: 0.5, weight: 0.001, method: "arap", mode: "move", on: true, name: "Left arm", chosen: ["b"] as string[], joint: ["hips"] as string[],
  tab: "one", dialog: false, keys: [{ id: "k0", time: 0 }, { id: "k1", time: 1.2 }, { id: "k2", time: 2 }] as TimelineKey[], selectedKeys: [] as string[],
});
const nodes = signal<Node[]>([
  { id: "hips", label: "Hips", parent: null, icon: "joint" }, { id: "spine", label: "Spine", parent: "hips", icon: "joint" },
  { id: "head", label: "Head", parent: "spine", icon: "joint", detail: "end" }, { id: "arm.l", label: "Arm.L", parent: "spine", icon: "joint" },
  { id: "leg.l", label: "Leg.L", parent: "hips", icon: "joint" },
]);
const playback = createPlayback({ duration: 3, frameRate: 25 });
const set = (change: Partial<typeof state.value>) => (state.value = { ...state.value, ...change });
Object.assign(window, { state, nodes, playback });
const x = Array.from({ length: 60 }, (_, i) => i);
const energy = { label: "Energy", values: x.map((i) => 100 * Math.exp(-i / 9) + 0.4) };
const bound = { label: "Converged", values: x.map(() => 0.4), dashed: true };

const Fields = () => (
  <Panel title="Method" actions={<ToolButton icon="reset" label="Reset the method" onClick={() => set({ number: 0 })} />}>
    <NumberField label="Offset" unit="mm" value={state.value.number} step={0.1} onChange={(number) => set({ number })} />
    <SliderField label="Stiffness" min={0} max={1} value={state.value.slider} onInput={(slider) => set({ slider })} onChange={(slider) => set({ slider })} />
    <SliderField label="Weight" min={1e-6} max={1} logarithmic digits={6} value={state.value.weight} onChange={(weight) => set({ weight })} />
    <Select label="Method" value={state.value.method} options={[{ value: "arap", label: "ARAP" }, { value: "gn", label: "Gauss–Newton" }]} onChange={(method) => set({ method })} />
    <Segmented label="Mode" value={state.value.mode} options={[{ value: "move", label: "Move", icon: "move" }, { value: "rotate", label: "Rotate", icon: "rotate" }, { value: "scale", label: "Scale", icon: "scale" }]} onChange={(mode) => set({ mode })} />
    <Toggle label="Smooth rotations" checked={state.value.on} onChange={(on) => set({ on })} />
    <TextField label="Name" value={state.value.name} onChange={(name) => set({ name })} />
    <div class="row"><Button onClick={() => set({ dialog: true })}>Ask</Button><Button kind="primary" onClick={() => undefined}>Solve</Button><Button kind="danger" icon="trash" onClick={() => undefined}>Delete</Button></div>
  </Panel>
);

const Lists = () => (
  <>
    <Panel title="Handles">
      <List label="Handles" multiple maxHeight={140} selected={state.value.chosen} onSelect={(chosen) => set({ chosen })} onDelete={() => set({ chosen: [] })}
        items={["a", "b", "c", "d"].map((id, i) => ({ id, label: `Handle ${i + 1}`, detail: `${12 * i + 3}`, color: `var(--data-${i + 1})`, actions: <Icon name="eye" /> }))} />
    </Panel>
    <Panel title="Skeleton">
      <Tree label="Joints" multiple nodes={nodes.value} selected={state.value.joint} onSelect={(joint) => set({ joint })}
        onRename={(id, label) => (nodes.value = nodes.value.map((node) => (node.id === id ? { ...node, label } : node)))}
        onMove={(ids, parent) => (nodes.value = nodes.value.map((node) => (ids.includes(node.id) ? { ...node, parent } : node)))} />
    </Panel>
    <Tabs label="Pages" selected={state.value.tab} onSelect={(tab) => set({ tab })} tabs={[{ id: "one", label: "One", content: () => <p>First</p> }, { id: "two", label: "Two", content: () => <p>Second</p> }]} />
  </>
);

const Keys = () => (
  <Timeline label="Keys" playback={playback} tracks={[{ id: "t", label: "Handle 1", keys: state.value.keys }, { id: "u", label: "Handle 2", color: "var(--data-2)", keys: [] }]}
    selected={state.value.selectedKeys} onSelect={(selectedKeys) => set({ selectedKeys })}
    onMove={(ids, by, final) => final && set({ keys: state.value.keys.map((key) => (ids.includes(key.id) ? { ...key, time: key.time + by } : key)) })}
    onDelete={(ids) => set({ keys: state.value.keys.filter((key) => !ids.includes(key.id)) })}
    onAdd={(time) => set({ keys: [...state.value.keys, { id: `n${time}`, time }] })} />
);

const View = () => (
  <>
    <Toolbar label="Tools" vertical class="view-tools">
      <ToolButton icon="select" label="Select" shortcut="S" tip="right" pressed onClick={() => undefined} />
      <ToolButton icon="lasso" label="Lasso" shortcut="L" tip="right" pressed={false} onClick={() => undefined} />
      <ToolDivider />
      <ToolButton icon="brush" label="Brush" tip="right" onClick={() => undefined} />
    </Toolbar>
    <div style={{ display: "flex", flexWrap: "wrap", gap: "12px", padding: "16px 16px 16px 64px" }}>{(Object.keys(ICONS) as IconName[]).map((name) => <span key={name} title={name}><Icon name={name} /></span>)}</div>
    <p class="view-facts">43 243 vertices</p>
  </>
);

const Page = () => (
  <div class="workspace">
    <h1 class="hidden-visually">Controls</h1>
    <Layout name="test" left={<Lists />} view={<View />} bottom={<Keys />}
      right={<><Fields /><Panel title="Energy"><Plot label="Energy" xLabel="Iteration" logarithmic x={x} curves={[energy, bound]} marker={20} /></Panel></>} />
    {state.value.dialog && <Dialog title="Delete the handle?" onClose={() => set({ dialog: false })} actions={<Button kind="primary" onClick={() => set({ dialog: false })}>Delete</Button>}><p>It has 12 vertices.</p></Dialog>}
  </div>
);

const root = document.getElementById("studio");
if (root) render(<Page />, root);
