// Follows a server stream while a page is open: reconnects after a lost connection, at once when
// the browser is back online, and drops a connection that has gone silent (the lid was closed). The
// caller interprets the messages; an exception there is a fault of the page, which no new connection
// mends.

import { Code, type Interceptor } from "@connectrpc/connect";
import { type Signal, signal } from "@preact/signals";
import { LONGEST_WAIT_MS, SHORTEST_WAIT_MS } from "./asking";
import { type Fault, faultOf, isPassing, PAGE_BROKEN } from "./faults";
import { lookForUpdate } from "./update";

/**
 * The state of a stream: connecting, open, lost and about to reconnect, ended for good, or failed
 * with an error that a retry does not fix.
 */
export type Link = "connecting" | "open" | "lost" | "ended" | "failed";

/** A followed stream. */
export interface Following {
  readonly link: Signal<Link>;
  /** The server's error when the stream failed. */
  readonly fault: Signal<Fault | undefined>;
  /** Closes the stream. */
  stop(): void;
}

/** Seconds between the heartbeats that a stream asks for while nothing else is sent. */
const HEARTBEAT_S = 3;
/** After two missing heartbeats the connection counts as dead. */
const SILENCE_MS = 9_000;
const WATCH_EVERY_MS = 1_000;

/** The time by two clocks: that of the day may be set back, and the other may stand still while a device sleeps. */
const clocks = () => ({ dayMs: Date.now(), runMs: performance.now() });

/** Asks for heartbeats on the streams of the server, which leaves them out where there are none. */
export const askHeartbeats: Interceptor = (next) => (request) => {
  if (request.stream) request.header.set("chefshat-heartbeat", String(HEARTBEAT_S));
  return next(request);
};

/** How a stream is followed. */
interface Options {
  /** Whether the server had nothing more to send, when a stream ends while more should follow. */
  readonly isComplete?: () => boolean;
  /**
   * Closes the stream while the page is hidden: without HTTP/2, all tabs of a browser have six
   * connections to a server. For what nobody's seat depends on, and what is the same when it is
   * opened again.
   */
  readonly restsWhileHidden?: boolean;
}

/** The page is hidden this long before a stream is closed, milliseconds. */
const REST_AFTER_MS = 10_000;

/**
 * Follows the stream that `open` opens. `onMessage` receives every message and returns whether more
 * will follow. A stream that ends while more should follow is reopened, unless it is complete.
 */
export function follow<Message>(
  open: (signal: AbortSignal) => AsyncIterable<Message>,
  onMessage: (message: Message) => boolean,
  { isComplete = () => false, restsWhileHidden = false }: Options = {},
): Following {
  const link = signal<Link>("connecting");
  const fault = signal<Fault | undefined>(undefined);
  let stopped = false;
  let current = new AbortController();
  let heard = clocks();
  let wake = () => {};
  let resting = false;
  let restTimer: ReturnType<typeof setTimeout> | undefined;

  const dropIfSilent = () => {
    const now = clocks();
    if (Math.max(now.dayMs - heard.dayMs, now.runMs - heard.runMs) > SILENCE_MS) current.abort();
  };
  const rest = () => {
    resting = true;
    current.abort();
  };
  const revive = () => {
    clearTimeout(restTimer);
    if (document.visibilityState === "hidden") {
      if (restsWhileHidden) restTimer = setTimeout(rest, REST_AFTER_MS);
      return;
    }
    resting = false;
    dropIfSilent();
    wake();
  };
  /** The connections of the former network are dead, even if nothing has shown it yet. */
  const reopen = () => {
    current.abort();
    wake();
  };
  const watchdog = setInterval(dropIfSilent, WATCH_EVERY_MS);
  document.addEventListener("visibilitychange", revive);
  // The page may be hidden from the start, in a tab in the background.
  revive();
  window.addEventListener("online", reopen);

  const end = (last: Link) => {
    stopped = true;
    link.value = last;
    clearInterval(watchdog);
    clearTimeout(restTimer);
    document.removeEventListener("visibilitychange", revive);
    window.removeEventListener("online", reopen);
    current.abort();
    wake();
  };

  /** Whether more messages will follow, after this one was handled. */
  const handle = (message: Message): boolean => {
    try {
      return onMessage(message);
    } catch (thrown) {
      console.error(thrown);
      fault.value = { reason: PAGE_BROKEN, code: Code.Internal, message: String(thrown), metadata: {} };
      end("failed");
      return true;
    }
  };

  const run = async () => {
    for (let failures = 0; !stopped; failures += 1) {
      while (resting && !stopped) {
        await new Promise<void>((resolve) => {
          wake = resolve;
        });
      }
      if (stopped) return;
      let retryMs = 0;
      current = new AbortController();
      heard = clocks();
      try {
        for await (const message of open(current.signal)) {
          if (stopped) return;
          heard = clocks();
          failures = 0;
          if (link.peek() === "lost") void lookForUpdate();
          link.value = "open";
          if (!handle(message)) return end("ended");
        }
        if (!stopped && isComplete()) return end("ended");
      } catch (thrown) {
        if (stopped) return;
        const found = faultOf(thrown);
        if (!current.signal.aborted && !isPassing(found)) {
          fault.value = found;
          return end("failed");
        }
        retryMs = found.retryMs ?? 0;
      }
      if (stopped) return;
      if (resting) continue;
      link.value = "lost";
      const waitMs = Math.max(retryMs, Math.min(LONGEST_WAIT_MS, SHORTEST_WAIT_MS * 2 ** failures));
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
