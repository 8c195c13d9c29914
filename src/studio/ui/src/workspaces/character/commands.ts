// All actions of the workspace as commands: in the menus, the palette and the list of shortcuts.
import type { Command } from "../../workspace";
import { TABS, type Page } from "./page";
import type { SkeletonMode } from "./skeleton_tools";

export function commandsOf(page: Page): Command[] {
  return [...tabs(page), ...skeleton(page), ...weights(page), ...pose(page), ...animation(page), ...view(page), ...files(page)];
}

const chosen = (page: Page) => page.active !== null;
const on = (page: Page, ...names: string[]) => () => names.includes(page.tab.value);

function tabs(page: Page): Command[] {
  return TABS.map(({ id, label }, i) => ({ id: `tab-${id}`, title: label, group: "Mode", shortcut: `Ctrl+${i + 1}`, run: () => (page.tab.value = id) }));
}

function skeleton(page: Page): Command[] {
  const { actions } = page;
  const group = "Skeleton";
  const here = on(page, "skeleton");
  const active = () => here() && chosen(page);
  const mode = (id: SkeletonMode, title: string, shortcut: string): Command =>
    ({ id: `tool-${id}`, title, group, shortcut, enabled: here, run: () => (page.mode.value = id) });
  return [
    { id: "extract", title: "Extract skeleton", group, shortcut: "Shift+X", enabled: here, run: () => actions.extract({}) },
    mode("select", "Move joints", "V"), mode("add", "Add joints", "A"), mode("extrude", "Extrude by drag", "Shift+E"),
    mode("split", "Split bones", "Shift+S"), mode("pin", "Pin ends", "Shift+P"),
    { id: "add-center", title: "Add joint at the center of the view", group, shortcut: "Shift+A", enabled: here, run: () => page.addAtCenter() },
    { id: "extrude", title: "Extrude joint", group, shortcut: "E", enabled: active, run: () => actions.extrudeSelected() },
    { id: "split", title: "Split bone", group, shortcut: "S", enabled: () => active() && page.active?.parent !== null, run: () => actions.split(page.active!.index, 0.5) },
    { id: "dissolve", title: "Dissolve joints", group, shortcut: "Ctrl+Delete", enabled: active, run: () => actions.dissolve(page.selected.value) },
    { id: "remove", title: "Delete joints", group, shortcut: "Delete", enabled: active, run: () => actions.remove(page.selected.value) },
    { id: "mirror", title: "Mirror joint", group, shortcut: "M", enabled: active, run: () => actions.mirror(page.active!.index) },
    { id: "with-children", title: "Children move along: on or off", group, shortcut: "C", enabled: here, run: () => (page.withChildren.value = !page.withChildren.value) },
  ];
}

function weights(page: Page): Command[] {
  const here = on(page, "weights");
  const group = "Weights";
  const { brush, actions } = page;
  const scaled = (factor: number) => () => (brush.size.value = Math.min(0.3, Math.max(0.005, brush.size.value * factor)));
  return [
    ...([["add", "1"], ["subtract", "2"], ["replace", "3"], ["smooth", "4"]] as const).map(([op, key]): Command => (
      { id: `brush-${op}`, title: `Brush: ${op}`, group, shortcut: `Alt+${key}`, enabled: here, run: () => (brush.op.value = op) })),
    { id: "brush-larger", title: "Larger brush", group, shortcut: "]", enabled: here, run: scaled(1.25) },
    { id: "brush-smaller", title: "Smaller brush", group, shortcut: "[", enabled: here, run: scaled(0.8) },
    { id: "brush-mirror", title: "Mirrored brush: on or off", group, shortcut: "X", enabled: here, run: () => (brush.mirror.value = !brush.mirror.value) },
    { id: "paint-center", title: "Paint at the center of the view", group, shortcut: "P", enabled: () => here() && chosen(page), run: () => page.paintAtCenter() },
    { id: "compute", title: "Compute weights again", group, shortcut: "Shift+W", enabled: here, run: () => actions.computeWeights(page.state.value.weights) },
  ];
}

