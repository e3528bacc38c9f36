// A participant's place: its next game, links that bring a place, and the countdown to the start.

import { create } from "@bufbuild/protobuf";
import { beforeAll, beforeEach, expect, test } from "vitest";
import { TournamentGameSchema, TournamentGameState } from "../src/gen/chefshat/v1/tournament_pb";
import { startLanguage } from "../src/i18n";
import { clockOf } from "../src/tournaments/Countdown";
import { nextOf } from "../src/tournaments/OwnPlace";
import {
  decidePlace,
  forgetPlace,
  type HeldPlace,
  heldPlace,
  linkToPlace,
  placeFromLink,
} from "../src/tournaments/place";

const ID = "5f0c6a4de2b14b7f8a3d9c1e7b60425d";

beforeAll(startLanguage);
beforeEach(() => forgetPlace(ID));

const BO: HeldPlace = { ticket: "ab".repeat(48), participant: 3, name: "Bo & Çem" };
const ADA: HeldPlace = { ticket: "cd".repeat(48), participant: 1, name: "Ada" };
const open = (held: HeldPlace) => {
  const { pathname, hash } = new URL(linkToPlace(ID, held));
  history.replaceState(null, "", pathname + hash);
};

test("a link brings a place to another device and leaves the address", () => {
  open(BO);
  expect(placeFromLink(ID)).toBeNull();
  expect(heldPlace(ID)).toEqual(BO);
  expect(location.hash).toBe("");
  // Opened again, there is nothing to ask.
  open(BO);
  expect(placeFromLink(ID)).toBeNull();
  expect(location.hash).toBe("");
});

test.each([
  ["stays without an answer", undefined, ADA, true],
  ["stays if the person wants it to", null, ADA, false],
  ["is replaced if the person wants it to be", BO, BO, false],
] as const)("the place that this device already has %s", (_, chosen, expected, stillInAddress) => {
  open(ADA);
  placeFromLink(ID);
  open(BO);
  expect(placeFromLink(ID)).toEqual(BO);
  if (chosen !== undefined) decidePlace(ID, chosen);
  expect(heldPlace(ID)).toEqual(expected);
  expect(location.hash !== "").toBe(stillInAddress);
});

test.each(["", "#place=", "#place=%5B1%5D", "#place=%", "#table=x"])(
  "a link without a place brings none: %s",
  (hash) => {
    history.replaceState(null, "", `/tournaments/${ID}${hash}`);
    placeFromLink(ID);
    expect(heldPlace(ID)).toBeNull();
  },
);

test("the next game is the first that is due", () => {
  const game = (number: number, state: TournamentGameState, seats: number[]) =>
    create(TournamentGameSchema, { game: number, state, seats: seats.map((participant) => ({ participant })) });
  const games = [
    game(0, TournamentGameState.COUNTED, [0, 1]),
    game(1, TournamentGameState.DUE, [2, 3]),
    game(2, TournamentGameState.PLAYING, [0, 2]),
    game(3, TournamentGameState.DUE, [0, 3]),
  ];
  expect(nextOf(games, 0)?.game).toBe(3);
  expect(nextOf(games, 1)).toBeUndefined();
});

test.each([
  [1, "0:01"],
  [59_000, "0:59"],
  [600_000, "10:00"],
  [3_723_000, "1:02:03"],
  [90_061_000, "1 day 01:01:01"],
])("%i ms are %s", (ms, clock) => expect(clockOf(ms)).toBe(clock));
