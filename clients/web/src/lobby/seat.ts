// Taking seats and creating rooms, and the secrets that this device stores for it: the ticket of
// each seat, the owner token of each room; that of a physical table is in attend/ticket.ts. Without
// them a reload would lose the seat.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { roomApi } from "../api/client";
import { keepSecret } from "../api/secrets";
import { keepTableTicket } from "../attend/ticket";
import { ParticipantKind, type Room } from "../gen/chefshat/v1/room_pb";
import type { CreateRoomRequestSchema } from "../gen/chefshat/v1/room_service_pb";
import { nameKey } from "../name-key";
import { pathOf } from "../router";
import { recall, recallObject, remember, remembered } from "../store";
import { linksBringing } from "./bringing";

/** A seat of this device. */
export interface HeldSeat {
  ticket: string;
  seat: number;
  name: string;
}

/** The secrets of a room that this device created. */
export interface HostedRoom {
  joinCode: string;
  ownerToken: string;
  /** Seats of people who play as another kind. The server names them to nobody before the record. */
  wizards: readonly number[];
}

/** This device's seat in a room, if any. */
export function heldSeat(roomId: string): HeldSeat | null {
  return recallObject(SEAT + roomId, (value) =>
    typeof value.ticket === "string" && typeof value.seat === "number" && typeof value.name === "string"
      ? { ticket: value.ticket, seat: value.seat, name: value.name }
      : null,
  );
}

/** The rooms in which this device has a seat. */
export function roomsWithSeats(): string[] {
  return [...remembered().keys()].flatMap((name) => (name.startsWith(SEAT) ? [name.slice(SEAT.length)] : []));
}

/** Deletes a seat and everything stored with it: the room is gone, or the seat was given up. */
export function giveUpSeat(roomId: string): void {
  remember(SEAT + roomId, null);
  for (const name of codesOf(roomId)) remember(name, null);
}

/** Links that bring a seat to another device. */
export const {
  linkTo: linkToSeat,
  fromLink: seatFromLink,
  decide: decideSeat,
} = linksBringing<HeldSeat>({
  name: "seat",
  path: (roomId) => pathOf({ page: "room", roomId }),
  key: (roomId) => SEAT + roomId,
  held: heldSeat,
  numberOf: ({ seat }) => seat,
  withNumber: (holding, seat) => ({ ...holding, seat }),
});

/** Frees a seat before the game starts, and deletes it here. */
export async function giveBackSeat(roomId: string): Promise<void> {
  const held = heldSeat(roomId);
  if (held) await roomApi.leaveRoom({ ticket: held.ticket });
  giveUpSeat(roomId);
}

/** The secrets of a room, if this device created it. */
export function hostedRoom(roomId: string): HostedRoom | null {
  return recallObject(`hosted.${roomId}`, (value) =>
    typeof value.joinCode === "string" && typeof value.ownerToken === "string"
      ? { joinCode: value.joinCode, ownerToken: value.ownerToken, wizards: seatsIn(value.wizards) }
      : null,
  );
}

/** The seats in a stored value; none if it was stored before there were any. */
function seatsIn(stored: unknown): readonly number[] {
  return Array.isArray(stored) ? stored.filter((seat) => typeof seat === "number") : [];
}

/** The room in which this device has a seat taken with this code, if any. */
export function roomOfCode(code: string): string | null {
  const roomId = recall(CODE + canonical(code));
  return roomId !== null && heldSeat(roomId) ? roomId : null;
}

/**
 * Takes a seat for a person, or for one who plays as another kind; the first free one without a
 * number. Returns the room. `key` is that of the name: by default this device's.
 */
export async function takeSeat(
  code: string,
  name: string,
  seat?: number,
  kind: ParticipantKind = ParticipantKind.HUMAN,
  key = nameKey(),
): Promise<Room> {
  const joined = await roomApi.joinRoom({
    joinCode: canonical(code),
    name: name.trim(),
    kind,
    nameKey: key,
    ...(seat === undefined ? {} : { seat }),
  });
  const room = requiredRoom(joined.room);
  const held: HeldSeat = { ticket: joined.ticket, seat: joined.seat, name: name.trim() };
  remember(SEAT + room.roomId, JSON.stringify(held));
  keepSecret(held.ticket, room.policy, room.gameId);
  remember(CODE + canonical(code), room.roomId);
  // A robot's name is not the person's own.
  if (kind === ParticipantKind.HUMAN) remember("name", held.name);
  return room;
}

/** Creates a room and stores its secrets. */
export async function createRoom(
  request: MessageInitShape<typeof CreateRoomRequestSchema>,
): Promise<{ room: Room; joinCode: string }> {
  const made = await roomApi.createRoom(request);
  const room = requiredRoom(made.room);
  const wizards = (request.seats ?? []).flatMap(({ filledBy }, seat) => (filledBy?.case === "wizard" ? [seat] : []));
  const hosted: HostedRoom = { joinCode: made.joinCode, ownerToken: made.ownerToken, wizards };
  remember(`hosted.${room.roomId}`, JSON.stringify(hosted));
  keepSecret(hosted.ownerToken, room.policy, room.gameId);
  if (made.tableTicket !== "") keepTableTicket(room.roomId, made.tableTicket);
  return { room, joinCode: made.joinCode };
}

/** Closes a room that this device created; a running game is aborted. */
export async function closeRoom(roomId: string): Promise<void> {
  const hosted = hostedRoom(roomId);
  if (hosted) await roomApi.closeRoom({ roomId, ownerToken: hosted.ownerToken });
}

/** The last name used on this device. */
export function lastName(): string {
  return recall("name") ?? "";
}

const SEAT = "seat.";
const CODE = "code.";

/** Storage keys of the codes that led to a room. */
function codesOf(roomId: string): string[] {
  return [...remembered()].flatMap(([name, value]) => (name.startsWith(CODE) && value === roomId ? name : []));
}

/** The join code with which this device took its seat in a room, if it has one. */
export function codeOf(roomId: string): string | undefined {
  return heldSeat(roomId) ? codesOf(roomId)[0]?.slice(CODE.length) : undefined;
}

/** A join code as the server writes it: capitals without separators. */
export function canonical(code: string): string {
  return code.replaceAll(/[\s-]/g, "").toUpperCase();
}

/** The invitation address of a room. */
export function invitation(code: string): string {
  return `${location.origin}/join/${canonical(code)}`;
}

/** The room of a response, which always has one. */
export function requiredRoom(room: Room | undefined): Room {
  if (!room) throw new Error("the server did not say which room it is");
  return room;
}
