// Short texts for the user: what failed, what a method warns of. Read aloud as they come.
import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { Icon, ToolButton } from "./components";

export type Level = "info" | "warning" | "error";
interface Notice { id: number; level: Level; text: string; count: number }

const MAX_SHOWN = 5;
const SECONDS: Record<Level, number> = { info: 5, warning: 10, error: 20 };

/** What is shown now, the newest last. */
export const notices = signal<Notice[]>([]);
let next = 1;

/** Shows a text for a while; the same text again is counted, not repeated. */
export function notify(level: Level, text: string) {
  const same = notices.value.find((notice) => notice.text === text && notice.level === level);
  const notice = { id: next++, level, text, count: (same?.count ?? 0) + 1 };
  notices.value = [...notices.value.filter((other) => other !== same), notice].slice(-MAX_SHOWN);
  setTimeout(() => dismiss(notice.id), SECONDS[level] * 1000);
}

export function dismiss(id: number) {
  if (notices.value.some((notice) => notice.id === id)) notices.value = notices.value.filter((notice) => notice.id !== id);
}

/** The notices, at the lower right: above dialogs too, which cover everything else. */
export function Notices() {
  const box = useRef<HTMLElement>(null);
  const shown = notices.value;
  useEffect(() => {
    box.current?.hidePopover();
    if (shown.length > 0) box.current?.showPopover();
  }, [shown]);
  return (
    <section ref={box} popover="manual" class="notices" aria-label="Notices" aria-live="polite" aria-relevant="additions">
      {shown.map(({ id, level, text, count }) => (
        <div key={id} class={`notice ${level}`} role={level === "error" ? "alert" : "status"}>
          <Icon name={level} />
          <span class="grow">
            {text}
            {count > 1 && <span class="muted"> ({count} times)</span>}
          </span>
          <ToolButton icon="close" label="Dismiss" tip="left" onClick={() => dismiss(id)} />
        </div>
      ))}
    </section>
  );
}
