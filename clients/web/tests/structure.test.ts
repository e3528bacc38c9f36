// The structure of a tournament's games: rounds and tables, a bracket, and games from two sources.

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import {
  type TournamentGame,
  TournamentGameSchema,
  TournamentGameState,
  TournamentSchema,
  TournamentState,
} from "../src/gen/chefshat/v1/tournament_pb";
import { bracket, gradeOf, mergedGames, playedRounds } from "../src/tournaments/structure";

interface Described {
  game: number;
  round: number;
  table: number;
  /** Participants, best first. */
  order: number[];
  counted?: boolean;
}

const SCORES = [5, 3, 1, 0];

function game({ game, round, table, order, counted = true }: Described): TournamentGame {
  return create(TournamentGameSchema, {
    game,
    round,
    table,
    number: 1,
    state: counted ? TournamentGameState.COUNTED : TournamentGameState.PLAYING,
    seats: [...order]
      .sort((one, other) => one - other)
      .map((participant) => ({
        participant,
        place: order.indexOf(participant) + 1,
        score: counted ? (SCORES[order.indexOf(participant)] ?? 0) : 0,
      })),
  });
}

/** A knockout of eight: the first round is over, the final is running. */
const first = [
  game({ game: 0, round: 1, table: 1, order: [3, 1, 0, 2] }),
  game({ game: 1, round: 1, table: 2, order: [4, 7, 6, 5] }),
];
const running = game({ game: 2, round: 2, table: 1, order: [1, 3, 4, 7], counted: false });
const final = game({ game: 2, round: 2, table: 1, order: [7, 3, 1, 4] });

function knockout(games: TournamentGame[], state = TournamentState.PLAYING) {
  const participants = Array.from({ length: 8 }, (_, participant) => ({ participant, name: `P${participant}` }));
  return bracket(create(TournamentSchema, { participants, state, rounds: 2 }), games).map(({ tables }) =>
    tables.map(({ seats }) => seats.map(({ participant, wentOn }) => `${participant}${wentOn ? "+" : ""}`).join(" ")),
  );
}

test.each([
  ["nothing drawn", [], TournamentState.OPEN, []],
  ["the first round", first, TournamentState.PLAYING, [["3 1 0 2", "4 7 6 5"], [""]]],
  [
    "the final is still played",
    [...first, running],
    TournamentState.PLAYING,
    [["3+ 1+ 0 2", "4+ 7+ 6 5"], ["1 3 4 7"]],
  ],
  ["over", [...first, final], TournamentState.FINISHED, [["3+ 1+ 0 2", "4+ 7+ 6 5"], ["7+ 3 1 4"]]],
])("a bracket: %s", (_, games, state, expected) => {
  expect(knockout(games, state)).toEqual(expected);
});

test("a table of a later round names the tables that lead to it", () => {
  const participants = Array.from({ length: 16 }, (_, participant) => ({ participant }));
  const tournament = create(TournamentSchema, { participants, rounds: 3, state: TournamentState.PLAYING });
  const rounds = bracket(tournament, [game({ game: 0, round: 1, table: 1, order: [0, 1, 2, 3] })]);
  expect(rounds.map(({ tables }) => tables.map(({ from }) => from))).toEqual([
    [[], [], [], []],
    [
      [1, 2],
      [3, 4],
    ],
    [[1, 2]],
  ]);
});

test("games are grouped by round and table, in order", () => {
  const second = game({ game: 3, round: 1, table: 1, order: [0, 1, 2, 3] });
  const rounds = playedRounds([final, second, ...first]);
  expect(rounds.map(({ round, tables }) => [round, tables.map((table) => table.games.map((one) => one.game))])).toEqual(
    [
      [1, [[0, 3], [1]]],
      [2, [[2]]],
    ],
  );
});

test("games from the stream replace listed ones, but never a result", () => {
  const states = (games: TournamentGame[]) => games.map(({ state }) => state);
  expect(states(mergedGames([running], [final]))).toEqual([TournamentGameState.COUNTED]);
  expect(states(mergedGames([final], [running]))).toEqual([TournamentGameState.COUNTED]);
  expect(mergedGames(first, [running]).map((one) => one.game)).toEqual([0, 1, 2]);
});

test.each([
  [1, "certain"],
  [0.95, "certain"],
  [0.9, "likely"],
  [0.7, "leaning"],
  [0.5, "open"],
  [0.1, "against"],
] as const)("a confidence of %d is %s", (confidence, grade) => {
  expect(gradeOf(confidence)).toBe(grade);
});
