// Method and options, described by the schema of the stage: texts, ranges and words are those of `plumbline stages mesh.deform`.
import { Button, NumberField, Panel, Select } from "../../shell/components";
import type { MeshPage, Property } from "./page";

const METHODS: Record<string, string> = {
  arap: "ARAP, spokes and rims",
  "arap-spokes": "ARAP, spokes",
  "arap-elements": "ARAP, triangles",
  "gauss-newton": "ARAP by Gauss–Newton",
  laplacian: "Laplacian, detail-preserving",
  poisson: "Poisson",
  primo: "PriMo",
};

/** Which methods an option is for; the others are for all. */
const ONLY_FOR: Record<string, (method: string) => boolean> = {
  solver: (method) => method.startsWith("arap"),
  laplacian: (method) => method === "laplacian",
  rotation_estimation: (method) => method === "laplacian",
  init: (method) => method !== "poisson",
  iterations: (method) => method !== "poisson",
  tolerance: (method) => method !== "poisson",
};

const ORDER = ["solver", "laplacian", "rotation_estimation", "cotangents", "init", "iterations", "tolerance", "roi", "unconstrained"];

const LABELS: Record<string, string> = {
  solver: "Minimizer", laplacian: "Laplacian", rotation_estimation: "Rotations", cotangents: "Cotangents", init: "Initial guess",
  iterations: "Iterations", tolerance: "Tolerance", roi: "Reach", unconstrained: "Free parts",
};

export function MethodPanel({ page }: { page: MeshPage }) {
  const schema = page.schema.value;
  const { options } = page.state.value;
  const method = String(options.method);
  const set = (name: string, value: unknown) => void page.edit({ do: "set_option", name, value });
  const words = wordsOf(schema?.properties.method);
  const choices = Object.entries(METHODS).map(([value, label]) => ({ value, label, title: words.find((w) => w.const === value)?.description }));
  const shown = ORDER.filter((name) => schema?.properties[name] && (ONLY_FOR[name]?.(method) ?? true));
  const changed = shown.filter((name) => JSON.stringify(options[name] ?? null) !== JSON.stringify(schema?.defaults[name] ?? null));
  return (
    <Panel title="Method">
      <Select label="Method" value={method} options={choices} title={words.find((w) => w.const === method)?.description} onChange={(value) => set("method", value)} />
      {shown.map((name) => (
        <Option key={name} name={name} property={schema!.properties[name]!} value={options[name]} onChange={(value) => set(name, value)} />
      ))}
      {changed.length > 0 && (
        <Button icon="reset" onClick={() => void page.edits(...changed.map((name) => ({ do: "set_option", name, value: null }) as const))}>
          Options to their defaults
        </Button>
      )}
    </Panel>
  );
}

function Option({ name, property, value, onChange }: { name: string; property: Property; value: unknown; onChange: (value: unknown) => void }) {
  const words = wordsOf(property);
  const label = LABELS[name] ?? name;
  if (words.length > 0) {
    const options = words.map((word) => ({ value: word.const, label: word.const.replaceAll("-", " "), title: word.description }));
    return <Select label={label} title={property.description} value={String(value)} options={options} onChange={onChange} />;
  }
  const range = numberOf(property);
  const whole = range?.type === "integer";
  return (
    <NumberField
      label={label}
      title={property.description}
      value={typeof value === "number" ? value : null}
      placeholder="all"
      min={range?.minimum}
      max={range?.maximum}
      step={whole ? 10 : typeof value === "number" && value > 0 ? Number((value / 10).toPrecision(1)) : 0.1}
      digits={whole ? 0 : 3}
      onChange={(next) => onChange(whole ? Math.round(next) : next)}
    />
  );
}

function wordsOf(property: Property | undefined): { const: string; description?: string }[] {
  return property?.oneOf ?? property?.anyOf?.flatMap(wordsOf) ?? [];
}

function numberOf(property: Property): Property | undefined {
  return property.minimum !== undefined ? property : property.anyOf?.map(numberOf).find((found) => found);
}
