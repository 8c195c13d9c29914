// The character workspace: a skeleton in a surface, weights, poses, movements.
import { useEffect, useMemo, useState } from "preact/hooks";
import type { Connection } from "../../connection";
import type { WorkspacePage } from "../../workspace";
import { Layout, ToolButton, Toolbar } from "../../shell/components";
import { View3D, type LegendProps, type Viewport } from "../../view3d";
import { commandsOf } from "./commands";
import { JointTree } from "./joint_tree";
import type { State } from "../../generated/character";
import { Labels } from "./labels";
import { pageOf, TABS, type Page, type TabName } from "./page";
import { AnimateBottom, AnimatePanel } from "./panels/animate";
import { ComparePanel } from "./panels/compare";
import { PosePanel } from "./panels/pose";
import { SkeletonPanel } from "./panels/skeleton";
import { WeightsPanel } from "./panels/weights";
import { Scene } from "./scene";
import { moveFocus } from "../../shell/components/button";

const PANELS = { skeleton: SkeletonPanel, weights: WeightsPanel, pose: PosePanel, animate: AnimatePanel, compare: ComparePanel };

const HINTS: Record<TabName, (page: Page) => string> = {
  skeleton: (page) => ({
    select: "Click chooses a joint, drag moves it",
    add: "Click adds a joint in the middle of the volume",
    extrude: "Drag from a joint makes a child",
    split: "Click on a bone splits it there",
    pin: "Click pins an end of the extracted skeleton, or unpins it",
  })[page.mode.value],
  weights: (page) => (page.active ? `Drag paints the weight of ${page.active.name}` : "Choose a joint to see and paint its weight"),
  pose: () => "Click a joint for its rings, drag a limb to move it",
  animate: () => "Pose at a time, then add a key (K)",
  compare: () => "The same pose by each method",
};

function View({ connection }: { connection: Connection<State> }) {
  const page = useMemo(() => pageOf(connection), [connection]);
  const [scene, setScene] = useState<Scene | null>(null);
  useEffect(() => page.open(), [page]);
  const onReady = (view: Viewport) => {
    const made = new Scene(page, view);
    setScene(made);
    return () => made.dispose();
  };
  const tab = page.tab.value;
  const Side = PANELS[tab];
  return (
    <div class="character-page">
      <ModeBar page={page} />
      <Layout
        name="character"
        left={<JointTree page={page} />}
        view={
          <div class="view-and-timeline">
            <div class="view">
              <View3D label={`${page.state.value.name}, ${page.joints.value.length} joints`} onReady={onReady} legend={legend(page)}>
                <p class="view-hint">{HINTS[tab](page)}</p>
                {scene && <Labels scene={scene} />}
              </View3D>
            </div>
            {tab === "animate" && <div class="bottom"><AnimateBottom page={page} /></div>}
          </div>
        }
        right={<div role="tabpanel" aria-label={TABS.find(({ id }) => id === tab)?.label} id="character-tab"><Side page={page} /></div>}
      />
    </div>
  );
}

function legend(page: Page): LegendProps | null {
  return page.tab.value === "weights" && page.active ? { title: `Weight of ${page.active.name}`, low: 0, high: 1, scale: "heat" } : null;
}

function ModeBar({ page }: { page: Page }) {
  const onKeyDown = (event: KeyboardEvent) => {
    moveFocus(event, event.currentTarget as HTMLElement, false);
    const to = (document.activeElement as HTMLElement | null)?.dataset.tab;
    if (event.defaultPrevented && to) page.tab.value = to as TabName;
  };
  return (
    <div class="mode-bar">
      <div class="row" role="tablist" aria-label="Mode" style={{ gap: "2px" }} onKeyDown={onKeyDown}>
        {TABS.map(({ id, label }) => (
          <button key={id} type="button" class="tab" role="tab" data-tab={id} aria-selected={id === page.tab.value} aria-controls="character-tab"
            tabIndex={id === page.tab.value ? 0 : -1} onClick={() => (page.tab.value = id)}>
            {label}
          </button>
        ))}
      </div>
      <Toolbar label="Files">
        <ToolButton labelled icon="upload" label="Import" shortcut="Ctrl+I" onClick={() => page.actions.chooseImport()} />
        <ToolButton labelled icon="download" label="Export GLB" shortcut="Ctrl+E" onClick={() => page.actions.export("glb")} />
        <ToolButton icon="terminal" label="Copy as command" shortcut="Alt+Shift+C" tip="left" onClick={() => page.actions.copyCommand()} />
      </Toolbar>
    </div>
  );
}

export const page: WorkspacePage = { name: "character", View, commands: (connection) => commandsOf(pageOf(connection as Connection<State>)) };
