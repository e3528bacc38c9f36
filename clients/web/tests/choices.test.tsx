// What the choices of a game were worth: asked one after the other, listed where it matters, and led
// to from the graph and the end of a game.

import { create } from "@bufbuild/protobuf";
import { Code, ConnectError } from "@connectrpc/connect";
import { act } from "preact/test-utils";
import { expect, test, vi } from "vitest";
import { analysisApi, recordApi } from "../src/api/client";
import { EvaluateResponseSchema } from "../src/gen/chefshat/v1/analysis_service_pb";
import { GetRecordResponseSchema } from "../src/gen/chefshat/v1/record_service_pb";
import { t } from "../src/i18n";
import { choices, compared, costliest, estimatedChoices, finest } from "../src/replay/choices";
import { filmOf } from "../src/replay/frames";
import { Graph } from "../src/replay/Graph";
import { Highlights } from "../src/replay/Highlights";
import { useFilm } from "../src/replay/hooks";
import { legalActions } from "../src/table/model/actions";
import { eventually, mount, root, settle } from "./mounted";
import { recorded } from "./record";
import { AWAY, refused } from "./refusals";

const FILM = filmOf(recorded("fixed"));
const ALL = choices(FILM);
const CHOICE = { decisions: 4, frame: 9, shift: 1, seat: 2, taken: 7 };

const worth = (action: number, points: number, standardError = 0.05) =>
  ({ action, points, standardError }) as Parameters<typeof compared>[1][number];

/** The server answers by the number of decisions before the one asked for. */
function answers(points: (decisions: number, action: number) => number) {
  return vi.spyOn(analysisApi, "evaluate").mockImplementation(async function* ({ position }) {
    const decisions = Number(position?.case === "moment" ? position.value.decisions : -1n);
    const mask = FILM.at(ALL.find((choice) => choice.decisions === decisions)?.frame ?? 0).open?.actionMask;
    const actions = legalActions(mask ?? new Uint8Array());
    yield create(EvaluateResponseSchema, {
      actions: actions.map((action) => ({ action, points: points(decisions, action), standardError: 0.01 })),
    });
  });
}

/** Opens the section, as a click on its summary does. */
async function open() {
  const details = root.querySelector("details");
  await act(() => {
    details?.setAttribute("open", "");
    details?.dispatchEvent(new Event("toggle"));
  });
}

/** Waits until everything asked for has been answered. */
async function answered() {
  for (let turn = 0; turn < 2 * ALL.length && root.querySelector("progress"); turn += 1) await settle();
}

test("every decision with several legal actions is a choice, of one seat or of all", () => {
  const decisions = recorded("fixed").flatMap(({ line }) => (line.case === "decision" ? [line.value] : []));
  const several = decisions.filter(({ actionMask }) => legalActions(actionMask).length > 1);
  expect(several.length).toBeLessThan(decisions.length);
  expect(ALL.map(({ seat, taken }) => [seat, taken])).toEqual(several.map(({ seat, action }) => [seat, action]));
  expect(choices(FILM, 1)).toEqual(ALL.filter(({ seat }) => seat === 1));
});

test("a choice is compared with the best other one, and chance is not noteworthy", () => {
  expect(compared(CHOICE, [worth(7, 1), worth(8, 1.5), worth(9, 2)])).toMatchObject({
    other: 9,
    won: -1,
    noteworthy: true,
  });
  expect(compared(CHOICE, [worth(7, 2), worth(8, 1.5), worth(9, 1)])).toMatchObject({
    other: 8,
    won: 0.5,
    noteworthy: true,
  });
  expect(compared(CHOICE, [worth(7, 1), worth(8, 1.1)])?.noteworthy).toBe(false);
  expect(compared(CHOICE, [worth(7, 1, 0.5), worth(8, 2, 0.5)])?.noteworthy).toBe(false);
  expect(compared(CHOICE, [worth(8, 2)])).toBeUndefined();
  expect(compared(CHOICE, [worth(7, 2)])).toBeUndefined();
});

