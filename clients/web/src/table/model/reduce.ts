// Applies events to what a viewer knows of a table: one pure function for a seat's stream,
// spectators and records. It trusts the server that every event follows the rules.

import type { GameEvent, Play } from "../../gen/chefshat/v1/event_pb";
import { DecisionSource } from "../../gen/chefshat/v1/event_pb";
import { Opening, PassScope, Role } from "../../gen/chefshat/v1/rules_pb";
import { shownLabel } from "../expressions";
import { type Card, cardsFromNumbers, countOf, faceOf, playedCards, together, without } from "./cards";
import { publicRequirement } from "./requirement";
import {
  type Cause,
  type Demand,
  fromRules,
  type LogEntry,
  MAX_LOG,
  type SeatState,
  seatFromParticipant,
  type TableState,
} from "./state";

const CAUSES: Record<DecisionSource, Cause> = {
  [DecisionSource.UNSPECIFIED]: "agent",
  [DecisionSource.AGENT]: "agent",
  [DecisionSource.TIMEOUT]: "timeout",
  [DecisionSource.INVALID]: "invalid",
  [DecisionSource.DISCONNECTED]: "disconnected",
  [DecisionSource.SUBSTITUTE]: "substitute",
  [DecisionSource.RECORDED]: "recorded",
  [DecisionSource.TABLE]: "table",
};

/** The table after an event. An event that was already applied changes nothing. */
export function applyEvent(table: TableState, event: GameEvent): TableState {
  const sequence = Number(event.sequence);
  if (sequence < table.nextSequence) return table;
  const { history } = table;
  if (!history) return step(table, event);
  const firstVoid = event.kind.case === "correction" ? Number(event.kind.value.firstVoid) : 0;
  if (firstVoid === 0) return { ...step(table, event), history: { ...history, events: [...history.events, event] } };
  const valid = history.events.filter((past) => Number(past.sequence) < firstVoid || OF_ROOM.includes(past.kind.case));
  const events = [...valid, event];
  return { ...events.reduce(step, history.start), history: { ...history, events } };
}

/** Events that stay when a correction makes the events of the game before it void. */
const OF_ROOM: readonly GameEvent["kind"]["case"][] = [
  "seated",
  "vacated",
  "disconnected",
  "returned",
  "substituted",
  "expressionShown",
  "serverRestarted",
  "handReported",
  "violation",
  "correction",
  "tablePaused",
];

/** The table after an event and its line in the log. */
function step(table: TableState, event: GameEvent): TableState {
  const sequence = Number(event.sequence);
  const [changed, entry] = change(table, event, sequence);
  const log = entry ? [...changed.log, { sequence, entry }].slice(-MAX_LOG) : changed.log;
  return { ...changed, log, nextSequence: sequence + 1 };
}

/** The table after a list of events. */
export function applyEvents(table: TableState, events: readonly GameEvent[]): TableState {
  return events.reduce(applyEvent, table);
}

type Change = readonly [TableState, LogEntry | undefined];

