// The tournaments of the server, newest first.

import { tournamentApi } from "../api/client";
import type { AskPage } from "../api/pages";
import type { Tournament, TournamentState } from "../gen/chefshat/v1/tournament_pb";

/** Requests the tournaments in a state. */
export function tournamentsIn(state: TournamentState): AskPage<Tournament> {
  return async (page, signal) => {
    const { tournaments, nextPageToken } = await tournamentApi.listTournaments({ state, ...page }, { signal });
    return { items: tournaments, nextPageToken };
  };
}
