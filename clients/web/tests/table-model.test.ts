// The model of the table against recorded games: after every event it agrees with the server's
// engine, at every decision with the mask of legal actions.

import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { describe, expect, test } from "vitest";
import { DecisionKind } from "../src/gen/chefshat/v1/decision_pb";
import { GameEventSchema } from "../src/gen/chefshat/v1/event_pb";
import { SnapshotSchema } from "../src/gen/chefshat/v1/play_service_pb";
import type { DecisionRecord } from "../src/gen/chefshat/v1/record_pb";
import { Opening, type RuleSetSchema } from "../src/gen/chefshat/v1/rules_pb";
import { actionOf, legalActions, type Move, maskOf, moveOf, turnActions } from "../src/table/model/actions";
import { lookupOf } from "../src/table/model/lookup";
import { canPick, legalMoves, pickedMove, picksOf, reasonAgainst, toggle } from "../src/table/model/picking";
import { applyEvent } from "../src/table/model/reduce";
import { allows, holds, publicRequirement } from "../src/table/model/requirement";
import { applySnapshot } from "../src/table/model/snapshot";
import { emptyTable, type TableState } from "../src/table/model/state";
import { RECORDS, recorded, seenBy } from "./record";

/** Replays a record and calls `look` with each decision and its table; returns the final table. */
function follow(
  name: (typeof RECORDS)[number],
  viewer: number | "all" | undefined,
  look: (decision: DecisionRecord, table: TableState) => void = () => {},
): TableState {
  let table = emptyTable();
  for (const { line } of recorded(name)) {
    if (line.case === "decision") look(line.value, table);
    if (line.case === "event") table = applyEvent(table, viewer === "all" ? line.value : seenBy(line.value, viewer));
  }
  return table;
}

describe.each(RECORDS)("the recorded game %s", (name) => {
  const lines = recorded(name);
  const end = lines.flatMap(({ line }) => (line.case === "event" ? [line.value.kind] : [])).at(-1);
  if (end?.case !== "gameEnded") throw new Error("the fixture has no result");

  test("ends with the result that was recorded", () => {
    const table = follow(name, "all");
    expect(table.phase).toBe("gameOver");
    expect(table.standings).toHaveLength(table.seats.length);
    for (const { seat, points } of end.value.standings) expect(table.seats[seat]?.points).toBe(Number(points));
  });

  test("finds exactly the legal actions in the open hands", () => {
    let decisions = 0;
    follow(name, "all", ({ seat, kind, actionMask, action }, table) => {
      if (kind !== DecisionKind.TURN) return;
      decisions += 1;
      const hand = table.seats[seat]?.hand ?? [];
      const legal = new Set(legalActions(actionMask));
      expect(legal).toContain(action);
      // From the public requirement and the hand alone.
      const requirement = publicRequirement(table);
      const { plays, others } = lookupOf(table, requirement, hand, legal);
      for (const { move, action: number, state } of [...plays.flat(2), ...others]) {
        if (move.kind === "pass") continue;
        expect(allows(requirement, move) && holds(hand, move), `${name} ${JSON.stringify(move)}`).toBe(
          legal.has(number),
        );
        expect(state === "legal").toBe(legal.has(number));
      }
      expect(hand).toHaveLength(table.seats[seat]?.cardsLeft ?? -1);
    });
    expect(decisions).toBeGreaterThan(50);
  });

  test("knows whose turn it is", () => {
    let turns = 0;
    follow(name, undefined, ({ seat, kind }, table) => {
      if (kind !== DecisionKind.TURN || table.turn === 1) return;
      expect(table.next).toBe(seat);
      turns += 1;
    });
    expect(turns).toBeGreaterThan(50);
  });

  test("shows a spectator no card of a hand", () => {
    let table = emptyTable();
    for (const { line } of lines) {
      if (line.case !== "event") continue;
      table = applyEvent(table, seenBy(line.value, undefined));
      expect(table.seats.every((seat) => seat.hand === undefined && seat.received.length === 0)).toBe(true);
    }
  });

  test("shows a seat its own hand as the server sees it", () => {
    follow(name, 1, ({ seat, kind, actionMask }, table) => {
      if (seat !== 1 || kind !== DecisionKind.TURN) return;
      const hand = table.seats[1]?.hand ?? [];
      for (const move of legalMoves(legalActions(actionMask), table.faces)) {
        if (move.kind === "pass") continue;
        expect(pickedMove(hand, picksOf(hand, move), [move])).toEqual(move);
      }
      expect(table.seats[0]?.hand).toBeUndefined();
    });
  });

  test("gives a reason for every card that cannot be picked, and a legal play for every other", () => {
    let refused = 0;
    let ways = 0;
    follow(name, "all", ({ seat, kind, actionMask }, table) => {
      if (kind !== DecisionKind.TURN) return;
      const hand = table.seats[seat]?.hand ?? [];
      const moves = legalMoves(legalActions(actionMask), table.faces);
      hand.forEach((card, index) => {
        if (!canPick(hand, index, moves)) {
          expect(reasonAgainst(publicRequirement(table), hand, index).kind, JSON.stringify(card)).not.toBe("other");
          refused += 1;
          return;
        }
        const picked = toggle(hand, new Set(), index, moves);
        if (card.kind !== "joker") {
          expect(pickedMove(hand, picked, moves)).toBeDefined();
          ways += 1;
        }
        // The Golden card may be picked in place of the plain one that was clicked.
        if (picked.has(index)) expect(toggle(hand, picked, index, moves).has(index)).toBe(false);
      });
    });
    expect(refused).toBeGreaterThan(50);
    expect(ways).toBeGreaterThan(50);
  });
});

