// The seats of a room for the participants of a study. A participant who has joined keeps the link
// of their seat.

import { type Participant, ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { isFree } from "../lobby/rooms";

/** A participant's name, empty if the link sets none, and the seat for it. */
export interface Place {
  readonly name: string;
  readonly seat: number;
}

/** The seats that a person can take. */
export function freeForPeople(seats: readonly Participant[]): number[] {
  const kinds = [ParticipantKind.UNSPECIFIED, ParticipantKind.HUMAN];
  return seats.flatMap((seat, index) => (isFree(seat) && kinds.includes(seat.reservedFor) ? index : []));
}

/**
 * Assigns names to seats, from `first` or the next free one on; at most as many as there are seats.
 */
export function placed(seats: readonly Participant[], names: readonly string[], first: number): Place[] {
  const free = freeForPeople(seats).filter((seat) => seat >= first);
  return names.flatMap((name) => {
    const taken = name === "" ? -1 : seats.findIndex((seat) => seat.name === name);
    const seat = taken >= 0 ? taken : free.shift();
    return seat === undefined ? [] : { name, seat };
  });
}
