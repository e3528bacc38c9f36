// Joining and leaving a tournament, and the place that this device stores. Playing is in
// participation.ts.

import { CALL_LIMIT_MS, tournamentApi } from "../api/client";
import { keepSecret } from "../api/secrets";
import { ParticipantKind, Visibility } from "../gen/chefshat/v1/room_pb";
import { canonical } from "../lobby/seat";
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
  return recallObject(`tournament.${tournamentId}`, ({ ticket, participant, name }) =>
    typeof ticket === "string" && typeof participant === "number" && typeof name === "string"
      ? { ticket, participant, name }
      : null,
  );
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

/** The parts of an address that bring a place; see `placeFromLink`. */
const MARK = "place=";

/**
 * The address that brings a place to another device. The place comes after "#", which browsers send
 * to no server.
 */
export function linkToPlace(tournamentId: string, { ticket, participant, name }: HeldPlace): string {
  const place = encodeURIComponent(JSON.stringify([ticket, participant, name]));
  return `${location.origin}${pathOf({ page: "tournament", tournamentId })}#${MARK}${place}`;
}

/** Stores the place that the address brings, if any, and removes it from the address. */
export function placeFromLink(tournamentId: string): void {
  const [given] = location.hash
    .replace(/^#/, "")
    .split("&")
    .filter((part) => part.startsWith(MARK));
  if (!given) return;
  history.replaceState(history.state, "", location.pathname + location.search);
  try {
    const [ticket, participant, name]: unknown[] = JSON.parse(decodeURIComponent(given.slice(MARK.length)));
    if (typeof ticket !== "string" || typeof participant !== "number" || typeof name !== "string") return;
    const held: HeldPlace = { ticket, participant, name };
    remember(`tournament.${tournamentId}`, JSON.stringify(held));
    // Whether it is needed is not known yet.
    keepSecret(ticket, { visibility: Visibility.PRIVATE });
  } catch {
    // The link was cut; the page shows the tournament.
  }
}

/** Joins as a person. Returns the tournament's id. */
export async function takePlace(tournamentId: string, code: string, name: string): Promise<string> {
  const joined = await tournamentApi.joinTournament(
    { tournamentId, joinCode: canonical(code), name: name.trim(), kind: ParticipantKind.HUMAN },
    { timeoutMs: CALL_LIMIT_MS },
  );
  const id = joined.tournament?.tournamentId ?? tournamentId;
  const held: HeldPlace = { ticket: joined.ticket, participant: joined.participant, name: name.trim() };
  remember(`tournament.${id}`, JSON.stringify(held));
  keepSecret(held.ticket, joined.tournament?.settings?.policy);
  remember("name", held.name);
  return id;
}
