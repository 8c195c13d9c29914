// A timeline: playback, a ruler with the current time, and keys on tracks. The time is a slider and every key is a button, so that
// all of it works by keyboard: arrow keys step a frame, on a key they move it, Delete removes it, Enter goes to it.
import type { ComponentChildren } from "preact";
import { useRef, useState } from "preact/hooks";
import { ToolButton, ToolDivider, Toolbar } from "./button";
import { NumberInput } from "./field";
import { Icon } from "./icon";
import { formatNumber } from "./number";
import type { Playback } from "./playback";

/** A key of a track; ids are unique in the timeline. */
export interface TimelineKey { id: string; time: number; label?: string }

/** A row of keys. */
export interface Track { id: string; label: string; color?: string; keys: readonly TimelineKey[] }

export interface TimelineProps {
  label: string;
  playback: Playback;
  tracks: readonly Track[];
  selected?: readonly string[];
  onSelect?: (keys: string[]) => void;
  /** Keys moved by seconds (snapped to frames); `final` when the pointer is released. While dragging `by` is the whole way so far. */
  onMove?: (keys: string[], by: number, final: boolean) => void;
  onDelete?: (keys: string[]) => void;
  /** A double click on a track, or the button "Add key" with `track` undefined. */
  onAdd?: (time: number, track?: string) => void;
  /** A click on the name of a track. */
  onTrack?: (track: string) => void;
  /** The user changed duration or frame rate; without them these are only shown. */
  onDuration?: (seconds: number) => void;
  onFrameRate?: (rate: number) => void;
  /** More tools at the right end of the bar. */
  actions?: ComponentChildren;
  /** Shown where there are no tracks. */
  empty?: string;
}

/** A timeline with its playback controls. */
export function Timeline(props: TimelineProps) {
  return (
    <section class="timeline" aria-label={props.label}>
      <PlaybackBar {...props} />
      <div class="timeline-area">
        <Ruler {...props} />
        <div class="timeline-tracks scroll">
          {props.tracks.map((track) => <TrackRow key={track.id} track={track} {...props} />)}
          {props.tracks.length === 0 && <p class="empty">{props.empty ?? "No keys yet"}</p>}
        </div>
      </div>
    </section>
  );
}

function PlaybackBar(props: TimelineProps) {
  const { playback, tracks } = props;
  const toKey = (forward: boolean) => {
    const times = tracks.flatMap((track) => track.keys.map((key) => key.time)).sort((a, b) => a - b);
    const time = playback.time.peek();
    const to = forward ? times.find((t) => t > time + 1e-6) : times.filter((t) => t < time - 1e-6).pop();
    playback.pause();
    if (to !== undefined) playback.seek(to);
  };
  return (
    <Toolbar label={`${props.label}: playback`} class="timeline-bar">
      <ToolButton icon="first" label="To the previous key" tip="top" onClick={() => toKey(false)} />
      <ToolButton icon="previous" label="Back one frame" tip="top" onClick={() => playback.step(-1)} />
      <ToolButton
        icon={playback.playing.value ? "pause" : "play"}
        label={playback.playing.value ? "Pause" : "Play"}
        tip="top"
        onClick={playback.toggle}
      />
      <ToolButton icon="next" label="Forward one frame" tip="top" onClick={() => playback.step(1)} />
      <ToolButton icon="last" label="To the next key" tip="top" onClick={() => toKey(true)} />
      <ToolButton icon="loop" label="Loop" tip="top" pressed={playback.loop.value} onClick={() => (playback.loop.value = !playback.loop.value)} />
      <ToolDivider />
      {props.onAdd && <ToolButton icon="keyAdd" label="Add key" tip="top" onClick={() => props.onAdd?.(playback.time.peek())} />}
      {props.onDelete && (
        <ToolButton icon="keyDelete" label="Delete selected keys" tip="top" disabled={!props.selected?.length}
          onClick={() => props.onDelete?.([...(props.selected ?? [])])} />
      )}
      <span class="grow" />
      <Numbers {...props} />
      {props.actions}
    </Toolbar>
  );
}

