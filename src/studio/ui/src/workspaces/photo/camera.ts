// Zoom and place of the two pictures, linked: both show the same fraction of their sides around the same fraction of their extent.
import { signal } from "@preact/signals";

/** How a picture lies in its view: screen = picture · scale + offset. */
export interface Placement { scale: number; x: number; y: number }

const MAX_ZOOM = 40;

export class Camera {
  /** 1 shows the whole picture. */
  readonly zoom = signal(1);
  /** What lies in the middle of the view, as fractions of the picture's sides. */
  readonly middle = signal<readonly [number, number]>([0.5, 0.5]);

  /** How a picture lies in a view of so many px. */
  placement(width: number, height: number, view: { width: number; height: number }): Placement {
    const margin = 24;
    const fit = Math.min(Math.max(1, view.width - margin) / width, Math.max(1, view.height - margin) / height);
    const scale = fit * this.zoom.value;
    const [u, v] = this.middle.value;
    return { scale, x: view.width / 2 - u * width * scale, y: view.height / 2 - v * height * scale };
  }

  /** The part of a picture that a view shows, as fractions of its sides; null where it shows none. */
  part(width: number, height: number, view: { width: number; height: number }): [number, number, number, number] | null {
    const { scale, x, y } = this.placement(width, height, view);
    const inside = (v: number) => Math.min(1, Math.max(0, v));
    const part: [number, number, number, number] = [
      inside(-x / (width * scale)), inside(-y / (height * scale)), inside((view.width - x) / (width * scale)), inside((view.height - y) / (height * scale)),
    ];
    return part[2] - part[0] > 1e-3 && part[3] - part[1] > 1e-3 ? part : null;
  }

  /** Zooms by a factor; the point at these fractions of the picture stays where it is. */
  zoomAt(factor: number, u: number, v: number) {
    const before = this.zoom.value;
    const zoom = Math.min(MAX_ZOOM, Math.max(1, before * factor));
    const [mu, mv] = this.middle.value;
    const rest = before / zoom;
    this.zoom.value = zoom;
    this.setMiddle(u + (mu - u) * rest, v + (mv - v) * rest);
  }

  /** Moves by fractions of the picture's sides. */
  pan(du: number, dv: number) {
    const [u, v] = this.middle.value;
    this.setMiddle(u + du, v + dv);
  }

  fit() {
    this.zoom.value = 1;
    this.middle.value = [0.5, 0.5];
  }

  /** What lies in the middle, px of the picture. */
  center(width: number, height: number): [number, number] {
    const [u, v] = this.middle.value;
    return [Math.round(u * width), Math.round(v * height)];
  }

  private setMiddle(u: number, v: number) {
    if (this.zoom.value === 1) this.middle.value = [0.5, 0.5];
    else this.middle.value = [Math.min(1, Math.max(0, u)), Math.min(1, Math.max(0, v))];
  }
}
