// Joining and leaving a tournament, and the place that this device stores. Playing is in
// participation.ts.

import { CALL_LIMIT_MS, tournamentApi } from "../api/client";
import { keepSecret } from "../api/secrets";
import { ParticipantKind, Visibility } from "../gen/chefshat/v1/room_pb";
import { broughtBy, linkBringing } from "../lobby/bringing";
import { canonical } from "../lobby/seat";
import { nameKey } from "../name-key";
import { pathOf, readdress } from "../router";
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

/** Leaves a tournament: before the start the place is free again. */
export async function leaveTournament(tournamentId: string, { ticket }: HeldPlace): Promise<void> {
  await tournamentApi.withdrawParticipant({ tournamentId, ticket }, { timeoutMs: CALL_LIMIT_MS });
}

/** Moves a game of this device's participant to the end of the queue. */
export async function postponeOwnGame(tournamentId: string, { ticket }: HeldPlace, game: number): Promise<void> {
  await tournamentApi.postponeGame({ tournamentId, ticket, game }, { timeoutMs: CALL_LIMIT_MS });
}

/** The kind of what a link brings. */
const KIND = "place";

/** The address that brings a place to another device. */
export function linkToPlace(tournamentId: string, { ticket, participant, name }: HeldPlace): string {
  return linkBringing(pathOf({ page: "tournament", tournamentId }), KIND, [ticket, participant, name]);
}

/**
 * Stores the place that the address brings, if any. If this device has another place in the
 * tournament, it is returned instead, and stays in the address until `decidePlace`: taking it
 * would lose the other.
 */
export function placeFromLink(tournamentId: string): HeldPlace | null {
  const given = broughtBy(KIND, tournamentId);
  if (given === undefined) return null;
  const brought = given && { ticket: given[0], participant: given[1], name: given[2] };
  const held = heldPlace(tournamentId);
  if (brought && held && held.ticket !== brought.ticket) return brought;
  decidePlace(tournamentId, brought);
  return null;
}

/** Removes the place that the address brings from the address; stores the chosen one, if any. */
export function decidePlace(tournamentId: string, chosen: HeldPlace | null): void {
  readdress(location.search);
  if (!chosen) return;
  remember(`tournament.${tournamentId}`, JSON.stringify(chosen));
  // Whether it is needed is not known yet.
  keepSecret(chosen.ticket, { visibility: Visibility.PRIVATE });
}

/** Joins as a person; `key` is that of the name. Returns the tournament's id. */
export async function takePlace(tournamentId: string, code: string, name: string, key = nameKey()): Promise<string> {
  const joined = await tournamentApi.joinTournament(
    { tournamentId, joinCode: canonical(code), name: name.trim(), kind: ParticipantKind.HUMAN, nameKey: key },
    { timeoutMs: CALL_LIMIT_MS },
  );
  const id = joined.tournament?.tournamentId ?? tournamentId;
  const held: HeldPlace = { ticket: joined.ticket, participant: joined.participant, name: name.trim() };
  remember(`tournament.${id}`, JSON.stringify(held));
  keepSecret(held.ticket, joined.tournament?.settings?.policy);
  remember("name", held.name);
  return id;
}
