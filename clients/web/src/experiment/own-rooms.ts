// Separate rooms for the participants of a study, like a given room: which ones this device has
// created, and their links. Their secrets are stored like those of other rooms (lobby/seat.ts).

import { signal } from "@preact/signals";
import type { Room } from "../gen/chefshat/v1/room_pb";
import { MAX_NAME } from "../lobby/room-form";
import { requestLike } from "../lobby/room-like";
import { createRoom, hostedRoom } from "../lobby/seat";
import { recallObject, remember } from "../store";

/** Longest time that a room can wait for its players, milliseconds. */
export const LONGEST_WAIT_MS = 86_400_000;

/** Separates the room's name from the participant's. */
const BETWEEN = " · ";

/** A participant's room. */
export interface OwnRoom {
  readonly name: string;
  readonly roomId: string;
  readonly joinCode: string;
  /** The query of the link: its address from "?" on. */
  readonly search: string;
}

/** Rooms being created, or the result. */
export interface Job {
  readonly participants: readonly string[];
  readonly busy: boolean;
  /** The error; undefined if there was none. */
  readonly fault: unknown;
}

/**
 * The jobs of this page by the room they copy. They outlast the form, which may be closed and
 * opened again.
 */
export const jobs = signal<ReadonlyMap<string, Job>>(new Map());

/** The rooms that this device created for participants, like a given room. */
export function ownRooms(likeRoomId: string): OwnRoom[] {
  const stored = recallObject(storageKey(likeRoomId), ({ made }) => (Array.isArray(made) ? made : null));
  return (stored ?? []).flatMap((one: unknown) => {
    if (typeof one !== "object" || one === null) return [];
    const { name, roomId, search }: { name?: unknown; roomId?: unknown; search?: unknown } = one;
    if (typeof name !== "string" || typeof roomId !== "string" || typeof search !== "string") return [];
    const joinCode = hostedRoom(roomId)?.joinCode;
    return joinCode === undefined ? [] : [{ name, roomId, joinCode, search }];
  });
}

/**
 * Creates a room for each participant without one, one after the other; does nothing while a job
 * runs. Rooms created before an error are kept. `jobs` shows the progress.
 */
export async function makeOwnRooms(
  room: Room,
  participants: readonly string[],
  waitingTimeMs: number,
  searchFor: (name: string) => string,
): Promise<void> {
  const { roomId } = room;
  if (jobs.peek().get(roomId)?.busy) return;
  const report = (busy: boolean, fault?: unknown) => {
    jobs.value = new Map(jobs.peek()).set(roomId, { participants, busy, fault });
  };
  report(true);
  try {
    for (const name of participants) {
      // Read each time: another tab may be creating rooms too.
      if (ownRooms(roomId).some((one) => one.name === name)) continue;
      const { room: own, joinCode } = await createRoom(requestLike(room, ownName(room.name, name), waitingTimeMs));
      keep(roomId, [...ownRooms(roomId), { name, roomId: own.roomId, joinCode, search: searchFor(name) }]);
      report(true);
    }
    report(false);
  } catch (thrown) {
    report(false, thrown);
  }
}

/** The name of a participant's room; the room's own part is truncated if both are too long. */
function ownName(roomName: string, name: string): string {
  const space = MAX_NAME - Array.from(BETWEEN + name).length;
  const beginning = Array.from(roomName).slice(0, Math.max(space, 0)).join("").trim();
  return [beginning, name].filter(Boolean).join(BETWEEN);
}

function keep(likeRoomId: string, rooms: readonly OwnRoom[]): void {
  const made = rooms.map(({ name, roomId, search }) => ({ name, roomId, search }));
  remember(storageKey(likeRoomId), JSON.stringify({ made }));
}

function storageKey(roomId: string): string {
  return `own-rooms.${roomId}`;
}
