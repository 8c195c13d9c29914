// All actions of the workspace as commands: in the menus, the palette and the list of shortcuts.
import type { Command } from "../../workspace";
import { copiedPose } from "./actions";
import { TABS, type Page, type TabName } from "./page";
import type { SkeletonMode } from "./skeleton_tools";

/** All of them. A key may mean one thing in each mode: those that mean something in another mode have no key now. */
export function commandsOf(page: Page): ModeCommand[] {
  const all = [...tabs(page), ...nudges(page), ...skeleton(page), ...weights(page), ...pose(page), ...animation(page), ...view(page), ...files(page)];
  const now = all.filter((command) => !command.tabs || command.tabs.includes(page.tab.value));
  const taken = new Set(now.map(({ shortcut }) => shortcut));
  return all.map(({ tabs, enabled, ...command }) => {
    const here = () => !tabs || tabs.includes(page.tab.value);
    const shortcut = tabs && !here() && taken.has(command.shortcut) ? undefined : command.shortcut;
    return { ...command, shortcut, enabled: () => (enabled?.() ?? true) };
  });
}

/** A command of some modes; of all where they are left out. */
type ModeCommand = Command & { tabs?: readonly TabName[] };

/** The same for several commands. */
const of = (tabs: readonly TabName[], commands: readonly Command[]): ModeCommand[] => commands.map((command) => ({ ...command, tabs }));

const chosen = (page: Page) => page.active !== null;

const MODE_KEYS = ["Alt+S", "Alt+T", "Alt+P", "Alt+A", "Alt+C"];

function tabs(page: Page): ModeCommand[] {
  return TABS.map(({ id, label }, i) => ({ id: `tab-${id}`, title: label, group: "Mode", shortcut: MODE_KEYS[i], run: () => (page.tab.value = id) }));
}

/** Pixels of one press of an arrow key. */
const NUDGE = 12;

/** The arrow keys do what a drag of the joint does: move it in the skeleton, pull its limb in a pose. */
function nudges(page: Page): ModeCommand[] {
  const sides = [["Left", -1, 0], ["Right", 1, 0], ["Up", 0, 1], ["Down", 0, -1]] as const;
  return of(["skeleton", "pose", "animate"], sides.map(([key, x, y]) => ({
    id: `nudge-${key}`, title: `Pull joint ${key.toLowerCase()}`, group: "Joint", shortcut: `Alt+Shift+${key}`, enabled: () => chosen(page), run: () => page.nudge(NUDGE * x, NUDGE * y),
  })));
}

function skeleton(page: Page): ModeCommand[] {
  const { actions } = page;
  const group = "Skeleton";
  const active = () => chosen(page);
  const mode = (id: SkeletonMode, title: string, shortcut: string): Command =>
    ({ id: `tool-${id}`, title, group, shortcut, run: () => (page.mode.value = id) });
  return of(["skeleton"], [
    { id: "extract", title: "Extract skeleton", group, shortcut: "Shift+X", run: () => actions.extract({}) },
    mode("select", "Move joints", "V"), mode("add", "Add joints", "A"), mode("extrude", "Extrude by drag", "Shift+E"),
    mode("split", "Split bones", "Shift+S"), mode("pin", "Pin ends", "Shift+P"),
    { id: "add-center", title: "Add joint at the center of the view", group, shortcut: "Shift+A", run: () => page.addAtCenter() },
    { id: "extrude", title: "Extrude joint", group, shortcut: "E", enabled: active, run: () => actions.extrudeSelected() },
    { id: "split", title: "Split bone", group, shortcut: "S", enabled: () => active() && page.active?.parent !== null, run: () => actions.split(page.active!.index, 0.5) },
    { id: "dissolve", title: "Dissolve joints", group, shortcut: "Ctrl+Del", enabled: active, run: () => actions.dissolve(page.selected.value) },
    { id: "remove", title: "Delete joints", group, shortcut: "Del", enabled: active, run: () => actions.remove(page.selected.value) },
    { id: "mirror", title: "Mirror joint", group, shortcut: "M", enabled: active, run: () => actions.mirror(page.active!.index) },
    { id: "with-children", title: "Children move along: on or off", group, shortcut: "C", run: () => (page.withChildren.value = !page.withChildren.value) },
  ]);
}

function weights(page: Page): ModeCommand[] {
  const group = "Weights";
  const { brush, actions } = page;
  const scaled = (factor: number) => () => (brush.size.value = Math.min(0.3, Math.max(0.005, brush.size.value * factor)));
  return of(["weights"], [
    ...([["add", "A"], ["subtract", "S"], ["replace", "R"], ["smooth", "F"]] as const).map(([op, key]): Command => (
      { id: `brush-${op}`, title: `Brush: ${op}`, group, shortcut: key, run: () => (brush.op.value = op) })),
    { id: "brush-larger", title: "Larger brush", group, shortcut: "]", run: scaled(1.25) },
    { id: "brush-smaller", title: "Smaller brush", group, shortcut: "[", run: scaled(0.8) },
    { id: "brush-mirror", title: "Mirrored brush: on or off", group, shortcut: "X", run: () => (brush.mirror.value = !brush.mirror.value) },
    { id: "paint-center", title: "Paint at the center of the view", group, shortcut: "P", enabled: () => chosen(page), run: () => page.paintAtCenter() },
    { id: "compute", title: "Compute weights again", group, shortcut: "Shift+W", run: () => actions.computeWeights(page.state.value.weights) },
  ]);
}

