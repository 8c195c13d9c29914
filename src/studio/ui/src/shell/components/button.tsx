// Buttons: with text, of a toolbar, and toolbars.
import type { ComponentChildren } from "preact";
import { useRef } from "preact/hooks";
import { Icon, type IconName } from "./icon";
import "./tooltip";

/** A button with text. `kind`: `primary` once in a dialog, `danger` for what deletes. */
export function Button(props: {
  children: ComponentChildren;
  onClick: () => void;
  kind?: "plain" | "primary" | "danger";
  icon?: IconName;
  disabled?: boolean;
  /** As wide as its panel. */
  wide?: boolean;
  /** Longer text on hover. */
  title?: string;
}) {
  const { children, onClick, kind = "plain", icon, disabled, wide, title } = props;
  return (
    <button type="button" class={`button ${kind} ${wide ? "wide" : ""}`} onClick={onClick} disabled={disabled} title={title}>
      {icon && <Icon name={icon} />}
      {children}
    </button>
  );
}

/** A button of a toolbar: an icon with a tooltip, or with its text beside it. `pressed` makes it a toggle. */
export function ToolButton(props: {
  label: string;
  icon?: IconName;
  /** An outline of your own, instead of `icon`. */
  path?: string;
  shortcut?: string;
  pressed?: boolean;
  disabled?: boolean;
  /** Shows the label beside the icon. */
  labelled?: boolean;
  /** Where the tooltip opens. */
  tip?: "top" | "bottom" | "left" | "right";
  onClick: () => void;
}) {
  const { label, icon, path, shortcut, pressed, disabled, labelled, tip = "bottom", onClick } = props;
  return (
    <button
      type="button"
      class={`tool ${labelled ? "labelled" : ""}`}
      aria-label={label}
      aria-pressed={pressed}
      aria-keyshortcuts={shortcut?.replace("Ctrl", "Control")}
      data-tip={!labelled || shortcut ? label : undefined}
      data-shortcut={shortcut}
      data-side={tip}
      disabled={disabled}
      onClick={onClick}
    >
      {(icon || path) && <Icon name={icon} path={path} />}
      {labelled && label}
    </button>
  );
}

/** A row (or column) of tools: one stop of the Tab key, arrow keys move inside. `<ToolDivider/>` separates groups. */
export function Toolbar(props: { label: string; vertical?: boolean; children: ComponentChildren; class?: string }) {
  const { label, vertical = false, children } = props;
  const bar = useRef<HTMLDivElement>(null);
  const onKeyDown = (event: KeyboardEvent) => moveFocus(event, bar.current, vertical);
  return (
    <div
      ref={bar}
      role="toolbar"
      aria-label={label}
      aria-orientation={vertical ? "vertical" : "horizontal"}
      class={`toolbar ${vertical ? "vertical" : ""} ${props.class ?? ""}`}
      onKeyDown={onKeyDown}
    >
      {children}
    </div>
  );
}

export const ToolDivider = () => <span class="divider" />;

/** Arrow keys, Home and End move the focus among the buttons of `within`. */
export function moveFocus(event: KeyboardEvent, within: HTMLElement | null, vertical: boolean) {
  const buttons = [...(within?.querySelectorAll<HTMLElement>("button:not(:disabled)") ?? [])];
  const at = buttons.indexOf(document.activeElement as HTMLElement);
  const steps: Record<string, number> = {
    [vertical ? "ArrowDown" : "ArrowRight"]: at + 1,
    [vertical ? "ArrowUp" : "ArrowLeft"]: at - 1,
    Home: 0,
    End: buttons.length - 1,
  };
  const to = steps[event.key];
  if (at < 0 || to === undefined) return;
  event.preventDefault();
  event.stopPropagation();
  buttons[(to + buttons.length) % buttons.length]?.focus();
}
