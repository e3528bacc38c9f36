// The tournaments of the server, newest first.

import { CALL_LIMIT_MS, tournamentApi } from "../api/client";
import type { AskPage } from "../api/pages";
import type { Tournament, TournamentState } from "../gen/chefshat/v1/tournament_pb";

/** Requests the tournaments in a state. */
export function tournamentsIn(state: TournamentState): AskPage<Tournament> {
  return async (page, signal) => {
    const call = { signal, timeoutMs: CALL_LIMIT_MS };
    const { tournaments, nextPageToken } = await tournamentApi.listTournaments({ state, ...page }, call);
    return { items: tournaments, nextPageToken };
  };
}
