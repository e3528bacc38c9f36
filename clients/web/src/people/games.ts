// The games of one participant, from the server's records: found by name, newest first, with what they add up to.

import { CALL_LIMIT_MS, recordApi, tournamentApi } from "../api/client";
import { allPages } from "../api/pages";
import type { RecordSummary } from "../gen/chefshat/v1/record_service_pb";
import { type Participant, RoomState } from "../gen/chefshat/v1/room_pb";
import type { Rated } from "../gen/chefshat/v1/tournament_pb";

const PAGE_SIZE = 100;
/** Pages of records that are asked for at most. They come oldest first, so that all are needed to know the newest. */
const MAX_PAGES = 50;
/** Lines of the leaderboard that are searched. */
const MAX_LINES = 1000;
/** Games shown. */
export const SHOWN_GAMES = 100;

/** What a participant did in a game. */
export interface OwnGame {
  readonly record: RecordSummary;
  readonly seat: number;
  /** From 1; undefined if the game has no result. */
  readonly place: number | undefined;
  readonly points: number | undefined;
  readonly others: readonly Participant[];
}

/** What all games of a participant add up to; of those with a result. */
export interface Sum {
  readonly games: number;
  readonly wins: number;
  readonly meanPlace: number;
}

/** Everything the page of a participant shows. */
export interface Person {
  /** Of the leaderboard: more than one where kinds differ. */
  readonly rated: readonly Rated[];
  /** Newest first. */
  readonly games: readonly OwnGame[];
}

/** Asks for a participant. */
export async function askPerson(name: string, signal: AbortSignal): Promise<Person> {
  const call = { signal, timeoutMs: CALL_LIMIT_MS };
  const board = tournamentApi.getLeaderboard({ limit: MAX_LINES }, call);
  const records = await allPages(async (pageToken) => {
    const answer = await recordApi.listRecords({ filter: { participant: name }, pageSize: PAGE_SIZE, pageToken }, call);
    return { items: answer.records, nextPageToken: answer.nextPageToken };
  }, MAX_PAGES);
  const games = records.flatMap((record) => ownGame(record, name) ?? []);
  const rated = (await board).rated.filter((line) => line.name === name);
  return { rated, games: games.reverse() };
}

/** What the participant of a name did in a game: at its first seat if it has several. */
export function ownGame(record: RecordSummary, name: string): OwnGame | undefined {
  const own =
    record.seats.find((seat) => seat.name === name) ?? record.seats.find((seat) => seat.builtInAgent === name);
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

/** What games add up to. */
export function sum(games: readonly OwnGame[]): Sum {
  const places = games.flatMap(({ place }) => place ?? []);
  const total = places.reduce((all, place) => all + place, 0);
  return {
    games: places.length,
    wins: places.filter((place) => place === 1).length,
    meanPlace: places.length === 0 ? 0 : total / places.length,
  };
}
