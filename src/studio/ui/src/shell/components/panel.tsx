// Panels of a side, tabs, and the layout of a workspace: view in the middle, sides and a bottom that can be resized.
import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useId, useRef } from "preact/hooks";
import "@awesome.me/webawesome/dist/components/split-panel/split-panel.js";
import { moveFocus } from "./button";
import { Icon } from "./icon";
import { remembered } from "../remembered";

/** A part of a side with a heading that folds it. What is folded is remembered by `title`. `actions`: tools right of the heading. */
export function Panel(props: { title: string; actions?: ComponentChildren; folded?: boolean; children: ComponentChildren }) {
  const { title, actions, folded = false, children } = props;
  const id = useId();
  const open = remembered(`panel ${title}`, !folded);
  return (
    <section class="panel" aria-labelledby={id}>
      <div class="panel-head">
        <h2 class="grow row">
          <button id={id} type="button" class="panel-toggle" aria-expanded={open.value} onClick={() => (open.value = !open.value)}>
            <Icon name="chevron" />
            <span class="ellipsis">{title}</span>
          </button>
        </h2>
        {actions}
      </div>
      {open.value && <div class="panel-body">{children}</div>}
    </section>
  );
}

/** Pages of which one is shown. */
export function Tabs<T extends string>(props: {
  label: string;
  tabs: readonly { id: T; label: string; content: () => ComponentChildren }[];
  selected: T;
  onSelect: (id: T) => void;
}) {
  const { label, tabs, selected, onSelect } = props;
  const id = useId();
  const list = useRef<HTMLDivElement>(null);
  const onKeyDown = (event: KeyboardEvent) => {
    moveFocus(event, list.current, false);
    const to = (document.activeElement as HTMLElement | null)?.dataset.tab;
    if (event.defaultPrevented && to) onSelect(to as T);
  };
  return (
    <div class="column" style={{ gap: 0, minHeight: 0 }}>
      <div ref={list} class="tabs" role="tablist" aria-label={label} onKeyDown={onKeyDown}>
        {tabs.map((tab) => (
          <button
            key={tab.id}
            type="button"
            id={`${id}-${tab.id}`}
            class="tab"
            role="tab"
            data-tab={tab.id}
            aria-selected={tab.id === selected}
            aria-controls={`${id}-page`}
            tabIndex={tab.id === selected ? 0 : -1}
            onClick={() => onSelect(tab.id)}
          >
            {tab.label}
          </button>
        ))}
      </div>
      <div id={`${id}-page`} role="tabpanel" aria-labelledby={`${id}-${selected}`}>
        {tabs.find((tab) => tab.id === selected)?.content()}
      </div>
    </div>
  );
}

const sizes = new Map<string, ReturnType<typeof signal<number>>>();

/** Two parts with a divider between; the size of the `fixed` one is remembered by `name`. */
function Split(props: {
  name: string; vertical?: boolean; fixed: "start" | "end"; size: number; start: ComponentChildren; end: ComponentChildren;
}) {
  const { name, vertical, fixed, size, start, end } = props;
  const kept = sizes.get(name) ?? remembered(`size ${name}`, size);
  sizes.set(name, kept);
  const onReposition = (event: Event) => {
    const panel = event.target as HTMLElement & { positionInPixels: number };
    if (panel === event.currentTarget && panel.positionInPixels > 0) kept.value = Math.round(panel.positionInPixels);
  };
  return (
    <wa-split-panel
      class={`split-${fixed}`}
      orientation={vertical ? "vertical" : "horizontal"}
      primary={fixed}
      position-in-pixels={kept.peek()}
      onwa-reposition={onReposition}
    >
      <div slot="start">{start}</div>
      <div slot="end">{end}</div>
    </wa-split-panel>
  );
}

/** The layout of a workspace. Sides scroll by themselves; `view` fills what is left. Sizes are remembered by `name`. */
export function Layout(props: {
  name: string; view: ComponentChildren; left?: ComponentChildren; right?: ComponentChildren; bottom?: ComponentChildren;
  leftSize?: number; rightSize?: number; bottomSize?: number;
}) {
  const { name, leftSize = 240, rightSize = 288, bottomSize = 168 } = props;
  let content = <div class="view">{props.view}</div>;
  if (props.bottom) {
    const bottom = <div class="bottom">{props.bottom}</div>;
    content = <Split name={`${name} bottom`} vertical fixed="end" size={bottomSize} start={content} end={bottom} />;
  }
  if (props.right) {
    const right = <div class="side">{props.right}</div>;
    content = <Split name={`${name} right`} fixed="end" size={rightSize} start={content} end={right} />;
  }
  if (props.left) {
    const left = <div class="side">{props.left}</div>;
    content = <Split name={`${name} left`} fixed="start" size={leftSize} start={left} end={content} />;
  }
  return <main class="layout">{content}</main>;
}
