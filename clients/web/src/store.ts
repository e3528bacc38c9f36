// What this device stores between visits: localStorage under one prefix. Where the browser refuses
// to store (a private window), values last as long as the page. Only what a host asked for or a
// person entered is stored.

const PREFIX = "chefshat.";
const fallback = new Map<string, string>();

/** The stored value of a name, or null. */
export function recall(name: string): string | null {
  try {
    return localStorage.getItem(PREFIX + name) ?? fallback.get(name) ?? null;
  } catch {
    return fallback.get(name) ?? null;
  }
}

/**
 * The result of `take` for the stored JSON object, or null: another version may have stored
 * something else.
 */
export function recallObject<T>(name: string, take: (stored: Record<string, unknown>) => T | null): T | null {
  try {
    const stored: unknown = JSON.parse(recall(name) ?? "null");
    return typeof stored === "object" && stored !== null ? take({ ...stored }) : null;
  } catch {
    return null;
  }
}

/** Stores a value; null deletes it. */
export function remember(name: string, value: string | null): void {
  if (value === null) fallback.delete(name);
  else fallback.set(name, value);
  try {
    if (value === null) localStorage.removeItem(PREFIX + name);
    else localStorage.setItem(PREFIX + name, value);
  } catch {
    // Kept in memory only.
  }
}

/** All stored values by name. */
export function remembered(): Map<string, string> {
  const all = new Map(fallback);
  try {
    for (let index = 0; index < localStorage.length; index += 1) {
      const key = localStorage.key(index);
      if (key?.startsWith(PREFIX)) all.set(key.slice(PREFIX.length), localStorage.getItem(key) ?? "");
    }
  } catch {
    // Only what is in memory.
  }
  return all;
}

/** Deletes everything stored on this device. */
export function forgetAll(): void {
  for (const name of remembered().keys()) remember(name, null);
}
