// Resolves a join code before the person enters a name. Taking a seat is in seat.ts.

import { roomApi, tournamentApi } from "../api/client";
import { faultOf } from "../api/faults";
import type { Room } from "../gen/chefshat/v1/room_pb";
import { canonical, requiredRoom } from "./seat";

/** What a code belongs to. */
export type Found =
  | { readonly kind: "room"; readonly room: Room }
  | { readonly kind: "tournament"; readonly tournamentId: string };

/** Resolves a code. Throws JOIN_CODE_WRONG if it belongs to nothing. */
export async function lookUp(code: string, signal?: AbortSignal): Promise<Found> {
  const call = signal && { signal };
  const asked = { joinCode: canonical(code) };
  try {
    return { kind: "room", room: requiredRoom((await roomApi.getRoom(asked, call)).room) };
  } catch (thrown) {
    if (faultOf(thrown).reason !== "JOIN_CODE_WRONG") throw thrown;
  }
  const { tournament } = await tournamentApi.getTournament(asked, call);
  if (!tournament) throw new Error("the server did not say which tournament it is");
  return { kind: "tournament", tournamentId: tournament.tournamentId };
}
