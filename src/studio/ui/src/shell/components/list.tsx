// Lists and trees of things in a view: joints, handles, lines. Whatever can be pointed at in a picture can be chosen here.
import type { ComponentChildren } from "preact";
import { useEffect, useId, useRef, useState } from "preact/hooks";
import { Icon, type IconName } from "./icon";

/** An entry. */
export interface Item {
  id: string;
  label: string;
  /** Right of the label, muted: a count, a kind. */
  detail?: string;
  icon?: IconName;
  /** A square of this color (CSS) before the label. */
  color?: string;
  /** Tools at the right end, such as an eye. */
  actions?: ComponentChildren;
}

/** An entry of a tree; `parent` is an id, or null for a root. Parents come before their children. */
export interface Node extends Item { parent: string | null }

interface Common {
  label: string;
  selected: readonly string[];
  onSelect: (ids: string[]) => void;
  /** Ctrl and Shift select several. */
  multiple?: boolean;
  /** Enter or double click. */
  onActivate?: (id: string) => void;
  /** F2, or double click where there is no `onActivate`, edits the label. */
  onRename?: (id: string, label: string) => void;
  /** The Delete key. */
  onDelete?: (ids: string[]) => void;
  /** Shown where there is nothing. */
  empty?: string;
  /** Height in px at most; else as high as its content. */
  maxHeight?: number;
}

/** Entries one below another. */
export function List(props: Common & { items: readonly Item[] }) {
  const rows = props.items.map((item) => ({ item, depth: 0, expanded: undefined, setSize: props.items.length, position: 0 }));
  return <Rows {...props} role="listbox" rows={rows} />;
}

/** Entries below their parents. `onMove`: entries dropped on a new parent (null: made roots); by keyboard with Alt+arrow keys. */
export function Tree(props: Common & { nodes: readonly Node[]; onMove?: (ids: string[], parent: string | null) => void }) {
  const [folded, setFolded] = useState<ReadonlySet<string>>(new Set());
  const fold = (id: string, closed: boolean) => {
    const next = new Set(folded);
    if (closed) next.add(id);
    else next.delete(id);
    setFolded(next);
  };
  return <Rows {...props} role="tree" rows={visibleRows(props.nodes, folded)} fold={fold} />;
}

interface Row { item: Item & { parent?: string | null }; depth: number; expanded: boolean | undefined; setSize: number; position: number }

/** Depth first, in the order given, without what is below a folded entry. */
function visibleRows(nodes: readonly Node[], folded: ReadonlySet<string>): Row[] {
  const children = new Map<string | null, Node[]>();
  const known = new Set(nodes.map((node) => node.id));
  for (const node of nodes) {
    const parent = node.parent !== null && known.has(node.parent) ? node.parent : null;
    children.set(parent, [...(children.get(parent) ?? []), node]);
  }
  const rows: Row[] = [];
  const waiting = (children.get(null) ?? []).map((item, i, all) => ({ item, depth: 0, setSize: all.length, position: i + 1 })).reverse();
  for (let next = waiting.pop(); next; next = waiting.pop()) {
    const below = children.get(next.item.id) ?? [];
    rows.push({ ...next, expanded: below.length > 0 ? !folded.has(next.item.id) : undefined });
    if (folded.has(next.item.id) || rows.length > nodes.length) continue;
    const depth = next.depth + 1;
    waiting.push(...below.map((item, i) => ({ item, depth, setSize: below.length, position: i + 1 })).reverse());
  }
  return rows;
}

type RowsProps = Common & {
  role: "listbox" | "tree";
  rows: readonly Row[];
  fold?: (id: string, closed: boolean) => void;
  onMove?: (ids: string[], parent: string | null) => void;
};

