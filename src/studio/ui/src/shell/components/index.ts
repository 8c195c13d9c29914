// The controls of the studio, for the shell and the workspaces.
export { Button, ToolButton, Toolbar, ToolDivider } from "./button";
export { Dialog } from "./dialog";
export { NumberField, NumberInput, Segmented, Select, SliderField, TextField, Toggle, type Option } from "./field";
export { Icon, ICONS, type IconName } from "./icon";
export { List, Tree, type Item, type Node } from "./list";
export { formatNumber, parseNumber } from "./number";
export { Layout, Panel, Tabs } from "./panel";
export { createPlayback, type Playback } from "./playback";
export { Plot, type Curve, type PlotProps } from "./plot";
export { Timeline, type TimelineKey, type TimelineProps, type Track } from "./timeline";
export { cssColor, theme } from "../theme";
export { remembered } from "../remembered";
