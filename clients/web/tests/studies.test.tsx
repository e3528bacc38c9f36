// A participant of a study: stages, answers, withdrawing, another device, and what is stored.

import { create } from "@bufbuild/protobuf";
import { Code } from "@connectrpc/connect";
import { signal } from "@preact/signals";
import type { JSX } from "preact";
import { act } from "preact/test-utils";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { roomApi } from "../src/api/client";
import { ParticipantSchema } from "../src/gen/chefshat/v1/room_pb";
import {
  StudyEndReason,
  type StudyShownItem,
  StudyShownItemSchema,
  StudyTraceKind,
  StudyViewSchema,
} from "../src/gen/chefshat/v1/study_pb";
import { ContinueStudyResponseSchema, type SaveAnswersRequest } from "../src/gen/chefshat/v1/study_service_pb";
import { setLanguage } from "../src/i18n";
import { useTab } from "../src/parts/tab";
import { remembered } from "../src/store";
import { answersOf, missingItems } from "../src/studies/answers";
import { participationApi } from "../src/studies/client";
import type { Trace } from "../src/studies/participating";
import { StudyPage } from "../src/studies/StudyPage";
import { startTracing, targetOf } from "../src/studies/tracing";
import { startLive } from "../src/table/model/live";
import { emptyTable, seatFromParticipant } from "../src/table/model/state";
import { SeatPanel } from "../src/table/view/SeatPanel";
import { button, eventually, later, mount, root, type } from "./mounted";
import { refused } from "./refusals";
import { fakeStudy, viewOf } from "./study-fake";

const LINK = "Xk3_abcdefghijklmnopqrstuvwxy1";
const CONSENT = { case: "consent" as const, value: { text: "We record your games.\n\nYou may stop.", version: "2" } };
const TEXT = { case: "text" as const, value: { title: "Welcome", text: "Read this." } };
const OUTSIDE = {
  case: "externalQuestionnaire" as const,
  value: { text: "Please go there.", url: "https://forms.example/q?id=P07" },
};
const ITEMS = [
  { item: 4, text: "I trusted them", kind: { case: "likert" as const, value: { points: 5, labels: ["no", "yes"] } } },
  { item: 1, kind: { case: "semanticDifferential" as const, value: { points: 5, left: "fake", right: "natural" } } },
  {
    item: 2,
    text: "Effort",
    kind: { case: "slider" as const, value: { min: 0, max: 100, step: 5, left: "low", right: "high" } },
  },
  { item: 3, text: "Which", kind: { case: "choice" as const, value: { options: ["a", "b", "c"], multiple: true } } },
  {
    item: 0,
    text: "Anything else",
    optional: true,
    kind: { case: "freeText" as const, value: { maxCharacters: 200 } },
  },
];
const QUESTIONS = { case: "questionnaire" as const, value: { title: "About the game", items: ITEMS } };
const items: StudyShownItem[] = ITEMS.map((item) => create(StudyShownItemSchema, item));

beforeEach(() => {
  vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout", "setInterval", "clearInterval"] });
});
afterEach(() => setLanguage("en"));

const show = (beside?: JSX.Element) =>
  mount(
    <>
      {beside}
      <StudyPage route={{ page: "study", link: LINK }} />
    </>,
  ).then(settled);
const settled = () =>
  act(async () => {
    for (let turn = 0; turn < 5; turn += 1) await vi.advanceTimersByTimeAsync(0);
  });
const press = async (words: string) => {
  const found = button(words);
  expect(found, words).toBeDefined();
  await act(() => found?.click());
  await settled();
};
const input = (within: number, which: string) => {
  const found = root.querySelector<HTMLInputElement>(`[data-item="${within}"] ${which}`);
  if (!found) throw new Error(`${within} has no ${which}`);
  return found;
};
const title = () => root.querySelector("h1")?.textContent;

