// Panels beside the pictures: lines and faces as lists, the selected one in numbers.
import { Button, Icon, List, NumberField, NumberInput, Panel, Select, ToolButton, Toggle, type Item } from "../../shell/components";
import type { OrientationSetting } from "../../generated/photo";
import { orientationColor } from "./colors";
import type { PhotoPage } from "./page";

const EYE_OFF = "M1.5 8S4 3.5 8 3.5 14.5 8 14.5 8 12 12.5 8 12.5 1.5 8 1.5 8zM3 13 13 3";
const ORIENTATIONS = [
  { value: "free", label: "Free" }, { value: "horizontal", label: "Horizontal" }, { value: "vertical", label: "Vertical" }, { value: "angle", label: "Angle" },
] as const;
type OrientationName = (typeof ORIENTATIONS)[number]["value"];

const nameOf = (orientation: OrientationSetting): OrientationName =>
  orientation === "free" || orientation === "horizontal" || orientation === "vertical" ? orientation : "angle";

const px = (value: number) => (value < 0.095 ? value.toFixed(2) : value.toFixed(1));

export function LinesPanel({ page }: { page: PhotoPage }) {
  const { lines } = page.state.value;
  const selected = page.selected.value;
  const items: Item[] = lines.map((line, k) => ({
    id: String(k),
    label: line.name,
    color: line.off ? "var(--line-strong)" : orientationColor(line.orientation),
    detail: line.off ? "off" : line.report ? `${px(line.report.max_px)} px${line.report.bent ? " bent" : ""}` : "",
    actions: <Eye label={line.name} off={line.off} onClick={() => void page.edit({ do: "switch_lines", lines: [k], off: !line.off })} />,
  }));
  return (
    <Panel title={`Lines (${lines.length})`} actions={<ToolButton icon="plus" label="Add a line in the middle" onClick={() => page.addLineInMiddle()} />}>
      <List label="Marked lines" items={items} selected={selected.lines.map(String)} multiple maxHeight={220}
        empty="Draw along the image of a straight edge (L), or adopt found lines"
        onSelect={(ids) => page.select(ids.map(Number))}
        onRename={(id, name) => void page.edit({ do: "rename_line", line: Number(id), name })}
        onDelete={(ids) => void page.edit({ do: "delete_lines", lines: ids.map(Number) })} />
      <LineFields page={page} />
    </Panel>
  );
}

function LineFields({ page }: { page: PhotoPage }) {
  const selected = page.selected.value;
  const info = page.lineInfo(page.line.value);
  const orientation = info?.orientation ?? page.newOrientation.value;
  const name = nameOf(orientation);
  const set = (next: OrientationName) => page.orient(next === "angle" ? 45 : next);
  return (
    <>
      <Select label={info ? "Orientation" : "New lines"} value={name} options={ORIENTATIONS} onChange={set} />
      {name === "angle" && (
        <NumberField label="Angle" unit="°" value={Number(orientation)} min={-180} max={180} digits={2} onChange={(angle) => page.orient(angle)} />
      )}
      {selected.lines.length > 0 && (
        <div class="row photo-actions">
          <Button onClick={() => page.switchSelected()}>{info?.off ? "Switch on" : "Switch off"}</Button>
          {selected.lines.length === 1 && page.line.value !== null && (
            <Button onClick={() => void page.edit({ do: "snap_line", line: page.line.value ?? 0 })} title="Moves the points to the strongest edge near them">Snap</Button>
          )}
          <Button kind="danger" onClick={() => void page.edit({ do: "delete_lines", lines: [...selected.lines] })}>Delete</Button>
        </div>
      )}
      {info?.report && selected.lines.length === 1 && <Straightness page={page} />}
    </>
  );
}

function Straightness({ page }: { page: PhotoPage }) {
  const report = page.lineInfo(page.line.value)?.report;
  if (!report) return null;
  const rows: [string, string][] = [
    ["Largest deviation", `${report.max_px.toFixed(2)} px`],
    ["Root mean square", `${report.rms_px.toFixed(2)} px`],
  ];
  if (report.angle_error_deg !== null) rows.push(["Off its orientation", `${report.angle_error_deg.toFixed(3)}°`]);
  if (report.off_lens_px !== null) rows.push(["Marks off the lens", `${report.off_lens_px.toFixed(2)} px`]);
  if (report.shown < 1) rows.push(["Shown", `${Math.round(100 * report.shown)} %`]);
  return (
    <dl class="photo-facts tight" aria-label="Straightness of the line">
      {rows.map(([name, value]) => <div key={name}><dt>{name}</dt><dd class="num">{value}</dd></div>)}
    </dl>
  );
}

/** The points of the selected line: chosen, typed, moved by arrow keys. */
export function PointsPanel({ page }: { page: PhotoPage }) {
  const line = page.line.value;
  const info = page.lineInfo(line);
  if (line === null || !info || page.selected.value.lines.length !== 1) return null;
  const points = page.points(line);
  const point = page.selected.value.point;
  const p = point === null ? undefined : points[point];
  const items: Item[] = points.map(([x, y], k) => ({ id: String(k), label: k === 0 ? "Start" : k === points.length - 1 ? "End" : `Point ${k + 1}`, detail: `${x.toFixed(1)}, ${y.toFixed(1)}` }));
  return (
    <Panel title={`Points of ${info.name}`} actions={<ToolButton icon="plus" label="Insert a point" shortcut="I" onClick={() => page.insertPoint()} />}>
      <List label={`Points of ${info.name}`} items={items} selected={point === null ? [] : [String(point)]} maxHeight={150}
        onSelect={(ids) => page.select([line], Number(ids[0] ?? 0))}
        onDelete={() => page.deleteSelected()} />
      {p && point !== null && (
        <div class="row">
          <span class="muted">x</span>
          <NumberInput label="x of the point" unit="px" value={p[0]} digits={2} onChange={(x) => page.movePoint(line, point, x, p[1])} />
          <span class="muted">y</span>
          <NumberInput label="y of the point" unit="px" value={p[1]} digits={2} onChange={(y) => page.movePoint(line, point, p[0], y)} />
        </div>
      )}
      <p class="hint">Arrow keys in the picture, or Alt+arrow keys anywhere, move it by a pixel; with Shift by ten.</p>
    </Panel>
  );
}

