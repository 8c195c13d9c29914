// Files dropped anywhere in the window.
import { signal } from "@preact/signals";
import { Icon } from "./components";
import { openDropped } from "./documents";

const over = signal(false);
const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;

/** Watches the window; returns the way to stop. */
export function watchDrops(): () => void {
  const onDragOver = (event: DragEvent) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    over.value = true;
  };
  const onDragLeave = (event: DragEvent) => {
    if (event.relatedTarget === null) over.value = false;
  };
  const onDrop = (event: DragEvent) => {
    over.value = false;
    if (!hasFiles(event)) return;
    event.preventDefault();
    void openDropped([...(event.dataTransfer?.files ?? [])]);
  };
  const handlers = { dragover: onDragOver, dragleave: onDragLeave, drop: onDrop };
  for (const [name, handler] of Object.entries(handlers)) window.addEventListener(name, handler as EventListener);
  return () => {
    for (const [name, handler] of Object.entries(handlers)) window.removeEventListener(name, handler as EventListener);
  };
}

export function DropTarget() {
  if (!over.value) return null;
  return <div class="drop-target" aria-hidden="true"><Icon name="upload" /><span>Drop to open</span></div>;
}
