// What the page remembers between visits: folded panels, sizes, theme. Kept by the browser, never sent.
import { effect, signal, type Signal } from "@preact/signals";

const known = new Map<string, Signal<unknown>>();

/** The value of a name, with its default; changes are kept. The same signal for the same name. */
export function remembered<T>(name: string, initial: T): Signal<T> {
  const key = `plumbline ${name}`;
  const found = known.get(key);
  if (found) return found as Signal<T>;
  const value = signal(read(key, initial));
  known.set(key, value as Signal<unknown>);
  effect(() => {
    const text = JSON.stringify(value.value);
    try {
      localStorage.setItem(key, text);
    } catch {
      // A browser that keeps nothing: the value lives as long as the page.
    }
  });
  return value;
}

function read<T>(key: string, initial: T): T {
  try {
    const text = localStorage.getItem(key);
    const value: unknown = text === null ? initial : JSON.parse(text);
    return typeof value === typeof initial ? (value as T) : initial;
  } catch {
    return initial;
  }
}
