// Lists and trees of things in a view: joints, handles, lines. Whatever can be pointed at in a picture can be chosen here.
import type { ComponentChildren } from "preact";
import { useEffect, useId, useRef, useState } from "preact/hooks";
import { useSelection } from "./list_selection";
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

export interface Common {
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

/** An entry that is shown: depth and, where it has children, whether they are. */
export interface Row { item: Item & { parent?: string | null }; depth: number; expanded: boolean | undefined; setSize: number; position: number }

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

export type RowsProps = Common & {
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
