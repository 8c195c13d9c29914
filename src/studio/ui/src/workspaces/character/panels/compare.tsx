// Skinning methods side by side, in the pose or the movement that is shown.
import { Button, formatNumber, Panel, Select, Toggle } from "../../../shell/components";
import type { Page } from "../page";
import { SKINNING } from "./pose";

/** The trained skin that regression follows. */
function ModelPanel({ page }: { page: Page }) {
  const { model } = page.state.value;
  return (
    <Panel title="Trained skin">
      {model === null && <p class="hint">Regression follows a skin that was trained on meshes of this character in known poses. The command <code>plumbline skin train</code> learns one and writes a .skin file; import it here.</p>}
      {model !== null && model.fault === null && <p class="hint">{model.name} fits this mesh and skeleton.</p>}
      {model !== null && model.fault !== null && <p class="error-text">{model.name} does not fit: {model.fault}</p>}
      <Button wide icon="upload" onClick={() => page.actions.chooseModel()}>Import trained skin…</Button>
    </Panel>
  );
}

export function ComparePanel({ page }: { page: Page }) {
  const { skinning, compare } = page.state.value;
  const chosen = page.comparing.value;
  const toggle = (method: (typeof chosen)[number], on: boolean) =>
    page.compare(SKINNING.map(({ value }) => value).filter((value) => (value === method ? on : chosen.includes(value))));
  return (
    <>
      <Panel title="Methods">
        {SKINNING.map(({ value, label, title }) => (
          <Toggle key={value} label={label} title={title} checked={chosen.includes(value) && page.available(value)} disabled={!page.available(value)} onChange={(on) => toggle(value, on)} />
        ))}
      </Panel>
      <ModelPanel page={page} />
      <Panel title="Measures">
        <table class="measures">
          <thead><tr><th scope="col">Method</th><th scope="col">Volume</th><th scope="col">Stretch</th></tr></thead>
          <tbody>
            {compare.map(({ method, volume, stretch }) => (
              <tr key={method}><th scope="row">{SKINNING.find(({ value }) => value === method)?.label}</th><td>{formatNumber(100 * volume, 1)} %</td><td>{formatNumber(100 * stretch, 1)} %</td></tr>
            ))}
          </tbody>
        </table>
        <p class="hint">Volume as a fraction of that at rest; mean change of edge lengths.</p>
      </Panel>
      <Panel title="Used for the document">
        <Select label="Skinning" value={skinning} options={SKINNING.filter(({ value }) => page.available(value))} onChange={(method) => page.actions.skinning(method)} />
        <Button wide onClick={() => page.scene?.view.fit()}>Show all</Button>
      </Panel>
    </>
  );
}