test("a participant goes through all stages, and nothing is stored on the device", async () => {
  const { sent } = fakeStudy([CONSENT, TEXT, QUESTIONS, OUTSIDE]);
  const before = new Map(remembered());
  await show();
  expect(title()).toBe("Before you begin");
  expect(root.textContent).toContain("Step 1 of 4");
  await press("Agree and continue");
  expect(sent.map(({ call }) => call)).toEqual(["open"]);
  expect(root.querySelector('[role="alert"]')?.textContent).toContain("Tick the box");
  await act(() => root.querySelector<HTMLInputElement>('[data-part="consent"] input')?.click());
  await press("Agree and continue");

  expect(title()).toBe("Welcome");
  await press("Continue");

  expect(title()).toBe("About the game");
  await press("Send the answers");
  expect(root.querySelectorAll("[data-missing]")).toHaveLength(4);
  // The first one is shown first, whatever its number.
  expect(document.activeElement?.closest("[data-item]")?.getAttribute("data-item")).toBe("4");
  await act(() => input(4, 'input[value="2"]').click());
  await act(() => input(1, 'input[value="5"]').click());
  const slider = input(2, 'input[type="range"]');
  expect(slider.getAttribute("aria-valuetext")).toBe("no answer yet");
  await type(slider, "35");
  expect(input(2, 'input[type="range"]').getAttribute("aria-valuetext")).toBe("35, from 0 to 100");
  await act(() => root.querySelectorAll<HTMLInputElement>('[data-item="3"] input')[2]?.click());
  await act(() => root.querySelectorAll<HTMLInputElement>('[data-item="3"] input')[0]?.click());
  await press("Send the answers");

  expect(title()).toBe("A questionnaire");
  expect(root.querySelector("a[target]")?.getAttribute("href")).toBe("https://forms.example/q?id=P07");
  await press("I have filled it in");
  expect(title()).toBe("Thank you for taking part");
  expect(root.textContent).toContain("P07");

  expect(sent.map(({ call }) => call)).toEqual(["open", "consent", "continue", "answer", "continue"]);
  const { answers } = { answers: [], ...sent[3]?.request } as {
    answers: { item: number; value: { value: unknown } }[];
  };
  expect(answers.map(({ item, value }) => [item, value.value])).toEqual([
    [4, 2],
    [1, 5],
    [2, 35],
    [3, { options: [0, 2] }],
  ]);
  expect(remembered()).toEqual(before);
  expect(sessionStorage.length).toBe(0);
});

test("the study is shown in its own language, which is not stored", async () => {
  const { view } = fakeStudy([CONSENT]);
  vi.spyOn(participationApi, "openStudy").mockImplementation(async () => {
    const { create: make } = await import("@bufbuild/protobuf");
    const { OpenStudyResponseSchema } = await import("../src/gen/chefshat/v1/study_service_pb");
    return make(OpenStudyResponseSchema, { session: "s", view: { ...view(), language: "it" } });
  });
  await show();
  await eventually(() => expect(title()).toBe("Prima di cominciare"));
  expect(localStorage.getItem("chefshat.language")).not.toBe("it");
});

test.each([
  ["consent", CONSENT],
  ["text", TEXT],
  ["questionnaire", QUESTIONS],
  ["external", OUTSIDE],
  ["game", { case: "game" as const, value: { game: 1, games: 2 } }],
])("withdrawing is possible at the stage %s, says what it does and asks once", async (_, stage) => {
  const { sent } = fakeStudy([stage]);
  await show();
  await press("Withdraw from the study…");
  expect(root.querySelector('[data-part="question"]')?.textContent).toContain("ends at once");
  expect(sent.map(({ call }) => call)).toEqual(["open"]);
  await press("Withdraw now");
  expect(sent.at(-1)).toEqual({ call: "withdraw", request: { link: LINK, deleteData: false } });
  expect(root.textContent).toContain("You have withdrawn. Your data recorded so far are kept.");
  // The data can still be deleted.
  await press("Delete my data…");
  await press("Delete now");
  expect(sent.at(-1)).toEqual({ call: "withdraw", request: { link: LINK, deleteData: true } });
  expect(root.querySelector('[data-part="withdraw"]')).toBeNull();
});

