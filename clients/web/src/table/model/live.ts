// What the holder of a seat knows: the table, the open decision, and how the seat is attached. A
// pure function applies each update of the server; the stream is in session.ts.

import {
  AnswerStatus,
  DecisionKind,
  type DecisionRequest,
  type GiftRequirement,
  type Observation,
} from "../../gen/chefshat/v1/decision_pb";
import type { GameEvent } from "../../gen/chefshat/v1/event_pb";
import { DetachReason, type SeatUpdate } from "../../gen/chefshat/v1/play_service_pb";
import type { SpecialAction } from "../../gen/chefshat/v1/rules_pb";
import { legalActions } from "./actions";
import { type AwaitedSeat, awaitedSeat } from "./awaited";
import { type Card, cardsFromCounts } from "./cards";
import { applyEvent } from "./reduce";
import type { Requirement } from "./requirement";
import { applyObservation, applySnapshot } from "./snapshot";
import type { TableState } from "./state";

/** The seat's open decision. */
export interface OpenDecision {
  readonly id: bigint;
  readonly kind: DecisionKind;
  /** Legal actions, ascending. */
  readonly legal: readonly number[];
  /** The hand before the decision, in order. */
  readonly hand: readonly Card[];
  /** At a turn: what a play must be. */
  readonly requirement: Requirement | undefined;
  /** In the exchange: which card is due, and for whom. */
  readonly gift: Pick<GiftRequirement, "number" | "total" | "receiver"> | undefined;
  /** The special action that may be declared. */
  readonly special: SpecialAction;
  /** Milliseconds left for the decision when the request arrived. */
  readonly timeLeftMs: number;
  /** Milliseconds left in the time bank when the request arrived. */
  readonly bankLeftMs: number;
  /** Arrival time of the request, by the page's clock. */
  readonly receivedAtMs: number;
  /** Invalid attempts left; undefined if unlimited. */
  readonly attemptsLeft: number | undefined;
}

/** How the seat is attached. */
export type Attachment =
  | { readonly kind: "none" }
  | { readonly kind: "attached" }
  | { readonly kind: "superseded" }
  | { readonly kind: "over" }
  /** Someone with the ticket gave the seat up: this page never asks to be detached otherwise. */
  | { readonly kind: "left" }
  | { readonly kind: "refused"; readonly reason: string; readonly message: string };

export interface LiveState {
  readonly table: TableState;
  /** The seat; undefined before the first attachment. */
  readonly own: number | undefined;
  readonly decision: OpenDecision | undefined;
  /** Whom of the others the game waits for. */
  readonly awaited: AwaitedSeat | undefined;
  readonly attachment: Attachment;
  /** Whether a built-in agent plays for the seat. */
  readonly substituted: boolean;
}

export function startLive(table: TableState, own?: number): LiveState {
  return { table, own, decision: undefined, awaited: undefined, attachment: { kind: "none" }, substituted: false };
}

/** The state after an update; `nowMs` is the page's clock. */
export function applyUpdate(live: LiveState, update: SeatUpdate, nowMs: number): LiveState {
  const payload = update.update;
  switch (payload.case) {
    case "attached": {
      const own = payload.value.seat;
      const table = { ...live.table, roomId: payload.value.roomId, gameId: payload.value.gameId };
      // The open decision may have been closed while the stream was down; if not, the server sends
      // it again, and whom it waits for.
      const fresh = { decision: undefined, awaited: undefined, substituted: false };
      return { ...live, ...fresh, own, table, attachment: { kind: "attached" } };
    }
    case "events":
      return payload.value.events.reduce(withEvent, live);
    case "snapshot":
      return withSnapshot(live, applySnapshot(live.table, payload.value, live.own));
    case "substitution": {
      const substituted = payload.value.active;
      return { ...live, substituted, decision: substituted ? undefined : live.decision };
    }
    case "awaited":
      return { ...live, awaited: awaitedSeat(payload.value, nowMs) };
    case "decision":
      return withDecision(live, payload.value, nowMs);
    case "result": {
      const { decisionId, status, invalidAttemptsLeft: attemptsLeft } = payload.value;
      if (live.decision?.id !== decisionId) return live;
      if (status === AnswerStatus.INVALID) return { ...live, decision: { ...live.decision, attemptsLeft } };
      return { ...live, decision: undefined };
    }
    case "detached": {
      // The end of the stream follows, after which the page attaches the seat again.
      if (payload.value.reason === DetachReason.SERVER_STOPPING) return live;
      const kind = DETACHED[payload.value.reason] ?? "over";
      return { ...live, decision: undefined, attachment: { kind } };
    }
    case "refused": {
      const { reason, message } = payload.value;
      return { ...live, decision: undefined, attachment: { kind: "refused", reason, message } };
    }
    default:
      return live;
  }
}

