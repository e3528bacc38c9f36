// Joining a tournament, and the place that this device stores. Playing is in participation.ts.

import { CALL_LIMIT_MS, tournamentApi } from "../api/client";
import { keepSecret } from "../api/secrets";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { canonical } from "../lobby/seat";
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
