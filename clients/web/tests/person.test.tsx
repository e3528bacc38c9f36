// The page of a participant: ratings, totals and games, with what is missing said in words.

import { create } from "@bufbuild/protobuf";
import { Code, ConnectError } from "@connectrpc/connect";
import { act } from "preact/test-utils";
import { expect, test, vi } from "vitest";
import { recordApi, tournamentApi } from "../src/api/client";
import { tableOf } from "../src/attend/words";
import { ListRecordsResponseSchema, RecordSummarySchema } from "../src/gen/chefshat/v1/record_service_pb";
import { GameOrigin, ParticipantKind, RoomState } from "../src/gen/chefshat/v1/room_pb";
import { type Rated, RatedSchema } from "../src/gen/chefshat/v1/tournament_pb";
import { GetLeaderboardResponseSchema } from "../src/gen/chefshat/v1/tournament_service_pb";
import { MAX_LINES } from "../src/people/games";
import { LeaderboardPage } from "../src/people/LeaderboardPage";
import { PersonPage } from "../src/people/PersonPage";
import { Result } from "../src/table/view/Result";
import { mount, root, settle } from "./mounted";
import { stateOf } from "./table-state";

const NAME = '<b>Dr. "Rösa"/II</b> & ?#%';
const PER_PAGE = 50;

const line = (name: string, kind = ParticipantKind.HUMAN, nameFingerprint = "") =>
  create(RatedSchema, { name, kind, nameFingerprint, place: 3, rating: { mean: 30, deviation: 2.5, games: 12 } });

/** The result of a game: place 2 of four, or none. */
function record(number: number, state = RoomState.FINISHED, nameFingerprint = "") {
  return create(RecordSummarySchema, {
    gameId: `game-${number}`,
    roomName: `Room ${number}`,
    state,
    origin: GameOrigin.DEALT,
    seats: [
      { seat: 0, name: NAME, kind: ParticipantKind.HUMAN, nameFingerprint },
      { seat: 1, name: "Greta", builtInAgent: "greedy", kind: ParticipantKind.AGENT },
      { seat: 2, name: "Ben", kind: ParticipantKind.HUMAN },
      { seat: 3, name: "..", kind: ParticipantKind.AGENT },
    ],
    standings:
      state === RoomState.FINISHED
        ? [2, 1, 3, 4].map((place, seat) => ({ seat, place, points: BigInt(20 - place) }))
        : [],
  });
}

/** A server with these games, newest first, and these rows of the leaderboard. */
async function show(records: ReturnType<typeof record>[], rated: Rated[], fingerprint = "") {
  const list = vi.spyOn(recordApi, "listRecords").mockImplementation(async ({ pageSize = 0, pageToken }) => {
    const from = Number(pageToken || 0);
    const to = from + pageSize;
    const nextPageToken = to < records.length ? String(to) : "";
    return create(ListRecordsResponseSchema, { records: records.slice(from, to), nextPageToken });
  });
  vi.spyOn(tournamentApi, "getLeaderboard").mockResolvedValue(create(GetLeaderboardResponseSchema, { rated }));
  await mount(<PersonPage route={{ page: "person", name: NAME, fingerprint }} />);
  await settle();
  return list;
}

const rows = () => [...root.querySelectorAll("tbody tr")];
const facts = () =>
  [...root.querySelectorAll("dl > div")].map((fact) => [...fact.querySelectorAll("dt, b, dd > span")].map(text));
const text = (element: Element) => element.textContent?.replaceAll(/\s+/g, " ").trim();
const link = (words: string) => [...root.querySelectorAll("a")].find(({ textContent }) => textContent === words);

test("a name is text, whatever it contains, and its games have date, opponents, place, points and a replay", async () => {
  const list = await show([record(1), record(2, RoomState.ABORTED)], [line("Ben"), line(NAME)]);
  expect(root.querySelector("h1")?.textContent).toBe(NAME);
  expect(list.mock.calls[0]?.[0]).toMatchObject({ filter: { participant: NAME }, newestFirst: true });
  expect(facts()).toEqual([
    ["Rating person", "30.0 ± 4.9", expect.stringMatching(/^Place 3 on the leaderboard, 12 rated games\./)],
    ["Finished games", "1", "of 2 games shown"],
    ["Won", "0", "in this game"],
    ["Mean place", "2.00", "in this game"],
  ]);
  const [first, second] = rows().map((row) => [...row.querySelectorAll("td")].map(text));
  expect(first?.slice(1, 3)).toEqual(["2nd", "18"]);
  expect(first?.[3]).toContain("Against Greta, Ben, ..");
  expect(second?.slice(1, 3)).toEqual(["aborted", "–"]);
  expect(rows()[0]?.querySelector("a")?.getAttribute("href")).toBe("/replay/game-1");
  // Built-in agents are found by the agent's name; the browser does not resolve the dots.
  expect(link("Greta")?.getAttribute("href")).toBe("/people/greedy");
  expect(new URL(link("..")?.href ?? "").pathname).toBe("/people/..%20");
});

test("more games are shown on request, and the totals are of the games shown", async () => {
  await show(
    Array.from({ length: PER_PAGE + 1 }, (_, number) => record(number)),
    [],
  );
  expect(rows()).toHaveLength(PER_PAGE);
  expect(facts()).toContainEqual(["Finished games", "50", "of 50 games shown"]);
  const more = root.querySelector("button");
  expect(more?.textContent).toBe("Show more: Games played");
  await act(() => more?.click());
  await settle();
  expect(rows()).toHaveLength(PER_PAGE + 1);
  expect(facts()).toContainEqual(["Won", "0", "in these 51 games"]);
  expect(root.querySelector("button")).toBeNull();
});

