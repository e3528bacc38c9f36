// The tournaments of the server, newest first.

import { CALL_LIMIT_MS, tournamentApi } from "../api/client";
import { allPages } from "../api/pages";
import type { Tournament } from "../gen/chefshat/v1/tournament_pb";

const PAGE_SIZE = 100;
/** Pages that are asked for at most. The newest come last, so that all are needed to know them. */
const MAX_PAGES = 100;

/** Asks for the tournaments of the server. */
export async function listTournaments(signal: AbortSignal): Promise<Tournament[]> {
  const call = { signal, timeoutMs: CALL_LIMIT_MS };
  const found = await allPages(async (pageToken) => {
    const answer = await tournamentApi.listTournaments({ pageSize: PAGE_SIZE, pageToken }, call);
    return { items: answer.tournaments, nextPageToken: answer.nextPageToken };
  }, MAX_PAGES);
  return found.reverse();
}
