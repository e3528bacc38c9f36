// What one viewer knows of a table at one moment: who sits there, what each seat shows, the board, what happened last. A plain value made
// from the protocol's messages by reduce.ts and snapshot.ts; what the viewer may not see is not in it. No view, no clock, no network.

import type { Room, RoomPolicy } from "../../gen/chefshat/v1/room_pb";
import { AbortReason, type Participant, ParticipantKind } from "../../gen/chefshat/v1/room_pb";
import { PassScope, Role, type RuleSet, type SpecialAction } from "../../gen/chefshat/v1/rules_pb";
import type { Card } from "./cards";

/** Most happenings that are kept. */
export const MAX_LOG = 120;

/** Where the game stands. */
export type Phase = "waiting" | "dealt" | "pizza" | "shiftOver" | "gameOver" | "aborted";

/** Why it was not the seat's own agent that decided; "agent" if it was. */
export type Cause = "agent" | "timeout" | "invalid" | "disconnected" | "substitute" | "recorded";

/** One thing that happened, as the viewer may see it. */
export type Happening =
  | { readonly kind: "dealt"; readonly shift: number }
  | { readonly kind: "played"; readonly seat: number; readonly cards: readonly Card[]; readonly cause: Cause }
  | { readonly kind: "passed"; readonly seat: number; readonly cause: Cause }
  | { readonly kind: "finished"; readonly seat: number; readonly place: number }
  | { readonly kind: "pizzaDone"; readonly pizza: number; readonly nextLeader: number }
  | { readonly kind: "declared"; readonly seat: number; readonly action: SpecialAction }
  | {
      readonly kind: "gave";
      readonly giver: number;
      readonly receiver: number;
      readonly count: number;
      /** Empty where the viewer may not know. */
      readonly cards: readonly Card[];
    }
  | { readonly kind: "shiftOver"; readonly shift: number; readonly winner: number }
  | { readonly kind: "expressed"; readonly seat: number; readonly label: string }
  | { readonly kind: "seated" | "left" | "lost" | "back"; readonly seat: number }
  | { readonly kind: "substituted"; readonly seat: number; readonly agent: string }
  | { readonly kind: "restarted" | "gameStarted" | "gameOver" | "aborted" };

/** A happening and the number of the event that brought it. */
export interface LogLine {
  readonly sequence: number;
  readonly happening: Happening;
}

/** What one seat shows. */
export interface SeatState {
  readonly seat: number;
  /** Empty while the seat is free. */
  readonly name: string;
  readonly kind: ParticipantKind;
  readonly reservedFor: ParticipantKind;
  /** Name of the built-in agent that fills the seat, or empty. */
  readonly builtIn: string;
  readonly connected: boolean;
  /** Name of the built-in agent that plays for a lost participant, or empty. */
  readonly substitute: string;
  readonly role: Role;
  readonly points: number;
  readonly cardsLeft: number;
  /** The cards, where the viewer may see them. */
  readonly hand: readonly Card[] | undefined;
  readonly passed: boolean;
  /** Place in this Shift from 1; 0 while the seat holds cards. */
  readonly place: number;
  /** What the seat did last in this pizza. */
  readonly lastMove: readonly Card[] | "pass" | undefined;
  /** What the seat received in this Shift's exchange, where the viewer may know. */
  readonly received: readonly Card[];
  readonly expression: { readonly label: string; readonly sequence: number } | undefined;
}

/** How a Shift ended. */
export interface ShiftResult {
  readonly shift: number;
  /** Seats by place. */
  readonly order: readonly number[];
  /** Points of the Shift, index = seat. */
  readonly shiftPoints: readonly number[];
  /** Points of the game, index = seat. */
  readonly points: readonly number[];
  readonly adjudicated: boolean;
}

/** One line of the final table. */
export interface StandingLine {
  readonly seat: number;
  readonly points: number;
  readonly place: number;
}

export interface TableState {
  readonly roomId: string;
  readonly roomName: string;
  readonly gameId: string;
  readonly phase: Phase;
  /** Number of faces F. */
  readonly faces: number;
  /** Number of jokers in the deck. */
  readonly jokers: number;
  readonly rules: RuleSet | undefined;
  readonly policy: RoomPolicy | undefined;
  readonly passScope: PassScope;
  /** From 1; 0 before the first. */
  readonly shift: number;
  /** Pizza of the Shift from 1; 0 before the Shift's first play or pass. */
  readonly pizza: number;
  /** Number of the turn of the Shift that is open, from 1. */
  readonly turn: number;
  readonly seats: readonly SeatState[];
  readonly board: readonly Card[];
  /** Who played what is on the board. */
  readonly boardBy: number | undefined;
  /** What has gone onto the pizza: the face of every card played, F+1 for a joker. It stays to be seen until the next pizza is begun. */
  readonly toppings: readonly number[];
  /** Whose turn it is, where the viewer can tell. */
  readonly next: number | undefined;
  /** Cards played in this Shift: F+1 counts. */
  readonly played: readonly number[];
  readonly log: readonly LogLine[];
  /** How the last Shift ended. */
  readonly result: ShiftResult | undefined;
  /** Why the game was given up, if it was. */
  readonly abortReason: AbortReason;
  /** The final table, best first; empty before the end. */
  readonly standings: readonly StandingLine[];
  /** Number of the next event of the game. */
  readonly nextSequence: number;
}

export function seatFromParticipant(participant: Participant): SeatState {
  return {
    seat: participant.seat,
    name: participant.name,
    kind: participant.kind,
    reservedFor: participant.reservedFor,
    builtIn: participant.builtInAgent,
    connected: participant.connected,
    substitute: participant.substituted ? "substitute" : "",
    role: Role.UNSPECIFIED,
    points: 0,
    cardsLeft: 0,
    hand: undefined,
    passed: false,
    place: 0,
    lastMove: undefined,
    received: [],
    expression: undefined,
  };
}

/** What a rule set says of the deck and of passing. */
export function fromRules(rules: RuleSet | undefined) {
  const faces = rules?.faces ?? 11;
  return { rules, faces, jokers: rules?.jokers ?? 2, passScope: rules?.passScope ?? PassScope.PIZZA };
}

/** A table before its first event. */
export function emptyTable(seats: readonly SeatState[] = []): TableState {
  return {
    ...fromRules(undefined),
    roomId: "",
    roomName: "",
    gameId: "",
    phase: "waiting",
    policy: undefined,
    shift: 0,
    pizza: 0,
    turn: 1,
    seats,
    board: [],
    boardBy: undefined,
    toppings: [],
    next: undefined,
    played: [],
    log: [],
    result: undefined,
    abortReason: AbortReason.UNSPECIFIED,
    standings: [],
    nextSequence: 1,
  };
}

/** A table as its room shows it, before its first event. */
export function tableFromRoom(room: Room): TableState {
  return {
    ...emptyTable(room.seats.map(seatFromParticipant)),
    ...fromRules(room.rules),
    roomId: room.roomId,
    roomName: room.name,
    gameId: room.gameId,
    policy: room.policy,
  };
}

/** Whether a seat is a participant's rather than free. */
export function isTaken(seat: SeatState): boolean {
  return seat.builtIn !== "" || seat.kind !== ParticipantKind.UNSPECIFIED;
}
