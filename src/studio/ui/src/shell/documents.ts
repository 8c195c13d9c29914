// The open documents: one tab each. Which are open is kept with the window, so that a reload shows them again.
import { computed, effect, signal } from "@preact/signals";
import type { WorkspacePage } from "../workspace";
import { closeDocument, openFile, Refused, serverState, upload, type DocumentInfo, type ServerState } from "./api";
import { notify } from "./notices";
import { SocketConnection } from "./socket_connection";

/** Workspaces by name: their code is loaded when the first document of the kind opens. */
const WORKSPACES: Record<string, { load: () => Promise<{ page: WorkspacePage }>; webgl: boolean }> = {
  mesh: { load: () => import("../workspaces/mesh"), webgl: true },
  character: { load: () => import("../workspaces/character"), webgl: true },
  photo: { load: () => import("../workspaces/photo"), webgl: false },
};

/** An open document. */
export interface OpenDocument {
  info: DocumentInfo;
  connection: SocketConnection;
  /** Its page, when loaded. */
  page: ReturnType<typeof signal<WorkspacePage | null>>;
  /** Why it cannot be shown. */
  failure: ReturnType<typeof signal<string | null>>;
}

const KEY = "plumbline tabs";

export const documents = signal<readonly OpenDocument[]>([]);
const activeId = signal<string | null>(null);

/** The document that is shown; null for the start page. */
export const active = computed(() => documents.value.find(({ info }) => info.document === activeId.value) ?? null);

/** What the server has; null until it answered. */
export const server = signal<ServerState | null>(null);

/** Whether the page has found out what to show. */
export const ready = signal(false);

/** Whether no session could be begun: the page was opened without its link. */
export const locked = signal(false);

export function show(document: string | null) {
  activeId.value = document;
}

/** Adds a document as a tab and shows it. */
export function add(info: DocumentInfo) {
  const found = documents.value.some((open) => open.info.document === info.document);
  if (!found) documents.value = [...documents.value, open(info)];
  show(info.document);
}

/** Closes a document in all windows; what is not saved is kept for the next time. */
export async function closeEverywhere(document: string): Promise<void> {
  await attempt(() => closeDocument(document).then(() => undefined));
  close(document);
}

/** Closes the tab; the document stays with the server and its files. */
export function close(document: string) {
  const at = documents.value.findIndex(({ info }) => info.document === document);
  documents.value[at]?.connection.close();
  const rest = documents.value.filter((_, i) => i !== at);
  documents.value = rest;
  if (activeId.value === document) show(rest[Math.max(0, at - 1)]?.info.document ?? null);
  void refresh();
}

/** Opens a file of the server by its path; a refusal is shown as a notice. */
export async function openPath(path: string, workspace?: "character"): Promise<void> {
  await attempt(async () => add(await openFile(path, workspace)));
}

/** Files that name others, before those that they name: a pipeline its mesh, a mesh its textures. */
const NAMING = [/\.toml$/i, /\.(gltf|glb|fbx|obj|ply|off|stl)$/i];

function rank({ name }: File): number {
  const at = NAMING.findIndex((ending) => ending.test(name));
  return at < 0 ? NAMING.length : at;
}

/** Stores files that were dropped beside each other, then opens the first that is a document. */
export async function openDropped(files: readonly File[]): Promise<void> {
  await attempt(async () => {
    const drop = crypto.randomUUID();
    const paths: string[] = [];
    for (const file of [...files].sort((a, b) => rank(a) - rank(b))) paths.push((await upload(file, drop)).path);
    let refusal: unknown = null;
    for (const path of paths) {
      try {
        return add(await openFile(path));
      } catch (error) {
        refusal ??= error;
      }
    }
    if (refusal) throw refusal;
  });
}

/** Asks the server again what it has. */
export async function refresh(): Promise<void> {
  await attempt(async () => {
    server.value = await serverState();
  });
}

/** The tabs of this window before its reload; else what is open in the program, and the file that it was started with. */
export async function restore(): Promise<void> {
  await refresh();
  const kept = readTabs();
  const wanted = kept?.open ?? startTabs(server.value);
  for (const path of wanted) await openPath(path);
  if (kept) show(documents.value.find(({ info }) => info.path === kept.active)?.info.document ?? null);
  effect(() => {
    const open = documents.value.map(({ info }) => info.path);
    sessionStorage.setItem(KEY, JSON.stringify({ open, active: active.value?.info.path ?? null }));
  });
}

function startTabs(state: ServerState | null): string[] {
  const open = (state?.documents ?? []).map(({ path }) => path);
  return [...open.filter((path) => path !== state?.file), ...(state?.file ? [state.file] : [])];
}

/** After a new link was opened in this window: the documents connect again. */
export async function resume(): Promise<void> {
  locked.value = false;
  await refresh();
  for (const { connection } of documents.value) connection.reconnect();
}

interface Tabs { open: string[]; active: string | null }

function readTabs(): Tabs | null {
  try {
    return JSON.parse(sessionStorage.getItem(KEY) ?? "null") as Tabs | null;
  } catch {
    return null;
  }
}

async function attempt(action: () => Promise<void>): Promise<void> {
  try {
    await action();
  } catch (error) {
    if (error instanceof Refused && error.status === 401) locked.value = true;
    else notify("error", reasonOf(error));
  }
}

/** Why a request failed, for the user. */
export const reasonOf = (error: unknown) => (error instanceof Refused ? error.message : "plumbline does not answer. Is it still running?");

function open(info: DocumentInfo): OpenDocument {
  const page = signal<WorkspacePage | null>(null);
  const failure = signal<string | null>(null);
  const workspace = WORKSPACES[info.workspace];
  if (!workspace) failure.value = `This page has no workspace "${info.workspace}".`;
  else if (workspace.webgl && !hasWebGL2()) failure.value = NO_WEBGL;
  else workspace.load().then((module) => (page.value = module.page), () => (failure.value = "This part of the page could not be loaded. Reload the page."));
  return { info, connection: new SocketConnection(info), page, failure };
}

const NO_WEBGL =
  "This browser has no WebGL 2, which the 3D view needs. Turn on hardware acceleration in its settings, or open the studio in another browser. Nothing of the document is lost.";

function hasWebGL2(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return context !== null;
}
