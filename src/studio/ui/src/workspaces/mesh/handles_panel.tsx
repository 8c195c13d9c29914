// The handles: a list, and what the chosen one is and where it goes.
import { Button, formatNumber, List, NumberField, NumberInput, Panel, Segmented, ToolButton, Toggle } from "../../shell/components";
import type { HandleState } from "../../generated/mesh";
import { categoryColor } from "../../view3d";
import { Vector3 } from "three";
import type { MeshPage } from "./page";

const KINDS = [
  { value: "fixed", label: "Fixed", title: "The vertices stay" },
  { value: "rigid", label: "Rigid", title: "The vertices move as one rigid body" },
  { value: "free", label: "Free", title: "Each vertex has a target of its own" },
] as const;

const ICONS = { fixed: "lock", rigid: "move", free: "target" } as const;

export function HandlesPanel({ page }: { page: MeshPage }) {
  const { handles, active, selection } = page.state.value;
  const make = (kind: "fixed" | "rigid" | "free") => void page.edit({ do: "add_handle", kind });
  const move = (by: number) => active !== null && void page.edit({ do: "reorder_handle", handle: active, to: active + by });
  return (
    <Panel
      title="Handles"
      actions={
        <>
          <ToolButton label="Move up in the list" icon="up" disabled={!active} onClick={() => move(-1)} />
          <ToolButton label="Move down in the list" icon="down" disabled={active === null || active + 1 >= handles.length} onClick={() => move(1)} />
        </>
      }
    >
      <List
        label="Handles"
        items={handles.map((handle, k) => ({
          id: String(k),
          label: handle.name,
          detail: `${formatNumber(handle.vertices, 0)}${handle.weight === null ? "" : `, weight ${formatNumber(handle.weight)}`}`,
          icon: ICONS[handle.kind],
          color: categoryColor(k),
        }))}
        selected={active === null ? [] : [String(active)]}
        onSelect={(ids) => void page.edit({ do: "activate", handle: ids[0] === undefined ? null : Number(ids[0]) })}
        onRename={(id, name) => void page.edit({ do: "rename_handle", handle: Number(id), name })}
        onDelete={(ids) => void page.edit({ do: "delete_handles", handles: ids.map(Number) })}
        empty="Select vertices, then make them a handle"
        maxHeight={180}
      />
      <p class="hint">Make the selection a handle:</p>
      <div class="row">
        <Button icon="lock" disabled={selection.count === 0} onClick={() => make("fixed")}>Fixed</Button>
        <Button icon="move" disabled={selection.count === 0} onClick={() => make("rigid")}>Rigid</Button>
        <Button icon="target" disabled={selection.count === 0} onClick={() => make("free")}>Free</Button>
      </div>
    </Panel>
  );
}

export function HandlePanel({ page }: { page: MeshPage }) {
  const handle = page.active.value;
  const index = page.state.value.active;
  if (!handle || index === null) {
    return <Panel title="Handle"><p class="hint">No handle is chosen. Choose one in the list or click it in the view.</p></Panel>;
  }
  return (
    <Panel title="Handle">
      <Segmented label="Motion" value={handle.kind} options={KINDS} onChange={(kind) => void page.edit({ do: "set_kind", handle: index, kind })} />
      <Toggle
        label="Soft constraint"
        checked={handle.weight !== null}
        title="Vertices are pulled to their targets instead of being there"
        onChange={(on) => void page.edit({ do: "set_weight", handle: index, weight: on ? 1 : null })}
      />
      {handle.weight !== null && (
        <NumberField label="Weight" value={handle.weight} min={1e-6} max={1e12} step={0.5}
          onChange={(weight) => void page.edit({ do: "set_weight", handle: index, weight })} />
      )}
      {handle.kind === "rigid" && <Rigid page={page} handle={handle} index={index} />}
      {handle.kind === "free" && <p class="hint">Drag, rotate or scale its vertices with the gizmo, or move them by numbers.</p>}
      {handle.kind !== "fixed" && <MoveBy page={page} />}
      <div class="row wrap">
        {handle.kind !== "fixed" && (
          <Button icon="reset" onClick={() => void page.edit({ do: "reset", handle: index, time: page.time.value })}>Back to rest</Button>
        )}
        <Button onClick={() => void page.edit({ do: "select_handle", handle: index })}>Select its vertices</Button>
        <Button disabled={page.state.value.selection.count === 0} onClick={() => void page.edit({ do: "set_vertices", handle: index })}>
          Take the selection
        </Button>
        <Button kind="danger" icon="trash" onClick={() => void page.edit({ do: "delete_handles", handles: [index] })}>Delete</Button>
      </div>
    </Panel>
  );
}

function Rigid({ page, handle, index }: { page: MeshPage; handle: HandleState; index: number }) {
  const { diagonal } = page.state.value.mesh;
  const place = (change: { translation?: V3; axis?: V3; angle_deg?: number }) =>
    void page.edit({ do: "place", handle: index, time: page.time.value, ...change }).then(() => page.connection.seal());
  const [axis, angle] = [handle.axis ?? [0, 1, 0], handle.angle_deg ?? 0];
  return (
    <>
      <Triple label="Translation" values={handle.translation ?? [0, 0, 0]} step={diagonal / 100} onChange={(translation) => place({ translation })} />
      <Triple label="Axis" values={axis} step={0.1} onChange={(to) => place({ axis: to, angle_deg: angle })} />
      <NumberField label="Angle" unit="°" value={angle} step={5} onChange={(angle_deg) => place({ axis: axis as V3, angle_deg })} />
      <Triple label="Pivot" values={handle.pivot ?? [0, 0, 0]} step={diagonal / 100} onChange={(pivot) => void page.edit({ do: "set_pivot", handle: index, pivot })} />
      <Toggle label="Smooth between keys" checked={handle.smooth} onChange={(smooth) => void page.edit({ do: "set_interpolation", handle: index, smooth })} />
    </>
  );
}

function MoveBy({ page }: { page: MeshPage }) {
  const { diagonal } = page.state.value.mesh;
  return (
    <Triple label="Move by" values={[0, 0, 0]} step={diagonal / 100} onChange={([x, y, z]) => page.moveActive({ translation: new Vector3(x, y, z) })} />
  );
}

type V3 = [number, number, number];

/** Three numbers with one label. */
function Triple(props: { label: string; values: readonly number[]; step: number; onChange: (values: V3) => void }) {
  const { label, values, step, onChange } = props;
  const set = (k: number, value: number) => onChange(values.map((old, i) => (i === k ? value : old)) as V3);
  return (
    <fieldset class="mesh-triple">
      <legend class="field-label">{label}</legend>
      <div class="row">
        {["x", "y", "z"].map((axis, k) => (
          <NumberInput key={axis} label={`${label} ${axis}`} value={values[k]!} step={step} digits={4} onChange={(value) => set(k, value)} />
        ))}
      </div>
    </fieldset>
  );
}
