// A seat's stream: the effect of each update on the open decision, the attachment and the table.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { describe, expect, test } from "vitest";
import {
  AnswerStatus,
  DecisionKind,
  type GiftRequirementSchema,
  ObservationSchema,
  type PlayRequirementSchema,
} from "../src/gen/chefshat/v1/decision_pb";
import { DecisionSource } from "../src/gen/chefshat/v1/event_pb";
import { DetachReason, type SeatUpdate, SeatUpdateSchema } from "../src/gen/chefshat/v1/play_service_pb";
import { ParticipantKind } from "../src/gen/chefshat/v1/room_pb";
import { Role, SpecialAction } from "../src/gen/chefshat/v1/rules_pb";
import * as en from "../src/i18n/en";
import { maskOf } from "../src/table/model/actions";
import { awaitedSeconds } from "../src/table/model/awaited";
import { applyUpdate, type LiveState, startLive } from "../src/table/model/live";
import { legalMoves } from "../src/table/model/picking";
import { emptyTable } from "../src/table/model/state";
import { firstTable } from "../src/tutorial/lessons";
import { recorded, seenBy } from "./record";

type Init = NonNullable<MessageInitShape<typeof SeatUpdateSchema>["update"]>;
const update = (init: Init): SeatUpdate => create(SeatUpdateSchema, { update: init });
const updated = (live: LiveState, ...updates: Init[]) => {
  return updates.reduce((state, init) => applyUpdate(state, update(init), 1000), live);
};

const PASS = 199;
const OWN = 0;
const start = () => updated(startLive(firstTable("Rosa")), { case: "attached", value: { seat: OWN } });
interface Asked {
  kind?: DecisionKind;
  playRequirement?: MessageInitShape<typeof PlayRequirementSchema>;
  giftRequirement?: MessageInitShape<typeof GiftRequirementSchema>;
  specialAction?: SpecialAction;
}
const decision = (id: bigint, asked: Asked = {}): Init => ({
  case: "decision",
  value: {
    decisionId: id,
    kind: DecisionKind.TURN,
    actionMask: maskOf([0, PASS], 11),
    timeLeftMs: 9000,
    bankLeftMs: 60_000,
    invalidAttemptsLeft: 10,
    observation: {
      shift: 1,
      pizza: 1,
      hand: Uint8Array.of(1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 1),
      golden: true,
      cardsLeft: Uint8Array.of(4, 9, 9, 9),
      passed: Uint8Array.of(0, 1, 0, 0),
      places: new Uint8Array(4),
      roles: Uint8Array.of(1, 2, 4, 5),
      points: [5n, 3n, 1n, 0n],
      played: new Uint8Array(12),
    },
    ...asked,
  },
});
const events = (...kinds: Extract<Init, { case: "events" }>["value"]["events"] & object): Init => {
  return { case: "events", value: { events: kinds } };
};
const result = (id: bigint, status: AnswerStatus): Init => {
  return { case: "result", value: { decisionId: id, status, invalidAttemptsLeft: 9 } };
};

