// What the form for a new room holds, and the request that it makes. Values without a page: how they are asked for is in NewRoom.tsx.
// Whether rules and times can be accepted is the server's to say; here only numbers are read.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { AbortPolicy, ParticipantKind } from "../gen/chefshat/v1/room_pb";
import type { CreateRoomRequestSchema } from "../gen/chefshat/v1/room_service_pb";
import { Opening, PassScope, type RuleSet } from "../gen/chefshat/v1/rules_pb";

/** Longest name of a room or participant, characters. */
export const MAX_NAME = 64;

/** For whom a seat is free, or by which built-in agent it is filled. */
export type SeatChoice = "human" | "robot" | "agent" | "anybody" | `built-in ${string}`;

/** How fast a game is played. */
export type ClockChoice = "noHurry" | "relaxed" | "brisk" | "own";

/** Milliseconds of each clock: for a decision, and for all decisions of a seat beyond that. */
export const CLOCKS: Record<Exclude<ClockChoice, "own">, { decisionTimeMs: number; bankMs: number }> = {
  noHurry: { decisionTimeMs: 3_600_000, bankMs: 0 },
  relaxed: { decisionTimeMs: 60_000, bankMs: 300_000 },
  brisk: { decisionTimeMs: 20_000, bankMs: 60_000 },
};

/** How long built-in agents wait before they decide, so that a person can follow, milliseconds. */
export const PACE_MS = 1200;

/** The form; numbers as they were typed. */
export interface RoomForm {
  name: string;
  seats: SeatChoice[];
  preset: string;
  faces: string;
  jokers: string;
  stop: "points" | "shifts";
  target: string;
  /** Points by place, separated by commas; empty: the standard ones. */
  points: string;
  exchange: boolean;
  specialActions: boolean;
  opening: "golden" | "anyTopFace";
  openingPass: boolean;
  passScope: "pizza" | "turn";
  maxIdlePizzas: string;
  maxTurns: string;
  clock: ClockChoice;
  decisionSeconds: string;
  bankSeconds: string;
  paceSeconds: string;
  maxInvalidAttempts: string;
  maxTimeouts: string;
  substitute: string;
  abort: "allLost" | "anyLost" | "never";
  spectators: boolean;
  spectatorDelay: string;
  spectatorsSeeHands: boolean;
}

/** Names of the fields that hold one value. */
export type FieldName = Exclude<keyof RoomForm, "seats">;

/** A form to begin with: a person against three built-in agents, by the standard rules. */
export function newForm(opponents: readonly string[]): RoomForm {
  return {
    name: "",
    seats: ["human", ...threeOf(opponents).map((agent): SeatChoice => `built-in ${agent}`)],
    preset: "paper",
    faces: "11",
    jokers: "2",
    stop: "points",
    target: "15",
    points: "",
    exchange: true,
    specialActions: true,
    opening: "golden",
    openingPass: false,
    passScope: "pizza",
    maxIdlePizzas: "3",
    maxTurns: "10000",
    clock: "relaxed",
    decisionSeconds: "60",
    bankSeconds: "300",
    paceSeconds: String(PACE_MS / 1000),
    maxInvalidAttempts: "10",
    maxTimeouts: "3",
    substitute: "random",
    abort: "allLost",
    spectators: true,
    spectatorDelay: "0",
    spectatorsSeeHands: false,
  };
}

/** The form with the rules of a preset, which has every field set. */
export function withPreset(form: RoomForm, preset: RuleSet): RoomForm {
  return {
    ...form,
    preset: preset.preset,
    faces: String(preset.faces ?? form.faces),
    jokers: String(preset.jokers ?? form.jokers),
    stop: preset.stop.case === "targetShifts" ? "shifts" : "points",
    target: String(preset.stop.value ?? form.target),
    points: form.seats.length === preset.points.length ? preset.points.join(", ") : "",
    exchange: preset.exchange ?? form.exchange,
    specialActions: preset.specialActions ?? form.specialActions,
    opening: preset.opening === Opening.ANY_TOP_FACE ? "anyTopFace" : "golden",
    openingPass: preset.openingPass ?? form.openingPass,
    passScope: preset.passScope === PassScope.TURN ? "turn" : "pizza",
    maxIdlePizzas: String(preset.maxIdlePizzas ?? form.maxIdlePizzas),
    maxTurns: String(preset.maxTurns ?? form.maxTurns),
  };
}

/** The form with so many seats: the last ones go, new ones are free for people. Points of another number of seats fit no more. */
export function withPlayers(form: RoomForm, players: number): RoomForm {
  const seats = form.seats.slice(0, players);
  while (seats.length < players) seats.push("human");
  return { ...form, seats, points: seats.length === form.seats.length ? form.points : "" };
}