function pose(page: Page): Command[] {
  const here = on(page, "pose", "animate");
  const active = () => here() && chosen(page);
  const group = "Pose";
  const { actions } = page;
  const kind = (id: "position" | "orientation" | "pole" | "look_at", title: string, shortcut: string): Command =>
    ({ id: `target-${id}`, title, group, shortcut, enabled: active, run: () => actions.addTarget(page.active!.index, id) });
  return [
    kind("position", "Pin joint", "P"), kind("orientation", "Keep orientation", "Shift+O"), kind("pole", "Add pole", "Shift+L"), kind("look_at", "Look at", "L"),
    { id: "bake", title: "Keep pose, remove targets", group, shortcut: "B", enabled: here, run: () => actions.bakePose() },
    { id: "reset-joint", title: "Reset joints", group, shortcut: "R", enabled: active, run: () => actions.resetPose(page.selected.value) },
    { id: "reset-pose", title: "Reset pose", group, shortcut: "Shift+R", enabled: here, run: () => actions.resetPose(null) },
    { id: "mirror-pose", title: "Mirror pose", group, shortcut: "Shift+M", enabled: here, run: () => actions.mirrorPose() },
    { id: "store-pose", title: "Store pose in the library", group, shortcut: "Shift+K", enabled: here, run: () => actions.storePose(`pose ${page.state.value.poses.length + 1}`) },
  ];
}

function animation(page: Page): Command[] {
  const { playback, actions } = page;
  const here = on(page, "animate", "compare");
  const group = "Animation";
  return [
    { id: "play", title: "Play or pause", group, shortcut: "Space", enabled: here, run: playback.toggle },
    { id: "frame-back", title: "Back one frame", group, shortcut: ",", enabled: here, run: () => playback.step(-1) },
    { id: "frame-on", title: "Forward one frame", group, shortcut: ".", enabled: here, run: () => playback.step(1) },
    { id: "key", title: "Add keys of the chosen joints", group, shortcut: "K", enabled: here, run: () => actions.keySelected() },
    { id: "key-delete", title: "Delete chosen keys", group, shortcut: "Shift+Delete", enabled: () => here() && page.selectedKeys.value.length > 0, run: () => actions.removeKeys(page.selectedKeys.value) },
    { id: "new-clip", title: "New clip", group, shortcut: "Shift+N", enabled: here, run: () => actions.addClip() },
    { id: "onion", title: "Onion skins: on or off", group, shortcut: "O", enabled: here, run: () => (page.onion.on.value = !page.onion.on.value) },
    { id: "curves", title: "Curves: on or off", group, shortcut: "Shift+C", enabled: here, run: () => (page.curves.value = !page.curves.value) },
  ];
}

function view(page: Page): Command[] {
  return [
    { id: "wireframe", title: "Wireframe", group: "View", shortcut: "W", run: () => (page.wireframe.value = !page.wireframe.value) },
    { id: "joints", title: "Joints over the surface", group: "View", shortcut: "J", run: () => (page.showJoints.value = !page.showJoints.value) },
    { id: "select-all", title: "Choose all joints", group: "Edit", shortcut: "Ctrl+A", run: () => page.select(page.joints.value.map((j) => j.index)) },
    { id: "select-parent", title: "Choose the parent", group: "Edit", shortcut: "[", enabled: () => page.tab.value !== "weights" && chosen(page) && page.active?.parent !== null, run: () => page.select([page.active!.parent!]) },
    { id: "select-none", title: "Choose nothing", group: "Edit", shortcut: "Esc", run: () => page.select([]) },
  ];
}

function files(page: Page): Command[] {
  const { actions } = page;
  return [
    { id: "import", title: "Import skeleton, clip or weights…", group: "File", shortcut: "Ctrl+I", run: () => actions.chooseImport() },
    { id: "export-glb", title: "Export GLB with clip", group: "File", shortcut: "Ctrl+E", run: () => actions.export("glb") },
    { id: "export-bvh", title: "Export BVH", group: "File", run: () => actions.export("bvh") },
    { id: "export-obj", title: "Export OBJ frames", group: "File", run: () => actions.export("obj") },
    { id: "copy-command", title: "Copy as command", group: "File", shortcut: "Ctrl+Shift+C", run: () => actions.copyCommand() },
  ];
}
