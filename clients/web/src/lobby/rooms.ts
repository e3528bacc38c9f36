// The rooms of the server, for the lobby.

import { roomApi } from "../api/client";
import { faultOf } from "../api/faults";
import type { AskPage } from "../api/pages";
import {
  type Participant,
  ParticipantKind,
  type Room,
  type RoomPolicy,
  RoomState,
  Visibility,
} from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { giveUpSeat } from "./seat";

/** Requests the rooms in a state, newest first. Aborted rooms are left out. */
export function roomsIn(state: RoomState): AskPage<Room> {
  return async (page, signal) => {
    const { rooms, nextPageToken } = await roomApi.listRooms({ state, ...page }, { signal });
    return { items: rooms, nextPageToken };
  };
}

/** Rooms that were found to be over or gone, which they stay. */
const over = new Set<string>();

/** Those of the rooms that wait or play; the others are over, gone, or cannot be asked for now. */
export async function openRooms(roomIds: readonly string[], signal: AbortSignal): Promise<Room[]> {
  const ask = async (roomId: string): Promise<Room[]> => {
    try {
      const { room } = await roomApi.getRoom({ roomId }, { signal });
      if (room?.state === RoomState.WAITING || room?.state === RoomState.PLAYING) return [room];
      over.add(roomId);
    } catch (error) {
      if (faultOf(error).reason !== "ROOM_UNKNOWN") return [];
      over.add(roomId);
      giveUpSeat(roomId);
    }
    return [];
  };
  return (await Promise.all(roomIds.filter((roomId) => !over.has(roomId)).map(ask))).flat();
}

/** Whether the seat is free. */
export function isFree(participant: Participant): boolean {
  return participant.name === "" && participant.builtInAgent === "";
}

/** The seats that a person can take. */
export function freeForPeople(seats: readonly Participant[]): number[] {
  const kinds = [ParticipantKind.UNSPECIFIED, ParticipantKind.HUMAN];
  return seats.flatMap((seat, index) => (isFree(seat) && kinds.includes(seat.reservedFor) ? index : []));
}

/**
 * Whether a person or agent can still join. The seats of a tournament's room belong to its
 * participants.
 */
export function isOpen(room: Room): boolean {
  return room.state === RoomState.WAITING && room.tournamentId === "" && room.seats.some(isFree);
}

/** Whether an agent can still join: a seat is reserved for agents, or for nobody. */
export function isForAgents(seats: readonly Participant[]): boolean {
  const kinds = [ParticipantKind.UNSPECIFIED, ParticipantKind.AGENT];
  return seats.some((seat) => isFree(seat) && kinds.includes(seat.reservedFor));
}

interface Clock {
  decisionTimeMs: number;
  bankMs: number;
  absenceTimeMs: number | undefined;
}

/** The clock of a person under a policy. */
export function clockOfPeople(policy: RoomPolicy): Clock {
  return clockOf(policy, ParticipantKind.HUMAN);
}

/**
 * The clock of a kind of participants under a policy, milliseconds: per decision, and for the game
 * beyond that. The absence time; undefined in games without one.
 */
export function clockOf(policy: RoomPolicy, whose: ParticipantKind): Clock {
  const own = policy.clocks.find(({ kind }) => kind === whose);
  return {
    decisionTimeMs: own?.decisionTimeMs ?? policy.decisionTimeMs ?? 0,
    bankMs: own?.bankMs ?? policy.bankMs ?? 0,
    absenceTimeMs: own?.absenceTimeMs ?? policy.absenceTimeMs,
  };
}

/** A participant's display name: its own, else that of the built-in agent. */
export function nameOf(participant: Participant): string {
  return participant.name || participant.builtInAgent;
}

/** Who sees a room or tournament, if not everybody: nothing or one word. */
export function visibilityWords(policy: RoomPolicy | undefined): string[] {
  const words = t().lobby.rooms;
  if (policy?.visibility === Visibility.UNLISTED) return [words.unlisted];
  return policy?.visibility === Visibility.PRIVATE ? [words.private] : [];
}
