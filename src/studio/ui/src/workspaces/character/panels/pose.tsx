// Pose: the chosen joint, targets that hold (pins, poles, directions), the library of poses.
import { signal } from "@preact/signals";
import { Button, List, NumberField, Panel, Select, TextField, Toggle } from "../../../shell/components";
import type { SkinningMethod, Target } from "../../../generated/character";
import type { JointInfo, Page } from "../page";
import { copiedPose } from "../actions";
import { VectorField } from "../vector_field";
import { rotationOfDeg } from "../frames";

export const SKINNING: readonly { value: SkinningMethod; label: string; title: string }[] = [
  { value: "linear", label: "Linear blend", title: "Joint matrices are blended" },
  { value: "dual-quaternion", label: "Dual quaternions", title: "Rotations keep the volume of twisted limbs" },
  { value: "centers", label: "Centers of rotation", title: "Each vertex rotates about a center of its own" },
  { value: "mixed", label: "Twist and swing", title: "Twist by dual quaternions, swing by linear blend" },
  { value: "regression", label: "Regression", title: "As a trained model learnt from examples" },
];

const newName = signal("");

export function PosePanel({ page }: { page: Page }) {
  const joint = page.active;
  return (
    <>
      {joint ? <RotationPanel page={page} joint={joint} /> : <Panel title="Joint"><p class="hint">Click a joint for its rings, drag a limb to move it.</p></Panel>}
      <TargetsPanel page={page} />
      <CopyPanel page={page} />
      <LibraryPanel page={page} />
      <SurfacePanel page={page} />
      <RunPanel page={page} />
    </>
  );
}

function RotationPanel({ page, joint }: { page: Page; joint: JointInfo }) {
  const { actions } = page;
  return (
    <Panel title="Joint">
      <div class="row"><strong class="grow ellipsis">{joint.name}</strong>{joint.limits && <span class="muted">limited</span>}</div>
      <VectorField label="Rotation" unit="°" digits={1} step={5} value={page.poseVector(joint.index)}
        onChange={(vector) => actions.rotateTo(joint.index, rotationOfDeg(vector))} />
      {joint.parent === null && (
        <VectorField label="Translation" digits={4} step={page.step} value={page.poseTranslation(joint.index)} onChange={(by) => actions.translate(joint.index, by)} />
      )}
      <div class="button-row">
        <Button icon="reset" onClick={() => actions.resetPose(page.selected.value)}>Reset joint</Button>
        <Button icon="reset" onClick={() => actions.resetPose(null)}>Reset all</Button>
        <Button icon="mirror" onClick={() => actions.mirrorPose()}>Mirror</Button>
      </div>
      <Toggle label="Locked" checked={joint.locked} title="Dragged limbs do not rotate it; rings and numbers do" onChange={(on) => actions.lock(page.selected.value, on)} />
    </Panel>
  );
}

/** Copies of a pose, for another time, the other side or another character. */
export function CopyPanel({ page }: { page: Page }) {
  const { actions, selected } = page;
  const none = copiedPose.value === null;
  return (
    <Panel title="Copy and paste">
      <div class="button-row">
        <Button icon="copy" title="Ctrl+C" onClick={() => actions.copyPose()}>Copy pose</Button>
        <Button disabled={none} title="Ctrl+V" onClick={() => actions.pastePose(false, null)}>Paste</Button>
        <Button disabled={none} icon="mirror" title="Left and right exchanged: Ctrl+Shift+V" onClick={() => actions.pastePose(true, null)}>Paste mirrored</Button>
        <Button disabled={none || selected.value.length === 0} title="Alt+V" onClick={() => actions.pastePose(false, selected.value)}>Paste to chosen joints</Button>
      </div>
    </Panel>
  );
}

/** What a run of the saved file writes. */
export function RunPanel({ page }: { page: Page }) {
  const { actions, tab } = page;
  const { run, clip, duration } = page.state.value;
  const frames = page.clipFrames.value;
  const keyed = clip !== null && (duration > 0 || page.state.value.tracks.length > 0);
  return (
    <Panel title="What a run writes">
      <p class="hint">
        {run.clip === null ? "plumbline run on the saved file writes the pose of the mode Pose." : `plumbline run on the saved file writes ${run.frames} ${run.frames === 1 ? "pose" : "poses"} of the clip ${run.clip}, its keys.`}
      </p>
      <div class="button-row">
        {run.clip !== null && <Button onClick={() => actions.runWrites(null)}>Write the pose</Button>}
        {tab.value === "animate" && <Button disabled={!keyed} onClick={() => actions.runWrites(frames)}>Write this clip</Button>}
        {tab.value === "animate" && <Button disabled={clip === null} title="What is shown now becomes the pose of the mode Pose" onClick={() => actions.takePose()}>Use as the pose</Button>}
      </div>
      {tab.value === "animate" && <Button wide icon="download" disabled={!keyed} onClick={() => actions.exportFrames()}>Export OBJ frames</Button>}
    </Panel>
  );
}

