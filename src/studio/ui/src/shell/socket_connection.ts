// The connection of a document over a WebSocket that opens again when it is lost. What was sent and not answered is then rejected:
// the server kept it in its autosave, or never saw it, and its new state shows which.
import { signal } from "@preact/signals";
import type { Connection, History } from "../connection";
import { download, openFile, openSocket, Refused, type DocumentInfo } from "./api";
import { Buffers, parseBuffer } from "./buffers";
import { notify, type Level } from "./notices";

/** The version of the messages that this page understands. */
const PROTOCOL = 1;
const FIRST_RETRY_MS = 300;
const MAX_RETRY_MS = 4000;

interface Answer { reply: number | null; error?: string; result?: unknown; download?: { url: string; name: string } }
interface Message extends Partial<Answer> {
  hello?: { proto: number; workspace: string; document: string; name: string };
  state?: unknown;
  history?: History;
  working?: boolean;
  notice?: { level: Level; text: string };
  changedOnDisk?: string[];
  closed?: boolean;
}
interface Waiting { resolve: (answer: Answer) => void; reject: (error: Error) => void }

export class SocketConnection implements Connection<unknown> {
  readonly state = signal<unknown>(null);
  readonly history = signal<History>({ steps: [], at: 0, savedAt: null });
  readonly working = signal(false);
  readonly connected = signal(false);
  /** The name of the document, for its tab. */
  readonly name = signal("");
  /** Files that another program changed, until the user chose. */
  readonly changedOnDisk = signal<string[]>([]);
  /** Whether the program was started again and does not know this window: it needs the new link. */
  readonly unknown = signal(false);
  /** Why this document cannot be shown any more. */
  readonly outdated = signal<string | null>(null);

  private socket: WebSocket | null = null;
  private retry = FIRST_RETRY_MS;
  private timer = 0;
  private closed = false;
  private next = 1;
  private readonly waiting = new Map<number, Waiting>();
  private readonly buffers = new Buffers();
  private shownView: Record<string, unknown> = {};
  /** Whether a drag is unanswered, and the newest one that waits for its answer. */
  private dragging = false;
  private nextDrag: { edit: unknown } | null = null;

  readonly document: string;
  readonly workspace: string;

  constructor(private readonly info: DocumentInfo) {
    this.document = info.document;
    this.workspace = info.workspace;
    this.open();
  }

  edit = (edit: unknown) => this.quietly(this.request({ edit }).then(() => undefined));

  drag(edit: unknown) {
    if (this.dragging) this.nextDrag = { edit };
    else this.sendDrag(edit);
  }

  seal() {
    // The last position of the pointer comes before the end of the step.
    const last = this.nextDrag;
    this.nextDrag = null;
    if (last) this.sendDrag(last.edit);
    this.command({ seal: true });
  }

  view(view: unknown) {
    Object.assign(this.shownView, view);
    this.command({ view });
  }

  ask<T>(ask: unknown): Promise<T> {
    const answer = this.request({ ask }).then((reply) => {
      if (reply.download) download(reply.download);
      return (reply.download ? reply.download.name : reply.result) as T;
    });
    return this.quietly(answer);
  }

  undo = () => this.command({ undo: true });
  redo = () => this.command({ redo: true });
  goTo = (step: number) => this.command({ goto: step });
  save = () => this.quietly(this.request({ save: true }).then(() => undefined));
  onBuffer: Connection["onBuffer"] = (kind, listener) => this.buffers.listen(kind, listener);

  /** What to do about files that another program changed. */
  resolveDisk(choice: "reload" | "keep") {
    this.changedOnDisk.value = [];
    this.command({ disk: choice });
  }

  close() {
    this.closed = true;
    clearTimeout(this.timer);
    this.socket?.close();
  }

  /** Tries now rather than after the pause. */
  reconnect() {
    if (this.connected.value || this.closed) return;
    clearTimeout(this.timer);
    this.socket = null;
    this.unknown.value = false;
    void this.openAgain();
  }

