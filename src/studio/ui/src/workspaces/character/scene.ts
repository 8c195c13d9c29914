// The 3D scene of a character: the surface as skinned here or by the server, its joints, arcs of limits, onion skins, surfaces side by side.
// Everything follows the signals of the page.
import { computed, effect, signal, untracked } from "@preact/signals";
import { Quaternion } from "three";
import { cssColor, theme } from "../../shell/components";
import { brushTool, type JointLines, type Tool, type Viewport } from "../../view3d";
import { SideBySide } from "./comparison";
import { skinMatrices } from "./frames";
import { LimitArcs, type ArcLabel } from "./limit_arcs";
import { OnionSkins } from "./onion";
import type { Page } from "./page";
import { poseTool } from "./pose_tools";
import { TargetMarks } from "./targets";
import { skeletonTool } from "./skeleton_tools";

/** A text over the view, at a point of it. */
export interface Label extends ArcLabel { kind: "arc" | "compare"; note?: string }

/** Length of arcs and rings, fraction of the diagonal. */
const ARC = 0.11;

export class Scene {
  /** Whether the view has the size that it has beside the panels of the tab "Compare". */
  private readonly laidOut = signal(false);
  private readonly arcLabels = signal<readonly Label[]>([]);
  private readonly compareLabels = signal<readonly Label[]>([]);
  readonly labels = computed(() => [...this.arcLabels.value, ...this.compareLabels.value]);
  readonly joints: JointLines;
  private readonly arcs: LimitArcs;
  private readonly targets: TargetMarks;
  private readonly onions: OnionSkins;
  private readonly sides: SideBySide;
  private readonly stops: (() => void)[] = [];
  private readonly brush: Tool & { dispose(): void };
  private fitted = false;
  private drawn: Float32Array | null = null;

  constructor(readonly page: Page, readonly view: Viewport) {
    this.joints = view.addJoints();
    this.arcs = new LimitArcs(view, { swing: cssColor("--data-5"), twist: cssColor("--data-4") });
    this.targets = new TargetMarks(view, "#e0762f");
    this.onions = new OnionSkins(view);
    this.sides = new SideBySide(view);
    this.brush = this.weightBrush();
    page.scene = this;
    const follow = (show: () => void) => this.stops.push(effect(show));
    follow(() => this.showGeometry());
    follow(() => this.showSkin());
    follow(() => this.showPose());
    follow(() => this.showJoints());
    follow(() => this.showWeights());
    follow(() => this.showLimits());
    follow(() => this.showRings());
    follow(() => this.showTargets());
    follow(() => this.showOnions());
    follow(() => {
      this.laidOut.value = false;
      // Two frames: the page is drawn anew, then the canvas has its new size.
      if (page.tab.value === "compare") requestAnimationFrame(() => requestAnimationFrame(() => (this.laidOut.value = true)));
    });
    follow(() => this.showComparison());
    follow(() => this.chooseTool());
    follow(() => view.surface.setWireframe(page.wireframe.value));
  }

  /** Another mesh: triangles and positions at rest. */
  private showGeometry() {
    const mesh = this.page.geometry.value;
    if (!mesh) return;
    const { surface } = this.view;
    surface.setTopology(mesh.triangles, mesh.rest.length / 3);
    this.drawn = null;
    this.draw(mesh.rest);
    if (!this.fitted) {
      this.view.rig.setUp(untracked(() => (this.page.state.value.mesh.up === "z" ? "z" : "y")));
      this.view.fit();
    }
    this.fitted = true;
  }

  /** Whether the surface is skinned here: by linear blend, in a pose. */
  private get skinnedHere(): boolean {
    return this.page.inPose && this.page.positions.value === null;
  }

  private showSkin() {
    const { geometry, skin } = this.page;
    if (geometry.value) this.view.surface.setSkin(this.skinnedHere ? skin.value : null);
  }

  private showPose() {
    const { geometry, skin, posed, rest, positions } = this.page;
    const mesh = geometry.value;
    if (!mesh) return;
    const { surface } = this.view;
    if (this.skinnedHere && skin.value && posed.value.count === skin.value.jointCount) {
      this.draw(mesh.rest);
      surface.setJointMatrices(skinMatrices(posed.value, rest.value));
    } else if (this.page.inPose && positions.value) this.draw(positions.value.positions, positions.value.normals);
    else this.draw(mesh.rest);
  }

  /** Positions of the surface, unless they are drawn already: their normals take time. */
  private draw(positions: Float32Array, normals?: Int16Array) {
    if (positions !== this.drawn) this.view.surface.setPositions(positions, normals);
    this.drawn = positions;
  }

  private showJoints() {
    const { page } = this;
    void theme.value;
    const frames = page.shownFrames;
    // While a skeleton is on its way to the page, the last one is shown.
    if (frames.count !== page.joints.value.length) return;
    const shown = page.showJoints.value && page.tab.value !== "compare";
    this.joints.setVisible(shown && frames.count > 0);
    this.joints.set(frames.positions(), Int32Array.from(page.joints.value, (j) => j.parent ?? -1), {
      bone: cssColor("--joint-bone") || "#e8edf2", joint: cssColor("--joint-dot") || "#f4f7fa", selected: cssColor("--accent"),
      selection: new Set(page.selected.value), colors: page.jointColors.value,
    });
    this.view.surface.setOpacity(page.tab.value === "skeleton" && shown && page.joints.value.length > 0 ? 0.62 : 1);
  }

