// The attendant's view: what it shows of each state, and the reports that its controls send.

import { create } from "@bufbuild/protobuf";
import { act } from "preact/test-utils";
import { beforeEach, describe, expect, test, vi } from "vitest";
import { tableApi } from "../src/api/client";
import { secretsFor } from "../src/api/secrets";
import { AttendPage } from "../src/attend/AttendPage";
import { AttendView, pictureSource } from "../src/attend/AttendView";
import type { Outcome, ReportKind } from "../src/attend/attending";
import { DecisionKind } from "../src/gen/chefshat/v1/decision_pb";
import { RoomPolicySchema, Visibility } from "../src/gen/chefshat/v1/room_pb";
import { ViolatedRule } from "../src/gen/chefshat/v1/table_pb";
import { TableServiceWatchResponseSchema, TableStage, type TableState } from "../src/gen/chefshat/v1/table_service_pb";
import { setLanguage } from "../src/i18n";
import { forgetAll } from "../src/store";
import { fieldOf, mount, root, settle, type as typeInto } from "./mounted";
import { DEALT, OBSERVATION, stateOf } from "./table-state";

let sent: ReportKind[];
let outcome: Outcome;

beforeEach(() => {
  sent = [];
  outcome = { kind: "accepted" };
});

const show = (state: TableState) =>
  mount(
    <AttendView
      state={state}
      trouble=""
      report={async (what) => {
        sent.push(what);
        return outcome;
      }}
    />,
  );

/** The accessible name of a button. */
const nameOf = (button: Element) => (button.getAttribute("aria-label") ?? button.textContent ?? "").trim();
const button = (name: string, within: ParentNode = root) => {
  const found = [...within.querySelectorAll("button")].filter((one) => nameOf(one) === name);
  if (!found[0]) throw new Error(`no button "${name}", but ${[...within.querySelectorAll("button")].map(nameOf)}`);
  return found[0];
};
/** Presses a button, and lets what it sends be answered. */
const press = (name: string, within?: ParentNode) => act(() => button(name, within).click()).then(settle);
const part = (name: string) => root.querySelector(`[data-part~="${name}"]`);
const heading = () => part("awaited-heading")?.textContent?.replace(/^\d/, "");
const type = (label: string, text: string) => typeInto(fieldOf(label), text);

describe("what the table waits for", () => {
  test.each([
    [{ stage: TableStage.WAITING }, "Waiting for remote players"],
    [{ stage: TableStage.HAND, seat: 2 }, "Show the hand of Cleo"],
    [{ stage: TableStage.SPECIAL_ACTION, seat: undefined }, "Does anyone declare a special action?"],
    [{ stage: TableStage.SPECIAL_ACTION, seat: 2 }, "Cleo decides about a special action"],
    [{ stage: TableStage.GIFT, seat: 1 }, "Bo gives cards"],
    [{ stage: TableStage.GIFT, seat: 2 }, "Cleo chooses what to give"],
    [{ stage: TableStage.OPENING, seat: undefined }, "The player with the Golden 11 opens the Shift"],
    [{}, "Ada to play"],
    [{ seat: 2 }, "Cleo is deciding"],
    [{ stage: TableStage.QUESTION, seat: undefined }, "A question to you"],
    [{ stage: TableStage.CONFIRMATION, seat: undefined }, "Was the last play read correctly?"],
    [{ stage: TableStage.OVER, seat: undefined }, "The game is over"],
  ])("%o", async (changed, words) => {
    await show(stateOf(changed));
    expect(heading()).toBe(words);
  });

  test("is shown with what a play must be, the board and the seats", async () => {
    await show(stateOf());
    expect(part("awaited")?.textContent).toContain("8 or lower");
    expect(part("awaited")?.textContent).toContain("3+ cards");
    expect(part("board-words")?.textContent).toBe("two 9s with a joker");
    const seats = [...root.querySelectorAll('[data-part~="attend-seat"]')].map(({ textContent }) => textContent);
    expect(seats[0]).toContain("16 cards");
    expect(seats[2]).toMatch(/remote.*hand known/);
    expect(seats[3]).toMatch(/at the table.*passed.*hand not known/);
  });

  test("can be paused and resumed", async () => {
    await show(stateOf());
    await press("❚❚ Pause");
    await show(stateOf({ paused: true }));
    expect(part("awaited")?.textContent).toContain("Clocks stand still");
    await press("▶ Continue");
    expect(sent).toEqual([
      { case: "pause", value: { paused: true } },
      { case: "pause", value: { paused: false } },
    ]);
  });
});

