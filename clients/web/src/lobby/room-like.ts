// Playing again: a room with the rules, times and agents of another and its other seats free.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { CALL_LIMIT_MS, roomApi } from "../api/client";
import { SECRET_HEADER } from "../api/secrets";
import { GameOrigin, type Participant, ParticipantKind, type Room, RoomPolicySchema } from "../gen/chefshat/v1/room_pb";
import type { CreateRoomRequestSchema } from "../gen/chefshat/v1/room_service_pb";
import { NO_KEY, nameKey } from "../name-key";
import { navigate } from "../router";
import { createRoom, hostedRoom, takeSeat } from "./seat";

/** The request for a room with the rules, the policy and the agents of another that this device created. */
export function requestLike(room: Room): MessageInitShape<typeof CreateRoomRequestSchema> {
  const wizards = hostedRoom(room.roomId)?.wizards ?? [];
  return {
    name: room.name,
    seats: room.seats.map((seat) => seatLike(seat, wizards.includes(seat.seat))),
    physical: room.origin === GameOrigin.PHYSICAL,
    policy: room.policy ?? create(RoomPolicySchema),
    // A branched game keeps the rules of the game it branches from.
    ...(room.branchedFrom
      ? { start: { case: "branch" as const, value: room.branchedFrom } }
      : room.rules && { rules: room.rules }),
  };
}

/** A seat like another, in which a person played as another kind (`wizard`) or not. */
function seatLike(seat: Participant, wizard: boolean) {
  const { replay, builtInAgent, name, reservedFor, atTable, kind } = seat;
  if (wizard) return { filledBy: { case: "wizard" as const, value: reservedFor } };
  if (atTable) return { filledBy: { case: "atTable" as const, value: kind }, name };
  if (replay) return { filledBy: { case: "replay" as const, value: replay }, name };
  if (builtInAgent) return { filledBy: { case: "builtInAgent" as const, value: builtInAgent }, name };
  return { filledBy: { case: "reservedFor" as const, value: reservedFor } };
}

/** Creates a room like one of this device's, takes the same seat, tells the others and navigates to it. */
export async function playAgain(roomId: string, name: string, seat: number): Promise<void> {
  const { room } = await roomApi.getRoom({ roomId }, { timeoutMs: CALL_LIMIT_MS });
  if (!room) throw new Error("the server did not say which room it is");
  const { joinCode } = await createRoom(requestLike(room));
  const again = await sitAgain(room, joinCode, name, seat);
  const ownerToken = hostedRoom(roomId)?.ownerToken ?? "";
  // Without it the others need the invitation, which the new room shows.
  await roomApi.setNextRoom({ roomId, ownerToken, joinCode }, { timeoutMs: CALL_LIMIT_MS }).catch(() => undefined);
  navigate({ page: "room", roomId: again });
}

/** A room as its participants see it, with the join code of the room in which they play again. */
export async function roomOfTicket(roomId: string, ticket: string, signal: AbortSignal): Promise<Room | undefined> {
  const headers = { [SECRET_HEADER]: ticket };
  const { room } = await roomApi.getRoom({ roomId }, { signal, headers, timeoutMs: CALL_LIMIT_MS });
  return room;
}

/** Takes the same seat in the room in which the participants of a room play again, and navigates to it. */
export async function joinAgain(room: Room, name: string, seat: number): Promise<void> {
  navigate({ page: "room", roomId: await sitAgain(room, room.nextJoinCode, name, seat) });
}

/** Takes a seat as in a room before. Returns the id of its room. */
async function sitAgain(before: Room, code: string, name: string, seat: number): Promise<string> {
  const kind = before.seats[seat]?.kind || ParticipantKind.HUMAN;
  // A robot's name is not the person's own.
  const key = kind === ParticipantKind.HUMAN ? nameKey() : NO_KEY;
  const { roomId } = await takeSeat(code, name, seat, kind, key);
  return roomId;
}