const DETACHED: Partial<Record<DetachReason, "superseded" | "left">> = {
  [DetachReason.SUPERSEDED]: "superseded",
  [DetachReason.REQUESTED]: "left",
};

function withSnapshot(live: LiveState, table: TableState): LiveState {
  const mine = live.own === undefined ? undefined : table.seats[live.own];
  return { ...live, table, substituted: mine !== undefined && mine.substitute !== "" };
}

function withEvent(live: LiveState, event: GameEvent): LiveState {
  if (Number(event.sequence) < live.table.nextSequence) return live;
  const table = applyEvent(live.table, event);
  const kind = event.kind;
  const substituted =
    kind.case === "substituted" && kind.value.seat === live.own
      ? true
      : kind.case === "returned" && kind.value.seat === live.own
        ? false
        : live.substituted;
  return { ...live, table, substituted, decision: closes(event, live) ? undefined : live.decision };
}

/**
 * Whether an event closes the seat's open decision: it was answered, timed out, or taken by a
 * substitute.
 */
function closes(event: GameEvent, live: LiveState): boolean {
  const { own, decision } = live;
  const kind = event.kind;
  switch (kind.case) {
    case "play":
    case "pass":
      return kind.value.seat === own && decision?.kind === DecisionKind.TURN;
    case "specialActionDeclared":
      return kind.value.seat === own;
    case "cardsExchanged":
      return kind.value.giver === own && decision?.kind === DecisionKind.EXCHANGE;
    case "substituted":
      return kind.value.seat === own;
    // A decision that is still open after a correction is asked again.
    case "correction":
      return kind.value.firstVoid > 0n;
    case "shiftEnded":
    case "gameEnded":
    case "gameAborted":
      return true;
    default:
      return false;
  }
}

function withDecision(live: LiveState, request: DecisionRequest, nowMs: number): LiveState {
  const { observation: seen } = request;
  const before = live.table;
  // At a turn every event has arrived, so the observation is complete. In an unfinished exchange,
  // gifts have left the observed hand but their event is still to come.
  const turn = request.kind === DecisionKind.TURN;
  const table = !seen
    ? before
    : turn
      ? { ...applyBoard(before, seen, live.own), next: live.own }
      : withPoints(before, seen);
  const hand = seen ? cardsFromCounts(seen.hand, seen.golden, table.faces) : [];
  const decision: OpenDecision = {
    id: request.decisionId,
    kind: request.kind,
    legal: legalActions(request.actionMask),
    hand,
    requirement: request.playRequirement,
    gift: request.giftRequirement,
    special: request.specialAction,
    timeLeftMs: request.timeLeftMs,
    bankLeftMs: request.bankLeftMs,
    receivedAtMs: nowMs,
    attemptsLeft: request.invalidAttemptsLeft,
  };
  return { ...live, table, decision };
}

/** Adds the points, which a game that starts in the middle has before its first event. */
function withPoints(table: TableState, seen: Observation): TableState {
  const seats = table.seats.map((seat) => ({ ...seat, points: Number(seen.points[seat.seat] ?? seat.points) }));
  return { ...table, seats };
}

/**
 * Applies the observation, but keeps what only events contain: the Golden card on the board, the cards
 * just received.
 */
function applyBoard(table: TableState, seen: Observation, own: number | undefined): TableState {
  const next = applyObservation(table, seen, own);
  const seats = next.seats.map((seat) => ({ ...seat, received: table.seats[seat.seat]?.received ?? seat.received }));
  const board = next.board.length === table.board.length ? table.board : next.board;
  return { ...next, seats, board };
}