function Numbers({ playback, onDuration, onFrameRate }: TimelineProps) {
  const rate = playback.frameRate.value;
  const frame = Math.round(playback.time.value * rate);
  return (
    <span class="row num muted">
      <span>Frame</span>
      <NumberInput label="Frame" value={frame} min={0} max={Math.round(playback.duration.value * rate)} digits={0} onChange={(f) => playback.seek(f / rate)} />
      {onDuration
        ? <NumberInput label="Duration" unit="s" value={playback.duration.value} min={1 / rate} max={3600} step={0.1} onChange={onDuration} />
        : <span>of {playback.duration.value * rate < 1 ? 0 : formatNumber(playback.duration.value, 2)} s</span>}
      {onFrameRate
        ? <NumberInput label="Frames per second" unit="fps" value={rate} min={1} max={240} digits={2} onChange={onFrameRate} />
        : <span>{formatNumber(rate, 2)} fps</span>}
    </span>
  );
}

/** The current time as a slider, with ticks; dragging scrubs. */
function Ruler({ label, playback }: TimelineProps) {
  const bar = useRef<HTMLDivElement>(null);
  const { time, duration, frameRate } = playback;
  const scrub = (event: PointerEvent) => {
    const box = bar.current?.getBoundingClientRect();
    if (box) playback.seek(((event.clientX - box.left) / (box.width || 1)) * duration.peek());
  };
  const onPointerDown = (event: PointerEvent) => {
    playback.pause();
    (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
    scrub(event);
  };
  const onKeyDown = (event: KeyboardEvent) => {
    const frames: Record<string, number> = { ArrowLeft: -1, ArrowRight: 1, ArrowDown: -1, ArrowUp: 1, PageDown: -10, PageUp: 10 };
    const by = frames[event.key];
    if (by !== undefined) playback.step(by * (event.shiftKey ? 10 : 1));
    else if (event.key === "Home") playback.seek(0);
    else if (event.key === "End") playback.seek(duration.peek());
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <div class="timeline-row ruler-row">
      <span class="track-name" />
      <div ref={bar} class="ruler num" onPointerDown={onPointerDown} onPointerMove={(event) => { if (event.buttons & 1) scrub(event); }}>
        {ticks(duration.value, 1 / frameRate.value).map((at) => (
          <span key={at} class="tick" style={{ left: percent(at, duration.value) }}>{formatNumber(at, 2)}</span>
        ))}
        <div
          class="playhead"
          role="slider"
          tabIndex={0}
          aria-label={`${label}: time`}
          aria-valuemin={0}
          aria-valuemax={duration.value}
          aria-valuenow={Number(time.value.toFixed(4))}
          aria-valuetext={`${formatNumber(time.value, 2)} s, frame ${Math.round(time.value * frameRate.value)}`}
          style={{ left: percent(time.value, duration.value) }}
          onKeyDown={onKeyDown}
        />
      </div>
    </div>
  );
}

function TrackRow(props: TimelineProps & { track: Track }) {
  const { track, playback, onAdd, onTrack } = props;
  const bar = useRef<HTMLDivElement>(null);
  const addAt = (event: MouseEvent) => {
    const box = bar.current?.getBoundingClientRect();
    if (!box || !onAdd) return;
    const rate = playback.frameRate.peek();
    const time = ((event.clientX - box.left) / (box.width || 1)) * playback.duration.peek();
    onAdd(Math.round(time * rate) / rate, track.id);
  };
  return (
    <div class="timeline-row" role="group" aria-label={track.label}>
      {onTrack
        ? <button type="button" class="track-name ellipsis" onClick={() => onTrack(track.id)}>{track.label}</button>
        : <span class="track-name ellipsis">{track.label}</span>}
      <div ref={bar} class="track" style={track.color ? { color: track.color } : undefined} onDblClick={addAt}>
        <Now playback={playback} />
        {track.keys.map((key) => <KeyButton key={key.id} timeKey={key} {...props} />)}
      </div>
    </div>
  );
}

/** The current time on a track: alone, so that playback draws it and not the keys. */
function Now({ playback }: { playback: Playback }) {
  return <span class="now" style={{ left: percent(playback.time.value, playback.duration.value) }} />;
}

function KeyButton(props: TimelineProps & { track: Track; timeKey: TimelineKey }) {
  const { timeKey, track, playback, selected = [], onSelect } = props;
  const drag = useKeyDrag(props);
  const chosen = selected.includes(timeKey.id);
  const onKeyDown = (event: KeyboardEvent) => {
    const rate = playback.frameRate.peek();
    const keys = chosen ? [...selected] : [timeKey.id];
    const sign = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
    if (sign !== 0 && props.onMove) props.onMove(keys, (sign * (event.shiftKey ? 10 : 1)) / rate, true);
    else if (event.key === "Delete" && props.onDelete) props.onDelete(keys);
    else if (event.key === "Enter") onSelect?.([timeKey.id]), playback.pause(), playback.seek(timeKey.time);
    else if (event.key === " ") onSelect?.(chosen ? selected.filter((id) => id !== timeKey.id) : [...selected, timeKey.id]);
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <button
      type="button"
      class="key"
      aria-pressed={chosen}
      aria-label={`Key ${timeKey.label ?? `of ${track.label}`} at ${formatNumber(timeKey.time, 2)} s`}
      style={{ left: percent(timeKey.time + (chosen || drag.alone ? drag.by : 0), playback.duration.value) }}
      onKeyDown={onKeyDown}
      onPointerDown={drag.down}
      onPointerMove={drag.move}
      onPointerUp={drag.up}
      onDblClick={(event) => event.stopPropagation()}
    >
      <Icon name="key" />
    </button>
  );
}

/** Pointer on a key: a click selects it and goes there, a drag moves all that are selected. */
function useKeyDrag({ timeKey, playback, selected = [], onSelect, onMove }: TimelineProps & { timeKey: TimelineKey }) {
  const from = useRef<{ x: number; width: number; keys: string[] } | null>(null);
  const [by, setBy] = useState(0);
  const secondsAt = (event: PointerEvent) => {
    if (!from.current) return 0;
    const rate = playback.frameRate.peek();
    return Math.round((((event.clientX - from.current.x) / from.current.width) * playback.duration.peek()) * rate) / rate;
  };
  const down = (event: PointerEvent) => {
    event.stopPropagation();
    const key = event.currentTarget as HTMLElement;
    key.setPointerCapture(event.pointerId);
    const several = event.shiftKey || event.ctrlKey;
    const keys = selected.includes(timeKey.id) ? [...selected] : several ? [...selected, timeKey.id] : [timeKey.id];
    onSelect?.(keys);
    from.current = { x: event.clientX, width: key.parentElement?.clientWidth || 1, keys };
  };
  const move = (event: PointerEvent) => {
    if (!from.current || !onMove || secondsAt(event) === by) return;
    setBy(secondsAt(event));
    onMove(from.current.keys, secondsAt(event), false);
  };
  const up = (event: PointerEvent) => {
    const keys = from.current?.keys;
    const moved = secondsAt(event);
    from.current = null;
    setBy(0);
    if (keys && moved !== 0) onMove?.(keys, moved, true);
    else if (keys) playback.pause(), playback.seek(timeKey.time);
  };
  return { by, alone: from.current !== null, down, move, up };
}

const percent = (time: number, duration: number) => `${duration > 0 ? (100 * time) / duration : 0}%`;

/** About ten round times, no closer than frames. */
function ticks(duration: number, frame: number): number[] {
  if (!(duration >= frame)) return [0];
  const power = 10 ** Math.floor(Math.log10(duration / 10));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((width) => duration / width <= 12) ?? duration;
  return Array.from({ length: Math.floor(duration / step + 1e-9) + 1 }, (_, i) => i * step);
}