function Rows(props: RowsProps) {
  const { role, rows, label, selected, multiple, maxHeight } = props;
  const id = useId();
  const list = useRef<HTMLDivElement>(null);
  const control = useSelection(props);
  useEffect(() => {
    // Only where the list was not the cause: a click in the view brings its entry into sight.
    list.current?.querySelector(".item.active")?.scrollIntoView({ block: "nearest" });
  }, [control.active]);
  return (
    <div
      ref={list}
      class="list"
      role={role}
      aria-label={label}
      aria-multiselectable={multiple}
      aria-activedescendant={rows.some((row) => row.item.id === control.active) ? `${id}-${control.active}` : undefined}
      tabIndex={0}
      style={maxHeight ? { maxHeight: `${maxHeight}px` } : undefined}
      onKeyDown={control.onKeyDown}
      {...control.dropOutside}
    >
      {rows.map((row) => (
        <RowView key={row.item.id} id={`${id}-${row.item.id}`} row={row} tree={role === "tree"} props={props} control={control}
          selected={selected.includes(row.item.id)} />
      ))}
      {rows.length === 0 && <div class="empty" role={role === "tree" ? "treeitem" : "option"} aria-disabled="true" aria-selected="false">{props.empty ?? "Nothing here"}</div>}
    </div>
  );
}

type Control = ReturnType<typeof useSelection>;

function RowView({ id, row, tree, props, control, selected }: {
  id: string; row: Row; tree: boolean; props: RowsProps; control: Control; selected: boolean;
}) {
  const { item, depth, expanded } = row;
  return (
    <div
      id={id}
      class={`item ${control.active === item.id ? "active" : ""} ${control.dropTarget === item.id ? "drop-into" : ""}`}
      role={tree ? "treeitem" : "option"}
      aria-selected={selected}
      aria-expanded={expanded}
      aria-level={tree ? depth + 1 : undefined}
      aria-setsize={tree ? row.setSize : undefined}
      aria-posinset={tree ? row.position : undefined}
      style={tree ? { paddingLeft: `${4 + depth * 12}px` } : undefined}
      draggable={!!props.onMove && control.renaming !== item.id}
      onClick={(event) => control.click(item.id, event)}
      onDblClick={() => control.activate(item.id)}
      {...control.dragging(item.id)}
    >
      {tree && (
        <span class="twisty" aria-hidden="true" onClick={(event) => { event.stopPropagation(); props.fold?.(item.id, expanded === true); }}>
          {expanded !== undefined && <Icon name="chevron" />}
        </span>
      )}
      {item.color && <span class="swatch" style={{ background: item.color }} />}
      {item.icon && <Icon name={item.icon} />}
      {control.renaming === item.id
        ? <RenameInput item={item} onDone={(text) => control.rename(item.id, text)} />
        : <span class="grow ellipsis">{item.label}</span>}
      {item.detail && <span class="detail">{item.detail}</span>}
      {item.actions}
    </div>
  );
}

function RenameInput({ item, onDone }: { item: Item; onDone: (text: string | null) => void }) {
  const input = useRef<HTMLInputElement>(null);
  useEffect(() => input.current?.select(), []);
  const onKeyDown = (event: KeyboardEvent) => {
    event.stopPropagation();
    if (event.key === "Enter") onDone(input.current?.value ?? null);
    if (event.key === "Escape") onDone(null);
  };
  return <input ref={input} class="grow" aria-label={`New name of ${item.label}`} defaultValue={item.label} onKeyDown={onKeyDown}
    onBlur={() => onDone(input.current?.value ?? null)} onClick={(event) => event.stopPropagation()} />;
}

