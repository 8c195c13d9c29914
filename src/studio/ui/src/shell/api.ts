// Requests to the server. The address that the program opens carries a one-time token in its fragment; the page exchanges it for a
// session token, which every later request sends as a header and the socket as a subprotocol. No cookies: those ignore ports.

const KEY = "plumbline session";

/** A request that the server refused; the text is the server's. */
export class Refused extends Error {
  constructor(readonly status: number, text: string) {
    super(text);
  }
}

export interface ServerState {
  version: string;
  /** Folders in which files may be chosen, by absolute path. */
  folders: string[];
  documents: DocumentInfo[];
  recent: { path: string; workspace: string }[];
  examples: { path: string; workspace: string; title: string }[];
  /** The file that was named at start. */
  file: string | null;
}
export interface DocumentInfo { document: string; workspace: string; name: string; path: string }
export interface FolderEntry { name: string; path: string; folder: boolean; bytes?: number; workspace?: string | null }
export interface FolderListing { path: string; parent: string | null; entries: FolderEntry[]; cut: boolean }

let session: string | null = sessionStorage.getItem(KEY);

export const sessionToken = () => session;

/** Exchanges the token of the address, which is erased from it. False where there is neither token nor session. */
export async function startSession(): Promise<boolean> {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  if (token) {
    history.replaceState(null, "", location.pathname + location.search);
    const answer = await fetch("/api/session", {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify({ token }),
    });
    if (answer.ok) {
      session = ((await answer.json()) as { session: string }).session;
      sessionStorage.setItem(KEY, session);
    } else if (!session) {
      return false;
    }
  }
  return session !== null;
}

async function request(path: string, init: RequestInit = {}): Promise<unknown> {
  const headers = new Headers(init.headers);
  headers.set("x-plumbline-session", session ?? "");
  const answer = await fetch(path, { ...init, headers });
  if (!answer.ok) throw new Refused(answer.status, (await reason(answer)) || `the server answered ${answer.status}`);
  return answer.json();
}

async function reason(answer: Response): Promise<string> {
  const text = await answer.text();
  try {
    return (JSON.parse(text) as { error?: string }).error ?? text;
  } catch {
    return text;
  }
}

const post = (path: string, body: unknown) =>
  request(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) });

/** What the server has: folders, open and recent documents, examples. */
export const serverState = () => request("/api/state") as Promise<ServerState>;

/** The entries of a folder; without a path those that were named at start. */
export const listFolder = (path?: string) =>
  request(path === undefined ? "/api/files" : `/api/files?folder=${encodeURIComponent(path)}`) as Promise<FolderListing>;

/** Opens a file as a document, or finds the one that is open. */
export const openFile = (path: string, workspace?: "character") => post("/api/open", workspace ? { path, workspace } : { path }) as Promise<DocumentInfo>;

/** Closes a document in all windows; what is not saved is kept for the next time. */
export const closeDocument = (document: string) => post("/api/close", { document });

/** The address of the page with a token for one more window, of this browser or another. */
export async function newLink(): Promise<string> {
  const { token } = (await post("/api/link", {})) as { token: string };
  return `${location.origin}/#token=${token}`;
}

/** Stores a dropped file in the session's folder and gives its path. Files with the same word for `drop` are beside each other. */
export function upload(file: File, drop?: string): Promise<{ path: string }> {
  const query = new URLSearchParams(drop === undefined ? { name: file.name } : { name: file.name, drop });
  return request(`/api/upload?${query}`, { method: "POST", body: file }) as Promise<{ path: string }>;
}

/** A socket to a document. */
export function openSocket(document: string): WebSocket {
  const address = new URL(`/ws?document=${encodeURIComponent(document)}`, location.href);
  address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
  const socket = new WebSocket(address, ["plumbline", `token.${session ?? ""}`]);
  socket.binaryType = "arraybuffer";
  return socket;
}

/** Lets the browser save what a single-use link gives. */
export function download({ url, name }: { url: string; name: string }) {
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
}
