// What the page of a tournament knows: its state and standings as they change (a stream), and besides all its games and how sure the order
// is, which are asked for when the stream says that something has changed.

import { type Signal, signal } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { CALL_LIMIT_MS, tournamentApi } from "../api/client";
import { type Following, follow } from "../api/follow";
import { usePolled } from "../api/poll";
import type { OrderConfidence, Tournament, TournamentGame, TournamentStanding } from "../gen/chefshat/v1/tournament_pb";
import { isEnded, mergedGames } from "./course";

/** What the stream says. */
export interface Heard {
  readonly tournament: Tournament;
  readonly standings: readonly TournamentStanding[];
  /** Games of the round, or of a round robin those that are being played. */
  readonly games: readonly TournamentGame[];
}

/** A tournament that is followed. */
export interface FollowedTournament {
  readonly heard: Signal<Heard | undefined>;
  readonly following: Following;
}

/** Follows a tournament for as long as the page shows it. */
export function useTournament(tournamentId: string): FollowedTournament | undefined {
  const [followed, setFollowed] = useState<FollowedTournament | undefined>(undefined);
  useEffect(() => {
    const heard = signal<Heard | undefined>(undefined);
    const following = follow(
      (abort) => tournamentApi.followTournament({ tournamentId }, { signal: abort }),
      ({ tournament, standings, games }) => {
        if (!tournament) return true;
        heard.value = { tournament, standings, games };
        return !isEnded(tournament);
      },
    );
    setFollowed({ heard, following });
    return () => following.stop();
  }, [tournamentId]);
  return followed;
}

const PAGE_SIZE = 500;
/** Most pages of games that are asked for. */
const MAX_PAGES = 6;
/** How often games and confidence are asked for while a tournament goes on, milliseconds. */
const EVERY_MS = 4_000;
/** And when it is over: what does not change needs no asking. */
const SELDOM_MS = 3_600_000;

/** Most games that a page shows. */
export const MAX_GAMES = PAGE_SIZE * MAX_PAGES;

/** All games of a tournament, with what the stream has said of them since. */
export function useGames({ tournament, games }: Heard): TournamentGame[] {
  const { tournamentId, round, state } = tournament;
  const everyMs = isEnded(tournament) ? SELDOM_MS : EVERY_MS;
  const listed = usePolled((abort) => listGames(tournamentId, abort), everyMs, `${tournamentId} ${round} ${state}`);
  return mergedGames(listed.value ?? [], games);
}

/** For each two who follow one another in the standings, how sure their order is. */
export function useConfidence({ tournament }: Heard): readonly OrderConfidence[] {
  const { tournamentId, state, gamesOver } = tournament;
  const ask = async (abort: AbortSignal) => {
    if (gamesOver === 0) return [];
    const call = { signal: abort, timeoutMs: CALL_LIMIT_MS };
    return (await tournamentApi.getTournamentResults({ tournamentId }, call)).confidence;
  };
  const everyMs = isEnded(tournament) ? SELDOM_MS : EVERY_MS;
  return usePolled(ask, everyMs, `${tournamentId} ${state} ${gamesOver > 0}`).value ?? [];
}

async function listGames(tournamentId: string, abort: AbortSignal): Promise<TournamentGame[]> {
  const found: TournamentGame[] = [];
  let pageToken = "";
  for (let page = 0; page < MAX_PAGES; page += 1) {
    const request = { tournamentId, pageSize: PAGE_SIZE, pageToken };
    const answer = await tournamentApi.listTournamentGames(request, { signal: abort, timeoutMs: CALL_LIMIT_MS });
    found.push(...answer.games);
    pageToken = answer.nextPageToken;
    if (pageToken === "") break;
  }
  return found;
}
