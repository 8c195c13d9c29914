// Colors of data: scales from a number to a color, and conversion for the renderer.

/** A scale: `sequential` from low to high (viridis), `diverging` about zero, `heat` for weights, `categories` for numbered sets. */
export type ScaleName = "sequential" | "diverging" | "heat";

const STOPS: Record<ScaleName, readonly (readonly [number, number, number])[]> = {
  // Viridis (van der Walt & Smith), every eighth.
  sequential: [[68, 1, 84], [70, 50, 127], [54, 92, 141], [39, 127, 142], [31, 161, 135], [74, 194, 109], [159, 218, 58], [253, 231, 37]],
  // Blue to red (Moreland).
  diverging: [[59, 76, 192], [124, 159, 249], [192, 212, 245], [221, 221, 221], [245, 196, 172], [226, 120, 92], [180, 4, 38]],
  heat: [[28, 42, 120], [30, 110, 190], [40, 180, 190], [110, 205, 90], [240, 220, 60], [240, 130, 40], [200, 25, 30]],
};

/** Entries of a table. */
const SIZE = 256;
const tables = new Map<ScaleName, Uint8Array>();

/** sRGB colors of a scale from low to high, three bytes each. */
export function scaleTable(name: ScaleName): Uint8Array {
  const known = tables.get(name);
  if (known) return known;
  const stops = STOPS[name];
  const table = new Uint8Array(3 * SIZE);
  for (let i = 0; i < SIZE; i++) {
    const at = (i / (SIZE - 1)) * (stops.length - 1);
    const k = Math.min(stops.length - 2, Math.floor(at));
    const [a, b] = [stops[k]!, stops[k + 1]!];
    for (let c = 0; c < 3; c++) table[3 * i + c] = Math.round(a[c]! + (b[c]! - a[c]!) * (at - k));
  }
  tables.set(name, table);
  return table;
}

/** The scale as a CSS gradient, from left to right. */
export function scaleGradient(name: ScaleName): string {
  return `linear-gradient(to right, ${STOPS[name].map(([r, g, b]) => `rgb(${r} ${g} ${b})`).join(", ")})`;
}

/** Writes the colors of values into `rgb`, three bytes of sRGB per value. Values that are no numbers are gray. */
export function colorValues(values: ArrayLike<number>, low: number, high: number, name: ScaleName, rgb: Uint8Array) {
  const table = scaleTable(name);
  const factor = high > low ? (SIZE - 1) / (high - low) : 0;
  for (let v = 0; v < values.length; v++) {
    const value = values[v]!;
    const at = Math.round(Math.min(SIZE - 1, Math.max(0, (value - low) * factor)));
    const known = Number.isFinite(value);
    for (let c = 0; c < 3; c++) rgb[3 * v + c] = known ? table[3 * at + c]! : 128;
  }
}

/** Bytes of sRGB as bytes of linear light, which the renderer expects of vertices. */
export const linearByte = Uint8Array.from({ length: 256 }, (_, i) => {
  const s = i / 255;
  return Math.round(255 * (s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4));
});

/** Colors of numbered things (handles, joints), the same for the same number; as CSS. They differ from the blue of the selection. */
export function categoryColor(index: number): string {
  const [r, g, b] = categoryRgb(index);
  // With commas: three reads no others.
  return `rgb(${r}, ${g}, ${b})`;
}

const CATEGORIES: readonly [number, number, number][] = [
  [222, 110, 40], [46, 150, 90], [150, 80, 190], [200, 160, 20], [205, 60, 110], [20, 140, 165], [125, 105, 60], [105, 125, 220],
];

/** The same in bytes of sRGB. */
export function categoryRgb(index: number): [number, number, number] {
  return CATEGORIES[index % CATEGORIES.length]!;
}
