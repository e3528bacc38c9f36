// A person's seat in a room: follows what the seat is told over Watch; what it does is in acting.ts. What the updates mean is in
// model/live.ts, how it looks in view/. The ticket comes from what this device remembers and stays here.

import { type Signal, signal } from "@preact/signals";
import { playApi } from "../api/client";
import { type Following, follow } from "../api/follow";
import type { HeldSeat } from "../lobby/seat";
import { type Acting, asksForTimes, startActing } from "./acting";
import type { TableState } from "./model/state";

export interface Session extends Acting {
  readonly following: Signal<Following>;
  /** Takes the seat back from another page that has taken it. */
  takeBack(): void;
  stop(): void;
}

/** Sits down on a seat. */
export function startSession(held: HeldSeat, table: TableState): Session {
  const { ticket } = held;
  const acting = startActing(ticket, table, held.seat, asksForTimes(table.roomId));
  const { live } = acting;

  const attach = () =>
    follow(
      (abort) =>
        playApi.watch({ seats: [{ ticket, fromSequence: BigInt(live.peek().table.nextSequence) }] }, { signal: abort }),
      ({ updates }) => {
        acting.hear(updates);
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
