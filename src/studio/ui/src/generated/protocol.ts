// Messages of every document. Written by a test of `src/studio`: REGENERATE=1 cargo test -p plumbline-studio

/** Version of the messages. */
export const PROTO = 1;

export type DiskChoice = "reload" | "keep";

export type FromPage = { 
/**
 * Number of the message, chosen by the page, rising; without it there is no reply.
 */
id?: number, 
/**
 * A later waiting edit of the same window replaces this one: for drags.
 */
newest?: boolean, 
/**
 * A change of the document, as its workspace defines it.
 */
edit?: unknown, 
/**
 * What is looked at.
 */
view?: unknown, 
/**
 * A question.
 */
ask?: unknown, 
/**
 * One step back.
 */
undo?: boolean, 
/**
 * One step forward.
 */
redo?: boolean, 
/**
 * The document after this step of the history.
 */
goto?: number, 
/**
 * Ends the step that drags in a row made.
 */
seal?: boolean, 
/**
 * Writes the files of the document.
 */
save?: boolean, 
/**
 * What happens to the document whose files another program changed.
 */
disk?: DiskChoice, };

export type Hello = { 
/**
 * [`PROTO`].
 */
proto: number, 
/**
 * Name of the workspace.
 */
workspace: string, 
/**
 * Id of the document.
 */
document: string, 
/**
 * Name of its file.
 */
name: string, };

export type HistoryStep = { 
/**
 * What was done.
 */
label: string, };

export type HistoryList = { 
/**
 * All steps; the first is how the document was opened.
 */
steps: Array<HistoryStep>, 
/**
 * Number of the present one.
 */
at: number, 
/**
 * Number of the one that is on the disk.
 */
savedAt: number | null, };

export type Level = "info" | "warning" | "error";

export type Notice = { 
/**
 * How serious.
 */
level: Level, 
/**
 * The text.
 */
text: string, };

export type ToPage = { "hello": Hello } | { "state": unknown } | { "history": HistoryList } | { "working": boolean } | { "notice": Notice } | { "changedOnDisk": Array<string> } | { "closed": boolean };

export type Download = { 
/**
 * Path of the link, on this server.
 */
url: string, 
/**
 * Name of the file.
 */
name: string, };

export type Reply = { 
/**
 * Number of the message; null where it could not be read.
 */
reply: number | null, 
/**
 * Why it failed.
 */
error?: string, 
/**
 * Answer to a question.
 */
result?: unknown, 
/**
 * Answer to a question: a file.
 */
download?: Download, 
/**
 * A later edit replaced it.
 */
replaced?: boolean, };
