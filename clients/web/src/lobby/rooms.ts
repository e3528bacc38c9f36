// The rooms of the server as the lobby shows them: which there are, in which order, who sits there.

import { CALL_LIMIT_MS, roomApi } from "../api/client";
import { type Participant, type Room, RoomState } from "../gen/chefshat/v1/room_pb";

/** Pages of rooms that the lobby asks for at most, of 100 rooms each. */
const MAX_PAGES = 5;
const PAGE_SIZE = 100;
/** Rooms shown of one kind at first. */
export const SHOWN_ROOMS = 12;

/** The rooms by where they stand, newest first. */
export interface RoomsByState {
  waiting: Room[];
  playing: Room[];
  over: Room[];
}

/** Asks for the rooms of the server. */
export async function listRooms(signal: AbortSignal): Promise<RoomsByState> {
  const rooms: Room[] = [];
  let pageToken = "";
  for (let page = 0; page < MAX_PAGES; page += 1) {
    const answer = await roomApi.listRooms({ pageSize: PAGE_SIZE, pageToken }, { signal, timeoutMs: CALL_LIMIT_MS });
    rooms.push(...answer.rooms);
    pageToken = answer.nextPageToken;
    if (pageToken === "") break;
  }
  return sorted(rooms);
}

/** Rooms by where they stand, newest first. Games without a result that never began are of no interest to anybody. */
export function sorted(rooms: readonly Room[]): RoomsByState {
  const newestFirst = [...rooms].sort((one, other) => Number(other.createdAtMs - one.createdAtMs));
  const inState = (...states: RoomState[]) => newestFirst.filter(({ state }) => states.includes(state));
  return {
    waiting: inState(RoomState.WAITING),
    playing: inState(RoomState.PLAYING),
    over: inState(RoomState.FINISHED),
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

/** The name to show for a participant: its own, else that of the built-in agent. */
export function nameOf(participant: Participant): string {
  return participant.name || participant.builtInAgent;
}
