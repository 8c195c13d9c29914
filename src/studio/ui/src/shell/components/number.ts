// Numbers as typed and as shown.

/** At most `digits` after the point, without trailing zeros; small numbers keep three figures. Empty where there is none. */
export function formatNumber(value: number | null | undefined, digits = 3): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "";
  if (value !== 0 && Math.abs(value) < 0.5 * 10 ** -digits) return value.toExponential(2).replace(/\.?0+e/, "e").replaceAll("-", "−");
  const text = value.toFixed(digits);
  return (text.includes(".") ? text.replace(/\.?0+$/, "") : text).replace(/^-0$/, "0").replace("-", "−");
}

/** The number that a text means: "0,5", "−2", "1/3", "1e-4"; null where it means none. */
export function parseNumber(text: string): number | null {
  const clean = text.trim().replaceAll("−", "-").replace(",", ".");
  const parts = clean.split("/").map((part) => (part.trim() === "" ? NaN : Number(part)));
  const [a = NaN, b = 1] = parts;
  const value = a / b;
  return parts.length <= 2 && Number.isFinite(value) ? value : null;
}

interface Ends { min: number; max: number; logarithmic: boolean }

/** Where between the ends of a slider a value is, 0 to 1. */
export function positionOf(value: number, { min, max, logarithmic }: Ends): number {
  const at = logarithmic ? Math.log(value / min) / Math.log(max / min) : (value - min) / (max - min || 1);
  return Math.min(1, Math.max(0, at));
}

/** The value at a position of a slider. */
export function valueAt(position: number, { min, max, logarithmic }: Ends): number {
  return logarithmic ? min * (max / min) ** position : min + position * (max - min);
}
