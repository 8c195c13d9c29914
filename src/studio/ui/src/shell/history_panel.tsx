// The steps of a document; a click goes to one.
import { useEffect, useRef } from "preact/hooks";
import { historyShown } from "./commands";
import { ToolButton } from "./components";
import type { SocketConnection } from "./socket_connection";

export function HistoryPanel({ connection }: { connection: SocketConnection }) {
  const { steps, at, savedAt } = connection.history.value;
  const list = useRef<HTMLOListElement>(null);
  useEffect(() => list.current?.querySelector("[aria-current]")?.scrollIntoView({ block: "nearest" }), [at, steps.length]);
  const onKeyDown = (event: KeyboardEvent) => {
    const by = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
    if (by === 0) return;
    event.preventDefault();
    event.stopPropagation();
    const buttons = [...(list.current?.querySelectorAll<HTMLElement>("button") ?? [])];
    buttons[buttons.indexOf(document.activeElement as HTMLElement) + by]?.focus();
  };
  return (
    <aside class="history" aria-label="History">
      <div class="panel-head">
        <h2 class="grow">History</h2>
        <ToolButton icon="close" label="Close the history" onClick={() => (historyShown.value = false)} />
      </div>
      <ol ref={list} class="history-list scroll" onKeyDown={onKeyDown}>
        {steps.map(({ label }, step) => (
          <li key={step}>
            <button type="button" class={`history-step ${step > at ? "undone" : ""}`} aria-current={step === at ? "step" : undefined} onClick={() => connection.goTo(step)}>
              <span class="num muted">{step}</span>
              <span class="grow ellipsis">{label}</span>
              {step === savedAt && <span class="muted">saved</span>}
            </button>
          </li>
        ))}
      </ol>
    </aside>
  );
}