/** A table at the first turn of a Shift, with the first seat's hand known. */
function opening(rules: MessageInitShape<typeof RuleSetSchema>, cards: number[]): TableState {
  const events: NonNullable<MessageInitShape<typeof GameEventSchema>["kind"]>[] = [
    { case: "gameStarted", value: { rules, seats: [{ seat: 0 }, { seat: 1 }] } },
    { case: "shiftStarted", value: { shift: 1, hands: [{ seat: 0, cards, golden: true }] } },
  ];
  return events.reduce(
    (table, kind) => applyEvent(table, create(GameEventSchema, { sequence: BigInt(table.nextSequence), kind })),
    emptyTable(),
  );
}

/** The table after a seat plays elevens. */
function playElevens(table: TableState, seat: number, quantity: number): TableState {
  const kind = { case: "play", value: { seat, face: 11, quantity, cardsLeft: 1 } } as const;
  return applyEvent(table, create(GameEventSchema, { sequence: BigInt(table.nextSequence), kind }));
}

const GOLDEN = { kind: "golden", face: 11 };
const ELEVEN = { kind: "face", face: 11 };

describe("the Golden card", () => {
  test("opens the Shift under the standard opening, also where passing is allowed", () => {
    const table = opening({ opening: Opening.GOLDEN, openingPass: true }, [11, 11, 11]);
    expect(playElevens(table, 1, 2).board).toEqual([GOLDEN, ELEVEN]);
    const played = playElevens(table, 0, 2);
    expect([played.board, played.seats[0]?.hand]).toEqual([[GOLDEN, ELEVEN], [ELEVEN]]);
  });

  test("goes last of its face where any top face opens", () => {
    const table = opening({ opening: Opening.ANY_TOP_FACE, openingPass: true }, [11, 11, 11]);
    const played = playElevens(table, 0, 2);
    expect([played.board, played.seats[0]?.hand]).toEqual([[ELEVEN, ELEVEN], [GOLDEN]]);
    expect(playElevens(played, 0, 1).board).toEqual([GOLDEN]);
    expect(playElevens(table, 1, 2).board).toEqual([ELEVEN, ELEVEN]);
  });

  test("is picked first where a play must include it, and last otherwise", () => {
    const hand = opening({}, [11, 11]).seats[0]?.hand ?? [];
    const moves: Move[] = [{ kind: "play", face: 11, quantity: 1, jokers: 0 }];
    const picks = (index: number, goldenFirst: boolean) => [...toggle(hand, new Set(), index, moves, goldenFirst)];
    expect(hand).toEqual([GOLDEN, ELEVEN]);
    expect([picks(0, true), picks(1, true), picks(0, false), picks(1, false)]).toEqual([[0], [0], [1], [1]]);
    expect([...toggle(hand, new Set(), 0, [{ kind: "give", face: 11 }])]).toEqual([1]);
  });
});

test("a viewer who joins in the middle of a Shift does not take the next turn for its first", () => {
  const observation = { shift: 1, pizza: 3, played: [0, 0, 2], passed: [0, 0], cardsLeft: [3, 3], boardOwner: 0 };
  const bytes = Object.fromEntries(
    Object.entries(observation).map(([name, value]) => [name, Array.isArray(value) ? Uint8Array.from(value) : value]),
  );
  const gameStarted = { rules: {}, seats: [{ seat: 0 }, { seat: 1 }] };
  const snapshot = create(SnapshotSchema, { nextSequence: 40n, gameStarted, observation: bytes });
  const table = applySnapshot(emptyTable(), snapshot, undefined);
  expect(table.boardBy).toBe(0);
  expect(publicRequirement(table)).toMatchObject({ lowestFace: 1, highestFace: 11, loneJoker: true });
  expect(playElevens(table, 1, 2).board).toEqual([ELEVEN, ELEVEN]);
});

test("a snapshot in an exchange has the cards that are given, whose event is still to come", () => {
  const counts = { hand: [0, 1], gave: [0, 1], cardsLeft: [2, 3], played: [0, 0] };
  const observation = Object.fromEntries(Object.entries(counts).map(([name, list]) => [name, Uint8Array.from(list)]));
  const gameStarted = { rules: {}, seats: [{ seat: 0 }, { seat: 1 }] };
  const snapshot = create(SnapshotSchema, { nextSequence: 40n, gameStarted, observation });
  const before = { ...emptyTable(), next: 1, toppings: [3], nextSequence: 9 };
  const table = applySnapshot(before, snapshot, 0);
  expect(table.seats.map(({ cardsLeft }) => cardsLeft)).toEqual([3, 3]);
  expect(table.seats[0]?.hand).toHaveLength(2);
  expect(table).toMatchObject({ next: undefined, toppings: [], nextSequence: 40 });
});

test("an event that was already applied changes nothing", () => {
  const [first, second] = recorded("fixed").flatMap(({ line }) => (line.case === "event" ? [line.value] : []));
  if (!first || !second) throw new Error("the fixture has no events");
  const table = applyEvent(applyEvent(emptyTable(), first), second);
  expect(applyEvent(table, first)).toBe(table);
});

test("the indices of actions follow the rules", () => {
  expect(turnActions(11)).toBe(200);
  expect(moveOf(0, 11)).toEqual({ kind: "play", face: 1, quantity: 1, jokers: 0 });
  expect(moveOf(199, 11)).toEqual({ kind: "pass" });
  for (const faces of [4, 11, 15]) {
    const size = turnActions(faces) + faces + 3;
    for (let action = 0; action < size; action += 1) {
      const move = moveOf(action, faces);
      expect(move && actionOf(move, faces)).toBe(action);
    }
    expect(moveOf(size, faces)).toBeUndefined();
    const all = Array.from({ length: size }, (_, action) => action);
    expect(legalActions(maskOf(all, faces))).toEqual(all);
  }
});
