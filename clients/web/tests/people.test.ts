// A participant's games and their totals.

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { RecordSummarySchema } from "../src/gen/chefshat/v1/record_service_pb";
import {
  AbortReason,
  GameOrigin,
  type Participant,
  ParticipantKind,
  RecordedPlayerSchema,
  RoomState,
  Visibility,
} from "../src/gen/chefshat/v1/room_pb";
import { setLanguage } from "../src/i18n";
import { isForfeited, ownGame, sum, unratedBecause } from "../src/people/games";
import { ratingRange, ratingWords } from "../src/people/rating";

/** A game of Rosa, two built-in agents called greedy, and someone who took the agent's name. */
function record(state: RoomState, places: number[]) {
  return create(RecordSummarySchema, {
    state,
    seats: [
      { seat: 0, builtInAgent: "greedy", name: "greedy" },
      { seat: 1, name: "Rosa", kind: ParticipantKind.HUMAN },
      { seat: 2, builtInAgent: "greedy", name: "greedy" },
      { seat: 3, name: "Ben", kind: ParticipantKind.HUMAN },
    ],
    standings: places.map((place, seat) => ({ seat, place, points: BigInt(20 - place) })),
  });
}

const won = record(RoomState.FINISHED, [2, 1, 3, 4]);
const lost = record(RoomState.FINISHED, [1, 4, 2, 3]);
const aborted = record(RoomState.ABORTED, []);

test("a game is seen from the participant's seat", () => {
  const game = ownGame(won, "Rosa");
  expect([game?.seat, game?.place, game?.points]).toEqual([1, 1, 19]);
  expect(game?.others.map(({ seat }) => seat)).toEqual([0, 2, 3]);
  expect(ownGame(won, "greedy")?.seat).toBe(0);
  expect(ownGame(won, "Nobody")).toBeUndefined();
  expect(ownGame(aborted, "Rosa")?.place).toBeUndefined();
});

test("games without a result do not count", () => {
  const games = [won, lost, aborted].flatMap((one) => ownGame(one, "Rosa") ?? []);
  expect(games.length).toBe(3);
  expect(sum(games)).toEqual({ games: 2, wins: 1, meanPlace: 2.5 });
  expect(sum([])).toEqual({ games: 0, wins: 0, meanPlace: 0 });
});

test("a rating has its uncertainty, in the number format of the language", async () => {
  const rating = { mean: 30, deviation: 2.5, games: 7 } as Parameters<typeof ratingWords>[0];
  expect(ratingWords(rating)).toBe("30.0 ± 4.9");
  await setLanguage("it");
  expect(ratingWords(rating)).toBe("30,0 ± 4,9");
  await setLanguage("en");
  expect(ratingRange(rating)).toEqual({ from: 25.1, to: 34.9 });
});

test("an unrated game says why", () => {
  const rated = create(RecordSummarySchema, {
    state: RoomState.FINISHED,
    origin: GameOrigin.DEALT,
    seats: [
      { seat: 0, builtInAgent: "greedy", name: "greedy" },
      { seat: 1, name: "Rosa", kind: ParticipantKind.HUMAN },
      { seat: 2, name: "Rosa", kind: ParticipantKind.AGENT },
      { seat: 3, name: "greedy", kind: ParticipantKind.AGENT },
    ],
  });
  expect(unratedBecause(rated)).toBeNull();
  const changed = (fields: Partial<typeof rated>) => unratedBecause({ ...rated, ...fields });
  const seatsWith = (seat: number, fields: Partial<Participant>) =>
    rated.seats.map((one) => (one.seat === seat ? { ...one, ...fields } : one));
  const why = [
    changed({ substituted: true }),
    changed({ hinted: true }),
    changed({ added: true }),
    changed({ origin: GameOrigin.FIXED_SEED }),
    changed({ seats: seatsWith(2, { kind: ParticipantKind.HUMAN }) }),
    changed({ seats: seatsWith(0, { replay: create(RecordedPlayerSchema, { gameId: "g" }) }) }),
    changed({ visibility: Visibility.UNLISTED }),
    changed({ visibility: Visibility.PRIVATE }),
    changed({ seats: seatsWith(1, { shownKind: ParticipantKind.ROBOT }) }),
    changed({ origin: GameOrigin.PHYSICAL }),
    changed({ state: RoomState.ABORTED }),
  ];
  const expected = ["substituted", "hinted", "added", "notDealt", "twice", "recorded", "hidden", "hidden", "wizard"];
  expect(why).toEqual([...expected, "notDealt", null]);
});

test("a game that somebody left is rated as lost by them, also if it was broken off", () => {
  const names = ["Rosa", "Ben", "Cleo"];
  const game = create(RecordSummarySchema, {
    state: RoomState.FINISHED,
    origin: GameOrigin.DEALT,
    substituted: true,
    seats: names.map((name, seat) => ({ seat, name, kind: ParticipantKind.HUMAN, substituted: seat === 1 })),
  });
  const lost = (fields: Partial<typeof game>, seat = 1) => isForfeited({ ...game, ...fields }, seat);
  expect([lost({}), lost({}, 0), unratedBecause(game)]).toEqual([true, false, null]);
  expect(lost({ visibility: Visibility.PRIVATE })).toBe(false);
  const aborted = (abortReason: AbortReason, seats = game.seats) =>
    lost({ state: RoomState.ABORTED, abortReason, seats });
  expect([AbortReason.CLOSED, AbortReason.PARTICIPANTS_LOST, AbortReason.SHUTDOWN].map((why) => aborted(why))).toEqual([
    true,
    true,
    false,
  ]);
  const all = game.seats.map((seat) => ({ ...seat, substituted: true }));
  expect([aborted(AbortReason.PARTICIPANTS_LOST, all), aborted(AbortReason.CLOSED, all)]).toEqual([false, true]);
});
