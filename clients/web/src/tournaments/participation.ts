// Playing in a tournament: one stream per participant, on which the server attaches it to a seat in
// each of its games. Each seat becomes a table (table/acting.ts), drawn by Participation.tsx.

import { batch, type Signal, signal } from "@preact/signals";
import { playApi } from "../api/client";
import { type Following, follow } from "../api/follow";
import { type Attached, DetachReason, type Refused, type SeatUpdate } from "../gen/chefshat/v1/play_service_pb";
import { type Acting, startActing } from "../table/acting";
import { askRoom } from "../table/asking";
import { isOver, tableFromRoom } from "../table/model/state";

/** How the participant is attached. */
export type Presence = "coming" | "here" | "superseded" | "over" | "refused";

export interface Participation {
  readonly presence: Signal<Presence>;
  /** Why the server refused the place; undefined if it did not. */
  readonly refusal: Signal<Refused | undefined>;
  readonly following: Signal<Following>;
  /** The newest game; undefined before the first. */
  readonly game: Signal<Acting | undefined>;
  /** Takes the place back from another tab. */
  takeBack(): void;
  stop(): void;
}

/** A seat, and its updates before its room is known. */
interface Seated {
  readonly ticket: string;
  acting: Acting | undefined;
  waiting: SeatUpdate[];
}

/** Takes part with a participant's ticket. */
export function startParticipation(ticket: string): Participation {
  const presence = signal<Presence>("coming");
  const refusal = signal<Refused | undefined>(undefined);
  const game = signal<Acting | undefined>(undefined);
  let stopped = false;
  /** By room: after a reconnect a seat has another handle, but the same table. */
  const rooms = new Map<string, Seated>();

  const isPresent = () => !stopped && (presence.peek() === "coming" || presence.peek() === "here");

  const seat = (attached: Attached): Seated => {
    const known = rooms.get(attached.roomId);
    if (known) return known;
    const seated: Seated = { ticket: attached.ticket, acting: undefined, waiting: [] };
    rooms.set(attached.roomId, seated);
    const load = async () => {
      // Needed to draw the table.
      const room = await askRoom(attached.roomId, isPresent);
      if (!room) {
        // If the seat is announced again, the request is repeated.
        rooms.delete(attached.roomId);
        return;
      }
      const acting = startActing(attached.ticket, tableFromRoom(room), attached.seat);
      batch(() => {
        acting.apply(seated.waiting);
        game.value = acting;
      });
      seated.acting = acting;
      seated.waiting = [];
      // Only the newest game is shown.
      for (const [roomId, other] of rooms) if (other.acting && hasEnded(other.acting)) rooms.delete(roomId);
    };
    void load();
    return seated;
  };

  const attach = () => {
    let handles = new Map<number, Seated>();
    /** Handle of the participant. */
    let own = 0;
    const open = (abort: AbortSignal) => {
      // The server seats a participant only in games that go on, and this page may not know yet that
      // one has ended. The participant comes last, so that it is not seated there again.
      const again = [...rooms.values()].flatMap((seated) => {
        const { ticket, acting } = seated;
        if (!acting || hasEnded(acting) || ticket === "") return [];
        return [{ seated, attach: { ticket, fromSequence: BigInt(acting.live.peek().table.nextSequence) } }];
      });
      own = again.length;
      handles = new Map(again.map(({ seated }, handle) => [handle, seated]));
      return playApi.watch({ seats: [...again.map(({ attach }) => attach), { ticket }] }, { signal: abort });
    };
    const receive = (update: SeatUpdate) => {
      if (update.handle === own) {
        presence.value = presenceAfter(update, presence.peek());
        if (update.update.case === "refused") refusal.value = update.update.value;
        return;
      }
      if (update.update.case === "attached") handles.set(update.handle, seat(update.update.value));
      const seated = handles.get(update.handle);
      if (seated?.acting) seated.acting.apply([update]);
      else seated?.waiting.push(update);
      if (update.update.case === "detached") handles.delete(update.handle);
    };
    return follow(open, ({ updates }) => {
      batch(() => updates.forEach(receive));
      return isPresent();
    });
  };
  const following = signal(attach());

  const reattach = () => {
    following.peek().stop();
    presence.value = "coming";
    following.value = attach();
  };
  const stop = () => {
    stopped = true;
    following.peek().stop();
  };
  return { presence, refusal, following, game, takeBack: reattach, stop };
}

function hasEnded({ live }: Acting): boolean {
  return isOver(live.peek().table);
}

function presenceAfter({ update }: SeatUpdate, before: Presence): Presence {
  switch (update.case) {
    case "entered":
      return "here";
    case "refused":
      return "refused";
    case "detached":
      // The end of the stream follows, after which the page enters again.
      if (update.value.reason === DetachReason.SERVER_STOPPING) return before;
      return update.value.reason === DetachReason.TOURNAMENT_OVER ? "over" : "superseded";
    default:
      return before;
  }
}
