// Three numbers in a row: a position, a rotation.
import { NumberInput } from "../../shell/components";

export type Triple = [number, number, number];

export function VectorField(props: {
  label: string; value: readonly number[] | null; onChange: (value: Triple) => void; step?: number; unit?: string; digits?: number; disabled?: boolean;
}) {
  const { label, value, onChange, step, unit, digits, disabled } = props;
  const names = ["x", "y", "z"];
  return (
    <div class="field" role="group" aria-label={label}>
      <span class="field-label" aria-hidden="true">{label}{unit ? ` (${unit})` : ""}</span>
      <div class="vector">
        {names.map((name, i) => (
          <NumberInput key={name} label={`${label} ${name}`} value={value ? value[i] ?? null : null} step={step} digits={digits} disabled={disabled || !value}
            onChange={(next) => {
              const changed: Triple = [value?.[0] ?? 0, value?.[1] ?? 0, value?.[2] ?? 0];
              changed[i] = next;
              onChange(changed);
            }} />
        ))}
      </div>
    </div>
  );
}
