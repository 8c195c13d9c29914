// Binary messages of the server: four little-endian u32 (kind, item, last edit included, bytes), then the payload.
import type { Incoming } from "../connection";

const HEADER_BYTES = 16;

/** The buffer of a message; null where header and length disagree. */
export function parseBuffer(message: ArrayBuffer): Incoming | null {
  if (message.byteLength < HEADER_BYTES) return null;
  const header = new DataView(message, 0, HEADER_BYTES);
  const [kind, item, edit, bytes] = [0, 4, 8, 12].map((at) => header.getUint32(at, true)) as [number, number, number, number];
  return bytes === message.byteLength - HEADER_BYTES ? { kind, item, edit, payload: message.slice(HEADER_BYTES) } : null;
}

/** The newest buffer of each kind and item, and who listens to a kind. */
export class Buffers {
  private readonly newest = new Map<number, Map<number, Incoming>>();
  private readonly listeners = new Map<number, Set<(buffer: Incoming) => void>>();

  add(buffer: Incoming) {
    const items = this.newest.get(buffer.kind) ?? new Map<number, Incoming>();
    this.newest.set(buffer.kind, items.set(buffer.item, buffer));
    for (const listener of this.listeners.get(buffer.kind) ?? []) listener(buffer);
  }

  listen(kind: number, listener: (buffer: Incoming) => void): () => void {
    const listeners = this.listeners.get(kind) ?? new Set();
    this.listeners.set(kind, listeners.add(listener));
    for (const buffer of this.newest.get(kind)?.values() ?? []) listener(buffer);
    return () => void listeners.delete(listener);
  }

  /** Nothing is known any more; listeners stay. */
  forget() {
    this.newest.clear();
  }
}
