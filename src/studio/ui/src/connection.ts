// A document's connection to the server: edits out, state and buffers in. `shell/socket_connection.ts` implements it; workspaces use it.
import type { ReadonlySignal } from "@preact/signals";

/** One entry of the history list. */
export interface HistoryStep { label: string }

/** The history of a document. */
export interface History { steps: HistoryStep[]; at: number; savedAt: number | null }

/** What a workspace sees of its document. `State` is the workspace's `State` of the server. */
export interface Connection<State = unknown> {
  readonly document: string;
  readonly workspace: string;
  readonly state: ReadonlySignal<State | null>;
  readonly history: ReadonlySignal<History>;
  /** Whether the server computes. */
  readonly working: ReadonlySignal<boolean>;
  readonly connected: ReadonlySignal<boolean>;
  /** A change of the document; resolves when it is applied, rejects with the server's text, which the shell shows as well. A
   * rejection that nobody awaits is no fault. The same holds for `ask` and `save`. */
  edit(edit: unknown): Promise<void>;
  /** The same for drags: while one is on its way only the newest waits. */
  drag(edit: unknown): void;
  /** Ends the step of the history that drags in a row made (the pointer is released). */
  seal(): void;
  /** What this window looks at. Fields are kept, and sent again after the connection was lost. */
  view(view: unknown): void;
  /** A question; downloads start by themselves and resolve to their name. */
  ask<T = unknown>(ask: unknown): Promise<T>;
  undo(): void;
  redo(): void;
  goTo(step: number): void;
  save(): Promise<void>;
  /** Calls `listener` for each buffer of a kind, first with the newest known of each item. Returns the way to stop. */
  onBuffer(kind: number, listener: (buffer: Incoming) => void): () => void;
}

/** A buffer of the server: numbers as the kind defines them. `payload` starts at a multiple of 8 bytes. */
export interface Incoming { kind: number; item: number; edit: number; payload: ArrayBuffer }