test("who is asked to consent reads on which date all data are deleted", async () => {
  const { streams } = fakeStudy([CONSENT]);
  await show();
  expect(root.textContent).not.toContain("deleted from the server");
  streams[0]?.push(
    create(StudyViewSchema, { ...viewOf([CONSENT], 0), deletesAtMs: BigInt(Date.UTC(2031, 11, 30, 11)) }),
  );
  await settled();
  expect(root.textContent).toContain(
    "All data of this study are deleted from the server by December 30, 2031 at the latest.",
  );
});

test("who is screened out reads why, and can have the data deleted", async () => {
  const end = { reason: StudyEndReason.SCREENED_OUT, text: "For **adults** only.", url: "https://panel.example/out" };
  fakeStudy([{ case: "end", value: end }]);
  await show();
  expect(title()).toBe("The study is over for you");
  expect(root.textContent).not.toContain("This study is meant for other people");
  expect(root.querySelector("strong")?.textContent).toBe("adults");
  expect(root.querySelector<HTMLAnchorElement>('[data-part="go-on"]')?.href).toBe("https://panel.example/out");
  expect(button("Delete my data…")).toBeDefined();
  await mount(null);
  fakeStudy([{ case: "end", value: { ...end, text: "" } }]);
  await show();
  expect(root.textContent).toContain("This study is meant for other people");
});

/** The title of the tab, which the layout sets. */
function Tab() {
  useTab("Study");
  return null;
}

const waiting = (here: number) => ({
  case: "arrival" as const,
  value: { text: "Have *patience*.", size: 3, here, waitMs: 600_000n },
});

test("who waits for others sees how many are here, and goes on by itself", async () => {
  const { streams, sent } = fakeStudy([waiting(1), TEXT]);
  await show(<Tab />);
  expect(title()).toBe("Waiting for the others");
  expect(root.querySelector("em")?.textContent).toBe("patience");
  expect(root.textContent).toContain("1 of 3 people are here");
  expect(root.textContent).toContain("After 10 minutes at the latest");
  streams[0]?.push(viewOf([waiting(2), TEXT], 0));
  await settled();
  expect(root.textContent).toContain("2 of 3 people are here");
  expect(root.querySelectorAll('[data-taken="true"]')).toHaveLength(2);
  expect(button("Continue without the others")).toBeUndefined();
  // Nobody looks at the page when the last one comes: the tab says so.
  const hidden = vi.spyOn(document, "hidden", "get").mockReturnValue(true);
  streams[0]?.push(viewOf([waiting(2), TEXT], 1));
  await settled();
  expect(title()).toBe("Welcome");
  expect(document.title).toBe("Everybody is here · Study");
  hidden.mockReturnValue(false);
  await act(() => void document.dispatchEvent(new Event("visibilitychange")));
  expect(document.title).toBe("Study");
  expect(sent.map(({ call }) => call)).toEqual(["open"]);
});

test("a test participant may go on without the others", async () => {
  const { streams, sent } = fakeStudy([waiting(1), TEXT]);
  await show();
  streams[0]?.push(create(StudyViewSchema, { ...viewOf([waiting(1), TEXT], 0), test: true }));
  await settled();
  await press("Continue without the others");
  expect(sent.at(-1)?.call).toBe("continue");
  expect(title()).toBe("Welcome");
});

test("a game that waits for others of the group says for how many", async () => {
  fakeStudy([{ case: "game", value: { game: 1, games: 2, waitsFor: 2 } }]);
  await show();
  expect(root.textContent).toContain("The game begins when 2 other people are ready.");
});

test("who is left over is thanked", async () => {
  fakeStudy([{ case: "end", value: { reason: StudyEndReason.LEFT_OVER, url: "https://panel.example/done" } }]);
  await show();
  expect(title()).toBe("Thank you for taking part");
  expect(root.textContent).toContain("There are not enough people for a game now.");
  expect(root.querySelector<HTMLAnchorElement>('[data-part="go-on"]')?.href).toBe("https://panel.example/done");
});

