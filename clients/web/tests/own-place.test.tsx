// A participant's place: its next game, leaving and postponing, links that bring a place, and the
// countdown to the start.

import { create } from "@bufbuild/protobuf";
import { expect, test, vi } from "vitest";
import { serverApi, tournamentApi } from "../src/api/client";
import { GetClockResponseSchema } from "../src/gen/chefshat/v1/server_service_pb";
import {
  TournamentGameSchema,
  TournamentGameState,
  TournamentSchema,
  TournamentState,
} from "../src/gen/chefshat/v1/tournament_pb";
import {
  ListTournamentGamesResponseSchema,
  PostponeGameResponseSchema,
  WithdrawParticipantResponseSchema,
} from "../src/gen/chefshat/v1/tournament_service_pb";
import { Countdown, clockOf } from "../src/tournaments/Countdown";
import { nextOf, OwnPlace } from "../src/tournaments/OwnPlace";
import { decidePlace, type HeldPlace, heldPlace, linkToPlace, placeFromLink } from "../src/tournaments/place";
import { button, later, mount, press, root, settle } from "./mounted";

const ID = "5f0c6a4de2b14b7f8a3d9c1e7b60425d";

const BO: HeldPlace = { ticket: `${ID}${"ab".repeat(32)}`, participant: 3, name: "Bo & Çem" };
const ADA: HeldPlace = { ticket: `${ID}${"cd".repeat(32)}`, participant: 1, name: "Ada" };
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

/** The buttons of Bo's place. */
async function showPlace(state: TournamentState, games: { game: number; state: TournamentGameState }[] = []) {
  open(BO);
  placeFromLink(ID);
  const listed = games.map((game) => ({ ...game, round: 2, table: 5, seats: [{ participant: BO.participant }] }));
  vi.spyOn(tournamentApi, "listTournamentGames").mockResolvedValue(
    create(ListTournamentGamesResponseSchema, { games: listed }),
  );
  const leave = vi.spyOn(tournamentApi, "withdrawParticipant");
  leave.mockResolvedValue(create(WithdrawParticipantResponseSchema));
  const postpone = vi.spyOn(tournamentApi, "postponeGame").mockResolvedValue(create(PostponeGameResponseSchema));
  const onLeft = vi.fn();
  const live = { tournament: create(TournamentSchema, { tournamentId: ID, state }), standings: [], games: [] };
  await mount(<OwnPlace held={BO} live={live} onLeft={onLeft} />);
  await settle();
  return { leave, postpone, onLeft };
}

test.each([
  ["before the start, and the device has no place any more", TournamentState.OPEN, "becomes free for others", null],
  ["during it, and the place stays to be shown", TournamentState.PLAYING, "you forfeit the others", BO],
])("a participant leaves a tournament %s", async (_, state, consequence, kept) => {
  const { leave, onLeft } = await showPlace(state);
  await press("Leave the tournament…");
  expect(root.querySelector('[data-part="question"]')?.textContent).toContain(consequence);
  expect(leave).not.toHaveBeenCalled();
  await press("Leave it now");
  expect(leave.mock.calls.map(([request]) => request)).toEqual([{ tournamentId: ID, ticket: BO.ticket }]);
  expect(onLeft).toHaveBeenCalledTimes(1);
  expect(heldPlace(ID)).toEqual(kept);
});

test("a participant whose request to leave fails keeps the place, and is told why", async () => {
  const { leave, onLeft } = await showPlace(TournamentState.OPEN);
  leave.mockRejectedValue(new Error("not now"));
  await press("Leave the tournament…");
  await press("Leave it now");
  expect(root.querySelector('[role="alert"]')?.textContent).toContain("The server does not answer.");
  expect(onLeft).not.toHaveBeenCalled();
  expect(heldPlace(ID)).toEqual(BO);
});

test("a participant postpones the next due game", async () => {
  const { postpone } = await showPlace(TournamentState.PLAYING, [
    { game: 4, state: TournamentGameState.COUNTED },
    { game: 6, state: TournamentGameState.DUE },
    { game: 9, state: TournamentGameState.DUE },
  ]);
  await press("Postpone my next game (round 2, table 5)");
  expect(postpone.mock.calls.map(([request]) => request)).toEqual([{ tournamentId: ID, ticket: BO.ticket, game: 6 }]);
});

test.each([
  ["no game is due", TournamentState.PLAYING, TournamentGameState.PLAYING],
  ["the tournament has not started", TournamentState.OPEN, TournamentGameState.DUE],
])("there is nothing to postpone if %s", async (_, state, game) => {
  await showPlace(state, [{ game: 1, state: game }]);
  expect(button("Postpone")).toBeUndefined();
  expect(button("Leave")).toBeDefined();
});

test("a place has no buttons after the end", async () => {
  await showPlace(TournamentState.FINISHED);
  expect(root.querySelector("button")).toBeNull();
});

test("the countdown runs by the server's clock", async () => {
  vi.useFakeTimers({ now: 1_000_000 });
  // Ten minutes behind, and with an answer that takes two seconds.
  vi.spyOn(serverApi, "getClock").mockImplementation(async () => {
    await new Promise((resolve) => setTimeout(resolve, 1_000));
    const us = BigInt(Date.now() - 600_000) * 1_000n;
    await new Promise((resolve) => setTimeout(resolve, 1_000));
    return create(GetClockResponseSchema, { receivedAtUs: us, sentAtUs: us });
  });
  const settings = { startAtMs: 1_030_000n };
  const tournament = create(TournamentSchema, { state: TournamentState.OPEN, settings });
  await mount(<Countdown tournament={tournament} />);
  await later(40_000);
  expect(root.querySelector('[role="timer"]')?.textContent).toBe("Starts in 9:50");
});

test("the countdown runs to the start, and only before it", async () => {
  vi.spyOn(serverApi, "getClock").mockRejectedValue(new Error("no server"));
  vi.useFakeTimers({ now: 1_000_000 });
  const show = (state: TournamentState, startAtMs: bigint) =>
    mount(<Countdown tournament={create(TournamentSchema, { state, settings: { startAtMs } })} />);
  const shown = () => root.querySelector('[role="timer"]')?.textContent;
  await show(TournamentState.OPEN, 0n);
  expect(root.textContent).toBe("");
  await show(TournamentState.OPEN, 1_065_000n);
  expect(shown()).toBe("Starts in 1:05");
  await later(60_000);
  expect(shown()).toBe("Starts in 0:05");
  await later(5_000);
  expect(shown()).toBeUndefined();
  expect(root.textContent).not.toBe("");
  await show(TournamentState.PLAYING, 1_065_000n);
  expect(root.textContent).toBe("");
  expect(vi.getTimerCount()).toBe(0);
});
