// Animation: the clip, its keys on a timeline, curves of the chosen joint, onion skins.
import { Button, cssColor, formatNumber, Icon, NumberField, Panel, Segmented, Select, TextField, theme, Timeline, Toggle, type Track as Row } from "../../../shell/components";
import { CurveEditor, type CurveLine } from "../curves";
import type { InterpolationKind } from "../../../generated/character";
import type { Page } from "../page";
import { UNKEYED } from "../actions";
import { samplesOf } from "../curve_samples";
import { CopyPanel, RunPanel } from "./pose";

const KINDS: readonly { value: InterpolationKind; label: string; title: string }[] = [
  { value: "spline", label: "Spline", title: "Quaternion splines: smooth through the keys" },
  { value: "linear", label: "Linear", title: "The shortest rotation from key to key" },
  { value: "step", label: "Step", title: "Each key holds until the next" },
];
/** Samples of a curve. */
const SAMPLES = 120;

export function AnimatePanel({ page }: { page: Page }) {
  const { clips, clip, tracks } = page.state.value;
  const { actions, onion } = page;
  const joint = page.active;
  const track = joint && tracks.find((t) => t.joint === joint.index);
  return (
    <>
      <Panel title="Clip">
        <Select label="Clip" value={clip ?? ""} options={clips.length > 0 ? clips.map((name) => ({ value: name, label: name })) : [{ value: "", label: "None" }]}
          onChange={(name) => actions.selectClip(name)} />
        {clip !== null && <TextField label="Name" value={clip} onChange={(name) => actions.renameClip(name)} />}
        <div class="button-row">
          <Button icon="plus" onClick={() => actions.addClip()}>New</Button>
          <Button icon="trash" disabled={clip === null} onClick={() => actions.removeClip()}>Delete</Button>
        </div>
      </Panel>
      <Panel title="Keys">
        <div class="button-row">
          <Button icon="keyAdd" onClick={() => actions.keySelected()}>Key {page.selected.value.length > 0 ? "joints" : "all joints"}</Button>
          <Button icon="keyDelete" disabled={page.selectedKeys.value.length === 0} onClick={() => actions.removeKeys(page.selectedKeys.value)}>Delete</Button>
        </div>
        <Segmented label="Between keys" value={track?.interpolation ?? "spline"} options={KINDS} disabled={tracks.length === 0}
          onChange={(kind) => actions.interpolation(kind)} />
        <Toggle label="Key what is posed" checked={page.autoKey.value} onChange={(on) => (page.autoKey.value = on)} title="Every change of the pose becomes a key at the shown time" />
        <p class="hint">A pose that is not keyed stays at its time until you key or discard it; at other times the keys are shown.</p>
      </Panel>
      <CopyPanel page={page} />
      <Panel title="Onion skins">
        <Toggle label="Show" checked={onion.on.value} onChange={(on) => (onion.on.value = on)} />
        <NumberField label="On each side" value={onion.count.value} min={1} max={6} digits={0} onChange={(n) => (onion.count.value = n)} />
        <NumberField label="Apart" unit="frames" value={onion.spacing.value} min={1} max={120} digits={0} onChange={(n) => (onion.spacing.value = n)} />
      </Panel>
      <RunPanel page={page} />
    </>
  );
}

/** A key of the timeline: joint and time. */
export const keyId = (joint: number, time: number) => `${joint}@${time}`;