test("another device that opens the study is said clearly, and can be answered", async () => {
  const { streams, sent } = fakeStudy([CONSENT, TEXT]);
  await show();
  streams[0]?.fail(refused("SESSION_SUPERSEDED", Code.Aborted));
  await settled();
  expect(title()).toBe("You continue on another device or page");
  expect(button("Withdraw")).toBeUndefined();
  await vi.advanceTimersByTimeAsync(60_000);
  expect(sent.map(({ call }) => call)).toEqual(["open"]);
  await press("Continue here instead");
  expect(sent.map(({ call }) => call)).toEqual(["open", "open"]);
  expect(title()).toBe("Before you begin");
});

test("a server that has forgotten the session is asked with the link again", async () => {
  const { streams, sent } = fakeStudy([CONSENT, TEXT]);
  await show();
  streams[0]?.fail(refused("SESSION_UNKNOWN", Code.Unauthenticated));
  await settled();
  expect(sent.map(({ call }) => call)).toEqual(["open", "open"]);
  expect(title()).toBe("Before you begin");
});

test("what the server shows replaces the stage, but never leads back", async () => {
  const { streams } = fakeStudy([CONSENT, TEXT]);
  await show();
  streams[0]?.push(viewOf([CONSENT, TEXT], 1));
  await settled();
  expect(title()).toBe("Welcome");
  streams[0]?.push(viewOf([CONSENT, TEXT], 0));
  await settled();
  expect(title()).toBe("Welcome");
});

test("a page that is behind shows the newest stage", async () => {
  const { state } = fakeStudy([TEXT, QUESTIONS]);
  await show();
  vi.spyOn(participationApi, "continueStudy").mockRejectedValue(refused("STEP_OVER"));
  state.step = 1;
  await press("Continue");
  expect(title()).toBe("About the game");
});

test.each(["LINK_UNKNOWN", "STUDY_CLOSED", "STUDY_FULL"])("%s is said in words", async (reason) => {
  vi.spyOn(participationApi, "openStudy").mockRejectedValue(refused(reason));
  await show();
  const said = root.querySelector('[role="alert"]')?.textContent ?? "";
  expect(said).not.toContain(reason);
  expect(said.length).toBeGreaterThan(20);
  expect(button("Try again")).toBeUndefined();
});

test("a study that failed can be opened again", async () => {
  const { streams } = fakeStudy([TEXT]);
  await show();
  streams[0]?.fail(refused("INTERNAL", Code.Internal));
  await settled();
  expect(root.querySelector('[role="alert"]')?.textContent).toContain("Try again");
  await press("Try again");
  expect(title()).toBe("Welcome");
});

test("on another device than the study needs, the page says which, and opens the study where the window fits", async () => {
  const { sent } = fakeStudy([CONSENT]);
  const needs = { pointer: "", min_width: "1200", language: "en" };
  const open = vi.spyOn(participationApi, "openStudy");
  const wrong = refused("WRONG_DEVICE", Code.FailedPrecondition, needs);
  open.mockRejectedValueOnce(wrong).mockRejectedValueOnce(wrong);
  await show();
  expect(title()).toBe("This study needs another device");
  expect(root.textContent).toContain(`at least 1200 pixels wide. Here it is ${window.innerWidth} pixels wide`);
  expect(root.querySelector('[data-part="invite-link"]')?.textContent).toBe(location.href);
  expect(root.querySelector('[aria-label="QR code of the link"]')).not.toBeNull();
  await press("Try again");
  expect([open.mock.calls.length, sent.length]).toEqual([2, 0]);
  const resized = async (width: number) => {
    vi.spyOn(window, "innerWidth", "get").mockReturnValue(width);
    await act(() => void window.dispatchEvent(new Event("resize")));
    await settled();
  };
  await resized(1199);
  expect(open).toHaveBeenCalledTimes(2);
  await resized(1200);
  expect(title()).toBe("Before you begin");
});

