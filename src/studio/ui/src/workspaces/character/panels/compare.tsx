// Skinning methods side by side, in the pose or the movement that is shown.
import { Button, formatNumber, Panel, Select, Toggle } from "../../../shell/components";
import type { Page } from "../page";
import { SKINNING } from "./pose";

export function ComparePanel({ page }: { page: Page }) {
  const { skinning, compare } = page.state.value;
  const chosen = page.comparing.value;
  const toggle = (method: (typeof chosen)[number], on: boolean) =>
    page.compare(SKINNING.map(({ value }) => value).filter((value) => (value === method ? on : chosen.includes(value))));
  return (
    <>
      <Panel title="Methods">
        {SKINNING.map(({ value, label, title }) => (
          <Toggle key={value} label={label} title={title} checked={chosen.includes(value)} disabled={!page.available(value)} onChange={(on) => toggle(value, on)} />
        ))}
        <p class="hint">{page.available("regression") ? "" : "Regression needs a trained model (.skin): import one."}</p>
      </Panel>
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