test("the play that ended the game is confirmed, or corrected; nothing else is entered", async () => {
  await show(stateOf({ stage: TableStage.CONFIRMATION, seat: undefined }));
  expect(part("entry")).toBeNull();
  expect(part("reports")).not.toBeNull();
  await press("Yes, the game is over");
  expect(sent).toEqual([{ case: "endConfirmed", value: {} }]);
});

describe("entering by hand", () => {
  test("a play: the face, how many, jokers", async () => {
    await show(stateOf());
    await press("5, chilli");
    expect(button("Ada lays three 5s")).toBeTruthy();
    await press("More: How many");
    await press("More: Jokers with them");
    await press("Ada lays four 5s with a joker");
    expect(sent).toEqual([{ case: "laid", value: { seat: 0, cards: { cards: [5, 5, 5, 5, 12], golden: false } } }]);
    expect(button("Report the play").getAttribute("aria-disabled")).toBe("true");
  });

  test("a play that is being entered stays with its seat when the table waits for another", async () => {
    await show(stateOf());
    await press("5, chilli");
    await show(stateOf({ seat: 1 }));
    await press("Ada lays three 5s");
    expect(sent).toMatchObject([{ case: "laid", value: { seat: 0 } }]);
    await press("Bo passes");
    expect(sent).toMatchObject([{ case: "laid" }, { case: "pass", value: { seat: 1 } }]);
  });

  test("a play that is not allowed is marked, and can be reported all the same", async () => {
    await show(stateOf());
    await press("10, tomato, not allowed now");
    await press("Ada lays three 10s");
    expect(sent).toHaveLength(1);
  });

  test("keeps what was entered if it does not count", async () => {
    await show(stateOf());
    await press("5, chilli");
    outcome = { kind: "violation" };
    await press("Ada lays three 5s");
    expect(button("Ada lays three 5s")).toBeTruthy();
    outcome = { kind: "fault", words: "The server does not answer." };
    await press("Ada lays three 5s");
    expect(part("entry")?.querySelector("[role=alert]")?.textContent).toContain("The server does not answer.");
  });

  test("the opening is the Golden card's, of a seat that need not be known", async () => {
    const playRequirement = { lowestFace: 11, highestFace: 11, fewestCards: 1, goldenCard: true };
    await show(stateOf({ stage: TableStage.OPENING, seat: undefined, observation: DEALT, playRequirement }));
    expect([...root.querySelectorAll("button")].map(nameOf)).not.toContain("Pass");
    await press("11, mozzarella");
    await press("Report the play");
    await press("11, mozzarella");
    await press("2 Bo");
    await press("Bo lays the Golden 11");
    expect(sent).toEqual([
      { case: "laid", value: { cards: { cards: [11], golden: true } } },
      { case: "laid", value: { seat: 1, cards: { cards: [11], golden: true } } },
    ]);
  });

  test("is for players at the table: what a remote one decides is laid for it", async () => {
    await show(stateOf({ seat: 2 }));
    const who = [...root.querySelectorAll('[data-part~="entry"] [aria-pressed]')].map(nameOf);
    expect(who).not.toContain("3 Cleo");
    await press("5, chilli");
    await press("Report the play");
    expect(sent).toEqual([]);
    await press("2 Bo");
    await press("Bo lays three 5s");
    expect(sent).toHaveLength(1);
  });

  test("a pass, a pass taken back, a cleared board", async () => {
    await show(stateOf());
    await press("Ada passes");
    await press("Pass taken back");
    await press("Dan takes the pass back");
    await press("Board cleared");
    await press("The board was cleared");
    expect(sent).toEqual([
      { case: "pass", value: { seat: 0 } },
      { case: "passWithdrawn", value: { seat: 3 } },
      { case: "cleared", value: {} },
    ]);
  });

  test("a hand, typed and tapped, must have as many cards as the seat", async () => {
    await show(
      stateOf({ stage: TableStage.HAND, seat: 2, observation: { ...DEALT, cardsLeft: Uint8Array.of(4, 4, 4, 4) } }),
    );
    await type("Cards", "j, 2x7");
    await press("This is the hand of Cleo");
    expect(sent).toEqual([]);
    await press("Add 11, mozzarella");
    await act(() => root.querySelector<HTMLInputElement>('[data-part~="entry"] [type=checkbox]')?.click());
    await press("This is the hand of Cleo");
    expect(sent).toEqual([{ case: "hand", value: { seat: 2, cards: { cards: [7, 7, 11, 12], golden: true } } }]);
  });

  test("typed cards that the deck does not have are refused", async () => {
    await show(stateOf({ stage: TableStage.HAND, seat: 2 }));
    await type("Cards", "2 2 2");
    expect(part("entry")?.querySelector("[role=alert]")?.textContent).toBe("The deck has only 2 cards of face 2.");
    await type("Cards", "2 pizza");
    expect(part("entry")?.querySelector("[role=alert]")?.textContent).toContain("“pizza” is not a card");
  });

  test("special actions, gifts and roles before the first turn of a later Shift", async () => {
    const observation = { ...DEALT, shift: 2, pizza: 0, roles: Uint8Array.of(1, 2, 4, 5) };
    await show(stateOf({ stage: TableStage.SPECIAL_ACTION, seat: undefined, observation }));
    await press("Nobody declares");
    await press("Dan declares");
    await press("Gift");
    await press("4 Dan");
    await press("Dan gave, cards not seen");
    await press("Gift");
    await press("4 Dan");
    await press("Add 1, truffle");
    await press("Add 2, shrimp");
    await press("Dan gave these cards");
    await press("Role taken");
    await press("1 Ada");
    await press("Chef");
    await press("Ada is Chef");
    expect(sent).toEqual([
      { case: "special", value: {} },
      { case: "special", value: { seat: 3 } },
      { case: "gift", value: { seat: 3 } },
      { case: "gift", value: { seat: 3, cards: { cards: [1, 2], golden: false } } },
      { case: "role", value: { seat: 0, role: 1 } },
    ]);
  });
});

