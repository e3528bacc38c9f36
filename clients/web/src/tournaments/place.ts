// Taking part in a tournament: joining it, and what this device remembers of the place it has taken. How its games are played is in
// participation.ts.

import { CALL_LIMIT_MS, tournamentApi } from "../api/client";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { canonical } from "../lobby/seat";
import { recall, remember } from "../store";

/** A place in a tournament that this device has taken. */
export interface HeldPlace {
  ticket: string;
  participant: number;
  name: string;
}

/** The place that this device has in a tournament, if any. */
export function heldPlace(tournamentId: string): HeldPlace | null {
  try {
    const kept: unknown = JSON.parse(recall(`tournament.${tournamentId}`) ?? "null");
    if (typeof kept !== "object" || kept === null) return null;
    const { ticket, participant, name }: Partial<Record<keyof HeldPlace, unknown>> = kept;
    return typeof ticket === "string" && typeof participant === "number" && typeof name === "string"
      ? { ticket, participant, name }
      : null;
  } catch {
    // Another version kept something else.
    return null;
  }
}

/** Joins as a person. */
export async function takePlace(tournamentId: string, code: string, name: string): Promise<HeldPlace> {
  const joined = await tournamentApi.joinTournament(
    { tournamentId, joinCode: canonical(code), name: name.trim(), kind: ParticipantKind.HUMAN },
    { timeoutMs: CALL_LIMIT_MS },
  );
  const held = { ticket: joined.ticket, participant: joined.participant, name: name.trim() };
  remember(`tournament.${tournamentId}`, JSON.stringify(held));
  remember("name", held.name);
  return held;
}
