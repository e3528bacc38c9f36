// Following a stream of the server for as long as a page is open: a lost connection is made again, sooner when the browser says that it is
// back, and one on which nothing is heard any more (a lid was closed) is given up. What the messages mean is for the caller.

import { type Signal, signal } from "@preact/signals";
import { type Fault, faultOf, isPassing } from "./faults";

/** How a stream stands: being opened, open, lost and to be opened again, ended for good, or ended by a fault that trying again does not mend. */
export type Link = "connecting" | "open" | "lost" | "ended" | "failed";

/** A stream that is followed. */
export interface Following {
  readonly link: Signal<Link>;
  /** What the server said when the stream failed. */
  readonly fault: Signal<Fault | undefined>;
  /** Ends it. */
  stop(): void;
}

/** The server sends a heartbeat every 15 seconds; after two that are missing nobody is there. */
const SILENCE_MS = 35_000;
const WATCH_EVERY_MS = 5_000;
const SHORTEST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 8_000;

/**
 * Follows what `open` opens. `heard` is given every message and says whether there is more to come. A stream that ends by itself while there is
 * is opened again.
 */
export function follow<Message>(
  open: (signal: AbortSignal) => AsyncIterable<Message>,
  heard: (message: Message) => boolean,
): Following {
  const link = signal<Link>("connecting");
  const fault = signal<Fault | undefined>(undefined);
  let stopped = false;
  let current = new AbortController();
  let heardAtMs = Date.now();
  let wake = () => {};

  const revive = () => {
    if (document.visibilityState === "hidden") return;
    if (Date.now() - heardAtMs > SILENCE_MS) current.abort();
    wake();
  };
  const watchdog = setInterval(() => {
    if (Date.now() - heardAtMs > SILENCE_MS) current.abort();
  }, WATCH_EVERY_MS);
  document.addEventListener("visibilitychange", revive);
  window.addEventListener("online", revive);

  const end = (last: Link) => {
    stopped = true;
    link.value = last;
    clearInterval(watchdog);
    document.removeEventListener("visibilitychange", revive);
    window.removeEventListener("online", revive);
    current.abort();
    wake();
  };

  const run = async () => {
    for (let failures = 0; !stopped; failures += 1) {
      current = new AbortController();
      heardAtMs = Date.now();
      try {
        for await (const message of open(current.signal)) {
          if (stopped) return;
          heardAtMs = Date.now();
          failures = 0;
          link.value = "open";
          if (!heard(message)) return end("ended");
        }
      } catch (thrown) {
        if (stopped) return;
        const found = faultOf(thrown);
        if (!current.signal.aborted && !isPassing(found)) {
          fault.value = found;
          return end("failed");
        }
      }
      if (stopped) return;
      link.value = "lost";
      const waitMs = Math.min(LONGEST_WAIT_MS, SHORTEST_WAIT_MS * 2 ** failures);
      await new Promise<void>((resolve) => {
        const timer = setTimeout(resolve, waitMs);
        wake = () => {
          clearTimeout(timer);
          resolve();
        };
      });
    }
  };
  void run();
  return { link, fault, stop: () => !stopped && end("ended") };
}
