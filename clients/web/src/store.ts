// What this device remembers between visits: localStorage under one prefix. A browser that refuses to keep things (a private window)
// is no fault: everything then lasts as long as the page. Nothing is kept here that a host did not ask for or a person did not enter.

const PREFIX = "chefshat.";
const fallback = new Map<string, string>();

/** What was kept under a name, or null. */
export function recall(name: string): string | null {
  try {
    return localStorage.getItem(PREFIX + name) ?? fallback.get(name) ?? null;
  } catch {
    return fallback.get(name) ?? null;
  }
}

/** What `take` makes of the JSON object kept under a name, or null: another version may have kept another. */
export function recallObject<T>(name: string, take: (kept: Record<string, unknown>) => T | null): T | null {
  try {
    const kept: unknown = JSON.parse(recall(name) ?? "null");
    return typeof kept === "object" && kept !== null ? take({ ...kept }) : null;
  } catch {
    return null;
  }
}

/** Keeps a value under a name; null forgets it. */
export function remember(name: string, value: string | null): void {
  if (value === null) fallback.delete(name);
  else fallback.set(name, value);
  try {
    if (value === null) localStorage.removeItem(PREFIX + name);
    else localStorage.setItem(PREFIX + name, value);
  } catch {
    // Kept for this page alone.
  }
}

/** Everything kept, by name. */
export function remembered(): Map<string, string> {
  const all = new Map(fallback);
  try {
    for (let index = 0; index < localStorage.length; index += 1) {
      const key = localStorage.key(index);
      if (key?.startsWith(PREFIX)) all.set(key.slice(PREFIX.length), localStorage.getItem(key) ?? "");
    }
  } catch {
    // Only what this page knows.
  }
  return all;
}

/** Forgets everything that this device remembers. */
export function forgetAll(): void {
  for (const name of remembered().keys()) remember(name, null);
}
