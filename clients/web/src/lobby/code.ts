// Resolves a join code before the person enters a name. Taking a seat is in seat.ts.

import { CALL_LIMIT_MS, roomApi, tournamentApi } from "../api/client";
import { type Fault, faultOf, needsToken } from "../api/faults";
import type { Room } from "../gen/chefshat/v1/room_pb";
import { canonical } from "./seat";

/** What a code belongs to. */
export type Found =
  | { readonly kind: "room"; readonly room: Room }
  | { readonly kind: "tournament"; readonly tournamentId: string }
  | { readonly kind: "nothing" }
  | { readonly kind: "refused"; readonly fault: Fault }
  | { readonly kind: "unknown" };

/** Resolves a code. */
export async function lookUp(code: string, signal?: AbortSignal): Promise<Found> {
  const call = { ...(signal && { signal }), timeoutMs: CALL_LIMIT_MS };
  const asked = { joinCode: canonical(code) };
  try {
    const { room } = await roomApi.getRoom(asked, call);
    return room ? { kind: "room", room } : { kind: "unknown" };
  } catch (thrown) {
    if (!isWrong(thrown)) return notFound(thrown);
  }
  try {
    const { tournament } = await tournamentApi.getTournament(asked, call);
    return tournament ? { kind: "tournament", tournamentId: tournament.tournamentId } : { kind: "unknown" };
  } catch (thrown) {
    return isWrong(thrown) ? { kind: "nothing" } : notFound(thrown);
  }
}

function notFound(thrown: unknown): Found {
  const fault = faultOf(thrown);
  return needsToken(fault) ? { kind: "refused", fault } : { kind: "unknown" };
}

function isWrong(thrown: unknown): boolean {
  return faultOf(thrown).reason === "JOIN_CODE_WRONG";
}
