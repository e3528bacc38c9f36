// The data of a tournament's page: its state and standings from a stream, and its games and
// confidence, which are requested when the stream reports a change.

import { type Signal, signal } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import { tournamentApi } from "../api/client";
import { type Following, follow } from "../api/follow";
import { allPages } from "../api/pages";
import { usePolled } from "../api/poll";
import type { OrderConfidence, Tournament, TournamentGame, TournamentStanding } from "../gen/chefshat/v1/tournament_pb";
import { useStarted } from "../parts/started";
import { isEnded, mergedGames } from "./structure";

/** The data of the stream. */
export interface LiveTournament {
  readonly tournament: Tournament;
  readonly standings: readonly TournamentStanding[];
  /** Games of the round; of a round robin, the running ones. */
  readonly games: readonly TournamentGame[];
}

/** A followed tournament. */
export interface FollowedTournament {
  readonly live: Signal<LiveTournament | undefined>;
  readonly following: Following;
  stop(): void;
}

/** Follows a tournament while its page is shown. */
export function useTournament(tournamentId: string): FollowedTournament | undefined {
  const start = () => {
    const live = signal<LiveTournament | undefined>(undefined);
    const following = follow(
      (abort) => tournamentApi.followTournament({ tournamentId }, { signal: abort }),
      ({ tournament, standings, games }) => {
        if (!tournament) return true;
        live.value = { tournament, standings, games };
        return !isEnded(tournament);
      },
      { restsWhileHidden: true },
    );
    return { live, following, stop: following.stop };
  };
  return useStarted(start, tournamentId);
}

const PAGE_SIZE = 500;
/** Most pages of games requested. */
const MAX_PAGES = 6;
/**
 * Shortest interval between requests of games and confidence, milliseconds: in a large tournament
 * something changes all the time.
 */
const SOONEST_MS = 4_000;
/** Interval of these requests without changes, milliseconds. */
const QUIET_MS = 60_000;
/** And when the tournament is over, since nothing changes any more. */
const ENDED_MS = 3_600_000;

/** Most games shown. */
export const MAX_GAMES = PAGE_SIZE * MAX_PAGES;

/** All games of a tournament, updated with those from the stream. */
export function useGames({ tournament, games }: LiveTournament): TournamentGame[] {
  const listed = usePolled(() => listGames(tournament), quietMs(tournament), useChanges(tournament));
  return mergedGames(listed.value ?? [], games);
}

/** How certain the order of each pair of neighbours in the standings is. */
export function useConfidence({ tournament }: LiveTournament): readonly OrderConfidence[] {
  const { tournamentId, gamesOver } = tournament;
  const ask = async (abort: AbortSignal) => {
    if (gamesOver === 0) return [];
    return (await tournamentApi.getTournamentResults({ tournamentId }, { signal: abort })).confidence;
  };
  return usePolled(ask, quietMs(tournament), useChanges(tournament)).value ?? [];
}

function quietMs(tournament: Tournament): number {
  return isEnded(tournament) ? ENDED_MS : QUIET_MS;
}

/**
 * A key that changes when something in the server's lists has changed, but at most once per
 * `SOONEST_MS`.
 */
function useChanges({ tournamentId, state, round, gamesOver, gamesPlaying }: Tournament): string {
  const now = `${tournamentId} ${state} ${round} ${gamesOver} ${gamesPlaying}`;
  const [throttled, setThrottled] = useState(now);
  const changedAtMs = useRef(performance.now());
  useEffect(() => {
    if (now === throttled) return;
    const change = () => {
      changedAtMs.current = performance.now();
      setThrottled(now);
    };
    const timer = setTimeout(change, changedAtMs.current + SOONEST_MS - performance.now());
    return () => clearTimeout(timer);
  }, [now, throttled]);
  return throttled;
}

/** Requests within this time count as one, milliseconds: several parts of a page want the same games at once. */
const AT_ONCE_MS = 1_000;
/** The last request for each state of a tournament. */
const requested = new WeakMap<Tournament, { readonly atMs: number; readonly games: Promise<TournamentGame[]> }>();

function listGames(tournament: Tournament): Promise<TournamentGame[]> {
  const nowMs = performance.now();
  const last = requested.get(tournament);
  if (last && nowMs - last.atMs < AT_ONCE_MS) return last.games;
  const { tournamentId } = tournament;
  const games = allPages(async (pageToken) => {
    const answer = await tournamentApi.listTournamentGames({ tournamentId, pageSize: PAGE_SIZE, pageToken });
    return { items: answer.games, nextPageToken: answer.nextPageToken };
  }, MAX_PAGES);
  requested.set(tournament, { atMs: nowMs, games });
  return games;
}