test.each([
  ["fine", "Sie läuft auf einem Computer mit Maus oder Touchpad.", 0],
  ["coarse", "Sie läuft auf einem Smartphone oder Tablet.", 1],
])(
  "a study that needs a %s pointer says so in its language, and can be withdrawn from",
  async (pointer, words, codes) => {
    const { sent } = fakeStudy([CONSENT]);
    const needs = { pointer, min_width: "0", language: "de" };
    const wrong = refused("WRONG_DEVICE", Code.FailedPrecondition, needs);
    vi.spyOn(participationApi, "openStudy").mockRejectedValue(wrong);
    await show();
    await eventually(() => expect(title()).toBe("Diese Studie braucht ein anderes Gerät"));
    expect(root.textContent).toContain(words);
    expect(root.textContent).not.toContain("Pixel breit");
    expect(root.querySelectorAll('[aria-label="QR-Code des Links"]')).toHaveLength(codes);
    await press("Teilnahme zurückziehen…");
    await press("Jetzt zurückziehen");
    expect(sent.map(({ call }) => call)).toEqual(["withdraw"]);
    await eventually(() => expect(title()).toBe("The study is over for you"));
  },
);

test("by an open link nobody joins on another device, and there is nothing to withdraw from", async () => {
  fakeStudy([CONSENT]);
  vi.spyOn(participationApi, "openStudy").mockRejectedValueOnce(refused("LINK_OPEN"));
  const needs = { pointer: "fine", min_width: "0", language: "en" };
  const join = vi
    .spyOn(participationApi, "joinStudy")
    .mockRejectedValue(refused("WRONG_DEVICE", Code.FailedPrecondition, needs));
  await show();
  expect(title()).toBe("This study needs another device");
  expect(join.mock.calls[0]?.[0].device?.width).toBe(window.innerWidth);
  expect(button("Withdraw")).toBeUndefined();
});

test("a game is prepared, and its room is asked for with the ticket alone", async () => {
  const game = { game: 1, games: 2, roomId: "ab".repeat(16), gameId: "cd".repeat(16), ticket: "ef".repeat(48) };
  const { streams } = fakeStudy([{ case: "game", value: { game: 1, games: 2 } }]);
  await show();
  expect(root.textContent).toContain("Your game is being prepared.");
  const ask = vi.spyOn(roomApi, "getRoom").mockReturnValue(new Promise(() => {}));
  streams[0]?.push(viewOf([{ case: "game", value: game }], 0));
  await settled();
  expect(ask.mock.calls[0]?.[1]?.headers).toEqual({ "chefshat-secret": game.ticket });
  expect([...remembered().values()].join()).not.toContain(game.ticket);
});

test("a response that is older than what the stream has sent meanwhile is not shown", async () => {
  const stages = (ended: boolean) => [TEXT, { case: "game" as const, value: { game: 1, games: 1, ended } }];
  const { streams } = fakeStudy(stages(false));
  await show();
  let respond = () => {};
  vi.spyOn(participationApi, "continueStudy").mockImplementation(async () => {
    await new Promise<void>((resolve) => {
      respond = resolve;
    });
    return create(ContinueStudyResponseSchema, { view: viewOf(stages(false), 1) });
  });
  await press("Continue");
  streams[0]?.push(viewOf(stages(true), 1));
  await settled();
  expect(root.textContent).toContain("The game is over.");
  await act(() => respond());
  await settled();
  expect(root.textContent).toContain("The game is over.");
});

test("answers are checked, and sent in the order of the items", () => {
  const draft = {
    4: { value: 3, afterMs: 10.4 },
    3: { value: [2, 0], afterMs: 20 },
    0: { value: "  ", afterMs: 30 },
  };
  expect(missingItems(items, draft)).toEqual([1, 2]);
  expect(answersOf(items, draft)).toEqual([
    { item: 4, value: { case: "number", value: 3 }, answeredAfterMs: 10 },
    { item: 3, value: { case: "options", value: { options: [0, 2] } }, answeredAfterMs: 20 },
  ]);
});

