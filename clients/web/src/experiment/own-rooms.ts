// Rooms like one that stands, one for each participant of a study, and which of them this device has made, with what their links say. They are
// rooms like any other, whose secrets are kept with those of all rooms made here (lobby/seat.ts).

import { signal } from "@preact/signals";
import type { Room } from "../gen/chefshat/v1/room_pb";
import { MAX_NAME } from "../lobby/room-form";
import { requestLike } from "../lobby/room-like";
import { hostedRoom, makeRoom } from "../lobby/seat";
import { recallObject, remember } from "../store";

/** Longest time that a room can wait for its seats, milliseconds. */
export const LONGEST_WAIT_MS = 86_400_000;

/** Between the name of the room at hand and that of the participant. */
const BETWEEN = " · ";

/** A room that was made for a participant. */
export interface OwnRoom {
  readonly name: string;
  readonly roomId: string;
  readonly joinCode: string;
  /** What the link says of the study: its address from "?" on. */
  readonly search: string;
}

/** Rooms being made, or the end that this came to. */
export interface Job {
  readonly participants: readonly string[];
  readonly busy: boolean;
  /** What was thrown; undefined: nothing. */
  readonly fault: unknown;
}

/** The jobs of this page by the room that theirs are like. They outlast the form, which may be left and opened again meanwhile. */
export const jobs = signal<ReadonlyMap<string, Job>>(new Map());

/** The rooms that this device has made for participants, after the likeness of one. */
export function ownRooms(likeRoomId: string): OwnRoom[] {
  const kept = recallObject(keptUnder(likeRoomId), ({ made }) => (Array.isArray(made) ? made : null));
  return (kept ?? []).flatMap((one: unknown) => {
    if (typeof one !== "object" || one === null) return [];
    const { name, roomId, search }: { name?: unknown; roomId?: unknown; search?: unknown } = one;
    if (typeof name !== "string" || typeof roomId !== "string" || typeof search !== "string") return [];
    const joinCode = hostedRoom(roomId)?.joinCode;
    return joinCode === undefined ? [] : [{ name, roomId, joinCode, search }];
  });
}

/** Makes a room for each participant that has none yet, one after the other; nothing while that is done already. What was made before one is
 * refused is kept. How it goes on and ends stands in `jobs`. */
export async function makeOwnRooms(
  room: Room,
  participants: readonly string[],
  waitingTimeMs: number,
  searchFor: (name: string) => string,
): Promise<void> {
  const { roomId } = room;
  if (jobs.peek().get(roomId)?.busy) return;
  const tell = (busy: boolean, fault?: unknown) => {
    jobs.value = new Map(jobs.peek()).set(roomId, { participants, busy, fault });
  };
  tell(true);
  try {
    for (const name of participants) {
      // Asked each time: another page of this device may be making some as well.
      if (ownRooms(roomId).some((one) => one.name === name)) continue;
      const { room: own, joinCode } = await makeRoom(requestLike(room, ownName(room.name, name), waitingTimeMs));
      keep(roomId, [...ownRooms(roomId), { name, roomId: own.roomId, joinCode, search: searchFor(name) }]);
      tell(true);
    }
    tell(false);
  } catch (thrown) {
    tell(false, thrown);
  }
}

/** What a participant's room is called: the first name is cut where both are too long for one. */
function ownName(roomName: string, name: string): string {
  const space = MAX_NAME - Array.from(BETWEEN + name).length;
  const beginning = Array.from(roomName).slice(0, Math.max(space, 0)).join("").trim();
  return [beginning, name].filter(Boolean).join(BETWEEN);
}

function keep(likeRoomId: string, rooms: readonly OwnRoom[]): void {
  const made = rooms.map(({ name, roomId, search }) => ({ name, roomId, search }));
  remember(keptUnder(likeRoomId), JSON.stringify({ made }));
}

function keptUnder(roomId: string): string {
  return `own-rooms.${roomId}`;
}
