// Whether the server has another version of the page than the one that is open. Looked for where the
// server may have been replaced: after a lost connection is back, when the page is seen again, and now and then.
// parts/Update.tsx offers to load it; what cannot be loaded any more is loaded anew at once.

import { signal } from "@preact/signals";

/** Whether the page is of another version than the server's. */
export const outdated = signal(false);

/** The script of a document, in a build of the page: its name has a hash of all code. */
const SCRIPT = /<script type="module"[^>]* src="(\/assets\/[^"]+)"/;

/** How often it is looked for while the page is seen, milliseconds. */
const EVERY_MS = 300_000;

/** How long the server's document is waited for, milliseconds: a dead connection may not say that it is. */
const LIMIT_MS = 15_000;

/** Requests the server's document. */
function serversDocument(method: "GET" | "HEAD"): Promise<Response> {
  return fetch("/", { method, cache: "no-store", signal: AbortSignal.timeout(LIMIT_MS) });
}

let looking = false;

/** Requests the server's document, and compares its script with that of the open page. */
export async function lookForUpdate(): Promise<void> {
  const own = document.querySelector('script[type="module"]')?.getAttribute("src");
  if (!own || looking || outdated.peek()) return;
  looking = true;
  try {
    const answer = await serversDocument("GET");
    // What answers in between, such as a hotspot's sign-in page, has no such script.
    const [, script] = SCRIPT.exec(answer.ok ? await answer.text() : "") ?? [];
    outdated.value = script !== undefined && script !== own;
  } catch {
    // The connection is lost again: the next time it is back.
  } finally {
    looking = false;
  }
}

/**
 * Looks when the page is seen again, which may be days later, and now and then while it is seen: a quick
 * restart may pass between two calls.
 */
export function startUpdates(): void {
  const look = () => {
    if (!document.hidden) void lookForUpdate();
  };
  document.addEventListener("visibilitychange", look);
  setInterval(look, EVERY_MS);
}

/** Key of sessionStorage: when the document was last loaded again for a new version. */
const RELOADED = "chefshat.reloaded";
/** Nothing is loaded again so soon after: another version is not what is missing. */
const ONCE_IN_MS = 60_000;

/**
 * After a file of the page could not be loaded: loads the document again if the server answers, since
 * a new version of the page has other files. Returns whether it does.
 */
export async function reloadsForNewVersion(): Promise<boolean> {
  try {
    const before = Number(sessionStorage.getItem(RELOADED));
    // The clock may have been set back.
    if (Math.abs(Date.now() - before) < ONCE_IN_MS) return false;
    const { ok } = await serversDocument("HEAD");
    if (!ok) return false;
    sessionStorage.setItem(RELOADED, String(Date.now()));
  } catch {
    // The server does not answer, or this browser stores nothing and would load again for ever.
    return false;
  }
  location.reload();
  return true;
}
