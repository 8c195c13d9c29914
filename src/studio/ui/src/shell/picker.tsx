// The file picker: folders of the server that were named at start. A browser gives bytes of a chosen file, not its path; the
// documents live beside their files, so the server lists them.
import { useEffect, useRef, useState } from "preact/hooks";
import { listFolder, openFile, type FolderEntry, type FolderListing } from "./api";
import { overlay } from "./commands";
import { Button, Dialog, Icon, ToolButton, remembered } from "./components";
import { add, reasonOf } from "./documents";
import { workspaceIcon } from "./top_bar";

const close = () => (overlay.value = null);
const lastFolder = remembered("folder", "");

/** The folder that is shown, what of it is typed and chosen, and the ways on. */
function useFolder() {
  const [listing, setListing] = useState<FolderListing | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  const [filter, setFilter] = useState("");
  const [at, setAt] = useState(0);
  const enter = (path?: string) => {
    setProblem(null);
    return listFolder(path).then((next) => {
      setListing(next);
      lastFolder.value = next.path;
    }, (error: unknown) => {
      if (path !== undefined && listing === null) void enter();
      else setProblem(reasonOf(error));
    });
  };
  // The filter ends now rather than with the answer: what is typed meanwhile counts.
  const go = (path: string) => {
    setFilter("");
    setAt(0);
    void enter(path);
  };
  useEffect(() => void enter(lastFolder.peek() || undefined), []);
  const shown = (listing?.entries ?? []).filter((entry) => entry.name.toLowerCase().includes(filter.toLowerCase()));
  const choose = (entry: FolderEntry | undefined) => {
    if (entry?.folder) return go(entry.path);
    if (!entry) return;
    setProblem(null);
    openFile(entry.path).then((info) => { close(); add(info); }, (error: unknown) => setProblem(reasonOf(error)));
  };
  const up = () => { if (listing?.parent !== null && listing?.parent !== undefined) go(listing.parent); };
  const type = (text: string) => { setFilter(text); setAt(0); };
  return { listing, problem, filter, type, shown, at, setAt, choose, up };
}

export function Picker() {
  const { listing, problem, filter, type, shown, at, setAt, choose, up } = useFolder();
  const onKeyDown = (event: KeyboardEvent) => {
    const step = { ArrowDown: 1, ArrowUp: -1, PageDown: 10, PageUp: -10 }[event.key];
    if (step !== undefined) setAt(Math.min(shown.length - 1, Math.max(0, at + step)));
    else if (event.key === "Enter") choose(shown[at]);
    else if (event.key === "Backspace" && filter === "") up();
    else return;
    event.preventDefault();
  };
  return (
    <Dialog title="Open a file" onClose={close} wide class="picker"
      actions={<><Button onClick={close}>Cancel</Button><Button kind="primary" disabled={!shown[at]} onClick={() => choose(shown[at])}>{shown[at]?.folder ? "Open folder" : "Open"}</Button></>}>
      <div class="row">
        <ToolButton icon="up" label="Parent folder" disabled={listing?.parent === null || !listing} onClick={up} />
        <span class="grow ellipsis mono" title={listing?.path}>{listing ? listing.path || "Folders of this studio" : "…"}</span>
      </div>
      <input data-autofocus type="text" role="combobox" aria-expanded="true" aria-controls="picker-list" aria-label="Find in this folder" aria-autocomplete="list"
        aria-activedescendant={shown[at] ? `picker-${at}` : undefined} placeholder="Type to find; arrow keys choose, Enter opens, Backspace goes up"
        autocomplete="off" spellcheck={false} value={filter} onInput={(event) => type(event.currentTarget.value)} onKeyDown={onKeyDown} />
      {problem && <p class="error-text" role="alert">{problem}</p>}
      {listing?.cut && <p class="muted">This folder has more files than are listed.</p>}
      <Entries shown={shown} at={at} setAt={setAt} choose={choose} empty={listing ? "Nothing here that the studio opens" : "Reading the folder"} />
    </Dialog>
  );
}

function Entries({ shown, at, setAt, choose, empty }: {
  shown: readonly FolderEntry[]; at: number; setAt: (at: number) => void; choose: (entry: FolderEntry) => void; empty: string;
}) {
  const list = useRef<HTMLDivElement>(null);
  useEffect(() => list.current?.querySelector("[aria-selected=true]")?.scrollIntoView({ block: "nearest" }), [at]);
  return (
    <div ref={list} id="picker-list" class="list picker-list" role="listbox" aria-label="Files and folders">
      {shown.map((entry, i) => (
        <div key={entry.path} id={`picker-${i}`} class="item" role="option" aria-selected={i === at} onClick={() => setAt(i)} onDblClick={() => choose(entry)}>
          <Icon name={entry.folder ? "folder" : workspaceIcon(entry.workspace)} />
          <span class="grow ellipsis">{entry.name}</span>
          <span class="detail">{entry.folder ? "" : `${entry.workspace ?? ""} ${size(entry.bytes)}`}</span>
        </div>
      ))}
      {shown.length === 0 && <div class="empty" role="option" aria-selected="false" aria-disabled="true">{empty}</div>}
    </div>
  );
}

function size(bytes: number | undefined): string {
  if (bytes === undefined) return "";
  if (bytes < 1e3) return `${bytes} B`;
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}