describe("what is to be done for remote players", () => {
  const toLay = [
    { seat: 2, kind: DecisionKind.TURN, cards: { cards: [7, 7, 12], golden: false } },
    { seat: 2, kind: DecisionKind.TURN, cards: { cards: [] } },
    { seat: 2, kind: DecisionKind.EXCHANGE, cards: { cards: [3], golden: false }, receiver: 1 },
    { seat: 2, kind: DecisionKind.SPECIAL_ACTION },
  ];

  test("has words, cards, and a button that reports it", async () => {
    await show(stateOf({ toLay }));
    const items = [...root.querySelectorAll('[data-part~="to-lay-item"]')];
    const words = ["Lay for Cleo", "Show the pass card of Cleo", "Give from Cleo to Bo"];
    expect(items.map(({ textContent }, index) => textContent?.includes(words[index] ?? "Dinner is Served"))).toEqual(
      items.map(() => true),
    );
    expect(items[0]?.querySelectorAll('[data-part~="card"]')).toHaveLength(3);
    for (const item of items) await press(nameOf(item.querySelector("button") ?? item), item);
    expect(sent).toMatchObject([
      { case: "laid", value: { seat: 2, cards: { cards: [7, 7, 12] } } },
      { case: "pass", value: { seat: 2 } },
      { case: "gift", value: { seat: 2, cards: { cards: [3] } } },
      { case: "special", value: { seat: 2 } },
    ]);
  });
});