test("with a fingerprint, a name is one participant; without, everybody who chose it", async () => {
  const [own, other] = ["0123456789abcdef", "fedcba9876543210"];
  const records = [record(1, RoomState.FINISHED, own), record(2, RoomState.FINISHED, other)];
  const rated = [line(NAME, ParticipantKind.HUMAN, own), line(NAME, ParticipantKind.HUMAN, other)];
  await show(records, rated, own);
  expect(rows()).toHaveLength(1);
  expect(facts().map(([label]) => label)).toEqual(["Rating person #0123", "Finished games", "Won", "Mean place"]);
  expect(root.textContent).not.toContain("several people");
  await show(records, rated);
  expect(rows()).toHaveLength(2);
  expect(
    facts()
      .map(([label]) => label)
      ?.slice(0, 2),
  ).toEqual(["Rating person #0123", "Rating person #fedc"]);
  expect(root.textContent).toContain("several people");
  expect(new URL(link("#fedc")?.href ?? "").pathname).toMatch(/\/fedcba9876543210$/);
});

test("the games of one of many with a name are searched in large pages, and not all of them", async () => {
  const records = Array.from({ length: 6_000 }, (_, number) => record(number, RoomState.FINISHED, "fedcba9876543210"));
  const list = await show(records, [], "0123456789abcdef");
  expect(list.mock.calls.map(([{ pageSize }]) => pageSize)).toEqual(Array.from({ length: 50 }, () => 100));
  expect(root.textContent).toContain("None of the newest games with this name has this key.");
  expect(root.textContent).not.toContain("There is no record");
});

test("the leaderboard shows more on request, and says where it ends", async () => {
  const all = Array.from({ length: 1_300 }, (_, number) => line(`Player ${number}`));
  vi.spyOn(tournamentApi, "getLeaderboard").mockImplementation(async ({ limit }) =>
    create(GetLeaderboardResponseSchema, { rated: all.slice(0, limit), games: 1n }),
  );
  await mount(<LeaderboardPage />);
  await settle();
  expect(rows()).toHaveLength(200);
  const more = () => root.querySelector("button");
  for (let clicks = 0; more() && clicks < 9; clicks += 1) {
    await act(() => more()?.click());
    await settle();
  }
  expect(rows()).toHaveLength(MAX_LINES);
  expect(root.textContent).toContain("Only the first 1000 are shown.");
});

test("a rating is shown without games that the reader may see", async () => {
  await show([], [line(NAME), line(NAME, ParticipantKind.AGENT)]);
  expect(facts().map(([label]) => label)).toEqual(["Rating person", "Rating agent"]);
  expect(root.textContent).toContain("There is no record of a game with this name that you may see.");
});

test("an unknown name has neither", async () => {
  await show([], [line("Ben")]);
  expect(facts()).toEqual([]);
  expect(root.textContent).toContain("There is no record of a game with this name that you may see.");
});

test.each([
  [[line("Ben")], "No rated games yet."],
  [Array.from({ length: MAX_LINES }, () => line("Ben")), "Not among the first 1000 of the leaderboard."],
])("a participant without a line of the leaderboard", async (rated, words) => {
  await show([record(1)], rated);
  expect(facts()[0]).toEqual(["Rating", "–", words]);
});

test("it says that it is loading, and why it failed", async () => {
  let fail = (_: Error) => {};
  const response = new Promise<never>((_, reject) => {
    fail = reject;
  });
  vi.spyOn(recordApi, "listRecords").mockReturnValue(response);
  vi.spyOn(tournamentApi, "getLeaderboard").mockReturnValue(response);
  await mount(<PersonPage route={{ page: "person", name: NAME, fingerprint: "" }} />);
  expect(root.textContent).toContain("Loading…");
  fail(new ConnectError("no such server", Code.Unavailable));
  await settle();
  expect(root.querySelector('[role="alert"]')).not.toBeNull();
  expect(root.textContent).not.toContain("Loading…");
});

test("the result of a replay leads to the players, that of a game in progress does not", async () => {
  const dealt = tableOf(stateOf());
  const standings = dealt.seats.map(({ seat }) => ({ seat, points: 0, place: seat + 1 }));
  const table = { ...dealt, phase: "gameOver" as const, standings };
  await mount(<Result table={table} own={undefined} links={false} />);
  expect(link("Ada")?.getAttribute("href")).toBe("/people/Ada");
  await mount(<Result table={table} own={undefined} />);
  expect(link("Ada")).toBeUndefined();
});

test.each([
  ["its name", ["Ada", "Bo", "Bo", "Ci"], "Ada won"],
  ["its name and seat, if another one has that name", ["Bo", "Ada", "Bo", "Ci"], "Bo (1) won"],
])("the result names the winner with %s", async (_, names, words) => {
  const dealt = tableOf(stateOf());
  const seats = dealt.seats.map((seat) => ({ ...seat, name: names[seat.seat] ?? "" }));
  const standings = seats.map(({ seat }) => ({ seat, points: 0, place: seat + 1 }));
  await mount(<Result table={{ ...dealt, seats, phase: "gameOver", standings }} own={3} />);
  expect(root.querySelector("h2")?.textContent).toBe(words);
});
