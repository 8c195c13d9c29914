// Colors of what lies over a photo, in both themes: bright enough for any photo, each with a dark line below.
import type { OrientationSetting } from "../../generated/photo";

export interface Colors {
  found: string; selected: string; face: string; off: string; warning: string;
  of: (orientation: OrientationSetting) => string;
}

const FREE = "#4cc3f1";
const HORIZONTAL = "#ff9d4d";
const VERTICAL = "#6ee7a0";
const ANGLE = "#d9a0f5";

/** The color of an orientation. */
export function orientationColor(orientation: OrientationSetting): string {
  if (orientation === "horizontal") return HORIZONTAL;
  if (orientation === "vertical") return VERTICAL;
  return orientation === "free" ? FREE : ANGLE;
}

export const colorsOf = (): Colors => ({
  found: "#ffe27a", selected: "#ffffff", face: "#f7a8d8", off: "#c3cad2", warning: "#ff7a6b", of: orientationColor,
});

/** What the result draws: grid and carried lines. */
export const GRID_COLOR = "#ffffff";
