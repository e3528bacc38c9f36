// Joining a tournament, and the place that this device stores. Playing is in participation.ts.

import { tournamentApi } from "../api/client";
import { keepSecret } from "../api/secrets";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { linksBringing } from "../lobby/bringing";
import { canonical } from "../lobby/seat";
import { nameKey } from "../name-key";
import { pathOf } from "../router";
import { recallObject, remember } from "../store";

/** A place of this device in a tournament. */
export interface HeldPlace {
  ticket: string;
  participant: number;
  name: string;
}

/** This device's place in a tournament, if any. */
export function heldPlace(tournamentId: string): HeldPlace | null {
  return recallObject(`tournament.${tournamentId}`, asPlace);
}

/** A value as a place, if it is one. */
export function asPlace(value: unknown): HeldPlace | null {
  const { ticket, participant, name }: Partial<Record<keyof HeldPlace, unknown>> = { ...(value as object) };
  return typeof ticket === "string" && typeof participant === "number" && typeof name === "string"
    ? { ticket, participant, name }
    : null;
}

/** Deletes this device's place in a tournament. */
export function forgetPlace(tournamentId: string): void {
  remember(`tournament.${tournamentId}`, null);
}

/** Links that bring a place to another device. */
export const {
  linkTo: linkToPlace,
  fromLink: placeFromLink,
  decide: decidePlace,
} = linksBringing<HeldPlace>({
  name: "place",
  path: (tournamentId) => pathOf({ page: "tournament", tournamentId }),
  key: (tournamentId) => `tournament.${tournamentId}`,
  held: heldPlace,
  numberOf: ({ participant }) => participant,
  withNumber: (holding, participant) => ({ ...holding, participant }),
});

/** Joins as a person; `key` is that of the name. Returns the tournament's id. */
export async function takePlace(tournamentId: string, code: string, name: string, key = nameKey()): Promise<string> {
  const joined = await tournamentApi.joinTournament({
    tournamentId,
    joinCode: canonical(code),
    name: name.trim(),
    kind: ParticipantKind.HUMAN,
    nameKey: key,
  });
  const id = joined.tournament?.tournamentId ?? tournamentId;
  const held: HeldPlace = { ticket: joined.ticket, participant: joined.participant, name: name.trim() };
  remember(`tournament.${id}`, JSON.stringify(held));
  keepSecret(held.ticket, joined.tournament?.settings?.policy);
  remember("name", held.name);
  return id;
}