describe("a question", () => {
  const question = { questionId: "q", text: "7 or 9 at place 4?", options: ["7", "9"] };

  test("is answered with one of its options, or withdrawn", async () => {
    await show(stateOf({ questions: [{ ...question, picture: Uint8Array.of(0xff, 0xd8) }] }));
    const card = part("question-card");
    if (!card) throw new Error("no question");
    expect(card.querySelector("img")?.getAttribute("src")).toBe("data:image/jpeg;base64,/9g=");
    await press("9", card);
    await press("No answer", card);
    expect(sent).toEqual([
      { case: "answer", value: { questionId: "q", option: 1 } },
      { case: "answer", value: { questionId: "q" } },
    ]);
  });

  test.each([
    ["Did Ada pass?", "it", "Ada: ha passato?"],
    ["Did Ada, Bo and Cleo pass?", "it", "Ada, Bo e Cleo: hanno passato?"],
    ["Did Ada, Bo and Cleo pass?", "de", "Haben Ada, Bo und Cleo gepasst?"],
    ["Did Ada pass?", "es", "¿Ha pasado Ada?"],
    ["Did Ada and Inés pass?", "es", "¿Han pasado Ada e Inés?"],
    ["Did Ada and Bo pass?", "es", "¿Han pasado Ada y Bo?"],
    ["Who opened the Shift?", "it", "Chi ha aperto lo Shift?"],
    ["Is that a new play by Bo?", "it", "Bo: è una nuova giocata?"],
    ["Is that a new play by Bo?", "de", "Ist das ein neuer Zug von Bo?"],
    ["7 or 9 at place 4?", "it", "7 or 9 at place 4?"],
  ] as const)("of the referee, %s, has words in %s", async (text, language, words) => {
    await setLanguage(language);
    await show(stateOf({ questions: [{ ...question, text }] }));
    expect(part("question-card")?.querySelector("h2")?.textContent).toBe(words);
    await setLanguage("en");
  });

  test.each([
    ["Yes", "Ja"],
    ["No", "Nein"],
    ["No, Bo passed before 9 9 J", "Nein, Bo hatte davor gepasst (9 9 J)"],
    ["7", "7"],
  ])("of the referee has the option %s in German", async (option, words) => {
    await setLanguage("de");
    await show(stateOf({ questions: [{ ...question, options: [option] }] }));
    expect(part("question-card")?.querySelector("button")?.textContent).toBe(words);
    await setLanguage("en");
  });

  test("without a picture shows none", () => {
    expect(pictureSource(new Uint8Array())).toBeUndefined();
    expect(pictureSource(Uint8Array.of(0x89))).toMatch(/^data:image\/png/);
  });
});

describe("a violation", () => {
  const violation = { seat: 0, rule: ViolatedRule.FACE, text: "That pizza already shows 9s.", report: 4n };

  test("is shown with what to do, until it is dismissed or another comes", async () => {
    await show(stateOf({ violation }));
    expect(part("violation")?.getAttribute("role")).toBe("alert");
    expect(part("violation")?.textContent).toContain("Ada: That pizza already shows 9s.");
    await press("Taken back");
    expect(part("violation")).toBeNull();
    await show(stateOf({ violation: { ...violation, report: 5n } }));
    expect(part("violation")).not.toBeNull();
    expect(sent).toEqual([]);
  });

  test("that was misread leads to entering what really lies there", async () => {
    await show(stateOf({ violation: { ...violation, seat: 1 } }));
    await press("Enter what really lies there");
    expect(document.activeElement?.textContent).toBe("Enter by hand");
    await press("3, anchovy");
    await press("Bo lays three 3s");
    expect(sent).toEqual([{ case: "laid", value: { seat: 1, cards: { cards: [3, 3, 3], golden: false } } }]);
  });

  test("has an Italian sentence", async () => {
    await setLanguage("it");
    await show(stateOf({ violation }));
    expect(part("violation")?.textContent).toContain("Ada: Sul piatto ci sono già carte di valore 9");
    await setLanguage("en");
  });
});

