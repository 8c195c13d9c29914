// Menus: a button that opens a list of commands, and a bar of them.
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import type { Command } from "../workspace";
import { enabled, menus } from "./commands";
import { Icon } from "./components";
import { themeChoice } from "./theme";

/** The bar of menus: left and right go to the next menu, open or not. */
export function MenuBar() {
  const bar = useRef<HTMLDivElement>(null);
  const [open, setOpen] = useState<number | null>(null);
  const all = menus.value;
  const go = (to: number) => {
    const next = (to + all.length) % all.length;
    bar.current?.querySelectorAll<HTMLElement>(".menubar-button")[next]?.focus();
    if (open !== null) setOpen(next);
  };
  return (
    <div ref={bar} class="menubar" role="menubar" aria-label="Menus">
      {all.map(({ title, items }, i) => (
        <MenuButton key={title} title={title} items={items} open={open === i} first={i === (open ?? 0)}
          setOpen={(shown) => setOpen(shown ? i : null)} hovered={() => open !== null && open !== i && setOpen(i)} go={(by) => go(i + by)} />
      ))}
    </div>
  );
}

function MenuButton(props: {
  title: string; items: readonly Command[]; open: boolean; first: boolean; setOpen: (open: boolean) => void; hovered: () => void; go: (by: number) => void;
}) {
  const { title, items, open, setOpen, go } = props;
  const button = useRef<HTMLButtonElement>(null);
  const onKeyDown = (event: KeyboardEvent) => {
    if (event.key === "ArrowDown" || event.key === "ArrowUp") setOpen(true);
    else if (event.key === "ArrowRight") go(1);
    else if (event.key === "ArrowLeft") go(-1);
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  const close = () => {
    setOpen(false);
    button.current?.focus();
  };
  return (
    <div role="none" class="menu-button" onMouseEnter={props.hovered}>
      <button ref={button} type="button" role="menuitem" class={`menubar-button tool ${open ? "open" : ""}`} aria-haspopup="menu" aria-expanded={open}
        tabIndex={props.first ? 0 : -1} onClick={() => setOpen(!open)} onKeyDown={onKeyDown}>
        {title}
      </button>
      {open && <Menu title={title} items={items} anchor={button.current} close={close} leave={() => setOpen(false)} go={go} />}
    </div>
  );
}

function Menu({ title, items, anchor, close, leave, go }: {
  title: string; items: readonly Command[]; anchor: HTMLElement | null; close: () => void; leave: () => void; go: (by: number) => void;
}) {
  const menu = useRef<HTMLDivElement>(null);
  const entries = () => [...(menu.current?.querySelectorAll<HTMLElement>(".menu-item") ?? [])];
  useLayoutEffect(() => {
    entries()[0]?.focus();
    const outside = (event: PointerEvent) => {
      if (!menu.current?.parentElement?.contains(event.target as globalThis.Node)) leave();
    };
    document.addEventListener("pointerdown", outside);
    return () => document.removeEventListener("pointerdown", outside);
  }, []);
  const onKeyDown = (event: KeyboardEvent) => {
    const all = entries();
    const at = all.indexOf(document.activeElement as HTMLElement);
    const to: Record<string, number> = { ArrowDown: at + 1, ArrowUp: at - 1, Home: 0, End: all.length - 1 };
    if (to[event.key] !== undefined) all[((to[event.key] ?? 0) + all.length) % all.length]?.focus();
    else if (event.key === "Escape") close();
    else if (event.key === "Tab") return leave();
    else if (event.key === "ArrowRight") go(1);
    else if (event.key === "ArrowLeft") go(-1);
    else if (event.key.length === 1 && event.key !== " ") all.find((_, i) => items[i]?.title.toLowerCase().startsWith(event.key.toLowerCase()))?.focus();
    else return event.stopPropagation();
    event.preventDefault();
    event.stopPropagation();
  };
  const box = anchor?.getBoundingClientRect();
  return (
    <div ref={menu} class="menu" role="menu" aria-label={title} onKeyDown={onKeyDown}
      style={box ? { left: `${Math.min(box.left, window.innerWidth - 260)}px`, top: `${box.bottom + 2}px` } : undefined}>
      {items.map((command) => <MenuItem key={command.id} command={command} close={close} />)}
    </div>
  );
}

function MenuItem({ command, close }: { command: Command; close: () => void }) {
  const theme = command.id.match(/^theme-(.*)$/)?.[1];
  const usable = enabled(command);
  const run = () => {
    if (!usable) return;
    close();
    command.run();
  };
  return (
    <button type="button" class="menu-item" role={theme ? "menuitemradio" : "menuitem"} aria-checked={theme ? theme === themeChoice.value : undefined}
      aria-disabled={!usable} tabIndex={-1} onClick={run} onMouseEnter={(event) => event.currentTarget.focus()}>
      <span class="check">{theme === themeChoice.value && theme && <Icon name="check" />}</span>
      <span class="grow">{command.title}</span>
      {command.shortcut && <kbd aria-hidden="true">{command.shortcut}</kbd>}
    </button>
  );
}
