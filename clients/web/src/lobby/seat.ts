// Taking seats and making rooms, and what this device must remember for it: the ticket of each seat it has taken, the secrets of each
// room it has made. Without them a reload would lose the seat. How a seat is played is in table/.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { CALL_LIMIT_MS, roomApi } from "../api/client";
import { rememberFinished } from "../experiment/study";
import { ParticipantKind, type Room } from "../gen/chefshat/v1/room_pb";
import type { CreateRoomRequestSchema } from "../gen/chefshat/v1/room_service_pb";
import { recall, recallObject, remember, remembered } from "../store";

/** A seat that this device has taken. */
export interface HeldSeat {
  ticket: string;
  seat: number;
  name: string;
}

/** The secrets of a room that this device has made. */
export interface HostedRoom {
  joinCode: string;
  ownerToken: string;
}

/** The seat that this device has in a room, if any. */
export function heldSeat(roomId: string): HeldSeat | null {
  return recallObject(`seat.${roomId}`, (value) =>
    typeof value.ticket === "string" && typeof value.seat === "number" && typeof value.name === "string"
      ? { ticket: value.ticket, seat: value.seat, name: value.name }
      : null,
  );
}

/** Forgets a seat and all that was kept with it: its room is gone, or it was given up. */
export function giveUpSeat(roomId: string): void {
  for (const kept of ["seat", "study", "timed"]) remember(`${kept}.${roomId}`, null);
  for (const name of codesOf(roomId)) remember(name, null);
}

/** Gives a seat back to others before the game begins, and forgets it. */
export async function giveBackSeat(roomId: string): Promise<void> {
  const held = heldSeat(roomId);
  if (held) await roomApi.leaveRoom({ ticket: held.ticket }, { timeoutMs: CALL_LIMIT_MS });
  giveUpSeat(roomId);
}

/** Forgets a seat whose game is over, but for what a study still asks of its participant. */
export function leaveSeat(roomId: string): void {
  for (const name of codesOf(roomId)) rememberFinished(roomId, name.slice(CODE.length));
  giveUpSeat(roomId);
}

/** The secrets of a room if this device made it. */
export function hostedRoom(roomId: string): HostedRoom | null {
  return recallObject(`hosted.${roomId}`, (value) =>
    typeof value.joinCode === "string" && typeof value.ownerToken === "string"
      ? { joinCode: value.joinCode, ownerToken: value.ownerToken }
      : null,
  );
}

/** The room that this device has a seat in by this code, if any: who opens an invitation again goes back to the seat. */
export function roomOfCode(code: string): string | null {
  const roomId = recall(CODE + canonical(code));
  return roomId !== null && heldSeat(roomId) ? roomId : null;
}

/** Takes a seat for a person; without a number the first free one. Gives the room. */
export async function takeSeat(code: string, name: string, seat?: number): Promise<Room> {
  const joined = await roomApi.joinRoom(
    {
      joinCode: canonical(code),
      name: name.trim(),
      kind: ParticipantKind.HUMAN,
      ...(seat === undefined ? {} : { seat }),
    },
    { timeoutMs: CALL_LIMIT_MS },
  );
  const room = saidRoom(joined.room);
  const held: HeldSeat = { ticket: joined.ticket, seat: joined.seat, name: name.trim() };
  remember(`seat.${room.roomId}`, JSON.stringify(held));
  remember(CODE + canonical(code), room.roomId);
  remember("name", name.trim());
  return room;
}

/** Makes a room and remembers its secrets. */
export async function makeRoom(
  request: MessageInitShape<typeof CreateRoomRequestSchema>,
): Promise<{ room: Room; joinCode: string }> {
  const made = await roomApi.createRoom(request, { timeoutMs: CALL_LIMIT_MS });
  const room = saidRoom(made.room);
  const hosted: HostedRoom = { joinCode: made.joinCode, ownerToken: made.ownerToken };
  remember(`hosted.${room.roomId}`, JSON.stringify(hosted));
  return { room, joinCode: made.joinCode };
}

/** Closes a room that this device has made; a running game is aborted. */
export async function closeRoom(roomId: string): Promise<void> {
  const hosted = hostedRoom(roomId);
  if (hosted) await roomApi.closeRoom({ roomId, ownerToken: hosted.ownerToken }, { timeoutMs: CALL_LIMIT_MS });
}

/** The name that was used last on this device. */
export function lastName(): string {
  return recall("name") ?? "";
}

const CODE = "code.";

/** Under which names the codes are kept that led to a room. */
function codesOf(roomId: string): string[] {
  return [...remembered()].flatMap(([name, value]) => (name.startsWith(CODE) && value === roomId ? name : []));
}

/** A join code as the server writes it: capitals, nothing between them. */
export function canonical(code: string): string {
  return code.replaceAll(/[\s-]/g, "").toUpperCase();
}

/** The address that invites to a room. */
export function invitation(code: string): string {
  return `${location.origin}/join/${canonical(code)}`;
}

function saidRoom(room: Room | undefined): Room {
  if (!room) throw new Error("the server did not say which room it is");
  return room;
}