test("the costliest come first, and only what is noteworthy is listed", () => {
  const of = (won: number, noteworthy = true) => ({ ...CHOICE, points: 1, other: 8, won, noteworthy });
  const estimated = [of(-0.3), of(0.4), of(-0.9), of(-2, false), of(0.7), of(3, false)];
  expect(costliest(estimated, 1).map(({ won }) => won)).toEqual([-0.9]);
  expect(costliest(estimated, 9).map(({ won }) => won)).toEqual([-0.9, -0.3]);
  expect(finest(estimated)?.won).toBe(0.7);
  expect(finest([of(3, false)])).toBeUndefined();
});

test("the graph asks while it is open, and its list and its picture lead to the moments", async () => {
  const worst = ALL[3];
  const evaluate = answers((decisions, action) => (decisions === worst?.decisions && action !== worst.taken ? 3 : 1));
  const onGo = vi.fn();
  const table = FILM.at(0).table;
  await mount(<Graph gameId="g" film={FILM} table={table} perspective="all" decisions={3} onGo={onGo} />);
  await settle();
  expect(evaluate).not.toHaveBeenCalled();
  await open();
  await answered();
  expect(evaluate).toHaveBeenCalledTimes(ALL.length);
  const turning = [...root.querySelectorAll<HTMLElement>('[data-part~="turning-points"] button')];
  expect(turning).toHaveLength(1);
  expect(turning[0]?.textContent).toMatch(/^Shift 1, .+: .+ \(better by 2\.0 points: .+\)$/);
  await act(() => turning[0]?.click());
  expect(onGo).toHaveBeenLastCalledWith(worst?.frame);
  const svg = root.querySelector("svg");
  expect(svg?.querySelectorAll("path[style]")).toHaveLength(table.seats.length);
  if (svg) svg.getBoundingClientRect = () => new DOMRect(100, 0, 400, 80);
  await act(() => {
    svg?.dispatchEvent(new MouseEvent("click", { bubbles: true, clientX: 300 }));
  });
  expect(onGo).toHaveBeenLastCalledWith(FILM.after(Math.round(FILM.decisions / 2)));
});

test("from a seat the graph has the decisions of that seat alone", async () => {
  answers((decisions, action) =>
    ALL.some((choice) => choice.decisions === decisions && choice.taken === action) ? 1 : 2,
  );
  const { table } = FILM.at(0);
  await mount(<Graph gameId="g" film={FILM} {...{ table }} perspective={1} decisions={0} onGo={() => {}} />);
  await open();
  await answered();
  const turning = [...root.querySelectorAll('[data-part~="turning-points"] button')].map(
    ({ textContent }) => textContent,
  );
  expect(turning.length).toBeGreaterThan(1);
  expect(turning.filter((line) => !line.includes(`, ${table.seats[1]?.name}: `))).toEqual([]);
});

/** A server that refuses the calls with these numbers, from 1. */
function refuses(codes: Record<number, ConnectError>) {
  const evaluate = answers(() => 1);
  const answer = evaluate.getMockImplementation();
  let calls = 0;
  evaluate.mockImplementation(async function* (...args) {
    calls += 1;
    const code = codes[calls];
    if (code) throw code;
    if (answer) yield* answer(...args);
  });
  return evaluate;
}

const graph = () =>
  mount(<Graph gameId="g" film={FILM} table={FILM.at(0).table} perspective="all" decisions={0} onGo={() => {}} />);

test("a decision that cannot be estimated is left out, any other error is said and the rest resumed", async () => {
  const evaluate = refuses({
    2: new ConnectError("no position", Code.InvalidArgument),
    4: new ConnectError("no such game", Code.NotFound),
  });
  await graph();
  await open();
  for (let turn = 0; turn < 9 && !root.querySelector('[role="alert"]'); turn += 1) await settle();
  expect(root.querySelector('[role="alert"]')?.textContent).toBe("no such game");
  expect(root.textContent).toContain(`3 of ${ALL.length} decisions estimated`);
  await act(() => root.querySelector<HTMLElement>('[data-part~="button"]')?.click());
  await answered();
  expect(root.querySelector('[role="alert"]')).toBeNull();
  expect(root.textContent).toContain("No decision clearly cost points.");
  expect(evaluate).toHaveBeenCalledTimes(ALL.length + 1);
});

