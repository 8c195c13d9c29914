// Lists of vertices as people type them: "0-20, 35, 40-42".

/** The vertices that a text means; null where it means none. */
export function parseVertices(text: string, count: number): number[] | null {
  const found = new Set<number>();
  for (const part of text.split(/[\s,;]+/).filter((word) => word !== "")) {
    const match = /^(\d+)(?:[-–](\d+))?$/.exec(part);
    if (!match) return null;
    const [first, last] = [Number(match[1]), Number(match[2] ?? match[1])];
    if (first > last || last >= count) return null;
    for (let v = first; v <= last; v++) found.add(v);
  }
  return [...found].sort((a, b) => a - b);
}

/** Ascending vertices as such a text. */
export function formatVertices(vertices: readonly number[]): string {
  const runs: [number, number][] = [];
  for (const v of vertices) {
    const last = runs[runs.length - 1];
    if (last && v === last[1] + 1) last[1] = v;
    else runs.push([v, v]);
  }
  return runs.map(([a, b]) => (a === b ? `${a}` : b === a + 1 ? `${a}, ${b}` : `${a}-${b}`)).join(", ");
}
