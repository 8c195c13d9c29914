// Points of rotation curves, for drawing: between keys the same curves as in the library (`character::clip`), so that what is drawn is
// what plays. A smooth curve is that of Kim, Kim and Shin: a Bézier curve of rotations with the velocities at both keys.
import { Quaternion, Vector3 } from "three";
import { vectorDeg } from "./frames";
import type { Track } from "../../generated/character";

/** The rotation vector, degrees, at so many times from 0 to the end, x, y and z in turn; angles go on beyond 180°. */
export function samplesOf(track: Track, duration: number, count: number): { time: number; vector: [number, number, number] }[] {
  const keys = track.rotations.map((q) => new Quaternion(...q));
  const [first, last] = [track.times[0] ?? 0, track.times[track.times.length - 1] ?? 0];
  const times = new Set([...Array.from({ length: count + 1 }, (_, i) => (duration * i) / count), ...track.times]);
  return [...times].sort((a, b) => a - b).map((time) => {
    const t = Math.min(last, Math.max(first, time));
    return { time, vector: vectorDeg(rotationAt(track, keys, t)) };
  });
}

function rotationAt(track: Track, keys: readonly Quaternion[], time: number): Quaternion {
  const after = track.times.findIndex((t) => t > time);
  const k = after < 0 ? keys.length - 1 : Math.max(0, after - 1);
  const [a, b] = [keys[k] ?? new Quaternion(), keys[k + 1]];
  const [from, to] = [track.times[k] ?? 0, track.times[k + 1]];
  if (!b || to === undefined || track.interpolation === "step") return a.clone();
  const u = (time - from) / (to - from);
  if (track.interpolation === "linear") return a.clone().multiply(exp(stepOf(keys, k).multiplyScalar(u)));
  return smooth(track.times, keys, k, u);
}

function smooth(times: readonly number[], keys: readonly Quaternion[], k: number, u: number): Quaternion {
  const third = (times[k + 1]! - times[k]!) / 3;
  const first = velocity(times, keys, k).multiplyScalar(third);
  const last = velocity(times, keys, k + 1).multiplyScalar(third);
  const middle = log(exp(first).invert().multiply(exp(stepOf(keys, k))).multiply(exp(last).invert()));
  const b = [1 - (1 - u) ** 3, u * u * (3 - 2 * u), u ** 3] as const;
  return keys[k]!.clone().multiply(exp(first.multiplyScalar(b[0]))).multiply(exp(middle.multiplyScalar(b[1]))).multiply(exp(last.multiplyScalar(b[2])));
}

/** Angular velocity at a key, in its frame: the derivative of the parabola through three keys. */
function velocity(times: readonly number[], keys: readonly Quaternion[], k: number): Vector3 {
  const rate = (i: number) => stepOf(keys, i).divideScalar(times[i + 1]! - times[i]!);
  const end = keys.length - 1;
  if (end === 0) return new Vector3();
  if (k === 0) return rate(0);
  if (k === end) return rate(end - 1);
  const [before, after] = [times[k]! - times[k - 1]!, times[k + 1]! - times[k]!];
  return rate(k - 1).multiplyScalar(after).addScaledVector(rate(k), before).divideScalar(before + after);
}

/** Rotation vector from a key to the next on the shortest path, in the frame of the key. */
const stepOf = (keys: readonly Quaternion[], k: number) => log(keys[k]!.clone().invert().multiply(keys[k + 1]!));

const log = (q: Quaternion) => new Vector3(...vectorDeg(q)).multiplyScalar(Math.PI / 180);

function exp(vector: Vector3): Quaternion {
  const angle = vector.length();
  return angle > 0 ? new Quaternion().setFromAxisAngle(vector.clone().divideScalar(angle), angle) : new Quaternion();
}