describe("an open decision", () => {
  const open = updated(start(), decision(7n));

  test("has the legal actions, the hand and the time", () => {
    expect(open.decision).toMatchObject({ id: 7n, legal: [0, PASS], timeLeftMs: 9000, receivedAtMs: 1000 });
    expect(legalMoves(open.decision?.legal ?? [], 11).at(-1)).toEqual({ kind: "pass" });
    expect(open.decision?.hand.map((card) => card.kind)).toEqual(["face", "golden", "face", "joker"]);
    expect(open.table.next).toBe(OWN);
    expect(open.table.seats[1]).toMatchObject({ passed: true, role: Role.SOUS_CHEF, points: 3 });
  });

  const closing: [string, Init, boolean][] = [
    ["an accepted answer", result(7n, AnswerStatus.ACCEPTED), true],
    ["an answer that came too late", result(7n, AnswerStatus.CLOSED), true],
    ["an invalid answer", result(7n, AnswerStatus.INVALID), false],
    ["an answer to an older decision", result(6n, AnswerStatus.CLOSED), false],
    ["the seat's own pass", events({ sequence: 1n, kind: { case: "pass", value: { seat: OWN } } }), true],
    [
      "a default after a timeout",
      events({ sequence: 1n, kind: { case: "pass", value: { seat: OWN, source: DecisionSource.TIMEOUT } } }),
      true,
    ],
    ["another seat's pass", events({ sequence: 1n, kind: { case: "pass", value: { seat: 2 } } }), false],
    ["a substitute", events({ sequence: 1n, kind: { case: "substituted", value: { seat: OWN } } }), true],
    ["another window", { case: "detached", value: { reason: DetachReason.SUPERSEDED } }, true],
    ["a new connection", { case: "attached", value: { seat: OWN } }, true],
  ];
  test.each(closing)("after %s", (_, next, closed) => {
    expect(updated(open, next).decision === undefined).toBe(closed);
  });

  test("keeps count of invalid attempts", () => {
    expect(updated(open, result(7n, AnswerStatus.INVALID)).decision?.attemptsLeft).toBe(9);
  });

  test("in an exchange, leaves the table's hand to the events", () => {
    const giving = updated(start(), decision(8n, { kind: DecisionKind.EXCHANGE }));
    expect(giving.decision?.hand).toHaveLength(4);
    expect(giving.table.seats[OWN]?.hand).toHaveLength(9);
  });

  test("has the server's requirements for a play or a gift", () => {
    const playRequirement = { lowestFace: 1, highestFace: 4, fewestCards: 2, goldenCard: false, loneJoker: false };
    const turn = updated(start(), decision(7n, { playRequirement }));
    expect(turn.decision?.requirement).toMatchObject(playRequirement);
    expect(turn.decision?.gift).toBeUndefined();
    const giftRequirement = { number: 2, total: 2, receiver: 3 };
    const gift = updated(start(), decision(8n, { kind: DecisionKind.EXCHANGE, giftRequirement }));
    expect(gift.decision?.gift).toMatchObject(giftRequirement);
    expect(gift.decision?.requirement).toBeUndefined();
    const specialAction = SpecialAction.FOOD_FIGHT;
    const special = updated(start(), decision(9n, { kind: DecisionKind.SPECIAL_ACTION, specialAction }));
    expect(special.decision?.special).toBe(specialAction);
  });
});

describe("a substitution that others do not see", () => {
  const substitution = (active: boolean): Init => ({ case: "substitution", value: { active } });

  test("closes the open decision, and ends when the seat is back or attached again", () => {
    const away = updated(updated(start(), decision(7n, {})), substitution(true));
    expect([away.substituted, away.decision]).toEqual([true, undefined]);
    expect(updated(away, substitution(false)).substituted).toBe(false);
    expect(updated(away, { case: "attached", value: { seat: 0 } }).substituted).toBe(false);
  });
});

describe("whom the game waits for", () => {
  const awaited = (value: Extract<Init, { case: "awaited" }>["value"]): Init => ({ case: "awaited", value });
  const away = updated(start(), awaited({ seat: 2, away: true, waitedMs: 8000, leftMs: 12_400 })).awaited;

  test("counts down for a seat that is away", () => {
    if (!away) throw new Error("nobody is awaited");
    expect(away).toMatchObject({ seat: 2, receivedAtMs: 1000 });
    expect([1000, 1400, 1401, 99_000].map((nowMs) => awaitedSeconds(away, nowMs))).toEqual([13, 12, 12, 0]);
  });

  test("does not count down for a seat that is away where nobody may know how long", () => {
    const unknown = updated(start(), awaited({ seat: 2, away: true, waitedMs: 8000 })).awaited;
    if (!unknown) throw new Error("nobody is awaited");
    expect(awaitedSeconds(unknown, 2000)).toBeUndefined();
    expect(en.table.now.awaitedAway("Ada", undefined)).toBe("Waiting for Ada (away)");
  });

  test("counts up for a seat that is connected, once that is worth saying", () => {
    const here = updated(start(), awaited({ seat: 2, away: false, waitedMs: 1000, leftMs: 60_000 })).awaited;
    if (!here) throw new Error("nobody is awaited");
    expect([1000, 4999, 5000, 9500].map((nowMs) => awaitedSeconds(here, nowMs))).toEqual([undefined, undefined, 5, 9]);
  });

  test("is nobody after a message without a seat, and on a new connection", () => {
    const waiting = updated(start(), awaited({ seat: 0, away: true, waitedMs: 0, leftMs: 1 }));
    expect(waiting.awaited?.seat).toBe(0);
    expect(updated(waiting, awaited({})).awaited).toBeUndefined();
    expect(updated(waiting, { case: "attached", value: { seat: OWN } }).awaited).toBeUndefined();
  });
});