function change(table: TableState, event: GameEvent, sequence: number): Change {
  const kind = event.kind;
  switch (kind.case) {
    case "seated": {
      const { seat, name, kind: what } = kind.value;
      return [withSeat(table, seat, { name, nameFingerprint: "", kind: what, builtIn: "" }), { kind: "seated", seat }];
    }
    case "vacated":
      return [
        withSeat(table, kind.value.seat, { name: "", kind: 0, connected: false }),
        { kind: "left", seat: kind.value.seat },
      ];
    case "disconnected":
      return [withSeat(table, kind.value.seat, { connected: false }), { kind: "lost", seat: kind.value.seat }];
    case "returned":
      return [
        withSeat(table, kind.value.seat, { connected: true, substitute: "" }),
        { kind: "back", seat: kind.value.seat },
      ];
    case "substituted": {
      const { seat, builtInAgent } = kind.value;
      return [withSeat(table, seat, { substitute: builtInAgent }), { kind: "substituted", seat, agent: builtInAgent }];
    }
    case "gameStarted": {
      const { gameId, rules, policy, seats } = kind.value;
      const start = { ...table, ...fromRules(rules), gameId, policy, seats: seats.map(seatFromParticipant) };
      return [{ ...start, phase: "dealt" }, { kind: "gameStarted" }];
    }
    case "shiftStarted":
      return [dealt(table, kind.value), { kind: "dealt", shift: kind.value.shift }];
    case "rolesAssigned": {
      const { roles } = kind.value;
      return [eachSeat(table, (seat) => ({ role: roles[seat.seat] ?? Role.UNSPECIFIED })), undefined];
    }
    case "specialActionDeclared":
      return [table, { kind: "declared", seat: kind.value.seat, action: kind.value.action }];
    case "cardsExchanged": {
      const { giver, receiver, count } = kind.value;
      const cards = cardsFromNumbers(kind.value.cards, kind.value.golden, table.faces);
      return [exchanged(table, giver, receiver, count, cards), { kind: "gave", giver, receiver, count, cards }];
    }
    case "play":
      return play(table, kind.value);
    case "pass": {
      const { seat, source } = kind.value;
      const out = table.passScope === PassScope.PIZZA;
      const passed = withSeat(turnTaken(table), seat, { passed: out, lastMove: "pass" });
      return [
        { ...passed, next: nextAfter(passed, seat) },
        { kind: "passed", seat, cause: CAUSES[source] },
      ];
    }
    case "pizzaDone": {
      const { pizza, nextLeader } = kind.value;
      const cleared = eachSeat(table, () => ({ passed: false, lastMove: undefined }));
      return [
        { ...cleared, board: [], boardBy: undefined, pizza: pizza + 1, next: nextLeader },
        { kind: "pizzaDone", pizza, nextLeader },
      ];
    }
    case "seatFinished": {
      const { seat, place } = kind.value;
      const finished = withSeat(table, seat, { place, cardsLeft: 0 });
      return [
        { ...finished, next: nextAfter(finished, seat) },
        { kind: "finished", seat, place },
      ];
    }
    case "shiftEnded": {
      const { shift, order, shiftPoints, adjudicated } = kind.value;
      const points = kind.value.points.map(Number);
      const ended = eachSeat(table, (seat) => ({
        points: points[seat.seat] ?? seat.points,
        place: order.indexOf(seat.seat) + 1,
      }));
      const result = { shift, order, shiftPoints, points, adjudicated };
      return [
        { ...ended, phase: "shiftOver", results: [...table.results, result], next: undefined },
        { kind: "shiftOver", shift, winner: order[0] ?? 0 },
      ];
    }
    case "gameEnded": {
      const standings = kind.value.standings.map(({ seat, points, place }) => ({
        seat,
        points: Number(points),
        place,
      }));
      return [{ ...table, phase: "gameOver", standings, next: undefined }, { kind: "gameOver" }];
    }
    case "gameAborted":
      return [{ ...table, phase: "aborted", abortReason: kind.value.reason, next: undefined }, { kind: "aborted" }];
    case "expressionShown": {
      const { seat, expression } = kind.value;
      const label = expression ? shownLabel(expression) : "";
      return [withSeat(table, seat, { expression: { label, sequence } }), { kind: "expressed", seat, label }];
    }
    case "serverRestarted":
      return [table, { kind: "restarted" }];
    case "handReported": {
      const { seat = 0, cards = [], golden = false } = kind.value.hand ?? {};
      // Without cards, the viewer may not see them.
      const hand = cards.length > 0 ? { hand: cardsFromNumbers(cards, golden, table.faces) } : {};
      return [withSeat(table, seat, hand), { kind: "handReported", seat }];
    }
    case "violation": {
      const { seat, rule, text } = kind.value;
      const violation = { kind: "violated" as const, breach: { seat, rule, text }, demand: demandOf(table) };
      return [{ ...table, violation }, violation];
    }
    case "correction":
      return [
        { ...table, violation: undefined },
        { kind: "corrected", text: kind.value.text },
      ];
    case "tablePaused": {
      const { paused } = kind.value;
      return [{ ...table, paused }, { kind: paused ? "paused" : "resumed" }];
    }
    // An event of a later protocol version: it is counted, but its content is unknown.
    case undefined:
      return [table, undefined];
  }
}