describe("the reports of the Shift", () => {
  const report = (number: bigint, kind: ReportKind) => ({ report: number, seat: 1, text: "…", content: { kind } });
  const reports = [
    { ...report(1n, { case: "hand", value: { seat: 2 } }), seat: 2 },
    report(2n, { case: "laid", value: { seat: 1, cards: { cards: [9, 9, 12], golden: false } } }),
    report(3n, { case: "pass", value: { seat: 3 } }),
  ];
  const item = (index: number) => {
    const found = root.querySelectorAll('[data-part~="report"]')[index];
    if (!found) throw new Error("no such report");
    return found;
  };

  test("are listed, the newest first", async () => {
    await show(stateOf({ reports }));
    const words = [...root.querySelectorAll('[data-part~="report"] p')].map(({ textContent }) => textContent);
    expect(words).toEqual(["2 Dan passed", "2 Bo laid two 9s with a joker", "3 The hand of Cleo was seen"]);
  });

  test("are shown eight at a time, or all", async () => {
    const many = Array.from({ length: 20 }, (_, index) => report(BigInt(index), { case: "pass", value: { seat: 1 } }));
    await show(stateOf({ reports: many }));
    expect(root.querySelectorAll('[data-part~="report"]')).toHaveLength(8);
    await press("Show more");
    expect(root.querySelectorAll('[data-part~="report"]')).toHaveLength(20);
  });

  test("can be changed into what happened instead", async () => {
    await show(stateOf({ reports }));
    await press("Change: Bo laid two 9s with a joker", item(1));
    const dialog = part("change");
    if (!dialog) throw new Error("no dialog");
    expect(button("Bo lays two 9s with a joker", dialog)).toBeTruthy();
    await press("6, basil", dialog);
    outcome = { kind: "violation" };
    await press("Bo lays two 6s with a joker", dialog);
    expect(part("change")?.querySelector("[role=alert]")).not.toBeNull();
    outcome = { kind: "void", count: 2 };
    await press("Bo passes", dialog);
    expect(part("change")).toBeNull();
    expect(part("entry")?.textContent).toContain("2 later reports no longer fit");
    expect(sent).toEqual([
      {
        case: "correction",
        value: {
          report: 2n,
          instead: { kind: { case: "laid", value: { seat: 1, cards: { cards: [6, 6, 12], golden: false } } } },
        },
      },
      { case: "correction", value: { report: 2n, instead: { kind: { case: "pass", value: { seat: 1 } } } } },
    ]);
  });

  test("a play of whom is only assumed can be moved to another seat", async () => {
    const moved = reports.map((one) => ({ ...one, assumedSeat: one.report === 2n }));
    await show(stateOf({ reports: moved }));
    expect(item(1).textContent).toContain("(who it was is assumed)");
    expect(item(0).textContent).not.toContain("assumed");
    await press("Change: Bo laid two 9s with a joker", item(1));
    const dialog = part("change");
    if (!dialog) throw new Error("no dialog");
    await press("1 Ada", dialog);
    await press("Ada lays two 9s with a joker", dialog);
    expect(sent).toMatchObject([
      { case: "correction", value: { report: 2n, instead: { kind: { case: "laid", value: { seat: 0 } } } } },
    ]);
  });

  test("a corrected hand is as it was then", async () => {
    await show(stateOf({ reports }));
    await press("Change: The hand of Cleo was seen", item(2));
    await type("Cards", "1 11");
    const dialog = part("change");
    if (!dialog) throw new Error("no dialog");
    await act(() => dialog.querySelector<HTMLInputElement>("[type=checkbox]")?.click());
    await press("This is the hand of Cleo", dialog);
    const instead = { kind: { case: "hand", value: { seat: 2, cards: { cards: [1, 11], golden: true } } } };
    expect(sent).toEqual([{ case: "correction", value: { report: 1n, instead } }]);
  });

  test("can be removed, after a confirmation", async () => {
    await show(stateOf({ reports }));
    await press("Remove", item(0));
    expect(sent).toEqual([]);
    await press("Remove", item(0));
    expect(sent).toEqual([{ case: "correction", value: { report: 3n } }]);
  });

  test("can be removed again if that was refused", async () => {
    await show(
      stateOf({ reports, violation: { rule: ViolatedRule.CORRECTION, text: "Its pizza is over.", report: 9n } }),
    );
    await press("Remove", item(1));
    outcome = { kind: "violation" };
    await press("Remove", item(1));
    expect(item(1).querySelector("[role=alert]")?.textContent).toContain("Its pizza is over.");
    await press("Remove", item(1));
    expect(sent).toHaveLength(2);
  });
});