const KINDS: Record<Target["kind"], string> = { position: "position", orientation: "orientation", look_at: "looks at", pole: "pole" };

function TargetsPanel({ page }: { page: Page }) {
  const { actions, joints } = page;
  const { targets } = page.state.value;
  const { chosenTarget } = page;
  const at = chosenTarget.value;
  const target = at === null ? undefined : targets[at];
  const joint = page.active;
  const add = (kind: Target["kind"]) => joint && actions.addTarget(joint.index, kind);
  return (
    <Panel title="Targets">
      <List label="Targets" maxHeight={160} empty="None: pin a hand or a foot, and it stays while you drag"
        items={targets.map((t, i) => ({ id: String(i), label: joints.value[t.joint]?.name ?? "", detail: KINDS[t.kind], icon: t.kind === "position" ? "pin" : "target" }))}
        selected={at === null ? [] : [String(at)]} onSelect={([id]) => (chosenTarget.value = id === undefined ? null : Number(id))}
        onDelete={(ids) => ids.forEach((id) => actions.removeTarget(Number(id)))} />
      {target && at !== null && (
        <>
          <VectorField label="At" digits={4} step={page.step} value={target.at} onChange={(to) => actions.setTarget(at, { ...target, at: to })} />
          <NumberField label="Weight" value={target.weight} min={0.01} max={1000} step={0.1} onChange={(weight) => actions.setTarget(at, { ...target, weight })} />
          <Button onClick={() => { actions.removeTarget(at); chosenTarget.value = null; }}>Remove target</Button>
        </>
      )}
      <div class="button-row">
        <Button icon="pin" disabled={!joint} title="It stays where it is while other joints move" onClick={() => joint && actions.pin(joint.index, false)}>Pin</Button>
        <Button icon="lock" disabled={!joint} title="Position and orientation stay" onClick={() => joint && actions.pin(joint.index, true)}>Pin flat</Button>
        <Button disabled={!joint} title="The limb that ends here bends toward a point" onClick={() => add("pole")}>Pole</Button>
        <Button icon="eye" disabled={!joint} onClick={() => add("look_at")}>Look at</Button>
      </div>
      <Button wide disabled={targets.length === 0} title="The pose stays; its targets go" onClick={() => actions.bakePose()}>Keep pose, remove targets</Button>
    </Panel>
  );
}

function LibraryPanel({ page }: { page: Page }) {
  const { poses } = page.state.value;
  const chosen = page.chosenPose;
  const store = () => {
    const name = newName.value.trim() || `pose ${poses.length + 1}`;
    newName.value = "";
    page.actions.storePose(name);
  };
  return (
    <Panel title="Pose library">
      <List label="Poses" items={poses.map((name) => ({ id: name, label: name, icon: "character" }))} maxHeight={160} empty="No poses stored"
        selected={chosen.value ? [chosen.value] : []} onSelect={([name]) => (chosen.value = name ?? null)} onActivate={(name) => page.actions.applyPose(name)}
        onDelete={(names) => names.forEach((name) => page.actions.removePose(name))} />
      <TextField label="Name" value={newName.value} placeholder={`pose ${poses.length + 1}`} onChange={(name) => (newName.value = name)} />
      <div class="button-row">
        <Button icon="plus" onClick={store}>Store</Button>
        <Button disabled={!chosen.value} onClick={() => chosen.value && page.actions.applyPose(chosen.value)}>Apply</Button>
        <Button disabled={!chosen.value} icon="trash" onClick={() => chosen.value && page.actions.removePose(chosen.value)}>Delete</Button>
      </div>
    </Panel>
  );
}

function SurfacePanel({ page }: { page: Page }) {
  return (
    <Panel title="Surface">
      <Select label="Skinning" value={page.state.value.skinning} options={SKINNING.filter(({ value }) => page.available(value))} onChange={(method) => page.actions.skinning(method)} />
      <Toggle label="Wireframe" checked={page.wireframe.value} onChange={(on) => (page.wireframe.value = on)} />
      <Toggle label="Joints" checked={page.showJoints.value} onChange={(on) => (page.showJoints.value = on)} />
    </Panel>
  );
}
