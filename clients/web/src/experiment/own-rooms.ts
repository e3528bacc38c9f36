// Rooms like one that stands, one for each participant of a study, and which of them this device has made. They are rooms like any other, whose
// secrets are kept with those of all rooms made here (lobby/seat.ts).

import type { Room } from "../gen/chefshat/v1/room_pb";
import { requestLike } from "../lobby/room-like";
import { hostedRoom, makeRoom } from "../lobby/seat";
import { recallObject, remember } from "../store";

/** Longest time that a room can wait for its seats, milliseconds. */
export const LONGEST_WAIT_MS = 86_400_000;

/** A room that was made for a participant. */
export interface OwnRoom {
  readonly name: string;
  readonly roomId: string;
  readonly joinCode: string;
}

/** The rooms that this device has made for participants, after the likeness of one. */
export function ownRooms(likeRoomId: string): OwnRoom[] {
  const kept = recallObject(keptUnder(likeRoomId), ({ made }) => (Array.isArray(made) ? made : null));
  return (kept ?? []).flatMap((one: unknown) => {
    if (typeof one !== "object" || one === null) return [];
    const { name, roomId }: { name?: unknown; roomId?: unknown } = one;
    if (typeof name !== "string" || typeof roomId !== "string") return [];
    const joinCode = hostedRoom(roomId)?.joinCode;
    return joinCode === undefined ? [] : [{ name, roomId, joinCode }];
  });
}

/** Makes a room for each participant that has none yet, one after the other: what was made before one is refused is kept. `onMade` is told of each. */
export async function makeOwnRooms(
  room: Room,
  participants: readonly string[],
  waitingTimeMs: number,
  onMade: (made: readonly OwnRoom[]) => void,
): Promise<void> {
  const made = ownRooms(room.roomId);
  for (const name of participants) {
    if (made.some((one) => one.name === name)) continue;
    const ownName = [room.name, name].filter(Boolean).join(" · ");
    const { room: own, joinCode } = await makeRoom(requestLike(room, ownName, waitingTimeMs));
    made.push({ name, roomId: own.roomId, joinCode });
    const kept = made.map(({ name, roomId }) => ({ name, roomId }));
    remember(keptUnder(room.roomId), JSON.stringify({ made: kept }));
    onMade([...made]);
  }
}

function keptUnder(roomId: string): string {
  return `own-rooms.${roomId}`;
}
