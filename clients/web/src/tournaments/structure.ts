// The structure of a tournament's games: by round and table, and in a knockout which tables lead to
// which. Pure functions of the server's data; drawn by Bracket.tsx and Rounds.tsx.

import {
  type Tournament,
  type TournamentGame,
  type TournamentGameSeat,
  TournamentGameState,
  type TournamentParticipant,
  type TournamentStanding,
  TournamentState,
} from "../gen/chefshat/v1/tournament_pb";

/** Participants of a knockout's table that advance. */
const ADVANCING = 2;

/** The games of a table in a round: the same participants, with rotated seats. */
export interface PlayedTable {
  readonly table: number;
  readonly games: readonly TournamentGame[];
}

/** The tables of a round. */
export interface PlayedRound {
  readonly round: number;
  readonly tables: readonly PlayedTable[];
}

/** A participant at a table of a knockout. */
export interface BracketSeat {
  readonly participant: number;
  /** Score of the table's games that count. */
  readonly score: number;
  /** Points of those games, which break ties. */
  readonly points: number;
  /** Whether a later round, or the end of the tournament, shows that it advanced. */
  readonly wentOn: boolean;
}

/** A table of a knockout's bracket. */
export interface BracketTable {
  readonly table: number;
  /** The two tables of the previous round that lead here; empty in the first round. */
  readonly from: readonly number[];
  /** Best first once there are results; empty before the draw. */
  readonly seats: readonly BracketSeat[];
  readonly games: readonly TournamentGame[];
}

/** A round of a knockout. */
export interface BracketRound {
  readonly round: number;
  readonly tables: readonly BracketTable[];
}

/** Games by round and table, in order. */
export function playedRounds(games: readonly TournamentGame[]): PlayedRound[] {
  const rounds = new Map<number, Map<number, TournamentGame[]>>();
  for (const game of [...games].sort((one, other) => one.game - other.game)) {
    const tables = rounds.get(game.round) ?? new Map<number, TournamentGame[]>();
    rounds.set(game.round, tables);
    tables.set(game.table, [...(tables.get(game.table) ?? []), game]);
  }
  return [...rounds]
    .sort(([one], [other]) => one - other)
    .map(([round, tables]) => ({
      round,
      tables: [...tables].sort(([one], [other]) => one - other).map(([table, ofTable]) => ({ table, games: ofTable })),
    }));
}

/** All rounds of a knockout, including those not drawn yet. Empty before the first draw. */
export function bracket(tournament: Tournament, games: readonly TournamentGame[]): BracketRound[] {
  const played = playedRounds(games);
  const first = played[0];
  if (!first) return [];
  // The last round has one table.
  const count = 2 ** Math.max(0, tournament.rounds - 1);
  const rounds = Array.from({ length: Math.log2(count) + 1 }, (_, index) => index + 1);
  return rounds.map((round) => ({
    round,
    tables: Array.from({ length: count / 2 ** (round - 1) }, (_, index) => {
      const table = index + 1;
      const ofTable = played.find((one) => one.round === round)?.tables.find((one) => one.table === table)?.games ?? [];
      const next = played.find((one) => one.round === round + 1)?.tables.flatMap((one) => one.games) ?? [];
      const isFinal = round === rounds.length;
      const over = tournament.state === TournamentState.FINISHED;
      return {
        table,
        from: round === 1 ? [] : [2 * table - 1, 2 * table],
        seats: ranked(ofTable, (participant, rank) =>
          isFinal ? over && rank === 0 : next.some((game) => seatOf(game, participant) !== undefined),
        ),
        games: ofTable,
      };
    }),
  }));
}

/** The participants of a table's games, best first. */
function ranked(
  games: readonly TournamentGame[],
  wentOn: (participant: number, rank: number) => boolean,
): BracketSeat[] {
  const seats = games[0]?.seats.map(({ participant }) => {
    const counted = games
      .filter(({ state }) => state === TournamentGameState.COUNTED)
      .flatMap((game) => seatOf(game, participant) ?? []);
    return {
      participant,
      score: counted.reduce((sum, seat) => sum + seat.score, 0),
      points: counted.reduce((sum, seat) => sum + Number(seat.points), 0),
    };
  });
  const sorted = (seats ?? []).sort((one, other) => other.score - one.score || other.points - one.points);
  // Those who advanced come first: the server breaks ties that scores leave open.
  const marked = sorted.map((seat, rank) => ({ ...seat, wentOn: wentOn(seat.participant, rank) }));
  return marked.every(({ wentOn: went }) => !went) || marked.filter(({ wentOn: went }) => went).length > ADVANCING
    ? marked
    : marked.sort((one, other) => Number(other.wentOn) - Number(one.wentOn));
}

/** A participant's result in a game, if it has a seat there. */
export function seatOf(game: TournamentGame, participant: number) {
  return game.seats.find((seat) => seat.participant === participant);
}

/** Games from a list, updated with those from the stream. */
export function mergedGames(listed: readonly TournamentGame[], streamed: readonly TournamentGame[]): TournamentGame[] {
  const byNumber = new Map(listed.map((game) => [game.game, game]));
  for (const game of streamed) {
    const before = byNumber.get(game.game);
    // A void game may be called again.
    if (before?.state !== TournamentGameState.COUNTED) byNumber.set(game.game, game);
  }
  return [...byNumber.values()].sort((one, other) => one.game - other.game);
}

/** Whether the game has ended. */
export function isOver(game: TournamentGame): boolean {
  return game.state === TournamentGameState.COUNTED || game.state === TournamentGameState.VOID;
}

/** Whether the tournament has ended. */
export function isEnded(tournament: Tournament): boolean {
  return tournament.state === TournamentState.FINISHED || tournament.state === TournamentState.CLOSED;
}

/** The running game of a participant, if any. */
export function gameOf(games: readonly TournamentGame[], gameId: string): TournamentGame | undefined {
  return games.find((game) => game.gameId === gameId);
}

/** The participants, without those who left before the start. */
export function joinedIn({ state, participants }: Tournament): TournamentParticipant[] {
  return participants.filter(({ withdrawn }) => !withdrawn || state !== TournamentState.OPEN);
}

/** A participant by number. */
export function participantOf(tournament: Tournament, number: number): TournamentParticipant | undefined {
  return tournament.participants[number];
}

/** The name under which a seat's participant was called to the game. */
export function nameIn(tournament: Tournament, { participant, formerName }: TournamentGameSeat): string {
  return formerName || nameOf(tournament, participant);
}

/** A participant's display name: its own, else that of the built-in agent. */
export function nameOf(tournament: Tournament, number: number): string {
  const participant = participantOf(tournament, number);
  return participant?.name || participant?.builtInAgent || `#${number}`;
}

/** The mean score per game, which decides the order; 0 before the first game. */
export function meanScore(standing: TournamentStanding): number {
  return standing.games === 0 ? 0 : Number(standing.score) / standing.games;
}

/** How certain an order is, as a grade. */
export type Grade = "certain" | "likely" | "leaning" | "open" | "against";

/** The grade of a confidence in 0..=1. */
export function gradeOf(confidence: number): Grade {
  if (confidence >= 0.95) return "certain";
  if (confidence >= 0.8) return "likely";
  if (confidence >= 0.6) return "leaning";
  return confidence >= 0.4 ? "open" : "against";
}
