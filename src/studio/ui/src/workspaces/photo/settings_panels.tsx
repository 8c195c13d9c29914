// Lens, projection and result.
import { useEffect, useState } from "preact/hooks";
import { Button, NumberField, Panel, Segmented, Select, SliderField, TextField, Toggle } from "../../shell/components";
import type { SettingsInfo } from "../../generated/photo";
import type { PhotoPage } from "./page";

const MODELS = ["rectilinear", "equidistant", "equisolid", "stereographic", "orthographic", "equirectangular", "cylindrical", "mercator"];
const MODEL_NAMES: Record<string, string> = {
  rectilinear: "Rectilinear (no distortion)", equidistant: "Fisheye, equidistant", equisolid: "Fisheye, equisolid", stereographic: "Fisheye, stereographic",
  orthographic: "Fisheye, orthographic", equirectangular: "Panorama, equirectangular", cylindrical: "Panorama, cylindrical", mercator: "Panorama, Mercator",
};

export function LensPanel({ page }: { page: PhotoPage }) {
  const { settings, lens, photo, problem } = page.state.value;
  const files = useLensFiles(page);
  const source = settings.lens === "auto" ? "auto" : MODELS.includes(settings.lens) ? "model" : "file";
  const set = (lens: string, fov: number | null, axis = settings.fov_axis) =>
    void page.edit({ do: "set_lens", lens, fov: fov ?? undefined, fov_axis: fov === null ? undefined : axis });
  const field = lens?.field_deg[0] ?? 90;
  const choose = (next: "auto" | "model" | "file") => {
    if (next === "auto") set("auto", null);
    else if (next === "model") set("rectilinear", Math.round(Math.min(field, 120) * 10) / 10);
    else if (files[0]) set(files[0], null);
  };
  return (
    <Panel title="Lens">
      <div class="row">
        <Segmented label="Lens from" bare value={source} onChange={choose} options={[
          { value: "auto", label: "Automatic", title: "Marked lines, a profile, edges of the picture, EXIF: in this order" },
          { value: "model", label: "Model", title: "A projection and a field of view" },
          { value: "file", label: "File", title: "A lens file beside the photo", disabled: files.length === 0 && source !== "file" },
        ]} />
      </div>
      {source === "model" && <ModelFields page={page} />}
      {source === "file" && (
        <Select label="File" value={settings.lens} onChange={(file) => set(file, null)}
          options={[...new Set([settings.lens, ...files])].map((file) => ({ value: file, label: file }))} />
      )}
      {source === "auto" && settings.fov !== null && (
        <NumberField label="Field of view" unit="°" value={settings.fov} min={1} max={360} onChange={(fov) => set("auto", fov)} />
      )}
      {lens && (
        <dl class="photo-facts" aria-label="Lens in use">
          <div><dt>Source</dt><dd>{lens.how}</dd></div>
          <div><dt>Projection</dt><dd>{lens.projection}</dd></div>
          <div><dt>Focal length</dt><dd class="num">{lens.focal_px[0].toFixed(1)} px</dd></div>
          {lens.field_deg[0] !== null && <div><dt>Field of view</dt><dd class="num">{lens.field_deg.map((d) => (d === null ? "–" : d.toFixed(1))).join(" × ").replace(/ × ([^×]*)$/, "°, diagonal $1°")}</dd></div>}
        </dl>
      )}
      {!lens && problem && <p class="hint">Mark three curved lines with three points or more each, or choose a model or a lens file.</p>}
      {photo.exif.length > 0
        ? <dl class="photo-facts" aria-label="EXIF">{photo.exif.map(([name, value]) => <div key={name}><dt>{name}</dt><dd>{value}</dd></div>)}</dl>
        : <p class="hint">The file has no EXIF of camera and lens.</p>}
    </Panel>
  );
}

function ModelFields({ page }: { page: PhotoPage }) {
  const { settings } = page.state.value;
  const fov = settings.fov ?? page.state.value.lens?.field_deg[0] ?? 90;
  const edit = (lens: string, next: number, axis = settings.fov_axis) => ({ do: "set_lens" as const, lens, fov: next, fov_axis: axis });
  return (
    <>
      <Select label="Model" value={settings.lens} options={MODELS.map((value) => ({ value, label: MODEL_NAMES[value] ?? value }))}
        onChange={(lens) => void page.edit(edit(lens, fov))} />
      <SliderField label="Field of view" unit="°" value={fov} min={20} max={settings.lens === "rectilinear" ? 160 : 360} step={0.5} digits={1}
        onInput={(next) => page.drag(edit(settings.lens, next))}
        onChange={(next) => { page.drag(edit(settings.lens, next)); page.seal(); }} />
      <Select label="Measured" value={settings.fov_axis} onChange={(axis) => void page.edit(edit(settings.lens, fov, axis))}
        options={[{ value: "h", label: "Horizontally" }, { value: "v", label: "Vertically" }, { value: "d", label: "Corner to corner" }]} />
    </>
  );
}

function useLensFiles(page: PhotoPage): readonly string[] {
  const [files, setFiles] = useState<readonly string[]>([]);
  useEffect(() => void page.connection.ask<string[]>({ ask: "lens_files" }).then(setFiles, () => undefined), [page]);
  return files;
}

