// All commands: the shell's own and those of the shown workspace. Menus, palette, shortcuts and the list of shortcuts read them here.
import { computed, signal } from "@preact/signals";
import type { Command } from "../workspace";
import { newLink } from "./api";
import { active, close, documents, show } from "./documents";
import { notify } from "./notices";
import { matches, taken } from "./shortcuts";
import { themeChoice } from "./theme";

/** What is open above the workspace. */
export type Overlay = "palette" | "shortcuts" | "picker" | "about";
export const overlay = signal<Overlay | null>(null);
export const historyShown = signal(false);

const SHELL_GROUPS = ["File", "Edit", "View", "Help"];

const hasDocument = () => active.value !== null;

const shell: Command[] = [
  { id: "open", title: "Open…", group: "File", shortcut: "Ctrl+O", run: () => (overlay.value = "picker") },
  { id: "save", title: "Save", group: "File", shortcut: "Ctrl+S", enabled: hasDocument, run: () => void active.value?.connection.save() },
  { id: "start", title: "Start page", group: "File", run: () => show(null) },
  { id: "next-document", title: "Next document", group: "File", shortcut: "Alt+N", enabled: () => documents.value.length > 0, run: nextDocument },
  {
    id: "close", title: "Close document", group: "File", shortcut: "Alt+W", enabled: hasDocument,
    run: () => active.value && close(active.value.info.document),
  },
  { id: "link", title: "Copy a link for another window", group: "File", run: () => void copyLink() },
  { id: "undo", title: "Undo", group: "Edit", shortcut: "Ctrl+Z", enabled: canUndo, run: () => active.value?.connection.undo() },
  { id: "redo", title: "Redo", group: "Edit", shortcut: "Ctrl+Shift+Z", enabled: canRedo, run: () => active.value?.connection.redo() },
  { id: "history", title: "History", group: "Edit", shortcut: "Alt+H", enabled: hasDocument, run: () => (historyShown.value = !historyShown.value) },
  { id: "theme-system", title: "Theme of the system", group: "View", run: () => (themeChoice.value = "system") },
  { id: "theme-light", title: "Light theme", group: "View", run: () => (themeChoice.value = "light") },
  { id: "theme-dark", title: "Dark theme", group: "View", run: () => (themeChoice.value = "dark") },
  { id: "palette", title: "Find a command…", group: "Help", shortcut: "Ctrl+K", run: () => (overlay.value = "palette") },
  { id: "shortcuts", title: "Keyboard shortcuts", group: "Help", shortcut: "?", run: () => (overlay.value = "shortcuts") },
  { id: "about", title: "About plumbline studio", group: "Help", run: () => (overlay.value = "about") },
];

/** Other keys for commands. */
const ALIASES: Record<string, string> = { "Ctrl+Y": "redo" };

/** Every command that exists now. */
export const commands = computed<readonly Command[]>(() => {
  const document = active.value;
  const page = document?.page.value;
  return page && document ? [...shell, ...page.commands(document.connection)] : shell;
});

/** Groups as menus: File and Edit, those of the workspace, View and Help. */
export const menus = computed(() => {
  const groups = [...new Set(commands.value.map((command) => command.group))];
  const own = groups.filter((group) => !SHELL_GROUPS.includes(group));
  return ["File", "Edit", ...own, "View", "Help"].map((title) => ({
    title,
    // What a workspace adds to a menu of the shell comes first.
    items: commands.value.filter((command) => command.group === title).sort((a, b) => Number(shell.includes(a)) - Number(shell.includes(b))),
  }));
});

export const enabled = (command: Command) => command.enabled?.() ?? true;

export const byId = (id: string) => commands.value.find((command) => command.id === id);

/** Runs the command that a key event means, if any. */
export function runShortcut(event: KeyboardEvent) {
  if (event.defaultPrevented || event.isComposing || overlay.value !== null) return;
  const alias = Object.keys(ALIASES).find((shortcut) => matches(event, shortcut) && !taken(event, shortcut));
  // A workspace's commands come last in the list and first here: its keys win.
  const command = alias
    ? byId(ALIASES[alias] ?? "")
    : [...commands.value].reverse().find(({ shortcut }) => shortcut && matches(event, shortcut) && !taken(event, shortcut));
  if (!command) return;
  event.preventDefault();
  if (enabled(command)) command.run();
}

async function copyLink() {
  try {
    await navigator.clipboard.writeText(await newLink());
    notify("info", "A link that works once is in the clipboard.");
  } catch (error) {
    notify("error", `The link could not be copied: ${(error as Error).message}`);
  }
}
function canUndo() {
  return (active.value?.connection.history.value.at ?? 0) > 0;
}
function canRedo() {
  const history = active.value?.connection.history.value;
  return history !== undefined && history.at < history.steps.length - 1;
}
function nextDocument() {
  const order = [null, ...documents.value.map(({ info }) => info.document)];
  show(order[(order.indexOf(active.value?.info.document ?? null) + 1) % order.length] ?? null);
}
