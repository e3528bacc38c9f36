// A person's seat in a room: follows its stream with Watch. Commands are in acting.ts, updates are
// applied in model/live.ts. The ticket comes from this device's storage.

import { type Signal, signal } from "@preact/signals";
import { playApi } from "../api/client";
import { type Following, follow } from "../api/follow";
import type { HeldSeat } from "../lobby/seat";
import { type Acting, startActing } from "./acting";
import type { TableState } from "./model/state";

export interface Session extends Acting {
  readonly following: Signal<Following>;
  /** Takes the seat back from another tab. */
  takeBack(): void;
  stop(): void;
}

/**
 * Attaches to a seat; the server says which one it is. `timed` sends the decision time with each
 * answer.
 */
export function startSession(
  held: Pick<HeldSeat, "ticket"> & Partial<HeldSeat>,
  table: TableState,
  timed = false,
): Session {
  const { ticket } = held;
  const acting = startActing(ticket, table, held.seat, timed);
  const { live } = acting;

  const attach = () =>
    follow(
      (abort) =>
        playApi.watch({ seats: [{ ticket, fromSequence: BigInt(live.peek().table.nextSequence) }] }, { signal: abort }),
      ({ updates }) => {
        acting.apply(updates);
        const { attachment } = live.peek();
        return attachment.kind === "none" || attachment.kind === "attached";
      },
    );
  const following = signal(attach());

  return {
    ...acting,
    following,
    takeBack: () => {
      following.peek().stop();
      live.value = { ...live.peek(), attachment: { kind: "none" } };
      following.value = attach();
    },
    stop: () => following.peek().stop(),
  };
}
