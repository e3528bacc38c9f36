// What this device stores between visits: localStorage under one prefix. What the browser refuses
// to store (in a private window, or on a full disk) lasts as long as the page. Only what a host asked
// for or a person entered is stored.

const PREFIX = "chefshat.";
/**
 * The values that could not be stored, which are newer than stored ones. No others: another tab may
 * delete or replace what is stored.
 */
const unstored = new Map<string, string>();

/** The stored value of a name, or null. */
export function recall(name: string): string | null {
  try {
    return unstored.get(name) ?? localStorage.getItem(PREFIX + name);
  } catch {
    return null;
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
  unstored.delete(name);
  try {
    if (value === null) localStorage.removeItem(PREFIX + name);
    else localStorage.setItem(PREFIX + name, value);
  } catch {
    if (value !== null) unstored.set(name, value);
  }
}

/** All stored values by name. */
export function remembered(): Map<string, string> {
  const all = new Map<string, string>();
  try {
    for (const key of keysOf(localStorage)) all.set(key.slice(PREFIX.length), localStorage.getItem(key) ?? "");
  } catch {
    // Only what is in memory.
  }
  for (const [name, value] of unstored) all.set(name, value);
  return all;
}

/** Deletes everything stored on this device, also what lasts as long as this tab, such as its token. */
export function forgetAll(): void {
  for (const name of remembered().keys()) remember(name, null);
  try {
    for (const key of keysOf(sessionStorage)) sessionStorage.removeItem(key);
  } catch {
    // Nothing was stored.
  }
}

/** The keys of this page in a storage. */
function keysOf(storage: Storage): string[] {
  const keys = Array.from({ length: storage.length }, (_, index) => storage.key(index) ?? "");
  return keys.filter((key) => key.startsWith(PREFIX));
}
