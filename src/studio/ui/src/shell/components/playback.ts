// The clock of a timeline: where it is, whether it runs.
import { signal, type Signal } from "@preact/signals";

/** Time of a timeline in seconds, from 0 to `duration`; a workspace shows `time.value` by an `effect`. */
export interface Playback {
  readonly time: Signal<number>;
  readonly duration: Signal<number>;
  /** Frames per second: what one step is, and what times snap to. */
  readonly frameRate: Signal<number>;
  readonly playing: Signal<boolean>;
  readonly loop: Signal<boolean>;
  play(): void;
  pause(): void;
  toggle(): void;
  /** By so many frames; pauses. */
  step(frames: number): void;
  /** To a time, snapped to a frame and kept inside. */
  seek(time: number): void;
}

/** A clock that stands at 0. Call `pause` when its workspace closes. */
export function createPlayback(initial: { duration: number; frameRate: number; loop?: boolean }): Playback {
  const clock = {
    time: signal(0),
    duration: signal(initial.duration),
    frameRate: signal(initial.frameRate),
    playing: signal(false),
    loop: signal(initial.loop ?? true),
  };
  let started = { wall: 0, time: 0 };
  const seek = (time: number) => {
    const rate = clock.frameRate.value;
    clock.time.value = Math.min(clock.duration.value, Math.max(0, Math.round(time * rate) / rate));
    started = { wall: performance.now(), time: clock.time.value };
  };
  const tick = () => {
    if (!clock.playing.value) return;
    const duration = clock.duration.value;
    const elapsed = started.time + (performance.now() - started.wall) / 1000;
    const ended = elapsed >= duration;
    if (ended && clock.loop.value && duration > 0) {
      clock.time.value = elapsed % duration;
    } else {
      clock.time.value = Math.min(elapsed, duration);
      if (ended) clock.playing.value = false;
    }
    requestAnimationFrame(tick);
  };
  const play = () => {
    if (clock.playing.value) return;
    if (clock.time.value >= clock.duration.value) clock.time.value = 0;
    started = { wall: performance.now(), time: clock.time.value };
    clock.playing.value = true;
    requestAnimationFrame(tick);
  };
  const pause = () => {
    if (!clock.playing.value) return;
    clock.playing.value = false;
    seek(clock.time.value);
  };
  const toggle = () => (clock.playing.value ? pause() : play());
  const step = (frames: number) => {
    pause();
    seek(clock.time.value + frames / clock.frameRate.value);
  };
  return { ...clock, play, pause, toggle, step, seek };
}
