// The joints beside the view: chosen, renamed, re-parented and removed here without pointing at anything.
import { Tree, type Node } from "../../shell/components";
import type { Page } from "./page";

export function JointTree({ page }: { page: Page }) {
  const joints = page.joints.value;
  const editable = page.tab.value === "skeleton";
  const nodes: Node[] = page.treeOrder.value.map((joint) => ({
    id: String(joint.index),
    label: joint.name,
    parent: joint.parent === null ? null : String(joint.parent),
    detail: page.jointDetail(joint.index),
    color: page.jointColor(joint.index) ?? undefined,
  }));
  const indices = (ids: readonly string[]) => ids.map(Number);
  return (
    <div class="joint-side">
      <h2 class="joint-side-head"><span class="grow">Joints</span><span class="muted num">{joints.length}</span></h2>
      <Tree
        label="Joints"
        nodes={nodes}
        multiple
        selected={page.selected.value.map(String)}
        onSelect={(ids) => page.select(indices(ids))}
        onRename={editable ? (id, name) => page.actions.rename(Number(id), name) : undefined}
        onDelete={editable ? (ids) => page.actions.remove(indices(ids)) : undefined}
        onMove={editable ? (ids, parent) => page.actions.reparent(indices(ids), parent === null ? null : Number(parent)) : undefined}
        empty={extracting(page) ?? "No skeleton yet: extract one, take a template, or add a joint in the view"}
      />
    </div>
  );
}

/** How far an extraction is that runs. */
export function extracting(page: Page): string | null {
  const { running } = page.state.value.extraction;
  return running === null ? null : `Extracting the skeleton: ${Math.round(100 * running)} %`;
}