  private showWeights() {
    const { page } = this;
    const values = page.tab.value === "weights" ? page.heat.value : null;
    if (page.geometry.value) this.view.surface.setScalars(values, { low: 0, high: 1, name: "heat" });
  }

  /** Arcs where limits are set (skeleton) and where they are felt (pose). */
  private showLimits() {
    const { page } = this;
    const joint = page.active;
    const shown = joint?.limits && ["skeleton", "pose"].includes(page.tab.value) && page.showJoints.value;
    const labels = this.arcs.show(shown && joint ? { frame: page.limitFrame(joint.index), limits: page.limitShape(joint.limits!), radius: ARC * page.diagonal } : null);
    const texts = page.tab.value === "skeleton" ? labels : [];
    this.arcLabels.value = texts.map((label) => ({ ...label, kind: "arc" as const }));
  }

  /** Rings at the active joint: rotations about its axes. */
  private showRings() {
    const { page } = this;
    const joint = page.active;
    const { gizmo } = this.view;
    const chosen = page.chosenTarget.value;
    const target = chosen === null ? undefined : page.state.value.targets[chosen];
    if (chosen !== null && target && page.inPose) {
      gizmo.setMode("translate", "world");
      const start = page.scenePoint(target.at);
      let from = start;
      return gizmo.attach({
        position: start, quaternion: new Quaternion(), onStart: () => { from = page.scenePoint(page.state.peek().targets[chosen]?.at ?? target.at); },
        onChange: ({ translation }) => page.actions.dragTarget(chosen, target, from.clone().add(translation)),
        onEnd: () => page.actions.endDrag(),
      });
    }
    if (!joint || !["pose", "animate"].includes(page.tab.value) || !page.showJoints.value) return gizmo.attach(null);
    gizmo.setMode("rotate", "local");
    const frames = page.posed.value;
    let start = new Quaternion();
    gizmo.attach({
      position: frames.position(joint.index),
      quaternion: frames.rotation(joint.index),
      onStart: () => { start = page.posed.peek().rotation(joint.index); },
      onChange: ({ rotation }) => page.actions.rotateWorld(joint.index, rotation.clone().multiply(start), false),
      onEnd: () => page.actions.endDrag(joint.index),
    });
  }

  private showTargets() {
    const { page } = this;
    const targets = page.inPose ? page.state.value.targets.filter((t) => t.kind !== "orientation") : [];
    this.targets.show(targets.map((t) => ({ at: page.scenePoint(t.at), joint: page.posed.value.position(t.joint) })), 0.015 * page.diagonal);
  }

  private showOnions() {
    const { page } = this;
    const mesh = page.geometry.value;
    const skin = page.skin.value;
    const poses = page.tab.value === "animate" && page.onion.on.value ? page.onionPoses.value : [];
    this.onions.show(mesh && skin && poses.length > 0 ? page.onionGeometry.value : null, page.rest.value, poses);
  }

  private showComparison() {
    const { page } = this;
    const mesh = page.geometry.value;
    const on = page.tab.value === "compare" && mesh !== null && this.laidOut.value;
    this.view.surface.setVisible(!on);
    if (!on) {
      this.sides.clear();
      this.compareLabels.value = [];
      return;
    }
    const others = this.sides.show(page.compared.value, mesh.triangles, mesh.rest);
    for (const [id, shape] of page.comparedShapes.value) this.sides.setPositions(id, shape.positions, shape.normals);
    if (others) this.view.fit();
    this.compareLabels.value = this.sides.labels().map(({ id, at }) => ({ at, kind: "compare", ...page.comparedText(id) }));
  }

  private chooseTool() {
    const { page, view } = this;
    const tab = page.tab.value;
    if (tab === "skeleton") view.tool = skeletonTool(view, this.joints, () => page.mode.peek(), page.skeletonActions);
    else if (tab === "weights") view.tool = page.active ? this.brush : this.chooser();
    else if (tab === "pose" || tab === "animate") view.tool = poseTool(view, this.joints, page.poseActions);
    else view.tool = {};
  }

  private chooser(): Tool {
    return {
      click: (at) => {
        const hit = this.view.pick(at);
        this.page.choose(this.joints.pickJoint(at, this.view) ?? (hit ? this.page.jointOf(hit.vertex) : null), at.shift);
      },
    };
  }

  /** Paints on the surface; a click on a joint chooses it. */
  private weightBrush() {
    const { page, view } = this;
    const tool = brushTool(view, {
      radius: () => page.brush.size.peek() * page.diagonal, color: "#ffffff",
      onStroke: (_, hit, at) => page.actions.paint(hit.point, at.pressure, at.shift, at.ctrl),
      onEnd: () => page.actions.endDrag(),
    });
    const press = tool.press?.bind(tool);
    tool.press = (at) => {
      const joint = this.joints.pickJoint(at, view, 6);
      if (joint === null || joint === page.active?.index) return press?.(at) ?? null;
      page.choose(joint, at.shift);
      return { move: () => undefined, end: () => undefined, cancel: () => undefined };
    };
    return tool;
  }

  dispose() {
    for (const stop of this.stops) stop();
    this.brush.dispose();
    this.arcs.dispose();
    this.targets.dispose();
    this.onions.clear();
    this.sides.clear();
    if (this.page.scene === this) this.page.scene = null;
  }
}
