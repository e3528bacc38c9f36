// A game of a study: the interface traces, which are sent only if the study asks for them, and the
// decision time measured on the participant's device, which is sent with every answer.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { act } from "preact/test-utils";
import { beforeEach, expect, type MockInstance, test, vi } from "vitest";
import { playApi, roomApi } from "../src/api/client";
import { AnswerStatus, DecisionKind } from "../src/gen/chefshat/v1/decision_pb";
import {
  ActResponseSchema,
  PlayServiceWatchResponseSchema,
  SeatUpdateSchema,
} from "../src/gen/chefshat/v1/play_service_pb";
import { GetRoomResponseSchema } from "../src/gen/chefshat/v1/room_service_pb";
import { StudyTraceKind } from "../src/gen/chefshat/v1/study_pb";
import { StudyPage } from "../src/studies/StudyPage";
import { actionOf, maskOf } from "../src/table/model/actions";
import { mount, root } from "./mounted";
import { fakeStudy } from "./study-fake";
import { DEALT, SEATS } from "./table-state";

const FACES = 11;
const OWN = 2;
const GAME = "cd".repeat(16);
const PASS = actionOf({ kind: "pass" }, FACES);
const NINES = actionOf({ kind: "play", face: 9, quantity: 2, jokers: 0 }, FACES);
const NINE = actionOf({ kind: "play", face: 9, quantity: 1, jokers: 0 }, FACES);
/** A 3 and two 9s. */
const HAND = Uint8Array.of(0, 0, 1, 0, 0, 0, 0, 0, 2, 0, 0, 0);
const RULES = { preset: "paper", players: 4, faces: FACES, jokers: 2 };
const POLICY = { decisionTimeMs: 60_000 };

const UPDATES: NonNullable<MessageInitShape<typeof SeatUpdateSchema>["update"]>[] = [
  { case: "attached", value: { roomId: "r1", gameId: GAME, seat: OWN } },
  {
    case: "snapshot",
    value: { gameStarted: { gameId: GAME, seats: SEATS, rules: RULES, policy: POLICY }, observation: DEALT },
  },
  {
    case: "decision",
    value: {
      decisionId: 7n,
      kind: DecisionKind.TURN,
      actionMask: maskOf([NINE, NINES, PASS], FACES),
      timeLeftMs: 60_000,
      observation: { ...DEALT, hand: HAND },
    },
  },
];

const STREAM = UPDATES.map((update) => create(SeatUpdateSchema, { update }));

/** The page's clock, milliseconds. */
let nowMs = 0;
let focused = true;
/** What the page sends of the seat. */
let acted: MockInstance<typeof playApi.act>;

beforeEach(() => {
  vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout", "setInterval", "clearInterval"] });
  nowMs = 1_000;
  focused = true;
  vi.spyOn(performance, "now").mockImplementation(() => nowMs);
  vi.spyOn(globalThis, "requestAnimationFrame").mockImplementation((draw) => {
    draw(nowMs);
    return 0;
  });
  vi.spyOn(document, "hasFocus").mockImplementation(() => focused);
  vi.spyOn(roomApi, "getRoom").mockResolvedValue(
    create(GetRoomResponseSchema, { room: { roomId: "r1", gameId: GAME, seats: SEATS, rules: RULES, policy: POLICY } }),
  );
  vi.spyOn(playApi, "watch").mockImplementation(async function* () {
    yield create(PlayServiceWatchResponseSchema, { updates: STREAM });
    await new Promise(() => {});
  });
  acted = vi
    .spyOn(playApi, "act")
    .mockResolvedValue(create(ActResponseSchema, { result: { decisionId: 7n, status: AnswerStatus.ACCEPTED } }));
});

/** A participant's game, with its decision open. Returns what the page sends to the study. */
async function play(traces: boolean) {
  const game = { game: 1, games: 1, roomId: "r1", gameId: GAME, ticket: "ef".repeat(48) };
  const { sent } = fakeStudy([{ case: "game", value: game }], { traces });
  await mount(<StudyPage route={{ page: "study", link: "Xk3_abcdefghijklmnopqrstuvwxy1" }} />);
  await pass(0);
  expect(root.querySelector("[data-decision]")).not.toBeNull();
  return sent;
}
/** Lets time pass. */
async function pass(ms: number) {
  nowMs += ms;
  // What one answer of the server renders may ask for the next.
  for (const step of [ms, 0, 0, 0, 0]) {
    await act(async () => {
      for (const wait of [step, 0, 0]) await vi.advanceTimersByTimeAsync(wait);
    });
  }
}
const card = (face: string) => {
  const found = root.querySelector<HTMLElement>(`[data-part="hand-card"][data-card="${face}"]`);
  if (!found) throw new Error(`the hand has no ${face}`);
  return found;
};
const press = (action: string) => act(() => root.querySelector<HTMLElement>(`[data-action="${action}"]`)?.click());
const focusPage = (on: boolean) =>
  act(() => {
    focused = on;
    window.dispatchEvent(new Event(on ? "focus" : "blur"));
  });

/** What a participant does in the tests of traces: everything that has a trace. */
async function doEverything() {
  await act(() => card("9").click());
  await pass(300);
  await act(() => card("9").click());
  await act(() => card("3").focus());
  await pass(700);
  await act(() => card("3").blur());
  await focusPage(false);
  await pass(2_000);
  await focusPage(true);
  await pass(10_000);
}

test("picking, putting back, focus, and leaving the page are sent if the study asks for traces", async () => {
  const sent = await play(true);
  await doEverything();
  const calls = sent.filter(({ call }) => call === "traces").map(({ request }) => request);
  const traces = calls.flatMap((request) => (request as { traces: { kind: StudyTraceKind }[] }).traces);
  expect(new Set(calls.map((request) => (request as { gameId: string }).gameId))).toEqual(new Set([GAME]));
  expect(traces).toEqual([
    { kind: StudyTraceKind.DECISION_SHOWN, target: "", atMs: 0n, decisionId: 7n, durationMs: 0 },
    { kind: StudyTraceKind.CARD_PICKED, target: "card:9", atMs: 0n, decisionId: 7n, durationMs: 0 },
    { kind: StudyTraceKind.CARD_PUT_BACK, target: "card:9", atMs: 300n, decisionId: 7n, durationMs: 0 },
    { kind: StudyTraceKind.FOCUS, target: "card:3", atMs: 300n, decisionId: 7n, durationMs: 700 },
    { kind: StudyTraceKind.PAGE_LEFT, target: "", atMs: 1_000n, decisionId: 7n, durationMs: 0 },
    { kind: StudyTraceKind.PAGE_RETURNED, target: "", atMs: 3_000n, decisionId: 7n, durationMs: 0 },
  ]);
});

test("no traces are collected or sent if the study does not ask for them", async () => {
  const sent = await play(false);
  await doEverything();
  await press("pass");
  await pass(60_000);
  expect(acted).toHaveBeenCalledTimes(1);
  expect(sent.filter(({ call }) => call === "traces")).toEqual([]);
});

test.each([true, false])("an answer has the time since the decision was shown here, traces %s", async (traces) => {
  await play(traces);
  await pass(1_234);
  await press("pass");
  await pass(0);
  expect(acted.mock.calls.map(([request]) => request)).toEqual([
    {
      ticket: "ef".repeat(48),
      command: {
        case: "answer",
        value: { decisionId: 7n, action: PASS, annotations: { extra: { person_decision_time_ms: "1234" } } },
      },
    },
  ]);
});