function dealt(
  table: TableState,
  start: { shift: number; hands: { seat: number; cards: number[]; golden: boolean }[] },
): TableState {
  const hands = new Map(start.hands.map((hand) => [hand.seat, cardsFromNumbers(hand.cards, hand.golden, table.faces)]));
  const deck = (table.faces * (table.faces + 1)) / 2 + table.jokers;
  const handSize = start.hands[0]?.cards.length ?? Math.floor(deck / Math.max(1, table.seats.length));
  const fresh = eachSeat(table, (seat) => ({
    hand: hands.get(seat.seat),
    cardsLeft: handSize,
    passed: false,
    place: 0,
    lastMove: undefined,
    received: [],
    role: Role.UNSPECIFIED,
  }));
  return {
    ...fresh,
    phase: "dealt",
    shift: start.shift,
    pizza: 0,
    turn: 1,
    board: [],
    boardBy: undefined,
    toppings: [],
    next: undefined,
    played: Array<number>(table.faces + 1).fill(0),
  };
}

function exchanged(
  table: TableState,
  giver: number,
  receiver: number,
  count: number,
  cards: readonly Card[],
): TableState {
  // Without its cards, a gift makes a known hand unknown: at a table with real cards.
  const known = cards.length === count;
  return eachSeat(table, (seat) => {
    if (seat.seat === giver) {
      const hand = known && seat.hand ? without(seat.hand, cards) : undefined;
      return { cardsLeft: seat.cardsLeft - count, hand };
    }
    if (seat.seat === receiver) {
      const hand = known && seat.hand ? together(seat.hand, cards) : undefined;
      return { cardsLeft: seat.cardsLeft + count, hand, received: together(seat.received, cards) };
    }
    return {};
  });
}

function play(table: TableState, { seat, face, quantity, jokers, cardsLeft, source }: Play): Change {
  const alone = face > table.faces;
  const hand = table.seats[seat]?.hand;
  const cards = playedCards(face, quantity, jokers, face === table.faces && playsGolden(table, hand, quantity));
  const changed = withSeat(turnTaken(table), seat, {
    cardsLeft,
    hand: hand && without(hand, cards),
    lastMove: cards,
    received: [],
  });
  const played = changed.played.map((count, index) => {
    if (index === table.faces) return count + jokers;
    return !alone && index === face - 1 ? count + quantity : count;
  });
  const onPizza = table.board.length > 0 ? table.toppings : [];
  const toppings = [...onPizza, ...cards.map((card) => faceOf(card) ?? table.faces + 1)];
  const after = { ...changed, played, board: cards, boardBy: seat, toppings };
  return [
    { ...after, next: nextAfter(after, seat) },
    { kind: "played", seat, cards, cause: CAUSES[source] },
  ];
}

/**
 * Whether a play of the top face includes the Golden card: it goes first in the standard opening,
 * and last otherwise.
 */
function playsGolden(table: TableState, hand: readonly Card[] | undefined, quantity: number): boolean {
  if (table.turn === 1 && table.rules?.opening !== Opening.ANY_TOP_FACE) return true;
  const held = hand?.some(({ kind }) => kind === "golden") ?? false;
  return held && countOf(hand ?? [], table.faces) === quantity;
}

function turnTaken(table: TableState): TableState {
  return { ...table, phase: "pizza", pizza: Math.max(1, table.pizza), turn: table.turn + 1, violation: undefined };
}

/** What the board demands at the open turn. */
function demandOf(table: TableState): Demand {
  const { highestFace, fewestCards, goldenCard, lowestFace } = publicRequirement(table);
  return {
    highestFace,
    fewestCards,
    onBoard: table.board.length > 0,
    goldenCard,
    opening: lowestFace > 1,
    next: table.next,
  };
}

/** The next seat to the left that is still in the pizza. */
function nextAfter(table: TableState, seat: number): number | undefined {
  const players = table.seats.length;
  for (let distance = 1; distance < players; distance += 1) {
    const other = table.seats[(seat + distance) % players];
    if (other && other.cardsLeft > 0 && !other.passed) return other.seat;
  }
  return undefined;
}

function withSeat(table: TableState, seat: number, changed: Partial<SeatState>): TableState {
  return eachSeat(table, (other) => (other.seat === seat ? changed : {}));
}

function eachSeat(table: TableState, changed: (seat: SeatState) => Partial<SeatState>): TableState {
  return { ...table, seats: table.seats.map((seat) => ({ ...seat, ...changed(seat) })) };
}
