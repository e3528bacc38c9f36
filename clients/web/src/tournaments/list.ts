// The tournaments of the server, newest first: asked for page by page.

import { CALL_LIMIT_MS, tournamentApi } from "../api/client";
import type { Tournament } from "../gen/chefshat/v1/tournament_pb";

const PAGE_SIZE = 100;
/** Pages that are asked for at most. */
const MAX_PAGES = 10;

/** Asks for the tournaments of the server. */
export async function listTournaments(signal: AbortSignal): Promise<Tournament[]> {
  const found: Tournament[] = [];
  let pageToken = "";
  for (let page = 0; page < MAX_PAGES; page += 1) {
    const request = { pageSize: PAGE_SIZE, pageToken };
    const answer = await tournamentApi.listTournaments(request, { signal, timeoutMs: CALL_LIMIT_MS });
    found.push(...answer.tournaments);
    pageToken = answer.nextPageToken;
    if (pageToken === "") break;
  }
  return found.reverse();
}
