// What is new at the table since the last render.

import { useEffect, useRef } from "preact/hooks";
import { MOST_AT_ONCE } from "../model/log";
import type { TableState } from "../model/state";

/**
 * Calls after each render with new events: `since` is the sequence number of the last one before
 * them. A reader who catches up gets many at once, which did not happen just now. The events of a
 * table that has just been opened are not new.
 */
export function useArrivals(table: TableState, onArrival: (since: number, caughtUp: boolean) => void): void {
  const last = table.log.at(-1)?.sequence ?? 0;
  const seen = useRef(last);
  useEffect(() => {
    const since = seen.current;
    seen.current = last;
    if (last > since) onArrival(since, last - since > MOST_AT_ONCE);
  }, [last]);
}
