// Asks until the server answers: what passes is asked again with growing pauses.

import { type Fault, faultOf, isPassing } from "./faults";

/** Pause before a failed request is repeated: the first, and the longest, doubled each time. */
const SHORTEST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 16_000;

/**
 * The answer; undefined if nobody waits for it any more, or the server refuses. `onFault` is told why
 * each request failed.
 */
export async function askUntilAnswered<Answer>(
  ask: () => Promise<Answer>,
  isWanted: () => boolean,
  onFault: (fault: Fault) => void = () => {},
): Promise<Answer | undefined> {
  for (let waitMs = SHORTEST_WAIT_MS; isWanted(); waitMs = Math.min(LONGEST_WAIT_MS, 2 * waitMs)) {
    try {
      return await ask();
    } catch (thrown) {
      const fault = faultOf(thrown);
      onFault(fault);
      if (!isPassing(fault)) return undefined;
      await new Promise((resolve) => setTimeout(resolve, Math.max(waitMs, fault.retryMs ?? 0)));
    }
  }
  return undefined;
}
