// Comings and goings as they are read out: once for each change that lasted. A connection that flaps says nothing until it has made up its
// mind, and nothing at all if it ends as it began.

import type { PresenceLine } from "./model/log";

/** How long a seat's connection must have been as it is before that is said. */
export const SETTLED_MS = 2000;

type Presence = PresenceLine["happening"]["kind"];

export interface PresenceTeller {
  /** Takes in what happened to a seat's connection. */
  hear(line: PresenceLine): void;
  /** Says nothing any more. */
  stop(): void;
}

/** Tells `say` of each change that lasted. */
export function tellPresence(say: (line: PresenceLine) => void): PresenceTeller {
  /** How each seat's connection stood when it was last quiet. */
  const stood = new Map<number, Presence>();
  const waiting = new Map<number, ReturnType<typeof setTimeout>>();
  return {
    hear: (line) => {
      const { seat, kind } = line.happening;
      // Of a seat that nothing was heard of: who is lost had been there, who is back had been lost.
      if (!stood.has(seat)) stood.set(seat, kind === "lost" ? "back" : "lost");
      clearTimeout(waiting.get(seat));
      const timer = setTimeout(() => {
        waiting.delete(seat);
        if (stood.get(seat) === kind) return;
        stood.set(seat, kind);
        say(line);
      }, SETTLED_MS);
      waiting.set(seat, timer);
    },
    stop: () => {
      for (const timer of waiting.values()) clearTimeout(timer);
      waiting.clear();
    },
  };
}
