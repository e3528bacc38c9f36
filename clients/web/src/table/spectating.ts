// Watching a room without a seat: follows its public events, which model/reduce.ts applies.

import { type Signal, signal } from "@preact/signals";
import { spectatorApi } from "../api/client";
import { type Following, follow } from "../api/follow";
import { type AwaitedSeat, awaitedSeat } from "./model/awaited";
import { applyEvents } from "./model/reduce";
import { applySnapshot } from "./model/snapshot";
import { emptyTable, isOver, type TableState, tableFromRoom } from "./model/state";

export interface Spectating {
  readonly table: Signal<TableState>;
  /** Whom the game waits for. */
  readonly awaited: Signal<AwaitedSeat | undefined>;
  readonly following: Following;
  stop(): void;
}

/** Starts watching a room. */
export function startSpectating(roomId: string): Spectating {
  const table = signal(emptyTable());
  const awaited = signal<AwaitedSeat | undefined>(undefined);
  const following = follow(
    (abort) => spectatorApi.watch({ roomId, fromSequence: BigInt(table.peek().nextSequence) }, { signal: abort }),
    ({ room, snapshot, events, awaited: changes }) => {
      let next = table.peek();
      const last = changes.at(-1);
      // The first message of a connection has the room.
      if (last || room) awaited.value = last && awaitedSeat(last, performance.now());
      if (room && next.nextSequence === 1) next = tableFromRoom(room);
      if (snapshot) next = applySnapshot(next, snapshot, undefined);
      table.value = applyEvents(next, events);
      return !isOver(table.value);
    },
  );
  return { table, awaited, following, stop: () => following.stop() };
}
