// A document: its workspace, and what the shell says above it.
import { h } from "preact";
import { Boundary, Message } from "./boundary";
import { historyShown } from "./commands";
import { Button, Dialog, Icon } from "./components";
import type { OpenDocument } from "./documents";
import { HistoryPanel } from "./history_panel";
import type { SocketConnection } from "./socket_connection";

export function DocumentPage({ document }: { document: OpenDocument }) {
  const { connection, failure } = document;
  const page = document.page.value;
  const refused = failure.value ?? connection.outdated.value;
  return (
    <div class="document">
      {!connection.connected.value && connection.outdated.value === null && <LostBanner connection={connection} />}
      <div class="document-body">
        <div class="document-view">
          {refused
            ? <Message icon="warning" title="This document cannot be shown" text={refused} />
            : page && connection.state.value !== null
              ? <Boundary><div class="workspace">{h(page.View, { connection })}</div></Boundary>
              : <Opening name={document.info.name} />}
        </div>
        {historyShown.value && <HistoryPanel connection={connection} />}
      </div>
      {connection.changedOnDisk.value.length > 0 && <DiskDialog connection={connection} />}
    </div>
  );
}

function Opening({ name }: { name: string }) {
  return <main class="message-page" aria-busy="true"><span class="spinner" aria-hidden="true" /><p>Opening {name}</p></main>;
}

function LostBanner({ connection }: { connection: SocketConnection }) {
  // At first opening there is nothing to say yet.
  if (connection.state.value === null) return null;
  const text = connection.unknown.value
    ? "plumbline was started again. Open the link that it printed in this window; every step was kept."
    : "The connection to plumbline is lost. Every step was kept, and this window goes on when plumbline answers again. If it was ended, start it again.";
  return (
    <div class="banner" role="alert">
      <Icon name="warning" />
      <span class="grow">{text}</span>
      <Button onClick={() => connection.reconnect()}>Try now</Button>
    </div>
  );
}

function DiskDialog({ connection }: { connection: SocketConnection }) {
  const paths = connection.changedOnDisk.value;
  return (
    <Dialog title="Files changed on the disk" modal onClose={() => undefined} actions={
      <>
        <Button onClick={() => connection.resolveDisk("keep")}>Keep mine</Button>
        <Button kind="primary" onClick={() => connection.resolveDisk("reload")}>Read the files again</Button>
      </>
    }>
      <p>Another program changed {paths.length === 1 ? "a file" : "files"} of this document:</p>
      <ul class="column">{paths.map((path) => <li key={path} class="mono">{path}</li>)}</ul>
      <p class="muted">Reading again is a step of the history that can be undone. "Keep mine" leaves the document as it is; saving then replaces the files.</p>
    </Dialog>
  );
}
