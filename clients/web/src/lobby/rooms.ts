// The rooms of the server as the lobby shows them: which there are, in which order, who sits there.

import { CALL_LIMIT_MS, roomApi } from "../api/client";
import { allPages } from "../api/pages";
import { type Participant, type Room, RoomState } from "../gen/chefshat/v1/room_pb";

const PAGE_SIZE = 100;
/** Pages of rooms in one state that are asked for at most. The newest come last, so that all are needed to know them. */
const MAX_PAGES = 100;
/** Pages of rooms whose games are over: a server that is used keeps many, and the lobby is not where one searches them. */
const MAX_PAGES_OVER = 20;
/** Rooms shown of one kind at first. */
export const SHOWN_ROOMS = 12;

/** The rooms that are not over, newest first. */
export interface OpenRooms {
  waiting: Room[];
  playing: Room[];
}

/** Asks for the rooms that wait or are being played in. */
export async function listOpenRooms(signal: AbortSignal): Promise<OpenRooms> {
  const [waiting, playing] = await Promise.all([
    listRooms(RoomState.WAITING, MAX_PAGES, signal),
    listRooms(RoomState.PLAYING, MAX_PAGES, signal),
  ]);
  return { waiting, playing };
}

/** Asks for the rooms with a result, newest first. Those that were given up are of no interest to anybody. */
export function listFinishedRooms(signal: AbortSignal): Promise<Room[]> {
  return listRooms(RoomState.FINISHED, MAX_PAGES_OVER, signal);
}

async function listRooms(state: RoomState, mostPages: number, signal: AbortSignal): Promise<Room[]> {
  const call = { signal, timeoutMs: CALL_LIMIT_MS };
  const rooms = await allPages(async (pageToken) => {
    const answer = await roomApi.listRooms({ state, pageSize: PAGE_SIZE, pageToken }, call);
    return { items: answer.rooms, nextPageToken: answer.nextPageToken };
  }, mostPages);
  return rooms.sort((one, other) => Number(other.createdAtMs - one.createdAtMs));
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
