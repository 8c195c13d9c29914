// Selection, renaming and dragging of the entries of a list or tree.
import { useRef, useState } from "preact/hooks";
import { keyAction } from "./list_keys";
import type { RowsProps } from "./list";

/** How an entry was chosen. */
interface How { ctrlKey: boolean; shiftKey: boolean; metaKey?: boolean }

/** The state of a list: which entry is active, which is being renamed, and what events do. */
export function useSelection(props: RowsProps) {
  const { rows, selected } = props;
  const [renaming, setRenaming] = useState<string | null>(null);
  const { active, setActive, choose, onSelect } = useChoice(props);
  const activate = (id: string) => {
    if (props.onActivate) props.onActivate(id);
    else if (props.onRename) setRenaming(id);
  };
  const rename = (id: string, text: string | null) => {
    setRenaming(null);
    const old = rows.find((row) => row.item.id === id)?.item.label;
    if (text !== null && text.trim() !== "" && text !== old) props.onRename?.(id, text.trim());
  };
  const onKeyDown = (event: KeyboardEvent) => {
    if (event.target !== event.currentTarget) return;
    const order = rows.map((row) => row.item.id);
    const action = keyAction(event, { props, rows, order, active, choose, setActive, onSelect });
    if (event.key === "F2" && active && props.onRename) setRenaming(active);
    else if (event.key === "Enter" && active) activate(active);
    else if (!action) return;
    event.preventDefault();
    event.stopPropagation();
  };
  return { active, renaming, onKeyDown, click: choose, activate, rename, ...useNodeDrag(props.onMove, selected, onSelect) };
}

/** Which entry is active, and the selection: one, a range, or one more. */
function useChoice({ rows, selected, multiple, onSelect: report }: RowsProps) {
  /** What this list chose last: another selection came from outside, and its entry is the active one. */
  const own = useRef("");
  const [focused, setActive] = useState<string | null>(null);
  const [anchor, setAnchor] = useState<string | null>(null);
  const order = rows.map((row) => row.item.id);
  const keeps = focused !== null && order.includes(focused) && (selected.includes(focused) || selected.length === 0 || selected.join("\n") === own.current);
  const active = keeps ? focused : (selected[selected.length - 1] ?? order[0] ?? null);
  const onSelect = (ids: string[]) => {
    own.current = ids.join("\n");
    report(ids);
  };
  const range = (from: string | null, to: string) => {
    const [a, b] = [order.indexOf(from ?? to), order.indexOf(to)].sort((x, y) => x - y);
    return order.slice(a, (b ?? 0) + 1);
  };
  const choose = (id: string, how: How) => {
    setActive(id);
    if (multiple && how.shiftKey) return onSelect(range(anchor ?? active, id));
    setAnchor(id);
    if (multiple && (how.ctrlKey || how.metaKey)) onSelect(selected.includes(id) ? selected.filter((other) => other !== id) : [...selected, id]);
    else onSelect([id]);
  };
  return { active, setActive, choose, onSelect };
}

/** The kind of data of a dragged entry, so that files and texts are not taken for one. */
const NODE = "text/x-plumbline-node";
const isNode = (event: DragEvent) => event.dataTransfer?.types.includes(NODE) ?? false;

/** Entries dragged onto another one, or below the last, which makes them roots. With one that is selected all that are go. */
function useNodeDrag(onMove: RowsProps["onMove"], selected: readonly string[], onSelect: (ids: string[]) => void) {
  const [dropTarget, setDropTarget] = useState<string | null>(null);
  if (!onMove) return { dropTarget: null, dragging: () => ({}), dropOutside: {} };
  const end = () => setDropTarget(null);
  const over = (event: DragEvent, target: string | null) => {
    if (!isNode(event)) return;
    event.preventDefault();
    event.stopPropagation();
    setDropTarget(target);
  };
  const drop = (event: DragEvent, target: string | null) => {
    if (!isNode(event)) return;
    event.preventDefault();
    event.stopPropagation();
    end();
    const dragged = event.dataTransfer?.getData(NODE) ?? "";
    const ids = (selected.includes(dragged) ? [...selected] : [dragged]).filter((id) => id !== "" && id !== target);
    if (ids.length > 0) onMove(ids, target);
  };
  const dragging = (id: string) => ({
    onDragStart: (event: DragEvent) => {
      event.dataTransfer?.setData(NODE, id);
      if (!selected.includes(id)) onSelect([id]);
    },
    onDragOver: (event: DragEvent) => over(event, id),
    onDragLeave: end,
    onDragEnd: end,
    onDrop: (event: DragEvent) => drop(event, id),
  });
  const dropOutside = { onDragOver: (event: DragEvent) => over(event, null), onDrop: (event: DragEvent) => drop(event, null) };
  return { dropTarget, dragging, dropOutside };
}
