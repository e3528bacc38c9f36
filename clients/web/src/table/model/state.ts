// What one viewer knows of a table at one moment: seats, board, last events. A plain value built
// from the protocol's messages by reduce.ts and snapshot.ts, without anything the viewer may not
// see.

import type { GameEvent } from "../../gen/chefshat/v1/event_pb";
import type { Room, RoomPolicy } from "../../gen/chefshat/v1/room_pb";
import { AbortReason, GameOrigin, type Participant, ParticipantKind } from "../../gen/chefshat/v1/room_pb";
import { PassScope, Role, type RuleSet, type SpecialAction } from "../../gen/chefshat/v1/rules_pb";
import type { ViolatedRule } from "../../gen/chefshat/v1/table_pb";
import type { Card } from "./cards";

/** Length of the log, events. */
export const MAX_LOG = 120;

/** The phase of the game. */
export type Phase = "waiting" | "dealt" | "pizza" | "shiftOver" | "gameOver" | "aborted";

/**
 * Who or what made a decision: "agent" for the seat's own participant, "table" for one reported from
 * a physical table.
 */
export type Cause = "agent" | "timeout" | "invalid" | "disconnected" | "substitute" | "recorded" | "table";

/** Something at a physical table that the rules or the cards do not allow. */
export interface Breach {
  /** Undefined if unknown. */
  readonly seat: number | undefined;
  readonly rule: ViolatedRule;
  /** The server's sentence, in English. */
  readonly text: string;
}

/** An event as the viewer may see it. */
export type LogEntry =
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
      /** Empty if the viewer may not know. */
      readonly cards: readonly Card[];
    }
  | { readonly kind: "shiftOver"; readonly shift: number; readonly winner: number }
  | { readonly kind: "expressed"; readonly seat: number; readonly label: string }
  | { readonly kind: "seated" | "left" | "lost" | "back"; readonly seat: number }
  | { readonly kind: "substituted"; readonly seat: number; readonly agent: string }
  | { readonly kind: "handReported"; readonly seat: number }
  | { readonly kind: "violated"; readonly breach: Breach; readonly demand: Demand }
  | { readonly kind: "corrected"; readonly text: string }
  | { readonly kind: "paused" | "resumed" }
  | { readonly kind: "restarted" | "gameStarted" | "gameOver" | "aborted" };

/** What the board demanded when something was not allowed: for the sentence that says so. */
export interface Demand {
  /** The highest face allowed; the top face on an empty board, 0 if nothing beats the board. */
  readonly highestFace: number;
  readonly fewestCards: number;
  /** Whether cards lay on the board. */
  readonly onBoard: boolean;
  /** Whether it was the first turn of a Shift, and whether that needs the Golden card. */
  readonly opening: boolean;
  readonly goldenCard: boolean;
  /** The seat whose turn it was, if known. */
  readonly next: number | undefined;
}

/** An event and its sequence number. */
export interface LogLine {
  readonly sequence: number;
  readonly entry: LogEntry;
}

/** The state of a seat. */
export interface SeatState {
  readonly seat: number;
  /** Empty while the seat is free. */
  readonly name: string;
  /** Of the name and its key, where it is known; empty if it has none. */
  readonly nameFingerprint: string;
  readonly kind: ParticipantKind;
  readonly reservedFor: ParticipantKind;
  /** Name of the built-in agent in the seat, or empty. */
  readonly builtIn: string;
  readonly connected: boolean;
  /** Whether the player sits at the physical table with real cards. Nobody connects. */
  readonly atTable: boolean;
  /** Name of the built-in agent that plays for a disconnected participant, or empty. */
  readonly substitute: string;
  readonly role: Role;
  readonly points: number;
  readonly cardsLeft: number;
  /** The cards, if the viewer may see them. */
  readonly hand: readonly Card[] | undefined;
  readonly passed: boolean;
  /** Place in this Shift from 1; 0 while the seat holds cards. */
  readonly place: number;
  /** The seat's last action in this pizza. */
  readonly lastMove: readonly Card[] | "pass" | undefined;
  /** Cards received in this Shift's exchange, if the viewer may know. */
  readonly received: readonly Card[];
  readonly expression: { readonly label: string; readonly sequence: number } | undefined;
}

