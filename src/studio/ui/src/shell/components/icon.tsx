// Icons: drawn for this program on a grid of 16, lines of 1.25.

/** Outlines by name; `Icon` takes a name or an outline of your own. */
export const ICONS = {
  undo: "M6 3 3 6l3 3M3 6h6.5a3.5 3.5 0 0 1 0 7H6",
  redo: "m10 3 3 3-3 3M13 6H6.5a3.5 3.5 0 0 0 0 7H10",
  save: "M3 3h8l2 2v8H3zM5.5 3v3.5h4V3M5 13V9.5h6V13",
  folder: "M2 12.5v-9h4l1.5 2H14v7z",
  file: "M4 2h5l3 3v9H4zM9 2v3h3",
  close: "m4 4 8 8M12 4l-8 8",
  plus: "M8 3v10M3 8h10",
  minus: "M3 8h10",
  check: "m3 8.5 3.5 3.5L13 4.5",
  chevron: "m6 4 4 4-4 4",
  down: "m4 6 4 4 4-4",
  up: "M8 13V3.5M4 7l4-4 4 4",
  search: "M7 11.5a4.5 4.5 0 1 0 0-9 4.5 4.5 0 0 0 0 9zM10.3 10.3 14 14",
  sun: "M8 10.5a2.5 2.5 0 1 0 0-5 2.5 2.5 0 0 0 0 5zM8 1.5v2M8 12.5v2M1.5 8h2M12.5 8h2M3.4 3.4l1.4 1.4M11.2 11.2l1.4 1.4M3.4 12.6l1.4-1.4M11.2 4.8l1.4-1.4",
  moon: "M13 9.5A5.5 5.5 0 0 1 6.5 3 5.5 5.5 0 1 0 13 9.5z",
  screen: "M2 3h12v8H2zM6 13.5h4M8 11v2.5",
  help: "M8 14A6 6 0 1 0 8 2a6 6 0 0 0 0 12zM6.3 6.3a1.8 1.8 0 1 1 2.6 1.6C8.2 8.3 8 8.6 8 9.3M8 11.4v.1",
  history: "M2.5 8a5.5 5.5 0 1 0 1.7-4L2.5 5.5M2.5 2.5v3h3M8 5v3l2 1.5",
  menu: "M2.5 4h11M2.5 8h11M2.5 12h11",
  dots: "M3.5 8h.01M8 8h.01M12.5 8h.01",
  play: "M5 3v10l8-5z",
  pause: "M5.5 3.5v9M10.5 3.5v9",
  previous: "M11 3.5 5.5 8l5.5 4.5zM4 3.5v9",
  next: "M5 3.5 10.5 8 5 12.5zM12 3.5v9",
  first: "M13 3.5 8.5 8l4.5 4.5zM8 3.5 3.5 8 8 12.5z",
  last: "M3 3.5 7.5 8 3 12.5zM8 3.5 12.5 8 8 12.5z",
  loop: "M3 8V6.5A2.5 2.5 0 0 1 5.5 4H13M11 2l2 2-2 2M13 8v1.5a2.5 2.5 0 0 1-2.5 2.5H3M5 14l-2-2 2-2",
  key: "m8 3 5 5-5 5-5-5z",
  keyAdd: "m7 4 4 4-4 4-4-4zM13.5 2v4M11.5 4h4",
  keyDelete: "m7 4 4 4-4 4-4-4zM11.5 4h4",
  select: "m4 2 8.5 6.5-4 .7L6.5 13z",
  brush: "m13.5 2.5-6 6 1.5 1.5 5-6.5zM7.5 8.5c-2 0-2.5 1-2.7 2.3-.2 1-1 1.7-2.3 1.7 1.5 1 5.5 1.2 6.3-2.2",
  lasso: "M8 2.5c3.3 0 6 1.6 6 3.8s-2.7 3.8-6 3.8-6-1.6-6-3.8 2.7-3.8 6-3.8zM5 9.8c-1.3.8-1.2 2.3 0 2.4 1.2 0 1.6-1.3.6-2.2M4.8 12.2 4 14",
  component: "M2 5.5 5.5 2 9 5.5 5.5 9zM10.5 9.5h.01M13 12h.01M10.5 13.5h.01M13.5 9h.01",
  ring: "M8 11.5c3.3 0 6-1.6 6-3.5S11.3 4.5 8 4.5 2 6.1 2 8s2.7 3.5 6 3.5zM8 9.5c2 0 3.5-.7 3.5-1.5S10 6.5 8 6.5 4.5 7.2 4.5 8 6 9.5 8 9.5z",
  halfspace: "M2 12 14 4M5 12.5h7.5v-5M3 8V3.5h5.5",
  move: "M8 2v12M2 8h12M6 4l2-2 2 2M6 12l2 2 2-2M4 6 2 8l2 2M12 6l2 2-2 2",
  rotate: "M13.5 8A5.5 5.5 0 1 1 11 3.4M11.5 1v3h-3",
  scale: "M2.5 13.5v-5h5v5zM9.5 2.5h4v4M13.5 2.5 9 7",
  mesh: "M8 2 14 6l-2.3 7H4.3L2 6zM8 2 5.5 7.5M8 2l2.5 5.5M2 6l3.5 1.5h5L14 6M5.5 7.5 8 13l2.5-5.5",
  character: "M4 3.5a1.3 1.3 0 1 0 0-.01zM12.5 6a1.3 1.3 0 1 0 0-.01zM6 13a1.3 1.3 0 1 0 0-.01zM6.4 4 10 5.5M11.6 7.2 7.9 12",
  photo: "M2 3h12v10H2zM2 11l3.5-3.5L9 11l2-2 3 3M10.5 6h.01",
  eye: "M1.5 8S4 3.5 8 3.5 14.5 8 14.5 8 12 12.5 8 12.5 1.5 8 1.5 8zM8 10a2 2 0 1 0 0-4 2 2 0 0 0 0 4z",
  eyeOff: "M1.5 8S4 3.5 8 3.5 14.5 8 14.5 8 12 12.5 8 12.5 1.5 8 1.5 8zM3 13 13 3",
  lock: "M4 7h8v6.5H4zM5.5 7V5a2.5 2.5 0 0 1 5 0v2",
  trash: "M3 4.5h10M6 4.5V3h4v1.5M4.5 4.5 5 13.5h6l.5-9M7 7v4M9 7v4",
  copy: "M5.5 5.5h8v8h-8zM10.5 5.5v-3h-8v8h3",
  download: "M8 2.5v7.5M4.5 7 8 10.5 11.5 7M3 13.5h10",
  upload: "M8 10.5V3M4.5 6 8 2.5 11.5 6M3 13.5h10",
  camera: "M2 5h3l1-1.5h4L11 5h3v8H2zM8 11a2.2 2.2 0 1 0 0-4.4A2.2 2.2 0 0 0 8 11z",
  terminal: "M2 3h12v10H2zM4.5 6l2 2-2 2M8 10.5h3",
  info: "M8 14A6 6 0 1 0 8 2a6 6 0 0 0 0 12zM8 7.5v3.5M8 5v.1",
  warning: "M8 2.5 14.5 13.5h-13zM8 6.5v3.5M8 11.8v.1",
  error: "M8 14A6 6 0 1 0 8 2a6 6 0 0 0 0 12zM6 6l4 4M10 6l-4 4",
  grid: "M2.5 2.5h11v11h-11zM2.5 6.2h11M2.5 9.8h11M6.2 2.5v11M9.8 2.5v11",
  mirror: "M8 2v12M6 4 2.5 12H6zM10 4l3.5 8H10z",
  split: "M3 13 8 8M8 8l5-5M6.3 6.3l3.4 3.4",
  extrude: "M3.5 13a1.3 1.3 0 1 0 0-.01zM5.5 10.5l6-6M8 4h4v4",
  joint: "M8 10.5a2.5 2.5 0 1 0 0-5 2.5 2.5 0 0 0 0 5zM8 1.5v4M8 10.5v4",
  pin: "M6 2.5h4M6.5 2.5v4L4.5 9h7l-2-2.5v-4M8 9v5",
  target: "M8 12a4 4 0 1 0 0-8 4 4 0 0 0 0 8zM8 1.5V6M8 10v4.5M1.5 8H6M10 8h4.5",
  line: "M4 12 12 4M3 13.3a1.3 1.3 0 1 0 0-.01M12.5 4.5a1.3 1.3 0 1 0-.01 0",
  face: "M8 14A6 6 0 1 0 8 2a6 6 0 0 0 0 12zM6 6.5v.5M10 6.5v.5M5.5 9.8c1.5 1.7 3.5 1.7 5 0",
  lens: "M8 14A6 6 0 1 0 8 2a6 6 0 0 0 0 12zM8 11a3 3 0 1 0 0-6 3 3 0 0 0 0 6z",
  reset: "M3 8a5 5 0 1 0 1.5-3.5L3 6M3 2.5V6h3.5",
  fit: "M2.5 5.5v-3h3M10.5 2.5h3v3M13.5 10.5v3h-3M5.5 13.5h-3v-3M6 6h4v4H6z",
  sliders: "M3 4h5M11 4h2M9.5 2.5v3M3 8h2M8 8h5M6.5 6.5v3M3 12h6M12 12h1M10.5 10.5v3",
  layers: "m8 2.5 6 3-6 3-6-3zM2 8.5l6 3 6-3M2 11.5l6 3 6-3",
  chart: "M2.5 2.5v11h11M4.5 10.5l3-4 2.5 2 3.5-5",
  palette: "M8 2a6 6 0 0 0 0 12c1.5 0 1.5-1 1.2-1.7-.4-1 .2-1.8 1.3-1.8H12a2 2 0 0 0 2-2A6 6 0 0 0 8 2zM5 8h.01M6.5 5h.01M10 5h.01",
  swap: "M4 3 2 5l2 2M2 5h9M12 9l2 2-2 2M14 11H5",
  link: "M6.5 9.5l3-3M7 5l1.5-1.5a2.5 2.5 0 0 1 4 4L11 9M9 11l-1.5 1.5a2.5 2.5 0 0 1-4-4L5 7",
} as const;

/** A name of the list above. */
export type IconName = keyof typeof ICONS;

/** An icon of 16 px in the color of the text. `path` draws an outline of your own. Never read aloud: the control has the name. */
export function Icon({ name, path }: { name?: IconName; path?: string }) {
  return (
    <svg class="icon" viewBox="0 0 16 16" aria-hidden="true">
      <path d={path ?? (name ? ICONS[name] : "")} />
    </svg>
  );
}