test("the seat's attachment and substitution are known", () => {
  expect(start().attachment).toEqual({ kind: "attached" });
  const other = updated(start(), { case: "detached", value: { reason: DetachReason.SUPERSEDED } });
  expect(other.attachment).toEqual({ kind: "superseded" });
  const over = updated(start(), { case: "detached", value: { reason: DetachReason.GAME_OVER } });
  expect(over.attachment).toEqual({ kind: "over" });
  const left = updated(start(), { case: "detached", value: { reason: DetachReason.REQUESTED } });
  expect(left.attachment).toEqual({ kind: "left" });
  const refused = updated(start(), { case: "refused", value: { reason: "TICKET_UNKNOWN", message: "no" } });
  expect(refused.attachment).toEqual({ kind: "refused", reason: "TICKET_UNKNOWN", message: "no" });
  const replaced = updated(start(), events({ sequence: 1n, kind: { case: "substituted", value: { seat: OWN } } }));
  expect(replaced.substituted).toBe(true);
  expect(
    updated(replaced, events({ sequence: 2n, kind: { case: "returned", value: { seat: OWN } } })).substituted,
  ).toBe(false);
});

test("reconnecting in the middle of a game leads to the same table", () => {
  const all = recorded("fixed").flatMap(({ line }) => (line.case === "event" ? [seenBy(line.value, 1)] : []));
  const gameId = "389c0885c0fb41a76b7ff2acb2626d27";
  const attached: Init = { case: "attached", value: { seat: 1, gameId } };
  const whole = updated(startLive(emptyTable()), attached, { case: "events", value: { events: all } });
  // The second connection repeats some events.
  const half = updated(startLive(emptyTable()), attached, { case: "events", value: { events: all.slice(0, 60) } });
  const resumed = updated(half, attached, { case: "events", value: { events: all.slice(55) } });
  expect(resumed.table).toEqual(whole.table);
  expect(whole.table.phase).toBe("gameOver");
});

test("a snapshot stands for the events so far", () => {
  const observation = create(ObservationSchema, {
    shift: 2,
    pizza: 3,
    hand: Uint8Array.of(0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
    boardFace: 9,
    boardSize: 3,
    boardJokers: 1,
    cardsLeft: Uint8Array.of(1, 4),
    passed: Uint8Array.of(0, 1),
    places: Uint8Array.of(0, 0),
    roles: Uint8Array.of(1, 5),
    points: [5n, 0n],
    played: new Uint8Array(12),
  });
  const seats = [
    { seat: 0, name: "Rosa", kind: ParticipantKind.HUMAN },
    { seat: 1, name: "Greta", kind: ParticipantKind.AGENT },
  ];
  const snapshot = { gameStarted: { gameId: "1", rules: { faces: 11, jokers: 2 }, seats }, observation };
  const live = updated(
    startLive(emptyTable(), 0),
    { case: "attached", value: { seat: 0 } },
    { case: "snapshot", value: { ...snapshot, nextSequence: 90n } },
  );
  expect(live.table).toMatchObject({ shift: 2, pizza: 3, phase: "pizza", nextSequence: 90 });
  expect(live.table.board.map((card) => card.kind)).toEqual(["face", "face", "joker"]);
  expect(live.table.seats[0]?.hand).toEqual([{ kind: "face", face: 2 }]);
  expect(live.table.seats[1]).toMatchObject({ hand: undefined, cardsLeft: 4, passed: true });
});
