// Controls of panels, each with its label: numbers, choices, switches.
import { useEffect, useId, useRef, useState } from "preact/hooks";
import { moveFocus } from "./button";
import { Icon, type IconName } from "./icon";
import { formatNumber, parseNumber, positionOf, valueAt } from "./number";

interface NumberProps {
  label: string;
  value: number | null;
  /** The value is decided: Enter, arrow key, focus leaves, slider released. Within `min` and `max`. */
  onChange: (value: number) => void;
  /** While the slider moves. Without it `onChange` is called at the end only. */
  onInput?: (value: number) => void;
  min?: number;
  max?: number;
  /** Of arrow keys and slider; Shift makes it ten times as large. */
  step?: number;
  /** px, °, s, % … */
  unit?: string;
  /** Digits after the point that are shown at most. */
  digits?: number;
  disabled?: boolean;
  /** Longer text on hover. */
  title?: string;
  /** Shown where `value` is null: values that differ, a default. */
  placeholder?: string;
}

/** A number with its unit: typed, or by arrow keys. Takes "1/3" and "0,5" too. */
export function NumberField(props: NumberProps) {
  const id = useId();
  return (
    <div class="field" title={props.title}>
      <label class="field-label" for={id}>{props.label}</label>
      <div class="field-value"><NumberInput id={id} {...props} /></div>
    </div>
  );
}

/** A slider and the number beside it. `min` and `max` are needed; `logarithmic` for values over several powers of ten. */
export function SliderField(props: NumberProps & { min: number; max: number; logarithmic?: boolean }) {
  const id = useId();
  const { label, value, min, max, step = (max - min) / 100, logarithmic = false, onInput, onChange } = props;
  const ends = { min, max, logarithmic };
  const read = (event: Event) => {
    const at = valueAt(Number((event.currentTarget as HTMLInputElement).value), ends);
    return logarithmic ? Number(at.toPrecision(3)) : Math.min(max, Math.round(at / step) * step);
  };
  return (
    <div class="field" title={props.title}>
      <label class="field-label" for={id}>{label}</label>
      <div class="field-value">
        <input
          type="range"
          aria-label={`${label}, slider`}
          aria-valuetext={`${formatNumber(value, props.digits)}${props.unit ?? ""}`}
          min={0}
          max={1}
          step={logarithmic ? 0.005 : step / (max - min || 1)}
          value={positionOf(value ?? min, ends)}
          disabled={props.disabled}
          onInput={(event) => onInput?.(read(event))}
          onChange={(event) => onChange(read(event))}
        />
        <NumberInput id={id} {...props} step={step} />
      </div>
    </div>
  );
}

/** The input alone, for tables and rows of x, y, z; the name comes from `label`. */
export function NumberInput(props: NumberProps & { id?: string }) {
  const { id, label, unit, disabled } = props;
  const { shown, invalid, type, commit, onKeyDown } = useNumberText(props);
  return (
    <span class="unit-input">
      <input
        id={id}
        inputMode="decimal"
        autocomplete="off"
        spellcheck={false}
        aria-label={id ? undefined : label}
        aria-invalid={invalid ? "true" : undefined}
        value={shown}
        placeholder={props.placeholder}
        disabled={disabled}
        style={unit ? { paddingRight: `${unit.length * 9 + 12}px` } : undefined}
        onFocus={(event) => event.currentTarget.select()}
        onInput={(event) => type(event.currentTarget.value)}
        onBlur={commit}
        onKeyDown={onKeyDown}
      />
      {unit && <span class="unit" aria-hidden="true">{unit}</span>}
    </span>
  );
}

/** What is typed until it is decided, and the steps of the arrow keys. */
function useNumberText({ value, onChange, min = -Infinity, max = Infinity, step = 1, digits = 3 }: NumberProps) {
  const [typed, type] = useState<string | null>(null);
  const meant = typed === null ? null : parseNumber(typed);
  const set = (next: number) => {
    const kept = Math.min(max, Math.max(min, next));
    if (kept !== value) onChange(kept);
    type(null);
  };
  const commit = () => (meant === null ? type(null) : set(meant));
  const onKeyDown = (event: KeyboardEvent) => {
    const sign = event.key === "ArrowUp" ? 1 : event.key === "ArrowDown" ? -1 : 0;
    if (event.key === "Enter") commit();
    else if (event.key === "Escape" && typed !== null) {
      type(null);
      event.stopPropagation();
    } else if (sign !== 0) {
      event.preventDefault();
      set(Number(((meant ?? value ?? 0) + sign * step * (event.shiftKey ? 10 : 1)).toPrecision(12)));
    }
  };
  const invalid = typed !== null && typed.trim() !== "" && meant === null;
  return { shown: typed ?? formatNumber(value, digits), invalid, type, commit, onKeyDown };
}

