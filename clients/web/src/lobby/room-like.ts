// Creates a room with the rules, times and agents of another and its other seats free: for studies
// in which each participant has a room of their own, and for playing again.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { CALL_LIMIT_MS, roomApi } from "../api/client";
import { SECRET_HEADER } from "../api/secrets";
import { GameOrigin, type Participant, type Room, RoomPolicySchema } from "../gen/chefshat/v1/room_pb";
import type { CreateRoomRequestSchema } from "../gen/chefshat/v1/room_service_pb";
import { navigate } from "../router";
import { MAX_NAME } from "./room-form";
import { createRoom, hostedRoom, takeSeat } from "./seat";

/** Why a room cannot be repeated exactly; null if it can. */
export function notToBeRepeated(room: Room): "seed" | "hands" | "real" | null {
  if (room.origin === GameOrigin.SCRIPTED) return "hands";
  if (room.origin === GameOrigin.PHYSICAL) return "real";
  return room.seedFixed ? "seed" : null;
}

/** The request for a room with the rules, the policy and the agents of another. */
export function requestLike(
  room: Room,
  name: string,
  waitingTimeMs = room.policy?.waitingTimeMs,
): MessageInitShape<typeof CreateRoomRequestSchema> {
  return {
    name: Array.from(name).slice(0, MAX_NAME).join(""),
    seats: room.seats.map(seatLike),
    physical: room.origin === GameOrigin.PHYSICAL,
    policy: { ...(room.policy ?? create(RoomPolicySchema)), ...(waitingTimeMs === undefined ? {} : { waitingTimeMs }) },
    // A branched game keeps the rules of the game it branches from.
    ...(room.branchedFrom
      ? { start: { case: "branch" as const, value: room.branchedFrom } }
      : room.rules && { rules: room.rules }),
  };
}

function seatLike(seat: Participant) {
  const { replay, builtInAgent, name, reservedFor, atTable, kind } = seat;
  if (atTable) return { filledBy: { case: "atTable" as const, value: kind }, name };
  if (replay) return { filledBy: { case: "replay" as const, value: replay }, name };
  if (builtInAgent) return { filledBy: { case: "builtInAgent" as const, value: builtInAgent }, name };
  return { filledBy: { case: "reservedFor" as const, value: reservedFor } };
}

/** Creates a room like one of this device's, takes the same seat, tells the others and navigates to it. */
export async function playAgain(roomId: string, name: string, seat: number): Promise<void> {
  const { room } = await roomApi.getRoom({ roomId }, { timeoutMs: CALL_LIMIT_MS });
  if (!room) throw new Error("the server did not say which room it is");
  const { joinCode } = await createRoom(requestLike(room, room.name));
  const again = await takeSeat(joinCode, name, seat);
  const ownerToken = hostedRoom(roomId)?.ownerToken ?? "";
  // Without it the others need the invitation, which the new room shows.
  await roomApi.setNextRoom({ roomId, ownerToken, joinCode }, { timeoutMs: CALL_LIMIT_MS }).catch(() => undefined);
  navigate({ page: "room", roomId: again.roomId });
}

/** The join code of the room in which the participants of a room play again; empty if there is none. */
export async function nextCode(roomId: string, ticket: string, signal: AbortSignal): Promise<string> {
  const headers = { [SECRET_HEADER]: ticket };
  const { room } = await roomApi.getRoom({ roomId }, { signal, headers, timeoutMs: CALL_LIMIT_MS });
  return room?.nextJoinCode ?? "";
}

/** Takes the same seat in the next room and navigates to it. */
export async function joinAgain(code: string, name: string, seat: number): Promise<void> {
  const { roomId } = await takeSeat(code, name, seat);
  navigate({ page: "room", roomId });
}
