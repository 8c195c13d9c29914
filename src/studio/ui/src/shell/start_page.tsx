// The page shown where no document is: open, recent documents, an example of each workspace.
import { overlay } from "./commands";
import { Button, Icon, ToolButton } from "./components";
import { add, closeEverywhere, locked, openPath, server } from "./documents";
import { workspaceIcon } from "./top_bar";

const PURPOSE: Record<string, string> = {
  mesh: "Make handles, grab a shape and drag it; the rest follows as rigidly as it can.",
  character: "Draw a skeleton by hand, paint its weights, pose it and set keys.",
  photo: "Mark lines that are straight or upright in the world; the picture follows.",
};

export function StartPage() {
  if (locked.value) return <Locked />;
  const known = server.value;
  return (
    <main class="start">
      <div class="start-inner">
        <div class="start-head">
          <svg class="start-mark" viewBox="0 0 16 16" aria-hidden="true"><rect width="16" height="16" rx="3.5" /><path d="M8 2.5v6.2M5.6 8.7h4.8L8 13.7z" /></svg>
          <div class="grow">
            <h1>plumbline studio</h1>
            <p class="muted">Meshes, characters and photos, edited by hand. Everything is stored in a file that plumbline can run.</p>
          </div>
          <Button kind="primary" icon="folder" onClick={() => (overlay.value = "picker")}>Open a file</Button>
        </div>
        <div class="start-columns">
          <section aria-labelledby="start-recent">
            <OpenList />
            <h2 id="start-recent">Recent</h2>
            <RecentList />
            <p class="drop-hint"><Icon name="upload" /> Or drop files anywhere in this window</p>
          </section>
          <section aria-labelledby="start-examples">
            <h2 id="start-examples">Examples</h2>
            <div class="column">
              {known?.examples.map((example) => (
                <button key={example.path} type="button" class="example" onClick={() => void openPath(example.path)}>
                  <span class="example-icon"><Icon name={workspaceIcon(example.workspace)} /></span>
                  <span class="grow">
                    <strong>{example.title}</strong>
                    <span class="muted">{PURPOSE[example.workspace] ?? ""}</span>
                  </span>
                </button>
              ))}
              {known?.examples.length === 0 && <p class="empty">Examples are in the folder media/ of the source; start the studio there to see them.</p>}
            </div>
          </section>
        </div>
        <footer class="muted num">{known ? `plumbline ${known.version} · files of ${known.folders.join(", ")}` : "Waiting for plumbline"}</footer>
      </div>
    </main>
  );
}

/** What the program has open, in this window or another. */
function OpenList() {
  const open = server.value?.documents ?? [];
  if (open.length === 0) return null;
  return (
    <>
      <h2 id="start-open">Open</h2>
      <ul class="recent" aria-labelledby="start-open">
        {open.map((info) => (
          <li key={info.document} class="row">
            <button type="button" class="recent-entry" title={info.path} onClick={() => add(info)}>
              <Icon name={workspaceIcon(info.workspace)} />
              <span class="grow ellipsis">{info.name}</span>
            </button>
            <ToolButton icon="close" label={`Close ${info.name} in all windows`} tip="left" onClick={() => void closeEverywhere(info.document)} />
          </li>
        ))}
      </ul>
    </>
  );
}

function RecentList() {
  const open = server.value?.documents.map(({ path }) => path) ?? [];
  const recent = (server.value?.recent ?? []).filter(({ path }) => !open.includes(path));
  if (recent.length === 0) return <p class="empty">Documents that you opened are listed here.</p>;
  return (
    <ul class="recent">
      {recent.map(({ path, workspace }) => (
        <li key={path}>
          <button type="button" class="recent-entry" title={path} onClick={() => void openPath(path)}>
            <Icon name={workspaceIcon(workspace)} />
            <span class="grow ellipsis">{path.split(/[/\\]/).pop()}</span>
            <span class="detail muted ellipsis"><bdi>{path.split(/[/\\]/).slice(0, -1).join("/")}</bdi></span>
          </button>
        </li>
      ))}
    </ul>
  );
}

/** Without the link that the program printed nothing can be shown. */
function Locked() {
  return (
    <main class="message-page">
      <Icon name="lock" />
      <h1>This window has no access</h1>
      <p>Each start of plumbline makes a link that works once. Start it again and use the link that it opens or prints:</p>
      <p><code>plumbline studio</code></p>
    </main>
  );
}
