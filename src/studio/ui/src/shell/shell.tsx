// Everything around the workspaces.
import { useEffect } from "preact/hooks";
import { startSession } from "./api";
import { overlay, runShortcut } from "./commands";
import { active, documents, locked, ready, refresh, restore, resume } from "./documents";
import { DocumentPage } from "./document_page";
import { DropTarget, watchDrops } from "./drop";
import { About, Shortcuts } from "./help";
import { Notices } from "./notices";
import { Palette } from "./palette";
import { Picker } from "./picker";
import { StartPage } from "./start_page";
import { TopBar } from "./top_bar";

const OVERLAYS = { palette: Palette, shortcuts: Shortcuts, picker: Picker, about: About };

const onHash = () => void again();

export function Shell() {
  useEffect(() => {
    void begin();
    window.addEventListener("keydown", runShortcut);
    window.addEventListener("hashchange", onHash);
    const stopDrops = watchDrops();
    return () => {
      window.removeEventListener("keydown", runShortcut);
      window.removeEventListener("hashchange", onHash);
      stopDrops();
    };
  }, []);
  const document = active.value;
  useTitle();
  // What is open or recent may have changed while another tab was shown.
  useEffect(() => { if (!document) void (documents.value.length > 0 && refresh()); }, [document]);
  const Overlay = overlay.value ? OVERLAYS[overlay.value] : null;
  return (
    <div class="shell" data-ready={ready.value}>
      <TopBar />
      {document ? <DocumentPage key={document.info.document} document={document} /> : <StartPage />}
      <Notices />
      <DropTarget />
      {Overlay && <Overlay />}
    </div>
  );
}

async function begin() {
  if (await startSession().catch(() => false)) await restore();
  else locked.value = true;
  ready.value = true;
}

/** A new link was pasted into this window. */
async function again() {
  if (!(await startSession().catch(() => false))) return;
  locked.value = false;
  await (documents.value.length > 0 ? resume() : restore());
}

function useTitle() {
  const document = active.value;
  const history = document?.connection.history.value;
  const unsaved = history && history.steps.length > 0 && history.at !== history.savedAt;
  useEffect(() => {
    globalThis.document.title = document ? `${unsaved ? "• " : ""}${document.info.name} – plumbline studio` : "plumbline studio";
  }, [document, unsaved]);
}
