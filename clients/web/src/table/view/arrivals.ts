// What is new at the table since the last render.

import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { MOST_AT_ONCE } from "../model/log";
import type { TableState } from "../model/state";

/** How long a deal takes, milliseconds; not shorter than in the style sheets. */
const DEALT_MS = 1400;

/**
 * Calls after each render with new events: `since` is the sequence number of the last one before
 * them. A reader who catches up gets many at once, which did not happen just now. The events of a
 * table that has just been opened are not new.
 */
export function useArrivals(table: TableState, onArrival: (since: number, caughtUp: boolean) => void): void {
  const last = table.log.at(-1)?.sequence ?? 0;
  const seen = useRef(last);
  // Before the browser paints: what was on the table is on its way from where it lay.
  useLayoutEffect(() => {
    const since = seen.current;
    seen.current = last;
    if (last > since) onArrival(since, last - since > MOST_AT_ONCE);
  }, [last]);
}

/** Whether the cards are being dealt: at the start of each Shift, also of the one that opens the table. */
export function useDealt(table: TableState): boolean {
  const [dealt, setDealt] = useState(table.log.at(-1)?.entry.kind === "dealt");
  useArrivals(table, (since, caughtUp) => {
    if (!caughtUp && table.log.some(({ entry, sequence }) => entry.kind === "dealt" && sequence > since))
      setDealt(true);
  });
  useEffect(() => {
    if (!dealt) return;
    const timer = setTimeout(() => setDealt(false), DEALT_MS);
    return () => clearTimeout(timer);
  }, [dealt]);
  return dealt;
}
