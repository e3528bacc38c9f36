// What the page of a tournament knows: its state and standings as they change (a stream), and besides all its games and how sure the order
// is, which are asked for when the stream says that something has changed.

import { type Signal, signal } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import { CALL_LIMIT_MS, tournamentApi } from "../api/client";
import { type Following, follow } from "../api/follow";
import { allPages } from "../api/pages";
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
/** Games and confidence are not asked for again sooner than this, milliseconds: in a large tournament something changes all the time. */
const SOONEST_MS = 4_000;
/** How often they are asked for although the stream says nothing new, milliseconds. */
const SELDOM_MS = 60_000;
/** And when the tournament is over: what does not change needs no asking. */
const HARDLY_MS = 3_600_000;

/** Most games that a page shows. */
export const MAX_GAMES = PAGE_SIZE * MAX_PAGES;

/** All games of a tournament, with what the stream has said of them since. */
export function useGames({ tournament, games }: Heard): TournamentGame[] {
  const { tournamentId } = tournament;
  const listed = usePolled((abort) => listGames(tournamentId, abort), quietMs(tournament), useChanges(tournament));
  return mergedGames(listed.value ?? [], games);
}

/** For each two who follow one another in the standings, how sure their order is. */
export function useConfidence({ tournament }: Heard): readonly OrderConfidence[] {
  const { tournamentId, gamesOver } = tournament;
  const ask = async (abort: AbortSignal) => {
    if (gamesOver === 0) return [];
    const call = { signal: abort, timeoutMs: CALL_LIMIT_MS };
    return (await tournamentApi.getTournamentResults({ tournamentId }, call)).confidence;
  };
  return usePolled(ask, quietMs(tournament), useChanges(tournament)).value ?? [];
}

function quietMs(tournament: Tournament): number {
  return isEnded(tournament) ? HARDLY_MS : SELDOM_MS;
}

/** Another text whenever something has changed that only the server's lists tell, but not sooner than `SOONEST_MS` after the one before. */
function useChanges({ tournamentId, state, round, gamesOver }: Tournament): string {
  const now = `${tournamentId} ${state} ${round} ${gamesOver}`;
  const [told, setTold] = useState(now);
  const toldAtMs = useRef(performance.now());
  useEffect(() => {
    if (now === told) return;
    const tell = () => {
      toldAtMs.current = performance.now();
      setTold(now);
    };
    const timer = setTimeout(tell, toldAtMs.current + SOONEST_MS - performance.now());
    return () => clearTimeout(timer);
  }, [now, told]);
  return told;
}

function listGames(tournamentId: string, abort: AbortSignal): Promise<TournamentGame[]> {
  const call = { signal: abort, timeoutMs: CALL_LIMIT_MS };
  return allPages(async (pageToken) => {
    const answer = await tournamentApi.listTournamentGames({ tournamentId, pageSize: PAGE_SIZE, pageToken }, call);
    return { items: answer.games, nextPageToken: answer.nextPageToken };
  }, MAX_PAGES);
}
