// Shortcuts: written as shown ("Ctrl+Shift+Z", "G", "Space", "?"), matched against key events.

const NAMES: Record<string, string> = {
  Space: " ", Left: "ArrowLeft", Right: "ArrowRight", Up: "ArrowUp", Down: "ArrowDown", Esc: "Escape", Del: "Delete",
};

/** Whether an event is this shortcut. On a Mac the command key counts as Ctrl. */
export function matches(event: KeyboardEvent, shortcut: string): boolean {
  const parts = shortcut === "+" ? ["+"] : shortcut.split("+");
  const key = parts[parts.length - 1] ?? "";
  const wanted = (NAMES[key] ?? key).toLowerCase();
  // Signs such as "?" need Shift on some keyboards and not on others.
  const sign = wanted.length === 1 && !/[a-z0-9 ]/.test(wanted);
  const pressed = event.key.toLowerCase();
  const byCode = event.altKey && event.code.toLowerCase() === `key${wanted}`;
  return (
    (pressed === wanted || byCode) &&
    (event.ctrlKey || event.metaKey) === parts.includes("Ctrl") &&
    event.altKey === parts.includes("Alt") &&
    (sign || event.shiftKey === parts.includes("Shift"))
  );
}

/** Whether the focus is where keys are typed or mean something else, so that this shortcut must not run. */
export function taken(event: KeyboardEvent, shortcut: string): boolean {
  const target = event.target as HTMLElement | null;
  if (!target?.closest) return false;
  const withControl = shortcut.startsWith("Ctrl+");
  if (target.matches("input[type=checkbox], input[type=range], select")) return !withControl && (shortcut.length === 1 || shortcut === "Space");
  if (target.closest("input, textarea, [contenteditable]")) return !withControl || /^Ctrl\+(Shift\+)?[ZYACVX]$/.test(shortcut);
  return (shortcut === "Space" || shortcut === "Enter") && target.closest("button, a") !== null;
}