function pose(page: Page): ModeCommand[] {
  const active = () => chosen(page);
  const group = "Pose";
  const { actions } = page;
  const copied = () => copiedPose.value !== null;
  const kind = (id: "pole" | "look_at", title: string, shortcut: string): Command =>
    ({ id: `target-${id}`, title, group, shortcut, enabled: active, run: () => actions.addTarget(page.active!.index, id) });
  return of(["pose", "animate"], [
    { id: "pin", title: "Pin joint, or let it go", group, shortcut: "P", enabled: active, run: () => actions.pin(page.active!.index, false) },
    { id: "pin-flat", title: "Pin position and orientation", group, shortcut: "Shift+P", enabled: active, run: () => actions.pin(page.active!.index, true) },
    kind("pole", "Add pole", "Shift+L"), kind("look_at", "Look at", "L"),
    { id: "bake", title: "Keep pose, remove targets", group, shortcut: "B", run: () => actions.bakePose() },
    { id: "reset-joint", title: "Reset joints", group, shortcut: "R", enabled: active, run: () => actions.resetPose(page.selected.value) },
    { id: "reset-pose", title: "Reset pose", group, shortcut: "Shift+R", run: () => actions.resetPose(null) },
    { id: "lock", title: "Lock joints, or unlock them", group, shortcut: "X", enabled: active, run: () => actions.toggleLock() },
    { id: "copy-pose", title: "Copy pose", group, shortcut: "Ctrl+C", enabled: () => !getSelection()?.toString(), run: () => actions.copyPose() },
    { id: "paste-pose", title: "Paste pose", group, shortcut: "Ctrl+V", enabled: copied, run: () => actions.pastePose(false, null) },
    { id: "paste-mirrored", title: "Paste mirrored pose", group, shortcut: "Ctrl+Shift+V", enabled: copied, run: () => actions.pastePose(true, null) },
    { id: "paste-chosen", title: "Paste pose to chosen joints", group, shortcut: "Alt+V", enabled: () => copied() && active(), run: () => actions.pastePose(false, page.selected.value) },
    { id: "mirror-pose", title: "Mirror pose", group, shortcut: "Shift+M", run: () => actions.mirrorPose() },
    { id: "store-pose", title: "Store pose in the library", group, shortcut: "Shift+K", run: () => actions.storePose(`pose ${page.state.value.poses.length + 1}`) },
  ]);
}

function animation(page: Page): ModeCommand[] {
  const { playback, actions } = page;
  const group = "Animation";
  return of(["animate", "compare"], [
    { id: "play", title: "Play or pause", group, shortcut: "Space", run: playback.toggle },
    { id: "frame-back", title: "Back one frame", group, shortcut: ",", run: () => playback.step(-1) },
    { id: "frame-on", title: "Forward one frame", group, shortcut: ".", run: () => playback.step(1) },
    { id: "key", title: "Add keys of the chosen joints", group, shortcut: "K", run: () => actions.keySelected() },
    { id: "key-unkeyed", title: "Key what is not keyed at this time", group, shortcut: "I", run: () => actions.keyUnkeyed(playback.time.value) },
    { id: "discard-unkeyed", title: "Discard what is not keyed at this time", group, shortcut: "Shift+I", run: () => actions.discardUnkeyed(playback.time.value) },
    { id: "take-pose", title: "Use the shown pose as the pose", group, enabled: () => page.state.value.clip !== null, run: () => actions.takePose() },
    { id: "key-delete", title: "Delete chosen keys", group, shortcut: "Shift+Del", enabled: () => page.selectedKeys.value.length > 0, run: () => actions.removeKeys(page.selectedKeys.value) },
    { id: "new-clip", title: "New clip", group, shortcut: "Shift+N", run: () => actions.addClip() },
    { id: "onion", title: "Onion skins: on or off", group, shortcut: "O", run: () => (page.onion.on.value = !page.onion.on.value) },
    { id: "curves", title: "Curves: on or off", group, shortcut: "Shift+C", run: () => (page.curves.value = !page.curves.value) },
  ]);
}

function view(page: Page): ModeCommand[] {
  return [
    { id: "wireframe", title: "Wireframe", group: "View", shortcut: "W", run: () => (page.wireframe.value = !page.wireframe.value) },
    { id: "joints", title: "Joints over the surface", group: "View", shortcut: "J", run: () => (page.showJoints.value = !page.showJoints.value) },
    { id: "select-all", title: "Choose all joints", group: "Edit", shortcut: "Ctrl+A", run: () => page.select(page.joints.value.map((j) => j.index)) },
    { id: "select-parent", title: "Choose the parent", group: "Edit", shortcut: "U", enabled: () => chosen(page) && page.active?.parent !== null, run: () => page.select([page.active!.parent!]) },
    { id: "select-none", title: "Choose nothing", group: "Edit", shortcut: "Esc", run: () => page.select([]) },
  ];
}

function files(page: Page): ModeCommand[] {
  const { actions } = page;
  return [
    { id: "import", title: "Import skeleton, clip, weights or trained skin…", group: "File", shortcut: "Ctrl+I", run: () => actions.chooseImport() },
    { id: "export-glb", title: "Export GLB with clip", group: "File", shortcut: "Ctrl+E", run: () => actions.export("glb") },
    { id: "export-bvh", title: "Export BVH", group: "File", run: () => actions.export("bvh") },
    { id: "export-obj", title: "Export OBJ", group: "File", run: () => actions.export("obj") },
    { id: "export-frames", title: "Export OBJ frames of the clip", group: "File", enabled: () => page.state.value.clip !== null, run: () => actions.exportFrames() },
    { id: "import-model", title: "Import trained skin…", group: "File", run: () => actions.chooseModel() },
    { id: "template-file", title: "Fit a skeleton file…", group: "File", run: () => actions.chooseTemplate() },
    { id: "copy-command", title: "Copy as command", group: "File", shortcut: "Alt+Shift+C", run: () => actions.copyCommand() },
  ];
}
