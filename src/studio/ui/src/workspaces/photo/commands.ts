// Commands of the photo workspace: every action, with its key.
import type { Command } from "../../workspace";
import type { PhotoPage, Tool } from "./page";

export function commandsOf(page: PhotoPage): Command[] {
  return [...tools(page), ...lines(page), ...moves(page), ...views(page), ...files(page)];
}

function tools(page: PhotoPage): Command[] {
  const tool = (id: Tool, title: string, shortcut: string): Command => ({ id: `tool-${id}`, title, group: "Tools", shortcut, run: () => page.setTool(id) });
  return [
    tool("select", "Select and move", "V"),
    tool("line", "Draw lines", "L"),
    tool("face", "Draw faces", "F"),
    { id: "finish-line", title: "Finish the line", group: "Tools", shortcut: "Enter", enabled: () => page.drawing.value.length > 1, run: () => page.finishLine() },
    { id: "cancel-line", title: "Cancel", group: "Tools", shortcut: "Esc", run: () => page.setTool("select") },
  ];
}

function lines(page: PhotoPage): Command[] {
  const selected = () => page.selected.value.lines.length > 0;
  const something = () => selected() || page.selected.value.faces.length > 0;
  const one = () => page.line.value !== null;
  return [
    { id: "add-line", title: "Add a line in the middle", group: "Lines", shortcut: "Shift+L", run: () => page.addLineInMiddle() },
    { id: "add-face", title: "Add a face in the middle", group: "Lines", shortcut: "Shift+F", run: () => page.addFaceInMiddle() },
    { id: "orient-free", title: "Free", group: "Lines", shortcut: "1", run: () => page.orient("free") },
    { id: "orient-horizontal", title: "Horizontal", group: "Lines", shortcut: "2", run: () => page.orient("horizontal") },
    { id: "orient-vertical", title: "Vertical", group: "Lines", shortcut: "3", run: () => page.orient("vertical") },
    { id: "switch", title: "Switch off or on", group: "Lines", shortcut: "O", enabled: something, run: () => page.switchSelected() },
    { id: "insert-point", title: "Insert a point", group: "Lines", shortcut: "I", enabled: one, run: () => page.insertPoint() },
    { id: "snap-line", title: "Snap to the edge", group: "Lines", shortcut: "S", enabled: one, run: () => void page.edit({ do: "snap_line", line: page.line.value ?? 0 }) },
    { id: "adopt", title: "Adopt found lines", group: "Lines", shortcut: "A", enabled: () => (page.state.value.found?.length ?? 0) > 0, run: () => page.adopt() },
    { id: "delete", title: "Delete", group: "Lines", shortcut: "Del", enabled: something, run: () => page.deleteSelected() },
  ];
}

function moves(page: PhotoPage): Command[] {
  const something = () => page.line.value !== null || page.face.value !== null;
  const nudge = (name: string, key: string, dx: number, dy: number, factor: number): Command => ({
    id: `nudge-${name}-${factor}`, title: `Move ${name} by ${factor} px`, group: "Move", shortcut: `Alt+${factor > 1 ? "Shift+" : ""}${key}`, enabled: something,
    run: () => page.nudge(dx * factor, dy * factor),
  });
  const all = (factor: number) => [nudge("left", "Left", -1, 0, factor), nudge("right", "Right", 1, 0, factor), nudge("up", "Up", 0, -1, factor), nudge("down", "Down", 0, 1, factor)];
  return [
    { id: "next-point", title: "Next point", group: "Move", shortcut: ".", run: () => page.step(1) },
    { id: "previous-point", title: "Previous point", group: "Move", shortcut: ",", run: () => page.step(-1) },
    ...all(1), ...all(10),
    { id: "face-wider", title: "Face larger", group: "Move", shortcut: "]", enabled: () => page.face.value !== null, run: () => page.grow(4, 4) },
    { id: "face-narrower", title: "Face smaller", group: "Move", shortcut: "[", enabled: () => page.face.value !== null, run: () => page.grow(-4, -4) },
  ];
}

function views(page: PhotoPage): Command[] {
  const { camera } = page;
  const zoom = (factor: number) => camera.zoomAt(factor, camera.middle.value[0], camera.middle.value[1]);
  return [
    { id: "zoom-in", title: "Zoom in", group: "View", shortcut: "+", run: () => zoom(1.5) },
    { id: "zoom-out", title: "Zoom out", group: "View", shortcut: "-", run: () => zoom(1 / 1.5) },
    { id: "zoom-fit", title: "Whole picture", group: "View", shortcut: "0", run: () => camera.fit() },
    { id: "grid", title: "Grid of the map", group: "View", shortcut: "G", run: () => (page.showGrid.value = !page.showGrid.value) },
    { id: "found", title: "Found lines", group: "View", shortcut: "D", run: () => (page.showFound.value = !page.showFound.value) },
  ];
}

function files(page: PhotoPage): Command[] {
  return [
    { id: "export", title: "Export picture", group: "File", shortcut: "Ctrl+E", enabled: () => page.state.value.result !== null, run: page.exportPicture },
    { id: "copy-command", title: "Copy as command", group: "File", run: () => void page.copyCommand() },
  ];
}
