// Announces changes of a seat's connection once they have lasted. A flapping connection is
// announced when it settles, and not at all if it ends as it started.

import type { PresenceLine } from "./model/log";

/** How long a change must last before it is announced, milliseconds. */
export const SETTLED_MS = 2000;

type Presence = PresenceLine["entry"]["kind"];

export interface PresenceAnnouncer {
  /** Processes an event of a seat's connection. */
  apply(line: PresenceLine): void;
  /** Cancels pending announcements. */
  stop(): void;
}

/** Calls `announce` for each change that lasts. */
export function createPresenceAnnouncer(announce: (line: PresenceLine) => void): PresenceAnnouncer {
  /** Each seat's last settled state. */
  const settled = new Map<number, Presence>();
  const waiting = new Map<number, ReturnType<typeof setTimeout>>();
  return {
    apply: (line) => {
      const { seat, kind } = line.entry;
      // A first event implies the opposite state before it.
      if (!settled.has(seat)) settled.set(seat, kind === "lost" ? "back" : "lost");
      clearTimeout(waiting.get(seat));
      const timer = setTimeout(() => {
        waiting.delete(seat);
        if (settled.get(seat) === kind) return;
        settled.set(seat, kind);
        announce(line);
      }, SETTLED_MS);
      waiting.set(seat, timer);
    },
    stop: () => {
      for (const timer of waiting.values()) clearTimeout(timer);
      waiting.clear();
    },
  };
}