test("a game of which nothing can be estimated is not called one without a mistake", async () => {
  vi.spyOn(analysisApi, "evaluate").mockImplementation(async function* () {
    yield* [];
    throw new ConnectError("hands unknown", Code.InvalidArgument);
  });
  await graph();
  await open();
  await answered();
  expect(root.textContent).toContain("The server cannot estimate this game.");
});

test("what the server may soon answer is asked again", async () => {
  vi.useFakeTimers({ toFake: ["setTimeout"], shouldAdvanceTime: true, advanceTimeDelta: 500 });
  const evaluate = refuses({ 2: AWAY });
  const found: unknown[] = [];
  for await (const choice of estimatedChoices("g", ALL.slice(0, 3), new AbortController().signal)) found.push(choice);
  vi.useRealTimers();
  expect(evaluate).toHaveBeenCalledTimes(4);
  expect(found).not.toContain(undefined);
});

test("at the end of a game a player asks for the best and the costliest own decision", async () => {
  const own = choices(FILM, 0);
  const [best, worst] = [own[1], own[0]];
  const evaluate = answers((decisions, action) => {
    if (decisions === best?.decisions) return action === best.taken ? 2.5 : 1;
    return decisions === worst?.decisions && action !== worst.taken ? 2 : 1;
  });
  vi.spyOn(recordApi, "getRecord").mockImplementation(async function* () {
    yield create(GetRecordResponseSchema, { lines: recorded("fixed") });
  });
  const over = { ...FILM.at(FILM.length - 1).table, phase: "gameOver" as const, gameId: "g" };
  await mount(<Highlights table={{ ...over, phase: "shiftOver" }} own={0} />);
  expect(root.childElementCount).toBe(0);
  await mount(<Highlights table={{ ...over, physical: true }} own={0} />);
  expect(root.childElementCount).toBe(0);
  await mount(<Highlights table={over} own={0} />);
  expect(evaluate).not.toHaveBeenCalled();
  await act(() => root.querySelector("button")?.click());
  await settle();
  await answered();
  expect(evaluate).toHaveBeenCalledTimes(own.length);
  const links = [...root.querySelectorAll('[data-part~="highlights"] a')];
  expect(links.map((link) => link.getAttribute("href"))).toEqual(
    [best, worst].map((choice) => `/replay/g?decision=${(choice?.decisions ?? 0) + 1}`),
  );
  expect(root.textContent).toMatch(/Your best decision, in Shift 1: .+ \(better than .+ by 1\.5 points\)/);
});

test("a record is read again while the server is away, from its beginning, and not if it has none", async () => {
  const lines = recorded("fixed");
  const reads = vi.spyOn(recordApi, "getRecord").mockImplementation(async function* ({ gameId }) {
    yield create(GetRecordResponseSchema, { lines: lines.slice(0, 9) });
    if (gameId !== "g") throw refused("GAME_UNKNOWN", Code.NotFound);
    if (reads.mock.calls.length === 1) throw AWAY;
    yield create(GetRecordResponseSchema, { lines: lines.slice(9) });
  });
  const seen: string[] = [];
  function Page({ gameId }: { gameId: string }) {
    const { film, fault } = useFilm(gameId);
    seen.push(fault || String(film?.length));
    return null;
  }
  await mount(<Page gameId="g" />);
  await eventually(() => expect(seen.at(-1)).toBe(String(FILM.length)));
  expect(seen).toContain(t().faults.notReached);
  await mount(<Page key="other" gameId="other" />);
  await eventually(() => expect(seen.at(-1)).not.toBe(String(FILM.length)));
  await settle();
  expect(reads).toHaveBeenCalledTimes(3);
});