/** The result of a Shift. */
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

/** A line of the final standings. */
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
  /** From 1; 0 before the first Shift. */
  readonly shift: number;
  /** Pizza of the Shift from 1; 0 before the first play or pass. */
  readonly pizza: number;
  /** The open turn of the Shift, from 1. */
  readonly turn: number;
  readonly seats: readonly SeatState[];
  readonly board: readonly Card[];
  /** The seat that played the cards on the board. */
  readonly boardBy: number | undefined;
  /**
   * The face of every card played on the pizza, F+1 for a joker. Kept until the next pizza starts.
   */
  readonly toppings: readonly number[];
  /** The seat whose turn it is, if the viewer knows it. */
  readonly next: number | undefined;
  /** Cards played in this Shift, F+1 counts. */
  readonly played: readonly number[];
  readonly log: readonly LogLine[];
  /** The results of the Shifts whose end the viewer has seen, in their order. */
  readonly results: readonly ShiftResult[];
  /** Why the game was aborted. */
  readonly abortReason: AbortReason;
  /** The final standings, best first; empty before the end. */
  readonly standings: readonly StandingLine[];
  /** Whether the cards are real. */
  readonly physical: boolean;
  /** At a physical table: whether the game is paused. */
  readonly paused: boolean;
  /** At a physical table: the last violation, until a play or pass counts. */
  readonly violation: (LogEntry & { readonly kind: "violated" }) | undefined;
  /**
   * At a physical table in progress: what a correction rebuilds the table from. A record needs none:
   * it has the game as corrected.
   */
  readonly history: History | undefined;
  /** Sequence number of the next event. */
  readonly nextSequence: number;
}

/** The events of a physical table that are not void, and the table before them. */
export interface History {
  readonly start: TableState;
  readonly events: readonly GameEvent[];
}

export function seatFromParticipant(participant: Participant): SeatState {
  return {
    seat: participant.seat,
    name: participant.name,
    nameFingerprint: participant.nameFingerprint,
    kind: participant.kind,
    reservedFor: participant.reservedFor,
    builtIn: participant.builtInAgent,
    connected: participant.connected || participant.atTable,
    atTable: participant.atTable,
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

/** The parts of a rule set that the table shows. */
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
    results: [],
    abortReason: AbortReason.UNSPECIFIED,
    standings: [],
    physical: false,
    paused: false,
    violation: undefined,
    history: undefined,
    nextSequence: 1,
  };
}

/** What a table shows of its room or record from the start. */
type RoomStart = Pick<Room, "seats" | "rules" | "roomId" | "name" | "gameId" | "policy" | "origin">;

/** The table of a room, before its first event. */
export function tableFromRoom(room: RoomStart): TableState {
  const physical = room.origin === GameOrigin.PHYSICAL;
  const table = {
    ...emptyTable(room.seats.map(seatFromParticipant)),
    ...fromRules(room.rules),
    roomId: room.roomId,
    roomName: room.name,
    gameId: room.gameId,
    policy: room.policy,
    physical,
  };
  return physical ? withHistory(table) : table;
}

/** A physical table whose corrections go back to this point. */
export function withHistory(table: TableState): TableState {
  return { ...table, history: { start: { ...table, history: undefined }, events: [] } };
}

/** Whether the game has ended, with a result or without. */
export function isOver({ phase }: Pick<TableState, "phase">): boolean {
  return phase === "gameOver" || phase === "aborted";
}

/** Whether a participant has the seat. A study may hide its kind, but not its name. */
export function isTaken(seat: SeatState): boolean {
  return seat.builtIn !== "" || seat.kind !== ParticipantKind.UNSPECIFIED || seat.name !== "";
}

/**
 * Whether the cards of a seat are dealt but not yet known to the server: at a physical table, those
 * of a remote participant are shown to it.
 */
export function awaitsHand({ physical, phase, seats }: TableState, own: number | undefined): boolean {
  const seat = own === undefined ? undefined : seats[own];
  if (!physical || !seat || seat.atTable || seat.hand !== undefined) return false;
  return (phase === "dealt" || phase === "pizza") && seat.cardsLeft > 0;
}
