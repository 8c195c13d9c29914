// The bar at the top: menus, tabs of documents, undo and redo, what state the document is in.
import { byId, enabled, historyShown, overlay } from "./commands";
import { Icon, ToolButton, ToolDivider, Toolbar, type IconName } from "./components";
import { active, close, documents, show, type OpenDocument } from "./documents";
import { MenuBar } from "./menu";
import { theme, themeChoice } from "./theme";

export function TopBar() {
  const document = active.value;
  return (
    <header class="top">
      <MenuBar />
      <TabBar />
      <span class="grow" />
      {document && <DocumentState document={document} />}
      <Toolbar label="Document">
        {document && <CommandTool id="undo" icon="undo" />}
        {document && <CommandTool id="redo" icon="redo" />}
        {document && <ToolButton icon="history" label="History" shortcut="Alt+H" pressed={historyShown.value} onClick={() => (historyShown.value = !historyShown.value)} />}
        {document && <CommandTool id="save" icon="save" />}
        {document && <ToolDivider />}
        <ToolButton icon="search" label="Find a command" shortcut="Ctrl+K" onClick={() => (overlay.value = "palette")} />
        <ToolButton icon={theme.value === "dark" ? "moon" : "sun"} label={theme.value === "dark" ? "Light theme" : "Dark theme"}
          onClick={() => (themeChoice.value = theme.value === "dark" ? "light" : "dark")} />
        <ToolButton icon="help" label="Keyboard shortcuts" shortcut="?" tip="left" onClick={() => (overlay.value = "shortcuts")} />
      </Toolbar>
    </header>
  );
}

function CommandTool({ id, icon }: { id: string; icon: IconName }) {
  const command = byId(id);
  if (!command) return null;
  return <ToolButton icon={icon} label={command.title} shortcut={command.shortcut} disabled={!enabled(command)} onClick={command.run} />;
}

/** Saved or not, and whether the server computes. */
function DocumentState({ document }: { document: OpenDocument }) {
  const { history, working, connected } = document.connection;
  const { at, savedAt, steps } = history.value;
  const text = !connected.value ? "Not connected" : steps.length === 0 ? "" : at === savedAt ? "Saved" : "Not saved";
  return (
    <span class="document-state">
      <span class={`working ${working.value ? "" : "idle"}`} data-working={working.value} title={working.value ? "plumbline is computing" : undefined}>
        <span class="spinner" aria-hidden="true" />
        Computing
      </span>
      <span role="status" class="muted saved-state">{text}</span>
    </span>
  );
}

const ICONS: Record<string, IconName> = { mesh: "mesh", character: "character", photo: "photo" };
export const workspaceIcon = (workspace: string | null | undefined): IconName => ICONS[workspace ?? ""] ?? "file";

/** The start page and the open documents. */
function TabBar() {
  const current = active.value?.info.document ?? null;
  return (
    <nav class="document-tabs" aria-label="Documents">
      <button type="button" class="document-tab start-tab" aria-current={current === null ? "page" : undefined} aria-label="Start page" onClick={() => show(null)}>
        <Icon name="home" />
      </button>
      {documents.value.map((document) => <DocumentTab key={document.info.document} document={document} current={current === document.info.document} />)}
    </nav>
  );
}

function DocumentTab({ document: { info, connection }, current }: { document: OpenDocument; current: boolean }) {
  const { at, savedAt, steps } = connection.history.value;
  const unsaved = steps.length > 0 && at !== savedAt;
  return (
    <span class={`document-tab ${current ? "current" : ""}`}>
      <button type="button" class="document-name" title={info.path} aria-current={current ? "page" : undefined} onClick={() => show(info.document)}
        onAuxClick={(event) => event.button === 1 && close(info.document)}>
        <Icon name={workspaceIcon(info.workspace)} />
        <span class="ellipsis">{info.name}</span>
        {unsaved && <span class="unsaved" title="Not saved" />}
      </button>
      <button type="button" class="tool close-tab" aria-label={`Close ${info.name}`} onClick={() => close(info.document)}><Icon name="close" /></button>
    </span>
  );
}
