// The selection: typed, by rule, followed along edges; named sets.
import { useState } from "preact/hooks";
import { Button, formatNumber, List, NumberField, Panel, Select, TextField, ToolButton, Toolbar } from "../../shell/components";
import type { Edit } from "../../generated/mesh";
import type { MeshPage } from "./page";
import { formatVertices, parseVertices } from "./vertex_list";

type Side = "+x" | "-x" | "+y" | "-y" | "+z" | "-z";
type How = "replace" | "add" | "remove" | "intersect";

const SIDES = (["+x", "-x", "+y", "-y", "+z", "-z"] as const).map((value) => ({
  value: value as Side, label: `${value[1]} ${value[0] === "+" ? "above" : "below"}`,
}));

const HOWS = [
  { value: "replace", label: "Replace" }, { value: "add", label: "Add" }, { value: "remove", label: "Remove" }, { value: "intersect", label: "Intersect" },
] as const;

export function SelectionPanel({ page }: { page: MeshPage }) {
  const { selection, mesh } = page.state.value;
  const [how, setHow] = useState<How>("replace");
  const listed = formatVertices(selection.first) + (selection.count > selection.first.length ? ", …" : "");
  const typed = (text: string) => {
    const vertices = parseVertices(text, mesh.vertices);
    if (vertices) void page.edit({ do: "select", vertices, how });
    else page.problem.value = `"${text}" is no list of vertices (expected such as 0-20, 35; the last is ${mesh.vertices - 1})`;
  };
  const action = (label: string, edit: Edit, path: string, shortcut?: string) => (
    <ToolButton label={label} path={path} shortcut={shortcut} onClick={() => void page.edit(edit)} />
  );
  return (
    <Panel title="Selection">
      <p class="num" role="status">
        {formatNumber(selection.count, 0)} of {formatNumber(mesh.vertices, 0)} vertices
      </p>
      <Toolbar label="Selection">
        {action("Select all", { do: "select_all" }, "M2.5 2.5h11v11h-11zM5.5 8l2 2 3.5-4", "A")}
        {action("Select nothing", { do: "select_none" }, "M2.5 2.5h11v11h-11z", "Alt+A")}
        {action("Invert selection", { do: "select_inverse" }, "M2.5 2.5h11v11h-11zM2.5 13.5l11-11M6 12h.01M9 12h.01M9 9.5h.01M12 12h.01M12 9h.01M12 6h.01", "Ctrl+I")}
        {action("Select connected", { do: "select_connected" }, "M2 5.5 5.5 2 9 5.5 5.5 9zM10.5 9.5h.01M13 12h.01M10.5 13.5h.01M13.5 9h.01", "L")}
        {action("Grow by a ring", { do: "select_rings", rings: 1 }, "M8 14A6 6 0 1 0 8 2a6 6 0 0 0 0 12zM8 5.5v5M5.5 8h5", "]")}
        {action("Shrink by a ring", { do: "select_rings", rings: -1 }, "M8 14A6 6 0 1 0 8 2a6 6 0 0 0 0 12zM5.5 8h5", "[")}
      </Toolbar>
      <Select label="New vertices" value={how} options={HOWS} onChange={setHow} />
      <TextField label="Vertices" value={listed} placeholder="0-20, 35" onChange={typed} />
      <HalfSpace page={page} how={how} />
      <Sets page={page} how={how} />
    </Panel>
  );
}

function HalfSpace({ page, how }: { page: MeshPage; how: How }) {
  const { center } = page.state.value.mesh;
  const [side, setSide] = useState<Side>("+y");
  const axis = "xyz".indexOf(side[1]!);
  const [at, setAt] = useState<number | null>(null);
  const value = at ?? center[axis]!;
  const select = () => {
    const [point, normal] = [[0, 0, 0], [0, 0, 0]] as [[number, number, number], [number, number, number]];
    point[axis] = value;
    normal[axis] = side[0] === "+" ? 1 : -1;
    void page.edit({ do: "select_half_space", point, normal, how });
  };
  return (
    <>
      <Select label="Half-space" value={side} options={SIDES} onChange={(next) => { setSide(next); setAt(null); }} />
      <NumberField label="Plane at" value={value} step={page.state.value.mesh.diagonal / 100} digits={4} onChange={setAt} />
      <Button wide onClick={select}>Select half-space</Button>
    </>
  );
}

function Sets({ page, how }: { page: MeshPage; how: How }) {
  const { sets, selection } = page.state.value;
  const [name, setName] = useState("");
  return (
    <>
      <h3>Named sets</h3>
      <List
        label="Named sets"
        items={sets.map((set) => ({ id: set.name, label: set.name, detail: formatNumber(set.vertices, 0) }))}
        selected={[]}
        onSelect={([id]) => id && void page.edit({ do: "select_set", name: id, how })}
        onRename={(from, to) => void page.edit({ do: "rename_set", from, to })}
        onDelete={([id]) => id && void page.edit({ do: "delete_set", name: id })}
        empty="No sets yet"
        maxHeight={120}
      />
      <TextField label="Name" value={name} placeholder="left hand" onChange={setName} />
      <Button
        wide
        disabled={selection.count === 0 || name.trim() === ""}
        onClick={() => { void page.edit({ do: "name_selection", name }); setName(""); }}
      >
        Name the selection
      </Button>
    </>
  );
}