test("before the game there is nothing to enter", async () => {
  await show(stateOf({ stage: TableStage.WAITING, seat: undefined, observation: undefined }));
  expect(part("entry")).toBeNull();
  expect(root.querySelectorAll('[data-part~="attend-seat"]')).toHaveLength(4);
  expect(OBSERVATION.shift).toBe(1);
});

/** A view whose reports wait until they are answered, one after another. */
async function showWaiting(state: TableState): Promise<(outcome?: Outcome) => Promise<void>> {
  const waiting: ((outcome: Outcome) => void)[] = [];
  const report = (what: ReportKind) => {
    sent.push(what);
    return new Promise<Outcome>((resolve) => waiting.push(resolve));
  };
  await mount(<AttendView state={state} trouble="" report={report} />);
  return async (outcome = { kind: "accepted" }) => {
    waiting.shift()?.(outcome);
    await settle();
  };
}

test("a button that is pressed twice reports once", async () => {
  const answer = await showWaiting(stateOf());
  await press("Ada passes");
  await press("Ada passes");
  await answer();
  expect(sent).toHaveLength(1);
  await press("Ada passes");
  expect(sent).toHaveLength(2);
});

test("another report waits for the one that is under way, and is not lost", async () => {
  const answer = await showWaiting(stateOf());
  await press("Ada passes");
  await press("❚❚ Pause");
  expect(sent.map((one) => one.case)).toEqual(["pass"]);
  await answer();
  expect(sent.map((one) => one.case)).toEqual(["pass", "pause"]);
});

test("what was pressed while a report was refused is not sent, and the page says so", async () => {
  const answer = await showWaiting(stateOf());
  await press("Ada passes");
  await press("❚❚ Pause");
  await answer({ kind: "violation" });
  expect(sent.map((one) => one.case)).toEqual(["pass"]);
  expect(root.textContent).toContain("Not sent");
});

test("a device that had only the ticket of a private table shows its replay after the end", async () => {
  const roomId = "5f0c6a4de2b14b7f8a3d9c1e7b60425d";
  const ticket = roomId + "ab".repeat(32);
  history.replaceState(null, "", `/rooms/${roomId}/table#ticket=${ticket}`);
  const state = stateOf({ stage: TableStage.OVER, seat: undefined });
  if (state.room) state.room.policy = create(RoomPolicySchema, { visibility: Visibility.PRIVATE });
  vi.spyOn(tableApi, "watch").mockImplementation(async function* () {
    yield create(TableServiceWatchResponseSchema, { state });
  });
  await mount(<AttendPage route={{ page: "attend", roomId }} />);
  await settle();
  expect(heading()).toBe("The game is over");
  await mount(null);
  expect(secretsFor("GetRecord", { gameId: "g1" })).toEqual([ticket]);
  forgetAll();
  history.replaceState(null, "", "/");
});
