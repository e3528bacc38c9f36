// Which seats of a room the participants of a study can have, as its links are written. Whoever has sat down keeps the link that led there.

import { type Participant, ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { isFree } from "../lobby/rooms";

/** A participant's name, empty for whoever opens the link, and the seat there is for it. */
export interface Place {
  readonly name: string;
  readonly seat: number;
}

/** The seats that a person can still take. */
export function freeForPeople(seats: readonly Participant[]): number[] {
  const kinds = [ParticipantKind.UNSPECIFIED, ParticipantKind.HUMAN];
  return seats.flatMap((seat, index) => (isFree(seat) && kinds.includes(seat.reservedFor) ? index : []));
}

/** Names on seats, the first on `first` or the next that is free; as many as there are seats for. */
export function placed(seats: readonly Participant[], names: readonly string[], first: number): Place[] {
  const free = freeForPeople(seats).filter((seat) => seat >= first);
  return names.flatMap((name) => {
    const taken = name === "" ? -1 : seats.findIndex((seat) => seat.name === name);
    const seat = taken >= 0 ? taken : free.shift();
    return seat === undefined ? [] : { name, seat };
  });
}