/** Selection, keyboard, renaming and dragging of the rows. */
function useSelection(props: RowsProps) {
  const { rows, selected, multiple } = props;
  /** What this list chose last: another selection came from outside, and its entry is the active one. */
  const own = useRef("");
  const onSelect = (ids: string[]) => {
    own.current = ids.join("\n");
    props.onSelect(ids);
  };
  const [focused, setActive] = useState<string | null>(null);
  const [anchor, setAnchor] = useState<string | null>(null);
  const [renaming, setRenaming] = useState<string | null>(null);
  const [dropTarget, setDropTarget] = useState<string | null>(null);
  const order = rows.map((row) => row.item.id);
  const lastSelected = selected[selected.length - 1] ?? null;
  const keeps = focused !== null && order.includes(focused) && (selected.includes(focused) || selected.length === 0 || selected.join("\n") === own.current);
  const active = keeps ? focused : (lastSelected ?? order[0] ?? null);

  const range = (from: string | null, to: string) => {
    const [a, b] = [order.indexOf(from ?? to), order.indexOf(to)].sort((x, y) => x - y);
    return order.slice(a, (b ?? 0) + 1);
  };
  const choose = (id: string, how: { ctrlKey: boolean; shiftKey: boolean; metaKey?: boolean }) => {
    setActive(id);
    if (multiple && how.shiftKey) return onSelect(range(anchor ?? active, id));
    setAnchor(id);
    if (multiple && (how.ctrlKey || how.metaKey)) onSelect(selected.includes(id) ? selected.filter((other) => other !== id) : [...selected, id]);
    else onSelect([id]);
  };
  const activate = (id: string) => {
    if (props.onActivate) props.onActivate(id);
    else if (props.onRename) setRenaming(id);
  };
  const rename = (id: string, text: string | null) => {
    setRenaming(null);
    const old = rows.find((row) => row.item.id === id)?.item.label;
    if (text !== null && text.trim() !== "" && text !== old) props.onRename?.(id, text.trim());
  };
  const moved = (ids: readonly string[]) => (selected.length > 0 ? [...selected] : [...ids]);
  const onKeyDown = (event: KeyboardEvent) => {
    if (event.target !== event.currentTarget) return;
    const action = keyAction(event, { props, rows, order, active, choose, setActive, onSelect });
    if (event.key === "F2" && active && props.onRename) setRenaming(active);
    else if (event.key === "Enter" && active) activate(active);
    else if (!action) return;
    event.preventDefault();
    event.stopPropagation();
  };
  const dragging = (id: string) => {
    if (!props.onMove) return {};
    const end = () => setDropTarget(null);
    return {
      onDragStart: (event: DragEvent) => { event.dataTransfer?.setData("text/x-plumbline-node", id); if (!selected.includes(id)) onSelect([id]); },
      onDragOver: (event: DragEvent) => { if (event.dataTransfer?.types.includes("text/x-plumbline-node")) { event.preventDefault(); setDropTarget(id); } },
      onDragLeave: end,
      onDragEnd: end,
      onDrop: (event: DragEvent) => {
        event.preventDefault();
        end();
        event.stopPropagation();
        const ids = moved([event.dataTransfer?.getData("text/x-plumbline-node") ?? ""]).filter((other) => other !== "" && other !== id);
        if (ids.length > 0) props.onMove?.(ids, id);
      },
    };
  };
  /** Dropped below the last entry: becomes a root. */
  const dropOutside = {
    onDragOver: (event: DragEvent) => { if (props.onMove && event.dataTransfer?.types.includes("text/x-plumbline-node")) event.preventDefault(); },
    onDrop: (event: DragEvent) => {
      const id = event.dataTransfer?.getData("text/x-plumbline-node");
      if (!props.onMove || !id) return;
      event.preventDefault();
      props.onMove(moved([id]), null);
    },
  };
  return { active, renaming, dropTarget, dropOutside, onKeyDown, click: choose, activate, rename, dragging };
}

interface KeyContext {
  props: RowsProps;
  rows: readonly Row[];
  order: string[];
  active: string | null;
  choose: (id: string, how: { ctrlKey: boolean; shiftKey: boolean }) => void;
  setActive: (id: string) => void;
  onSelect: (ids: string[]) => void;
}

/** What a key does in a list; false where it means nothing here. */
function keyAction(event: KeyboardEvent, context: KeyContext): boolean {
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
