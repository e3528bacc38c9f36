// Polling while a page is shown: at once, then at an interval, not while the page is hidden, and
// less often after an error. For data that the server does not stream.

import { useEffect, useState } from "preact/hooks";
import { type Fault, faultOf } from "./faults";
import { lookForUpdate } from "./update";

/** The last response and the last error. */
export interface Polled<T> {
  value: T | null;
  fault: Fault | null;
}

/** Longest wait after errors, as a multiple of the interval. */
const MAX_SLOWDOWN = 8;
/** The server counts wrong codes, for everybody behind the same address: one is sent once. */
const FINAL_REASON = "JOIN_CODE_WRONG";

/**
 * The latest response to `ask`, which runs every `everyMs` milliseconds and at once when `key`
 * changes.
 */
export function usePolled<T>(ask: (signal: AbortSignal) => Promise<T>, everyMs: number, key: string): Polled<T> {
  const [polled, setPolled] = useState<Polled<T>>({ value: null, fault: null });
  // `ask` is a new function on each render; `key` identifies the request.
  useEffect(() => {
    const stop = new AbortController();
    let timer: ReturnType<typeof setTimeout> | undefined;
    let slowdown = 1;
    let asking = false;
    let retryMs = 0;
    const next = () => {
      timer = setTimeout(round, Math.max(everyMs * slowdown, retryMs));
    };
    const round = async () => {
      timer = undefined;
      if (document.hidden) return;
      asking = true;
      try {
        const value = await ask(stop.signal);
        if (stop.signal.aborted) return;
        if (slowdown > 1) void lookForUpdate();
        slowdown = 1;
        retryMs = 0;
        setPolled({ value, fault: null });
      } catch (error) {
        if (stop.signal.aborted) return;
        slowdown = Math.min(MAX_SLOWDOWN, slowdown * 2);
        const fault = faultOf(error);
        retryMs = fault.retryMs ?? 0;
        setPolled((before) => ({ ...before, fault }));
        if (fault.reason === FINAL_REASON) return;
      }
      asking = false;
      next();
    };
    const seenAgain = () => {
      if (!document.hidden && !asking && timer === undefined) void round();
    };
    document.addEventListener("visibilitychange", seenAgain);
    void round();
    return () => {
      stop.abort();
      clearTimeout(timer);
      document.removeEventListener("visibilitychange", seenAgain);
    };
  }, [everyMs, key]);
  return polled;
}