  private sendDrag(edit: unknown) {
    this.dragging = true;
    const done = () => {
      this.dragging = false;
      const next = this.nextDrag;
      this.nextDrag = null;
      if (next) this.sendDrag(next.edit);
    };
    this.request({ edit, newest: true }).catch(() => undefined).finally(done);
  }

  /** A message whose answer matters only where it is an error. */
  private command(message: object) {
    if (this.connected.value) void this.quietly(this.request(message));
  }

  private request(message: object): Promise<Answer> {
    const id = this.next++;
    return new Promise<Answer>((resolve, reject) => {
      if (!this.connected.value) return reject(new Error("no connection to plumbline"));
      this.waiting.set(id, { resolve, reject });
      this.socket?.send(JSON.stringify({ id, ...message }));
    }).catch((error: Error) => {
      notify("error", error.message);
      throw error;
    });
  }

  /** The same promise, whose rejection nobody needs to handle: the user saw it. */
  private quietly<T>(promise: Promise<T>): Promise<T> {
    promise.catch(() => undefined);
    return promise;
  }

  private open() {
    const socket = openSocket(this.document);
    this.socket = socket;
    socket.onmessage = ({ data }) => {
      if (socket !== this.socket) return;
      if (data instanceof ArrayBuffer) this.receiveBuffer(data);
      else this.receive(JSON.parse(String(data)) as Message);
    };
    socket.onclose = () => {
      if (socket === this.socket) this.lost();
    };
  }

  private lost() {
    this.connected.value = false;
    this.working.value = false;
    this.nextDrag = null;
    const unanswered = [...this.waiting.values()];
    this.waiting.clear();
    for (const { reject } of unanswered) reject(new Error("the connection was lost before plumbline answered"));
    if (this.closed) return;
    this.timer = window.setTimeout(() => void this.openAgain(), this.retry);
    this.retry = Math.min(MAX_RETRY_MS, this.retry * 1.6);
  }

  /** The program may have been started again: then it opens the file anew, or does not know this window. */
  private async openAgain() {
    try {
      await openFile(this.info.path);
    } catch (error) {
      if (this.closed) return;
      if (!(error instanceof Refused)) this.lost();
      else if (error.status === 401) this.unknown.value = true;
      else this.outdated.value = error.message;
      return;
    }
    if (!this.closed) this.open();
  }

  private receiveBuffer(data: ArrayBuffer) {
    const buffer = parseBuffer(data);
    if (buffer) this.buffers.add(buffer);
  }

  private receive(message: Message) {
    if (message.hello) this.greeted(message.hello);
    if (message.state !== undefined) this.state.value = message.state;
    if (message.history) this.history.value = message.history;
    if (message.working !== undefined) this.working.value = message.working;
    if (message.notice) notify(message.notice.level, message.notice.text);
    if (message.changedOnDisk) this.changedOnDisk.value = message.changedOnDisk;
    if (message.closed) this.ended();
    if (message.reply !== undefined) this.answered(message as Answer);
  }

  private greeted({ proto, name }: { proto: number; name: string }) {
    if (proto !== PROTOCOL) {
      this.outdated.value = "The program has another version than this page. Reload the page.";
      return this.close();
    }
    this.buffers.forget();
    this.name.value = name;
    this.retry = FIRST_RETRY_MS;
    this.connected.value = true;
    if (Object.keys(this.shownView).length > 0) this.command({ view: this.shownView });
  }

  private ended() {
    this.outdated.value = "plumbline closed this document. Open it again from the start page.";
    this.close();
  }

  private answered(answer: Answer) {
    if (answer.reply === null) return notify("error", answer.error ?? "plumbline could not read a message of this page");
    const waiting = this.waiting.get(answer.reply);
    this.waiting.delete(answer.reply);
    if (answer.error !== undefined) waiting?.reject(new Error(answer.error));
    else waiting?.resolve(answer);
  }
}