/** The fields in which no number was typed. */
export function unreadable(form: RoomForm): FieldName[] {
  const whole: FieldName[] = ["faces", "jokers", "target", "maxIdlePizzas", "maxTurns"];
  whole.push("maxInvalidAttempts", "maxTimeouts", "spectatorDelay");
  const seconds: FieldName[] = ["paceSeconds"];
  if (form.clock === "own") seconds.push("decisionSeconds", "bankSeconds");
  const bad = whole.filter((field) => !/^\d{1,9}$/.test(String(form[field]).trim()));
  bad.push(...seconds.filter((field) => !/^\d{1,6}([.,]\d{1,3})?$/.test(String(form[field]).trim())));
  if (form.points.trim() !== "" && !/^\d{1,9}([\s,;]+\d{1,9})*$/.test(form.points.trim())) bad.push("points");
  return bad;
}

/** The request that a form makes; its numbers must be readable. */
export function requestOf(form: RoomForm): MessageInitShape<typeof CreateRoomRequestSchema> {
  const target = Number(form.target);
  const clock =
    form.clock === "own"
      ? { decisionTimeMs: milliseconds(form.decisionSeconds), bankMs: milliseconds(form.bankSeconds) }
      : CLOCKS[form.clock];
  return {
    name: form.name.trim(),
    rules: {
      preset: form.preset,
      players: form.seats.length,
      faces: Number(form.faces),
      jokers: Number(form.jokers),
      stop: form.stop === "points" ? { case: "targetPoints", value: target } : { case: "targetShifts", value: target },
      points: form.points.split(/[\s,;]+/).flatMap((points) => (points === "" ? [] : [Number(points)])),
      exchange: form.exchange,
      specialActions: form.specialActions,
      opening: form.opening === "golden" ? Opening.GOLDEN : Opening.ANY_TOP_FACE,
      openingPass: form.openingPass,
      passScope: form.passScope === "pizza" ? PassScope.PIZZA : PassScope.TURN,
      maxIdlePizzas: Number(form.maxIdlePizzas),
      maxTurns: Number(form.maxTurns),
    },
    seats: form.seats.map(seatConfig),
    policy: {
      ...clock,
      paceMs: milliseconds(form.paceSeconds),
      maxInvalidAttempts: Number(form.maxInvalidAttempts),
      maxTimeouts: Number(form.maxTimeouts),
      substitute: form.substitute,
      abort: ABORTS[form.abort],
      spectators: form.spectators,
      spectatorDelayDecisions: Number(form.spectatorDelay),
      spectatorsSeeHands: form.spectatorsSeeHands,
    },
  };
}

/** The request for a game of one person against three built-in agents, without hurry. */
export function quickGame(
  name: string,
  builtInAgents: readonly string[],
): MessageInitShape<typeof CreateRoomRequestSchema> {
  return { ...requestOf(newForm(builtInAgents)), name: Array.from(name).slice(0, MAX_NAME).join("") };
}

/** The field of the form that a field of the request is typed in; null if it is none of its own. */
export function fieldOf(requestField: string): FieldName | null {
  return FIELDS[requestField] ?? null;
}

const ABORTS = { allLost: AbortPolicy.ALL_LOST, anyLost: AbortPolicy.ANY_LOST, never: AbortPolicy.NEVER };

const FIELDS: Record<string, FieldName> = {
  name: "name",
  preset: "preset",
  faces: "faces",
  jokers: "jokers",
  stop: "target",
  target_points: "target",
  target_shifts: "target",
  points: "points",
  max_idle_pizzas: "maxIdlePizzas",
  max_turns: "maxTurns",
  decision_time_ms: "decisionSeconds",
  bank_ms: "bankSeconds",
  pace_ms: "paceSeconds",
  max_invalid_attempts: "maxInvalidAttempts",
  max_timeouts: "maxTimeouts",
  spectator_delay_decisions: "spectatorDelay",
  spectators_see_hands: "spectatorsSeeHands",
};

/** Opponents of different strength, as far as the server has them. */
function threeOf(builtInAgents: readonly string[]): string[] {
  const wanted = ["trained", "greedy", "random"];
  const known = wanted.filter((agent) => builtInAgents.includes(agent));
  const fallback = known[0] ?? builtInAgents[0] ?? "random";
  return [0, 1, 2].map((index) => known[index] ?? fallback);
}

const KINDS = {
  human: ParticipantKind.HUMAN,
  robot: ParticipantKind.ROBOT,
  agent: ParticipantKind.AGENT,
  anybody: ParticipantKind.UNSPECIFIED,
};

function seatConfig(choice: SeatChoice) {
  switch (choice) {
    case "human":
    case "robot":
    case "agent":
    case "anybody":
      return { filledBy: { case: "reservedFor" as const, value: KINDS[choice] } };
    default:
      return { filledBy: { case: "builtInAgent" as const, value: choice.slice("built-in ".length) } };
  }
}

function milliseconds(seconds: string): number {
  return Math.round(Number(seconds.trim().replace(",", ".")) * 1000);
}
