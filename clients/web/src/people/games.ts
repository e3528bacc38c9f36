// A participant's games from the server's records: found by name, newest first, with totals.

import { recordApi, tournamentApi } from "../api/client";
import { type AskPage, LARGEST_PAGE } from "../api/pages";
import type { RecordSummary } from "../gen/chefshat/v1/record_service_pb";
import {
  AbortReason,
  GameOrigin,
  type Participant,
  ParticipantKind,
  RoomState,
  Visibility,
} from "../gen/chefshat/v1/room_pb";
import type { Rated } from "../gen/chefshat/v1/tournament_pb";

/** Most lines of the leaderboard in a response. */
export const MAX_LINES = 1000;

/** A participant's result in a game. */
export interface OwnGame {
  readonly record: RecordSummary;
  readonly seat: number;
  /** From 1; undefined if the game has no result. */
  readonly place: number | undefined;
  readonly points: number | undefined;
  readonly others: readonly Participant[];
}

/** A participant's ratings. */
export interface Ratings {
  /** One per kind and key of the name. */
  readonly lines: readonly Rated[];
  /** Whether the leaderboard was searched to its end. */
  readonly complete: boolean;
}

/** The totals of a participant's games with a result. */
export interface Sum {
  readonly games: number;
  readonly wins: number;
  readonly meanPlace: number;
}

/**
 * Requests a participant's games, newest first; with a fingerprint those under the name with this
 * key only.
 */
export function gamesOf(name: string, fingerprint: string): AskPage<OwnGame> {
  return async (page, signal) => {
    const asked = { filter: { participant: name }, newestFirst: true, ...page };
    // Most games may be of others with this name.
    if (fingerprint !== "") asked.pageSize = LARGEST_PAGE;
    const { records, nextPageToken } = await recordApi.listRecords(asked, { signal });
    return { items: records.flatMap((record) => ownGame(record, name, fingerprint) ?? []), nextPageToken };
  };
}

/** Requests a participant's lines of the leaderboard; with a fingerprint one line. */
export async function ratedAs(name: string, fingerprint: string, signal: AbortSignal): Promise<Ratings> {
  const { rated } = await tournamentApi.getLeaderboard({ limit: MAX_LINES }, { signal });
  const own = (line: Rated) => line.name === name && [line.nameFingerprint, ""].includes(fingerprint);
  return { lines: rated.filter(own), complete: rated.length < MAX_LINES };
}

/** The result of a participant in a game; at its first seat if it has several. */
export function ownGame(record: RecordSummary, name: string, fingerprint = ""): OwnGame | undefined {
  const isOwn = (seat: Participant) =>
    seat.name === name && seat.builtInAgent === "" && [seat.nameFingerprint, ""].includes(fingerprint);
  const own = record.seats.find(isOwn) ?? record.seats.find((seat) => seat.builtInAgent === name && fingerprint === "");
  if (!own) return undefined;
  const standing =
    record.state === RoomState.FINISHED ? record.standings.find(({ seat }) => seat === own.seat) : undefined;
  return {
    record,
    seat: own.seat,
    place: standing?.place,
    points: standing && Number(standing.points),
    others: record.seats.filter(({ seat }) => seat !== own.seat),
  };
}

/** Why a game with a result is not rated. */
export type Unrated = "added" | "hidden" | "hinted" | "notDealt" | "recorded" | "substituted" | "twice" | "wizard";

/** How games end early that are rated as lost by those who left or closed them. */
const BROKEN_OFF = [AbortReason.CLOSED, AbortReason.PARTICIPANTS_LOST];

/** Why a game is not rated, as in server/record/src/rated.rs and docs/ratings.md; null if it is, or was aborted. */
export function unratedBecause(record: RecordSummary): Unrated | null {
  if (record.state !== RoomState.FINISHED) return null;
  const fixed = unratedFromStart(record);
  if (fixed) return fixed;
  // Who was substituted or given a hint has lost the game; records of earlier versions do not say who.
  const lost = record.seats.filter(({ substituted }) => substituted).length;
  if (record.substituted && (lost === 0 || lost === record.seats.length)) return "substituted";
  return record.hinted && lost === 0 ? "hinted" : null;
}

/** Whether a game is rated as lost by a seat to all others, whatever its place. */
export function isForfeited(record: RecordSummary, seat: number): boolean {
  const { seats, state, abortReason } = record;
  if (!seats.some((one) => one.seat === seat && one.substituted) || unratedFromStart(record)) return false;
  // If all were lost, the network or the server was.
  if (seats.every(({ substituted }) => substituted) && abortReason !== AbortReason.CLOSED) return false;
  return state === RoomState.FINISHED || (state === RoomState.ABORTED && BROKEN_OFF.includes(abortReason));
}

/** Why a game is not rated, by what was fixed before it began. */
function unratedFromStart(record: RecordSummary): Unrated | null {
  if (record.added) return "added";
  // In responses, public is unspecified.
  if (record.visibility !== Visibility.UNSPECIFIED) return "hidden";
  if (record.origin !== GameOrigin.DEALT) return "notDealt";
  if (record.seats.some(({ replay }) => replay !== undefined)) return "recorded";
  if (record.seats.some(({ shownKind }) => shownKind !== ParticipantKind.UNSPECIFIED)) return "wizard";
  const participants = record.seats.map(({ kind, name, builtInAgent, nameFingerprint }) => {
    return builtInAgent ? `built-in ${builtInAgent}` : `${kind} ${name} ${nameFingerprint}`;
  });
  return new Set(participants).size < participants.length ? "twice" : null;
}

/** The totals of games. */
export function sum(games: readonly OwnGame[]): Sum {
  const places = games.flatMap(({ place }) => place ?? []);
  const total = places.reduce((all, place) => all + place, 0);
  return {
    games: places.length,
    wins: places.filter((place) => place === 1).length,
    meanPlace: places.length === 0 ? 0 : total / places.length,
  };
}
