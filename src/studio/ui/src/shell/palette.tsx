// The command palette: type a few letters of a command, Enter runs it.
import { useEffect, useId, useMemo, useRef, useState } from "preact/hooks";
import type { Command } from "../workspace";
import { commands, enabled, overlay } from "./commands";
import { Dialog } from "./components";

/** How well a query fits a text: the letters in order, better where they are together and begin words; null where they are not there. */
export function fit(query: string, text: string): number | null {
  const [wanted, from] = [query.toLowerCase().replaceAll(" ", ""), text.toLowerCase()];
  let score = 0;
  let at = -1;
  for (const letter of wanted) {
    const next = from.indexOf(letter, at + 1);
    if (next < 0) return null;
    const beginsWord = next === 0 || from[next - 1] === " ";
    score += next === at + 1 ? 3 : beginsWord ? 2 : -Math.min(next - at, 8) / 8;
    at = next;
  }
  return score - from.length / 100;
}

const recent: string[] = [];

function found(query: string): Command[] {
  const usable = commands.value.filter((command) => enabled(command) && command.id !== "palette");
  if (query.trim() === "") return [...usable].sort((a, b) => order(a) - order(b));
  return usable
    .map((command) => ({ command, score: fit(query, `${command.title} ${command.group}`) }))
    .filter((entry): entry is { command: Command; score: number } => entry.score !== null)
    .sort((a, b) => b.score - a.score)
    .map(({ command }) => command);
}

const order = (command: Command) => (recent.includes(command.id) ? recent.indexOf(command.id) - 100 : 0);

export function Palette() {
  const id = useId();
  const [query, setQuery] = useState("");
  const [at, setAt] = useState(0);
  const list = useRef<HTMLDivElement>(null);
  const matching = useMemo(() => found(query), [query]);
  useEffect(() => list.current?.querySelector("[aria-selected=true]")?.scrollIntoView({ block: "nearest" }), [at, query]);
  const close = () => (overlay.value = null);
  const run = (command: Command | undefined) => {
    if (!command) return;
    close();
    recent.splice(0, recent.length, command.id, ...recent.filter((other) => other !== command.id).slice(0, 8));
    // After the dialog gave the focus back.
    setTimeout(command.run);
  };
  const onKeyDown = (event: KeyboardEvent) => {
    const step = { ArrowDown: 1, ArrowUp: -1, PageDown: 8, PageUp: -8 }[event.key];
    if (step !== undefined) setAt(Math.min(matching.length - 1, Math.max(0, at + step)));
    else if (event.key === "Enter") run(matching[at]);
    else return;
    event.preventDefault();
  };
  return (
    <Dialog title="Commands" onClose={close} class="palette">
      <input data-autofocus role="combobox" type="text" aria-label="Find a command" aria-expanded="true" aria-controls={`${id}-list`} aria-autocomplete="list"
        aria-activedescendant={matching[at] ? `${id}-${at}` : undefined} autocomplete="off" spellcheck={false} placeholder="Find a command" value={query}
        onInput={(event) => { setQuery(event.currentTarget.value); setAt(0); }} onKeyDown={onKeyDown} />
      <div ref={list} id={`${id}-list`} class="palette-list scroll" role="listbox" aria-label="Commands">
        {matching.map((command, i) => (
          <div key={command.id} id={`${id}-${i}`} class="item" role="option" aria-selected={i === at} onMouseMove={() => setAt(i)} onClick={() => run(command)}>
            <span class="grow ellipsis">{command.title}</span>
            <span class="detail">{command.group}</span>
            {command.shortcut && <kbd>{command.shortcut}</kbd>}
          </div>
        ))}
        {matching.length === 0 && <div class="empty" role="option" aria-selected="false" aria-disabled="true">No command fits</div>}
      </div>
    </Dialog>
  );
}