export function AnimateBottom({ page }: { page: Page }) {
  const { tracks, unkeyed } = page.state.value;
  const { actions, playback, selectedKeys } = page;
  const joints = page.joints.value;
  const waiting: Row[] = unkeyed.length === 0 ? [] : [{
    id: UNKEYED, label: "Not keyed", color: "var(--warning)", keys: unkeyed.map(({ time }) => ({ id: `${UNKEYED}@${time}`, time, label: "to be set" })),
  }];
  const rows: Row[] = tracks.map((track) => ({
    id: String(track.joint), label: joints[track.joint]?.name ?? "", color: page.selected.value.includes(track.joint) ? "var(--accent)" : "var(--muted)",
    keys: track.times.map((time) => ({ id: keyId(track.joint, time), time })),
  }));
  const curves = page.curves.value ? curvesOf(page) : [];
  return (
    <div class={`animate-bottom ${curves.length > 0 ? "" : "no-curves"}`}>
      <UnkeyedBar page={page} />
      <Timeline label="Animation" playback={playback} tracks={[...waiting, ...rows]} selected={selectedKeys.value} onSelect={(keys) => (selectedKeys.value = keys)}
        onMove={(keys, by, final) => actions.moveKeys(keys, by, final)} onDelete={(keys) => actions.removeKeys(keys)}
        onAdd={(time, track) => (track === undefined ? actions.keySelected() : track === UNKEYED ? actions.keyUnkeyed(time) : actions.key([Number(track)], time))}
        onTrack={(track) => track !== UNKEYED && page.select([Number(track)])} onDuration={(seconds) => (page.length.value = seconds)} onFrameRate={(rate) => (playback.frameRate.value = rate)} empty="No keys: pose a joint, then add a key" />
      {curves.length > 0 && (
        <div class="curve-pane">
          <div class="curve-legend">{curves.map((c) => <span key={c.id} class="row"><span class="swatch" style={{ background: c.color }} />{c.label}</span>)}</div>
          <CurveEditor label={`Rotation of ${page.active?.name ?? ""} over time`} unit="°" curves={curves} playback={playback} selected={selectedKeys.value}
            onSelect={(id) => (selectedKeys.value = [id])} onMove={(id, time, value, final) => actions.moveCurveKey(id, time, value, final)} />
        </div>
      )}
    </div>
  );
}

/** A pose that is not keyed, and what may be done about it: that of the shown time, else the first. */
function UnkeyedBar({ page }: { page: Page }) {
  const { unkeyed } = page.state.value;
  const { actions, playback } = page;
  const now = playback.time.value;
  const pose = unkeyed.find(({ time }) => Math.abs(time - now) < 1e-4) ?? unkeyed[0];
  if (!pose) return <div />;
  const here = Math.abs(pose.time - now) < 1e-4;
  const joints = pose.joints.length === 1 ? pose.joints[0] : `${pose.joints.length} joints`;
  return (
    <div class="unkeyed-bar row" role="status">
      <Icon name="warning" />
      <span class="grow ellipsis">Not keyed: {joints} at {formatNumber(pose.time, 2)} s{unkeyed.length > 1 ? `, and ${unkeyed.length - 1} more` : ""}</span>
      {!here && <Button onClick={() => { playback.pause(); playback.seek(pose.time); }}>Go to it</Button>}
      <Button icon="keyAdd" kind="primary" onClick={() => actions.keyUnkeyed(pose.time)}>Key it</Button>
      <Button icon="trash" onClick={() => actions.discardUnkeyed(pose.time)}>Discard</Button>
    </div>
  );
}

/** The rotation from rest of the active joint as three curves, degrees. */
function curvesOf(page: Page): CurveLine[] {
  void theme.value;
  const joint = page.active;
  const track = joint && page.state.value.tracks.find((t) => t.joint === joint.index);
  if (!joint || !track) return [];
  const samples = samplesOf(track, page.playback.duration.value, SAMPLES);
  return ["x", "y", "z"].map((axis, k) => ({
    id: axis, label: `Rotation ${axis}`, color: cssColor(`--data-${[6, 3, 1][k]}`),
    samples: samples.map(({ time, vector }) => [time, vector[k] ?? 0] as const),
    keys: track.times.map((time, i) => ({ id: `${axis}:${keyId(joint.index, time)}`, time, value: page.keyVector(track, i)[k] ?? 0 })),
  }));
}
