// What keys do in lists and trees.
import type { Row, RowsProps } from "./list";

export interface KeyContext {
  props: RowsProps;
  rows: readonly Row[];
  order: string[];
  active: string | null;
  choose: (id: string, how: { ctrlKey: boolean; shiftKey: boolean }) => void;
  setActive: (id: string) => void;
  onSelect: (ids: string[]) => void;
}

/** What a key does in a list; false where it means nothing here. */
export function keyAction(event: KeyboardEvent, context: KeyContext): boolean {
  const { props, rows, order, active } = context;
  const at = active === null ? -1 : order.indexOf(active);
  const row = rows[at];
  if (event.altKey) return props.onMove && row ? moveByKey(event.key, context, at) : false;
  const go = (to: number) => {
    const id = order[Math.min(order.length - 1, Math.max(0, to))];
    if (id === undefined) return true;
    if (event.ctrlKey && props.multiple) context.setActive(id);
    else context.choose(id, { ctrlKey: false, shiftKey: event.shiftKey });
    return true;
  };
  switch (event.key) {
    case "ArrowDown": return go(at + 1);
    case "ArrowUp": return go(at - 1);
    case "Home": return go(0);
    case "End": return go(order.length - 1);
    case "ArrowRight":
      if (row?.expanded === undefined) return false;
      return row.expanded ? go(at + 1) : (props.fold?.(row.item.id, false), true);
    case "ArrowLeft":
      if (row?.expanded) return props.fold?.(row.item.id, true), true;
      return row?.item.parent ? go(order.indexOf(row.item.parent)) : false;
    case " ": return active !== null && (context.choose(active, { ctrlKey: props.multiple === true, shiftKey: false }), true);
    case "a": return event.ctrlKey && props.multiple ? (context.onSelect(order), true) : false;
    case "Delete": return props.onDelete && props.selected.length > 0 ? (props.onDelete([...props.selected]), true) : false;
    default: return byLetter(event, rows, at, go);
  }
}

/** A letter goes to the next entry that starts with it. */
function byLetter(event: KeyboardEvent, rows: readonly Row[], at: number, go: (to: number) => boolean): boolean {
  if (event.key.length !== 1 || event.ctrlKey || event.metaKey || !/[\p{L}\p{N}]/u.test(event.key)) return false;
  const count = rows.length;
  for (let step = 1; step <= count; step++) {
    const to = (at + step + count) % count;
    if (rows[to]?.item.label.toLowerCase().startsWith(event.key.toLowerCase())) return go(to);
  }
  return false;
}

/** Alt+Left: to the parent of the parent. Alt+Right: below the entry before it on the same level. */
function moveByKey(key: string, { props, rows }: KeyContext, at: number): boolean {
  const row = rows[at];
  if (!row || !props.onMove) return false;
  const parentOf = (id: string | null | undefined) => rows.find((other) => other.item.id === id)?.item.parent ?? null;
  if (key === "ArrowLeft" && row.item.parent) return props.onMove([row.item.id], parentOf(row.item.parent)), true;
  const before = rows.slice(0, at).reverse().find((other) => other.depth <= row.depth);
  if (key === "ArrowRight" && before?.depth === row.depth) return props.onMove([row.item.id], before.item.id), true;
  return false;
}
