// The camera: it orbits about a target, by pointer, wheel and keyboard. A perspective camera, with an up axis that never tilts.
import { Matrix4, PerspectiveCamera, Quaternion, Spherical, Vector2, Vector3, type Box3 } from "three";

/** Where the camera looks from: a name for each side. */
export type NamedView = "front" | "back" | "left" | "right" | "top" | "bottom" | "home";

/** Azimuth and angle from the up axis of each named view, rad. */
const VIEWS: Record<NamedView, [number, number]> = {
  front: [0, Math.PI / 2],
  back: [Math.PI, Math.PI / 2],
  right: [Math.PI / 2, Math.PI / 2],
  left: [-Math.PI / 2, Math.PI / 2],
  top: [0, 0],
  bottom: [0, Math.PI],
  home: [0.5, 1.25],
};

/** Radians per pixel of a drag: a drag over 800 px is one rotation. */
const ORBIT_SPEED = (2 * Math.PI) / 800;
/** Nearer to the poles the up axis would be along the line of sight. */
const POLE = 1e-4;

/** An orbiting camera. `onChange` is called after each change. */
export class OrbitCamera {
  readonly camera = new PerspectiveCamera(35, 1, 0.01, 100);
  readonly target = new Vector3();
  /** Of the camera about the target, with the up axis along y. */
  private readonly spherical = new Spherical(3, 1.25, 0.5);
  private readonly upFromY = new Quaternion();
  private radius = 1;
  private height = 1;

  constructor(private readonly onChange: () => void) {
    this.update();
  }

  /** The up axis of what is shown. */
  setUp(axis: "y" | "z") {
    this.upFromY.setFromUnitVectors(new Vector3(0, 1, 0), axis === "y" ? new Vector3(0, 1, 0) : new Vector3(0, 0, 1));
    if (axis === "z") this.upFromY.setFromAxisAngle(new Vector3(1, 0, 0), Math.PI / 2);
    this.update();
  }

  setSize(width: number, height: number) {
    this.height = Math.max(1, height);
    this.camera.aspect = Math.max(1, width) / this.height;
    this.update();
  }

  /** Looks at all of a box, from where it looks now. */
  fit(box: Box3) {
    if (box.isEmpty()) return;
    box.getCenter(this.target);
    this.radius = Math.max(box.getSize(new Vector3()).length() / 2, 1e-9);
    this.spherical.radius = Math.max(1.08 * this.distanceFor(box), 1e-6 * this.radius);
    this.update();
  }

  /** The least distance from the center of a box at which all its corners are in the view, in the direction of now. */
  private distanceFor(box: Box3): number {
    const tangent = Math.tan((this.camera.fov * Math.PI) / 360);
    const back = this.camera.quaternion.clone().invert();
    const half = box.getSize(new Vector3()).divideScalar(2);
    let distance = 0;
    for (let corner = 0; corner < 8; corner++) {
      const sign = (bit: number) => (corner & bit ? 1 : -1);
      const p = new Vector3(sign(1) * half.x, sign(2) * half.y, sign(4) * half.z).applyQuaternion(back);
      distance = Math.max(distance, p.z + Math.abs(p.x) / (tangent * this.camera.aspect), p.z + Math.abs(p.y) / tangent);
    }
    return distance;
  }

  /** Looks from a named side. */
  look(view: NamedView) {
    [this.spherical.theta, this.spherical.phi] = VIEWS[view];
    this.update();
  }

  orbit(dx: number, dy: number) {
    this.spherical.theta -= dx * ORBIT_SPEED;
    this.spherical.phi -= dy * ORBIT_SPEED;
    this.update();
  }

  /** Moves the target with the pointer, by pixels. */
  pan(dx: number, dy: number) {
    const scale = this.unitsPerPixel(this.target);
    const [x, y] = [new Vector3(), new Vector3()];
    this.camera.matrixWorld.extractBasis(x, y, new Vector3());
    this.target.addScaledVector(x, -dx * scale).addScaledVector(y, dy * scale);
    this.update();
  }

  /** Comes nearer by a factor, towards a point of the view (normalized device coordinates). */
  zoom(factor: number, at: Vector2 = new Vector2()) {
    const before = this.spherical.radius;
    this.spherical.radius = Math.min(1e3 * this.radius, Math.max(1e-3 * this.radius, before / factor));
    const height = Math.tan((this.camera.fov * Math.PI) / 360) * (before - this.spherical.radius);
    const [x, y] = [new Vector3(), new Vector3()];
    this.camera.matrixWorld.extractBasis(x, y, new Vector3());
    this.target.addScaledVector(x, at.x * height * this.camera.aspect).addScaledVector(y, at.y * height);
    this.update();
  }

  /** The size of a pixel at a point, in units of the scene. */
  unitsPerPixel(point: Vector3): number {
    const depth = -point.clone().applyMatrix4(this.camera.matrixWorldInverse).z;
    return (2 * Math.max(depth, this.camera.near) * Math.tan((this.camera.fov * Math.PI) / 360)) / this.height;
  }

  /** Keys of the view: arrows orbit, with Shift pan; + and − zoom; 1, 3, 7 look from front, right, top, with Shift from the other side. */
  onKey(event: KeyboardEvent): boolean {
    if (event.ctrlKey || event.metaKey || event.altKey) return false;
    const step = 24;
    const arrows: Record<string, [number, number]> = {
      ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step],
    };
    const arrow = arrows[event.key];
    const views: Record<string, NamedView> = event.shiftKey
      ? { Digit1: "back", Digit3: "left", Digit7: "bottom" }
      : { Digit1: "front", Digit3: "right", Digit7: "top", Digit0: "home" };
    const view = views[event.code.replace("Numpad", "Digit")];
    if (arrow && event.shiftKey) this.pan(...arrow);
    else if (arrow) this.orbit(...arrow);
    else if (event.key === "+" || event.key === "=") this.zoom(1.15);
    else if (event.key === "-" || event.key === "_") this.zoom(1 / 1.15);
    else if (view) this.look(view);
    else return false;
    return true;
  }

  private update() {
    const { spherical, camera } = this;
    spherical.phi = Math.min(Math.PI - POLE, Math.max(POLE, spherical.phi));
    const offset = new Vector3().setFromSpherical(spherical).applyQuaternion(this.upFromY);
    camera.position.copy(this.target).add(offset);
    camera.up.set(0, 1, 0).applyQuaternion(this.upFromY);
    camera.quaternion.setFromRotationMatrix(new Matrix4().lookAt(camera.position, this.target, camera.up));
    camera.near = Math.max(spherical.radius - 4 * this.radius, spherical.radius * 0.01);
    camera.far = spherical.radius + 8 * this.radius;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    this.onChange();
  }
}