/** A line of text, decided by Enter or when the focus leaves. */
export function TextField(props: { label: string; value: string; onChange: (value: string) => void; disabled?: boolean; placeholder?: string }) {
  const id = useId();
  const input = useRef<HTMLInputElement>(null);
  // What is being typed stays where the value changes meanwhile.
  const typing = useRef(false);
  useEffect(() => { if (input.current && !typing.current) input.current.value = props.value; }, [props.value]);
  const commit = () => {
    typing.current = false;
    if (input.current && input.current.value !== props.value) props.onChange(input.current.value);
  };
  return (
    <div class="field">
      <label class="field-label" for={id}>{props.label}</label>
      <input
        ref={input}
        id={id}
        autocomplete="off"
        spellcheck={false}
        placeholder={props.placeholder}
        disabled={props.disabled}
        onInput={() => (typing.current = true)}
        onBlur={commit}
        onKeyDown={(event) => {
          if (event.key === "Enter") commit();
          if (event.key === "Escape" && input.current) {
            typing.current = false;
            input.current.value = props.value;
          }
        }}
      />
    </div>
  );
}

/** One of several values. */
export interface Option<T extends string = string> { value: T; label: string; icon?: IconName; title?: string; disabled?: boolean }

/** A choice from a list. */
export function Select<T extends string>(props: {
  label: string; value: T; options: readonly Option<T>[]; onChange: (value: T) => void; disabled?: boolean; title?: string;
}) {
  const id = useId();
  return (
    <div class="field" title={props.title}>
      <label class="field-label" for={id}>{props.label}</label>
      <select id={id} value={props.value} disabled={props.disabled} onChange={(event) => props.onChange(event.currentTarget.value as T)}>
        {props.options.map((option) => (
          <option key={option.value} value={option.value} disabled={option.disabled} title={option.title}>{option.label}</option>
        ))}
      </select>
    </div>
  );
}

/** A choice of two to four values, all visible; arrow keys change it. `bare` leaves the label to screen readers. */
export function Segmented<T extends string>(props: {
  label: string; value: T; options: readonly Option<T>[]; onChange: (value: T) => void; bare?: boolean; disabled?: boolean;
}) {
  const group = useRef<HTMLDivElement>(null);
  const onKeyDown = (event: KeyboardEvent) => {
    moveFocus(event, group.current, false);
    const to = (document.activeElement as HTMLElement | null)?.dataset.value;
    if (event.defaultPrevented && to !== undefined) props.onChange(to as T);
  };
  const buttons = (
    <div ref={group} class="segmented" role="radiogroup" aria-label={props.label} onKeyDown={onKeyDown}>
      {props.options.map((option) => (
        <button
          key={option.value}
          type="button"
          role="radio"
          class="tool"
          data-value={option.value}
          aria-checked={option.value === props.value}
          aria-label={option.label}
          title={option.title ?? (option.icon ? option.label : undefined)}
          tabIndex={option.value === props.value ? 0 : -1}
          disabled={props.disabled || option.disabled}
          onClick={() => props.onChange(option.value)}
        >
          {option.icon ? <Icon name={option.icon} /> : option.label}
        </button>
      ))}
    </div>
  );
  if (props.bare) return buttons;
  return (
    <div class="field">
      <span class="field-label" aria-hidden="true">{props.label}</span>
      {buttons}
    </div>
  );
}

/** A switch. */
export function Toggle(props: { label: string; checked: boolean; onChange: (checked: boolean) => void; disabled?: boolean; title?: string }) {
  return (
    <label class="toggle" title={props.title}>
      <span class="grow ellipsis">{props.label}</span>
      <input
        type="checkbox"
        role="switch"
        checked={props.checked}
        disabled={props.disabled}
        onChange={(event) => props.onChange(event.currentTarget.checked)}
      />
    </label>
  );
}
