// Frames of joints: matrices as the server sends them, and what the view needs of them.
import { Matrix4, Quaternion, Vector3 } from "three";

/** world_from_joint of all joints, 16 numbers each, column by column. */
export class Frames {
  constructor(readonly numbers: Float32Array = new Float32Array()) {}

  get count(): number {
    return this.numbers.length / 16;
  }

  matrix(joint: number): Matrix4 {
    return joint < this.count ? new Matrix4().fromArray(this.numbers, 16 * joint) : new Matrix4();
  }

  position(joint: number): Vector3 {
    const o = 16 * joint + 12;
    return new Vector3(this.numbers[o] ?? 0, this.numbers[o + 1] ?? 0, this.numbers[o + 2] ?? 0);
  }

  rotation(joint: number): Quaternion {
    const rotation = new Quaternion();
    this.matrix(joint).decompose(new Vector3(), rotation, new Vector3());
    return rotation;
  }

  /** Positions of all joints, three numbers each. */
  positions(): Float32Array {
    const out = new Float32Array(3 * this.count);
    for (let j = 0; j < this.count; j++) out.set(this.numbers.subarray(16 * j + 12, 16 * j + 15), 3 * j);
    return out;
  }
}

/** posed_from_rest of joints, for skinning: frames of a pose after the inverses of those at rest. */
export function skinMatrices(posed: Frames, rest: Frames): Float32Array {
  const out = new Float32Array(posed.numbers.length);
  for (let j = 0; j < posed.count; j++) posed.matrix(j).multiply(rest.matrix(j).invert()).toArray(out, 16 * j);
  return out;
}

/** A rotation as its vector, degrees. */
export function vectorDeg(rotation: Quaternion): [number, number, number] {
  const q = rotation.w < 0 ? new Quaternion(-rotation.x, -rotation.y, -rotation.z, -rotation.w) : rotation;
  const sine = Math.hypot(q.x, q.y, q.z);
  const factor = sine > 1e-12 ? (2 * Math.atan2(sine, q.w) * 180) / Math.PI / sine : 360 / Math.PI;
  return [q.x * factor, q.y * factor, q.z * factor];
}

/** The rotation of a vector in degrees. */
export function rotationOfDeg(vector: readonly [number, number, number]): Quaternion {
  const v = new Vector3(...vector).multiplyScalar(Math.PI / 180);
  const angle = v.length();
  return angle > 0 ? new Quaternion().setFromAxisAngle(v.divideScalar(angle), angle) : new Quaternion();
}
