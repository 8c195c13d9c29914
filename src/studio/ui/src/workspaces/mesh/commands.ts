// Commands of the mesh workspace.
import type { Command } from "../../workspace";
import type { Edit, Overlay } from "../../generated/mesh";
import { copyCommand, savePicture } from "./output_panel";
import type { MeshPage, ToolName } from "./page";
import { addKey } from "./timeline";
import { active, openPath } from "../../shell/documents";

export function commandsOf(page: MeshPage): Command[] {
  return [...selection(page), ...handles(page), ...tools(page), ...views(page), ...files(page)];
}

function selection(page: MeshPage): Command[] {
  const edit = (id: string, title: string, edit: Edit, shortcut?: string): Command =>
    ({ id, title, group: "Select", shortcut, run: () => void page.edit(edit) });
  return [
    edit("select-all", "Select all", { do: "select_all" }, "A"),
    edit("select-none", "Select nothing", { do: "select_none" }, "Alt+A"),
    edit("select-inverse", "Invert selection", { do: "select_inverse" }, "Ctrl+I"),
    edit("select-connected", "Select connected", { do: "select_connected" }, "L"),
    edit("select-grow", "Grow by a ring", { do: "select_rings", rings: 1 }, "]"),
    edit("select-shrink", "Shrink by a ring", { do: "select_rings", rings: -1 }, "["),
  ];
}

function handles(page: MeshPage): Command[] {
  const { state } = page;
  const selected = () => (state.value?.selection.count ?? 0) > 0;
  const moves = () => page.active.value !== null && page.active.value.kind !== "fixed";
  const make = (kind: "fixed" | "rigid" | "free", title: string, shortcut: string): Command =>
    ({ id: `make-${kind}`, title, group: "Handle", shortcut, enabled: selected, run: () => void page.edit({ do: "add_handle", kind }) });
  const nudge = (id: string, title: string, shortcut: string, right: number, up: number): Command =>
    ({ id, title, group: "Handle", shortcut, enabled: moves, run: () => page.nudge(right, up) });
  const step = (by: number) => {
    const { active, handles: all } = state.value;
    if (all.length > 0) void page.edit({ do: "activate", handle: ((active ?? (by > 0 ? -1 : 0)) + by + all.length) % all.length });
  };
  return [
    make("fixed", "Fix the selection", "F"),
    make("rigid", "Make the selection a rigid handle", "H"),
    make("free", "Make the selection a free handle", "Shift+H"),
    { id: "next-handle", title: "Next handle", group: "Handle", shortcut: "N", run: () => step(1) },
    { id: "previous-handle", title: "Previous handle", group: "Handle", shortcut: "Shift+N", run: () => step(-1) },
    nudge("nudge-left", "Move left", "4", -10, 0),
    nudge("nudge-right", "Move right", "6", 10, 0),
    nudge("nudge-up", "Move up", "8", 0, 10),
    nudge("nudge-down", "Move down", "2", 0, -10),
    { id: "turn-left", title: "Rotate left in the view", group: "Handle", shortcut: ",", enabled: moves, run: () => page.turn(-5) },
    { id: "turn-right", title: "Rotate right in the view", group: "Handle", shortcut: ".", enabled: moves, run: () => page.turn(5) },
    {
      id: "reset-handle", title: "Back to rest", group: "Handle", enabled: moves,
      run: () => state.value.active !== null && void page.edit({ do: "reset", handle: state.value.active, time: page.time.value }),
    },
    {
      id: "delete-handle", title: "Delete handle", group: "Handle", enabled: () => page.active.value !== null,
      run: () => state.value.active !== null && void page.edit({ do: "delete_handles", handles: [state.value.active] }),
    },
    { id: "add-key", title: "Add key", group: "Handle", shortcut: "K", enabled: moves, run: () => addKey(page, page.time.value) },
    { id: "play", title: "Play", group: "Handle", shortcut: "Space", run: () => page.togglePlayback() },
  ];
}

function tools(page: MeshPage): Command[] {
  const tool = (name: ToolName, title: string, shortcut?: string): Command =>
    ({ id: `tool-${name}`, title, group: "Tools", shortcut, run: () => (page.tool.value = name) });
  const mode = (name: "translate" | "rotate" | "scale", title: string, shortcut: string): Command =>
    ({ id: `gizmo-${name}`, title, group: "Tools", shortcut, run: () => (page.mode.value = name) });
  return [
    tool("select", "Select", "Q"), tool("brush", "Select by brush", "B"), tool("lasso", "Select by lasso", "O"), tool("grab", "Grab and drag", "G"),
    tool("region", "Paint the region of influence"),
    mode("translate", "Move gizmo", "W"), mode("rotate", "Rotate gizmo", "E"), mode("scale", "Scale gizmo", "R"),
    { id: "snap", title: "Snap", group: "Tools", shortcut: "Shift+S", run: () => (page.snap.value = !page.snap.value) },
  ];
}

function views(page: MeshPage): Command[] {
  const colors = (kind: Overlay, title: string): Command =>
    ({ id: `colors-${kind}`, title, group: "View", run: () => page.connection.view({ overlay: kind }) });
  return [
    { id: "rig-mesh", title: "Rig this mesh: open as a character", group: "Tools", run: () => void rig() },
    { id: "fit", title: "Show all", group: "View", shortcut: "Home", run: () => page.view?.fit() },
    { id: "wireframe", title: "Wireframe", group: "View", shortcut: "Shift+W", run: () => (page.wireframe.value = !page.wireframe.value) },
    { id: "flat", title: "Flat shading", group: "View", run: () => (page.flat.value = !page.flat.value) },
    colors("none", "Colors: handles"), colors("distortion", "Colors: distortion"), colors("energy", "Colors: energy per vertex"),
    colors("displacement", "Colors: displacement"), colors("flipped", "Colors: flipped faces"),
  ];
}

function files(page: MeshPage): Command[] {
  return [
    { id: "export-mesh", title: "Export mesh as OBJ", group: "File", run: () => void page.download({ ask: "export", format: "obj" }) },
    { id: "export-picture", title: "Save picture", group: "File", run: () => void savePicture(page) },
    { id: "copy-command", title: "Copy as command", group: "File", run: () => void copyCommand(page) },
  ];
}

/** Opens the mesh that is shown in the character workspace. */
async function rig() {
  const info = active.peek()?.info;
  if (info) await openPath(info.path, "character");
}
