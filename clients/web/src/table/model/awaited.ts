// Whom the game waits for, as everybody may know. The server says it when it changes; between two
// messages the page counts by its own clock.

import type { Awaited } from "../../gen/chefshat/v1/room_pb";

export interface AwaitedSeat {
  readonly seat: number;
  /** Whether the seat is not connected. */
  readonly away: boolean;
  /** Milliseconds since its decision was opened, when the message arrived. */
  readonly waitedMs: number;
  /** Milliseconds until the server decides for it, when the message arrived; undefined if nobody may know. */
  readonly leftMs: number | undefined;
  /** Arrival time of the message, by the page's clock. */
  readonly receivedAtMs: number;
}

/** The seat of a message that arrived at `nowMs`; undefined if nobody is awaited. */
export function awaitedSeat({ seat, away, waitedMs, leftMs }: Awaited, nowMs: number): AwaitedSeat | undefined {
  return seat === undefined ? undefined : { seat, away, waitedMs, leftMs, receivedAtMs: nowMs };
}

/** Seconds after which it is worth saying that the game waits for a seat that is connected. */
export const PATIENCE_SECONDS = 5;

/**
 * The whole seconds to show at `nowMs`: those left for a seat that is away, those that have passed for
 * one that is connected. Undefined if there are none to show, or not yet.
 */
export function awaitedSeconds(awaited: AwaitedSeat, nowMs: number): number | undefined {
  const sinceMs = Math.max(0, nowMs - awaited.receivedAtMs);
  if (awaited.away) {
    return awaited.leftMs === undefined ? undefined : Math.max(0, Math.ceil((awaited.leftMs - sinceMs) / 1000));
  }
  const waited = Math.floor((awaited.waitedMs + sinceMs) / 1000);
  return waited < PATIENCE_SECONDS ? undefined : waited;
}
