// Playing again: a room with the rules, times and agents of another and its other seats free.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { roomApi } from "../api/client";
import { faultOf } from "../api/faults";
import { SECRET_HEADER } from "../api/secrets";
import { GameOrigin, type Participant, ParticipantKind, type Room, RoomPolicySchema } from "../gen/chefshat/v1/room_pb";
import type { CreateRoomRequestSchema } from "../gen/chefshat/v1/room_service_pb";
import { NO_KEY, nameKey } from "../name-key";
import { navigateFromHere, type Route } from "../router";
import { closeRoom, createRoom, type HeldSeat, hostedRoom, requiredRoom, takeSeat } from "./seat";

/** The request for a room with the rules, the policy and the agents of another. */
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

/**
 * Creates a room like one in which this device has a seat, offers it to the others, takes the same seat
 * and navigates to it. If somebody else was faster, it takes the seat in that room.
 */
export async function playAgain(roomId: string, { ticket, name, seat }: HeldSeat): Promise<void> {
  const navigate = navigateFromHere();
  const room = await roomOfTicket(roomId, ticket);
  const made = await createRoom(requestLike(room));
  try {
    await roomApi.setNextRoom({ roomId, ticket, joinCode: made.joinCode });
  } catch (thrown) {
    if (faultOf(thrown).reason === "NEXT_ROOM_SET") {
      await closeRoom(made.room.roomId);
      const next = await roomOfTicket(roomId, ticket);
      return navigate(await sitAgain(next, next.nextJoinCode, { name, seat }));
    }
    // Without the offer the others need the invitation, which the new room shows.
  }
  navigate(await sitAgain(room, made.joinCode, { name, seat }));
}

/** A room as its participants see it, with the join code of the room in which they play again. */
export async function roomOfTicket(roomId: string, ticket: string, signal?: AbortSignal): Promise<Room> {
  const headers = { [SECRET_HEADER]: ticket };
  const { room } = await roomApi.getRoom({ roomId }, { headers, ...(signal && { signal }) });
  return requiredRoom(room);
}

/** Takes the same seat in the room in which the participants of a room play again, and navigates to it. */
export async function joinAgain(room: Room, { name, seat }: Pick<HeldSeat, "name" | "seat">): Promise<void> {
  const navigate = navigateFromHere();
  navigate(await sitAgain(room, room.nextJoinCode, { name, seat }));
}

/** Takes a seat as in a room before; returns the route to its room. */
async function sitAgain(before: Room, code: string, { name, seat }: Pick<HeldSeat, "name" | "seat">): Promise<Route> {
  const kind = before.seats[seat]?.kind || ParticipantKind.HUMAN;
  // A robot's name is not the person's own.
  const key = kind === ParticipantKind.HUMAN ? nameKey() : NO_KEY;
  const { roomId } = await takeSeat(code, name, seat, kind, key);
  return { page: "room", roomId };
}
