// Buffers of the photo workspace as the page uses them.
export type Point = readonly [number, number];
export type Curves = readonly (readonly Point[])[];

/** Samples of a part of a picture. */
export interface Picture {
  /** Left, top, right, bottom, px of the whole picture. */
  part: readonly [number, number, number, number];
  canvas: HTMLCanvasElement;
}

/** Vertices of the map's grid, px of the result. */
export interface Grid { cols: number; rows: number; vertices: Float32Array }

/** Four f32, two u32, then red, green, blue. */
export function pictureOf(payload: ArrayBuffer): Picture {
  const part = new Float32Array(payload, 0, 4);
  const [width = 1, height = 1] = new Uint32Array(payload, 16, 2);
  const rgb = new Uint8Array(payload, 24);
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext("2d");
  const image = new ImageData(width, height);
  const rgba = new Uint32Array(image.data.buffer);
  for (let i = 0, k = 0; i < rgba.length; i++, k += 3) {
    rgba[i] = 0xff000000 | ((rgb[k + 2] ?? 0) << 16) | ((rgb[k + 1] ?? 0) << 8) | (rgb[k] ?? 0);
  }
  context?.putImageData(image, 0, 0);
  return { part: [part[0] ?? 0, part[1] ?? 0, part[2] ?? 1, part[3] ?? 1], canvas };
}

/** Number of curves, points of each, then pairs of numbers. */
function pairs(payload: ArrayBuffer, numbers: (at: number) => ArrayLike<number>): Curves {
  const head = new Uint32Array(payload.slice(0, 4));
  const count = head[0] ?? 0;
  const lengths = new Uint32Array(payload, 4, count);
  const values = numbers(4 + 4 * count);
  let at = 0;
  return Array.from(lengths, (length) => Array.from({ length }, () => [values[at++] ?? 0, values[at++] ?? 0] as Point));
}

export const curvesOf = (payload: ArrayBuffer): Curves => pairs(payload, (at) => new Float32Array(payload, at));

export const marksOf = (payload: ArrayBuffer): Curves => pairs(payload, (at) => new Float64Array(payload, Math.ceil(at / 8) * 8));

export function gridOf(payload: ArrayBuffer): Grid {
  const [cols = 0, rows = 0] = new Uint32Array(payload, 0, 2);
  return { cols, rows, vertices: new Float32Array(payload, 8) };
}