test("what is entered is kept by the server, shown on another device, and its times count on", async () => {
  const { sent, state } = fakeStudy([QUESTIONS, QUESTIONS]);
  const clock = vi.spyOn(performance, "now").mockReturnValue(5_000);
  const saves = () => sent.filter(({ call }) => call === "save").map(({ request }) => request as SaveAnswersRequest);
  const times = () =>
    saves()
      .at(-1)
      ?.answers.map(({ item, answeredAfterMs }) => [item, answeredAfterMs]);
  await show();
  clock.mockReturnValue(6_200);
  await act(() => input(4, 'input[value="2"]').click());
  await act(() => root.querySelectorAll<HTMLInputElement>('[data-item="3"] input')[2]?.click());
  expect(saves()).toEqual([]);
  await later(500);
  expect(saves()).toHaveLength(1);
  expect(saves()[0]).toMatchObject({ session: "session 1", step: 0 });
  expect(times()).toEqual([
    [4, 1_200],
    [3, 1_200],
  ]);

  // The page is loaded again 20 s later.
  await mount(null);
  state.stepAgeMs = 20_000n;
  clock.mockReturnValue(100);
  await show();
  expect(input(4, 'input[value="2"]').checked).toBe(true);
  expect(root.querySelectorAll<HTMLInputElement>('[data-item="3"] input')[2]?.checked).toBe(true);
  clock.mockReturnValue(400);
  await act(() => input(1, 'input[value="5"]').click());
  // At once, because the page is hidden before the pause is over.
  vi.spyOn(document, "visibilityState", "get").mockReturnValue("hidden");
  await act(async () => void document.dispatchEvent(new Event("visibilitychange")));
  expect(times()).toEqual([
    [4, 1_200],
    [1, 20_300],
    [3, 1_200],
  ]);

  // The next questionnaire begins empty, and its times at nothing.
  await type(input(2, 'input[type="range"]'), "35");
  clock.mockReturnValue(900);
  await press("Send the answers");
  expect(root.querySelectorAll("input:checked")).toHaveLength(0);
  clock.mockReturnValue(1_000);
  await act(() => input(4, 'input[value="1"]').click());
  await later(500);
  expect(saves().at(-1)).toMatchObject({ step: 1 });
  expect(times()).toEqual([[4, 100]]);
});

test("traces name what was touched and how long, and wait for the server", async () => {
  root.innerHTML = '<i data-card="7"></i><b data-action="pass"></b><u data-part="sheet log"></u><s></s>';
  const [card, pass, log, other] = [...root.children];
  expect([card, pass, log, other].map((element) => targetOf(element ?? null))).toEqual([
    "card:7",
    "pass",
    "part:log",
    undefined,
  ]);
  const live = signal(startLive(emptyTable(), 0));
  const batches: Trace[][] = [];
  const send = vi.fn(async (traces: Trace[]) => {
    if (batches.length === 0 && send.mock.calls.length === 1) throw new Error("away");
    batches.push(traces);
  });
  let nowMs = 1_000;
  vi.spyOn(performance, "now").mockImplementation(() => nowMs);
  const tracing = startTracing(root, live, send);
  tracing.pick("7", true);
  card?.dispatchEvent(new Event("pointerover", { bubbles: true }));
  nowMs = 1_050;
  // Passing by.
  log?.dispatchEvent(new Event("pointerover", { bubbles: true }));
  nowMs = 1_950;
  root.dispatchEvent(new Event("pointerleave"));
  tracing.answered(12);
  await vi.advanceTimersByTimeAsync(5_000);
  expect(batches).toEqual([]);
  await vi.advanceTimersByTimeAsync(5_000);
  expect(batches.flat().map(({ kind, target, atMs, durationMs }) => [kind, target, atMs, durationMs])).toEqual([
    [StudyTraceKind.CARD_PICKED, "card:7", 0n, 0],
    [StudyTraceKind.HOVER, "part:log", 50n, 900],
    [StudyTraceKind.ANSWER_SENT, "action:12", 950n, 0],
  ]);
  tracing.stop();
  pass?.dispatchEvent(new Event("pointerover", { bubbles: true }));
  await vi.advanceTimersByTimeAsync(60_000);
  expect(send).toHaveBeenCalledTimes(2);
});

test("a seat whose kind a study hides has its name, and is not free", async () => {
  const seat = seatFromParticipant(create(ParticipantSchema, { seat: 0, name: "Player 1", connected: true }));
  await mount(<SeatPanel table={emptyTable([seat])} seat={seat} deciding={false} />);
  expect(root.querySelector("h2")?.textContent).toBe("Player 1");
  expect(root.querySelector('[data-part~="kind-badge"]')).toBeNull();
});