export function FoundPanel({ page }: { page: PhotoPage }) {
  const { found, using, lens } = page.state.value;
  const chosen = page.chosenFound.value;
  const items: Item[] = (found ?? []).map((line) => ({
    id: line.name,
    label: line.name,
    color: line.off ? "var(--line-strong)" : orientationColor(line.orientation),
    detail: line.off ? "off" : `${Math.round(line.length)} px`,
    actions: using === "found" ? <Eye label={line.name} off={line.off} onClick={() => void page.edit({ do: "switch_found", names: [line.name], off: !line.off })} /> : undefined,
  }));
  const explained = found === null ? "Searching…"
    : using === "found" ? "The result is made with these until lines are marked; the first mark keeps them."
      : using === "marked" ? "Suggestions: the result is made with the marked lines."
        : lens ? "The result is made without lines." : "Suggestions, found without a lens.";
  return (
    <Panel title={`Found lines (${found?.length ?? 0})`} actions={<Button onClick={() => page.adopt()} disabled={items.length === 0}>{chosen.length > 0 ? `Adopt ${chosen.length}` : "Adopt all"}</Button>}>
      <p class="hint">{explained}</p>
      <List label="Found lines" items={items} selected={chosen} multiple maxHeight={180} empty={found === null ? "Searching…" : "No line was found"}
        onSelect={(ids) => (page.chosenFound.value = ids)} onActivate={(name) => void page.edit({ do: "adopt", names: [name] })}
        onDelete={using === "found" ? (names) => void page.edit({ do: "switch_found", names, off: true }) : undefined} />
      {using === "found" && chosen.length > 0 && <Button onClick={() => page.switchFound()}>{page.chosenAreOff() ? "Switch on" : "Switch off"}</Button>}
      <Toggle label="Show in the picture" checked={page.showFound.value} onChange={(on) => (page.showFound.value = on)} />
    </Panel>
  );
}

export function FacesPanel({ page }: { page: PhotoPage }) {
  const { faces, faces_marked: marked } = page.state.value;
  const selected = page.selected.value;
  const items: Item[] = (faces ?? []).map((face, k) => ({
    id: String(k),
    label: face.name,
    color: face.off ? "var(--line-strong)" : "#f7a8d8",
    detail: face.off ? "off" : face.cut ? "cut" : `${Math.round(face.rect[2])} × ${Math.round(face.rect[3])}`,
    actions: <Eye label={face.name} off={face.off} onClick={() => void page.edit({ do: "switch_faces", faces: [k], off: !face.off })} />,
  }));
  return (
    <Panel title={`Faces (${faces?.length ?? 0})`} actions={<ToolButton icon="plus" label="Add a face in the middle" onClick={() => page.addFaceInMiddle()} disabled={faces === null} />}>
      <List label="Faces" items={items} selected={selected.faces.map(String)} multiple maxHeight={140} empty={faces === null ? "Searching…" : "No face was found"}
        onSelect={(ids) => page.select([], null, ids.map(Number))}
        onRename={(id, name) => void page.edit({ do: "rename_face", face: Number(id), name })}
        onDelete={(ids) => void page.edit({ do: "delete_faces", faces: ids.map(Number) })} />
      <FaceFields page={page} />
      {selected.faces.length > 0 && (
        <div class="row photo-actions">
          <Button onClick={() => page.switchSelected()}>{page.faceInfo(page.face.value)?.off ? "Switch on" : "Switch off"}</Button>
          <Button kind="danger" onClick={() => page.deleteSelected()}>Delete</Button>
        </div>
      )}
      <Toggle label="Show in the picture" checked={page.showFaces.value} onChange={(on) => (page.showFaces.value = on)} />
      {marked && <Button wide onClick={() => void page.edit({ do: "find_faces" })}>Find faces again</Button>}
    </Panel>
  );
}

function FaceFields({ page }: { page: PhotoPage }) {
  const face = page.face.value;
  const rect = page.faceInfo(face)?.rect;
  if (face === null || !rect) return null;
  const set = (k: number) => (value: number) => {
    const next = [...rect] as [number, number, number, number];
    next[k] = value;
    void page.edit({ do: "set_face", face, rect: next });
  };
  const names = ["Left", "Top", "Width", "Height"];
  return (
    <div class="photo-rect">
      {names.map((name, k) => <NumberField key={name} label={name} unit="px" value={rect[k] ?? 0} digits={1} min={k > 1 ? 1 : undefined} onChange={set(k)} />)}
    </div>
  );
}

/** For the pointer; by keyboard O, or the button below the list. */
function Eye({ label, off, onClick }: { label: string; off: boolean; onClick: () => void }) {
  const click = (event: MouseEvent) => { event.stopPropagation(); onClick(); };
  return (
    <span class={`tool photo-eye ${off ? "muted" : ""}`} aria-hidden="true" title={`${off ? "Switch on" : "Switch off"} ${label}`} onClick={click}>
      <Icon name={off ? undefined : "eye"} path={off ? EYE_OFF : undefined} />
    </span>
  );
}
