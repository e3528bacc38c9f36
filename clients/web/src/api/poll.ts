// Asking for something again and again while a page shows it: at once, then at an interval, not while the page is hidden, and after a
// fault more slowly. For what the server does not stream.

import { useEffect, useState } from "preact/hooks";
import { type Fault, faultOf } from "./faults";

/** What was learned last, and what went wrong last. */
export interface Polled<T> {
  value: T | null;
  fault: Fault | null;
}

/** How many times longer than usual to wait after a fault, at most. */
const MAX_SLOWDOWN = 8;

/** The newest answer to `ask`, which is asked again every `everyMs` milliseconds, and anew when `key` changes. */
export function usePolled<T>(ask: (signal: AbortSignal) => Promise<T>, everyMs: number, key: string): Polled<T> {
  const [polled, setPolled] = useState<Polled<T>>({ value: null, fault: null });
  // `ask` is a new function each time; what it asks for is said by `key`.
  useEffect(() => {
    const stop = new AbortController();
    let timer: ReturnType<typeof setTimeout> | undefined;
    let slowdown = 1;
    let asking = false;
    const next = () => {
      timer = setTimeout(round, everyMs * slowdown);
    };
    const round = async () => {
      timer = undefined;
      if (document.hidden) return;
      asking = true;
      try {
        const value = await ask(stop.signal);
        if (stop.signal.aborted) return;
        slowdown = 1;
        setPolled({ value, fault: null });
      } catch (error) {
        if (stop.signal.aborted) return;
        slowdown = Math.min(MAX_SLOWDOWN, slowdown * 2);
        const fault = faultOf(error);
        setPolled((before) => ({ ...before, fault }));
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