const PROJECTIONS = [
  { value: "optimized", label: "Optimized: lines straight, shapes kept" }, { value: "perspective", label: "Perspective" }, { value: "panini", label: "Panini" },
  { value: "stereographic", label: "Stereographic" }, { value: "mercator", label: "Mercator" }, { value: "cylindrical", label: "Cylindrical" }, { value: "equirectangular", label: "Equirectangular" },
];
const CROPS = [
  { value: "auto", label: "Automatic: straight border if possible" }, { value: "rectangle", label: "Largest rectangle" }, { value: "none", label: "None: curved border" },
  { value: "3:2", label: "3 : 2" }, { value: "4:3", label: "4 : 3" }, { value: "16:9", label: "16 : 9" }, { value: "1:1", label: "1 : 1" },
];

const withValue = (options: { value: string; label: string }[], value: string) =>
  options.some((option) => option.value === value) ? options : [...options, { value, label: value }];

export function ProjectionPanel({ page }: { page: PhotoPage }) {
  const { settings } = page.state.value;
  const set = (key: string, value: string) => void page.edit({ do: "set", key, value });
  const [kind = "optimized", distance] = settings.to.split(":");
  const turn = (k: number) => (value: number) => {
    const view = [...settings.view];
    view[k] = value;
    return view.map((v) => Math.round(v * 100) / 100).join(",");
  };
  return (
    <Panel title="Projection">
      <Select label="To" value={kind} options={PROJECTIONS} onChange={(to) => set("to", to)} />
      {kind === "panini" && (
        <SliderField label="Distance" value={Number(distance ?? 1)} min={0} max={3} step={0.05} digits={2}
          onInput={(d) => page.drag({ do: "set", key: "to", value: `panini:${d}` })}
          onChange={(d) => { page.drag({ do: "set", key: "to", value: `panini:${d}` }); page.seal(); }} />
      )}
      {["Yaw", "Pitch", "Roll"].map((label, k) => (
        <SliderField key={label} label={label} unit="°" value={settings.view[k] ?? 0} min={k === 0 ? -90 : -45} max={k === 0 ? 90 : 45} step={0.5} digits={2}
          onInput={(v) => page.drag({ do: "set", key: "view", value: turn(k)(v) })}
          onChange={(v) => { page.drag({ do: "set", key: "view", value: turn(k)(v) }); page.seal(); }} />
      ))}
      <Select label="Crop" value={settings.crop} options={withValue(CROPS, settings.crop)} onChange={(crop) => set("crop", crop)} />
      <FieldOfResult page={page} />
      <Select label="Border" value={settings.border} onChange={(border) => set("border", border)} options={[
        { value: "black", label: "Black" }, { value: "mirror", label: "Mirrored" }, { value: "replicate", label: "Edge drawn out" },
        { value: "transparent", label: "Transparent" }, { value: "fill", label: "Filled from the picture" },
      ]} />
    </Panel>
  );
}

function FieldOfResult({ page }: { page: PhotoPage }) {
  const field = page.state.value.settings.view_field;
  const [width, height] = field === "" ? [100, 75] : field.split(",").map(Number);
  const set = (value: string) => void page.edit({ do: "set", key: "view_field", value });
  return (
    <>
      <Toggle label="Limit the field of the result" checked={field !== ""} onChange={(on) => set(on ? `${width},${height}` : "")} />
      {field !== "" && (
        <div class="photo-rect">
          <NumberField label="Wide" unit="°" value={width ?? 100} min={1} max={359} onChange={(v) => set(`${v},${height}`)} />
          <NumberField label="High" unit="°" value={height ?? 75} min={1} max={179} onChange={(v) => set(`${width},${v}`)} />
        </div>
      )}
    </>
  );
}

export function ResultPanel({ page }: { page: PhotoPage }) {
  const { settings, result, lines } = page.state.value;
  const set = (key: keyof SettingsInfo, value: string) => void page.edit({ do: "set", key, value });
  const reports = lines.flatMap((line) => (line.report ? [line.report] : []));
  const bent = reports.filter((report) => report.bent).length;
  const worst = reports.reduce((most, report) => Math.max(most, report.max_px), 0);
  return (
    <Panel title="Result">
      {result && (
        <dl class="photo-facts" aria-label="Result">
          <div><dt>Size</dt><dd class="num">{result.width} × {result.height} px</dd></div>
          {reports.length > 0 && <div><dt>Straightness</dt><dd class="num">{reports.length - bent} of {reports.length} lines straight; largest deviation {worst.toFixed(2)} px</dd></div>}
        </dl>
      )}
      <TextField label="Size" value={settings.size} placeholder="as the photo; 1600x, 60%" onChange={(size) => set("size", size)} />
      <TextField label="File" value={settings.path} onChange={(path) => set("path", path)} />
      <NumberField label="JPEG quality" value={settings.quality} min={1} max={100} digits={0} onChange={(quality) => set("quality", String(quality))} />
      <Select label="Interpolation" value={settings.interpolation} onChange={(v) => set("interpolation", v)} options={[{ value: "bicubic", label: "Bicubic" }, { value: "lanczos3", label: "Lanczos 3" }]} />
      <Toggle label="Grid of the map" checked={page.showGrid.value} onChange={(on) => (page.showGrid.value = on)} />
      <Toggle label="Lines over the result" checked={page.showCarried.value} onChange={(on) => (page.showCarried.value = on)} />
      <div class="row photo-actions">
        <Button icon="save" onClick={page.exportPicture} disabled={!result}>Export picture</Button>
        <Button onClick={() => void page.copyCommand()}>Copy as command</Button>
      </div>
    </Panel>
  );
}
