// The rooms of the server as the lobby shows them: which there are, who sits there.

import { CALL_LIMIT_MS, roomApi } from "../api/client";
import type { AskPage } from "../api/pages";
import { type Participant, ParticipantKind, type Room, type RoomPolicy, RoomState } from "../gen/chefshat/v1/room_pb";

/** Asks for the rooms in a state, newest first. Those that were given up are of no interest to anybody. */
export function roomsIn(state: RoomState): AskPage<Room> {
  return async (page, signal) => {
    const { rooms, nextPageToken } = await roomApi.listRooms({ state, ...page }, { signal, timeoutMs: CALL_LIMIT_MS });
    return { items: rooms, nextPageToken };
  };
}

/** Whether nobody has taken a seat. */
export function isFree(participant: Participant): boolean {
  return participant.name === "" && participant.builtInAgent === "";
}

/** Whether somebody may still sit down: the seats of a tournament's room are its participants'. */
export function isOpen(room: Room): boolean {
  return room.state === RoomState.WAITING && room.tournamentId === "" && room.seats.some(isFree);
}

/** Whether an agent may still sit down: a free seat is kept for none but agents, or for nobody. */
export function isForAgents(seats: readonly Participant[]): boolean {
  const kinds = [ParticipantKind.UNSPECIFIED, ParticipantKind.AGENT];
  return seats.some((seat) => isFree(seat) && kinds.includes(seat.reservedFor));
}

/** The clock of a person under a policy, milliseconds: for a decision, and beyond that over the game. */
export function clockOfPeople(policy: RoomPolicy): { decisionTimeMs: number; bankMs: number } {
  const own = policy.clocks.find(({ kind }) => kind === ParticipantKind.HUMAN);
  return {
    decisionTimeMs: own?.decisionTimeMs ?? policy.decisionTimeMs ?? 0,
    bankMs: own?.bankMs ?? policy.bankMs ?? 0,
  };
}

/** The name to show for a participant: its own, else that of the built-in agent. */
export function nameOf(participant: Participant): string {
  return participant.name || participant.builtInAgent;
}
