// Asks for a room until the server answers: what passes is asked again with growing pauses.

import { CALL_LIMIT_MS, roomApi } from "../api/client";
import { type Fault, faultOf, isPassing } from "../api/faults";
import type { Room } from "../gen/chefshat/v1/room_pb";

/** Pause before a failed request is repeated: the first, and the longest, doubled each time. */
const SHORTEST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 16_000;

/**
 * The room; undefined if it is not wanted any more, or the server will not give it. `onFault` is told
 * why each request failed.
 */
export async function askRoom(
  roomId: string,
  isWanted: () => boolean,
  onFault: (fault: Fault) => void = () => {},
): Promise<Room | undefined> {
  for (let waitMs = SHORTEST_WAIT_MS; isWanted(); waitMs = Math.min(LONGEST_WAIT_MS, 2 * waitMs)) {
    try {
      return (await roomApi.getRoom({ roomId }, { timeoutMs: CALL_LIMIT_MS })).room;
    } catch (thrown) {
      const fault = faultOf(thrown);
      onFault(fault);
      if (!isPassing(fault)) return undefined;
      await new Promise((resolve) => setTimeout(resolve, Math.max(waitMs, fault.retryMs ?? 0)));
    }
  }
  return undefined;
}
