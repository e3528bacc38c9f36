// Asks until the server answers: what passes is asked again with growing pauses, and not before the
// server wants it.

import { type Fault, faultOf, isPassing } from "./faults";

/** Pause before a failed request is repeated: the first, and the longest, doubled each time. */
export const SHORTEST_WAIT_MS = 250;
export const LONGEST_WAIT_MS = 8_000;

/**
 * The answer; undefined if nobody waits for it any more, or the server refuses. `onFault` is told why
 * each request failed.
 */
export async function askUntilAnswered<Answer>(
  ask: () => Promise<Answer>,
  isWanted: () => boolean,
  onFault: (fault: Fault) => void = () => {},
  longestWaitMs = LONGEST_WAIT_MS,
): Promise<Answer | undefined> {
  for (let waitMs = SHORTEST_WAIT_MS; isWanted(); waitMs = Math.min(longestWaitMs, 2 * waitMs)) {
    try {
      return await ask();
    } catch (thrown) {
      const fault = faultOf(thrown);
      onFault(fault);
      if (!isPassing(fault)) return undefined;
      if (isWanted()) await pause(waitMs, fault.retryMs);
    }
  }
  return undefined;
}

/** Waits, but not longer than until the browser is back online; as long as the server says, if it does. */
async function pause(waitMs: number, retryMs: number | undefined): Promise<void> {
  const over = new AbortController();
  await new Promise<unknown>((resolve) => {
    setTimeout(resolve, Math.max(waitMs, retryMs ?? 0));
    if (retryMs === undefined) window.addEventListener("online", resolve, { signal: over.signal });
  });
  over.abort();
}
