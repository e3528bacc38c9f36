// The values of the fields that rooms and tournaments share: rules, clock, late and invalid
// answers, spectators. Used by room-form.ts and tournaments/tournament-form.ts; drawn by
// GameFields.tsx. The server validates rules and times; this module only finds obvious mistakes.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { type RoomPolicySchema, Visibility } from "../gen/chefshat/v1/room_pb";
import { Opening, PassScope, type RuleSet, type RuleSetSchema } from "../gen/chefshat/v1/rules_pb";
import { type Bounds, LARGEST, type NumberProblem, pointsProblem, secondsProblem, wholeProblem } from "./problems";

/** The choice of a clock. */
export type ClockChoice = "noHurry" | "relaxed" | "brisk" | "own";

/** The choice of who sees the room or tournament. */
export type VisibilityChoice = "public" | "unlisted" | "private";

/** Milliseconds of each clock: per decision, and for all decisions of a seat beyond that. */
export const CLOCKS: Record<Exclude<ClockChoice, "own">, { decisionTimeMs: number; bankMs: number }> = {
  noHurry: { decisionTimeMs: 3_600_000, bankMs: 0 },
  relaxed: { decisionTimeMs: 60_000, bankMs: 300_000 },
  brisk: { decisionTimeMs: 20_000, bankMs: 60_000 },
};

/** Delay of built-in agents before each decision, milliseconds, so that people can follow. */
export const PACE_MS = 1200;

/** The fields; numbers as typed. */
export interface GameForm {
  preset: string;
  faces: string;
  jokers: string;
  stop: "points" | "shifts";
  target: string;
  /** Points by place, separated by commas; empty for the default. */
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
  /** Empty for the default, which depends on who plays. */
  absenceSeconds: string;
  substitute: string;
  spectators: boolean;
  spectatorDelay: string;
  spectatorsSeeHands: boolean;
  hints: boolean;
  chat: boolean;
  visibility: VisibilityChoice;
}

/** Names of the fields. */
export type GameField = keyof GameForm;

/** The default rules, with the relaxed clock. */
export function newGame(): GameForm {
  return {
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
    absenceSeconds: "",
    substitute: "random",
    spectators: true,
    spectatorDelay: "0",
    spectatorsSeeHands: false,
    hints: false,
    chat: false,
    visibility: "public",
  };
}

/** The form with the rules of a preset, which sets every field. */
export function withPreset<Form extends GameForm>(form: Form, preset: RuleSet, players: number): Form {
  return {
    ...form,
    preset: preset.preset,
    faces: String(preset.faces ?? form.faces),
    jokers: String(preset.jokers ?? form.jokers),
    stop: preset.stop.case === "targetShifts" ? "shifts" : "points",
    target: String(preset.stop.value ?? form.target),
    points: players === preset.points.length ? preset.points.join(", ") : "",
    exchange: preset.exchange ?? form.exchange,
    specialActions: preset.specialActions ?? form.specialActions,
    opening: preset.opening === Opening.ANY_TOP_FACE ? "anyTopFace" : "golden",
    openingPass: preset.openingPass ?? form.openingPass,
    passScope: preset.passScope === PassScope.TURN ? "turn" : "pizza",
    maxIdlePizzas: String(preset.maxIdlePizzas ?? form.maxIdlePizzas),
    maxTurns: String(preset.maxTurns ?? form.maxTurns),
  };
}

/** Bounds of the integer fields. */
const WHOLE: Partial<Record<GameField, Bounds>> = {
  faces: [4, 15],
  jokers: [0, 2],
  target: [1, LARGEST],
  maxIdlePizzas: [1, LARGEST],
  maxTurns: [1, LARGEST],
  maxInvalidAttempts: [0, 1000],
  maxTimeouts: [1, 1000],
  spectatorDelay: [0, 10_000],
};
const PACE_SECONDS: Bounds = [0, 60];
const DECISION_SECONDS: Bounds = [0.01, 86_400];
const BANK_SECONDS: Bounds = [0, 86_400];
const ABSENCE_SECONDS: Bounds = [0, 86_400];

/** The problems of the fields. */
export function gameProblems(form: GameForm, players: number): Partial<Record<GameField, NumberProblem>> {
  const found: Partial<Record<GameField, NumberProblem | undefined>> = {
    points: pointsProblem(form.points, players),
    paceSeconds: secondsProblem(form.paceSeconds, PACE_SECONDS),
    absenceSeconds: isEmpty(form.absenceSeconds) ? undefined : secondsProblem(form.absenceSeconds, ABSENCE_SECONDS),
  };
  for (const [field, bounds] of Object.entries(WHOLE)) {
    found[field as GameField] = wholeProblem(String(form[field as GameField]), bounds);
  }
  // A disabled field is not submitted.
  if (!form.spectators) delete found.spectatorDelay;
  if (form.clock === "own") {
    found.decisionSeconds = secondsProblem(form.decisionSeconds, DECISION_SECONDS);
    found.bankSeconds = secondsProblem(form.bankSeconds, BANK_SECONDS);
  }
  return problemsAlone(found);
}

/** The entries that have a problem. */
export function problemsAlone<Field extends string, Problem>(
  found: Partial<Record<Field, Problem | undefined>>,
): Partial<Record<Field, Problem>> {
  const wrong = Object.entries(found).filter(([, problem]) => problem !== undefined);
  return Object.fromEntries(wrong) as Partial<Record<Field, Problem>>;
}

/** The rules of a form without problems. */
export function rulesOf(form: GameForm, players: number): MessageInitShape<typeof RuleSetSchema> {
  const target = Number(form.target);
  return {
    preset: form.preset,
    players,
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
  };
}

/** The policy of a form without problems. */
export function policyOf(form: GameForm) {
  const clock =
    form.clock === "own"
      ? { decisionTimeMs: milliseconds(form.decisionSeconds), bankMs: milliseconds(form.bankSeconds) }
      : CLOCKS[form.clock];
  return {
    ...clock,
    paceMs: milliseconds(form.paceSeconds),
    maxInvalidAttempts: Number(form.maxInvalidAttempts),
    maxTimeouts: Number(form.maxTimeouts),
    ...(isEmpty(form.absenceSeconds) ? {} : { absenceTimeMs: milliseconds(form.absenceSeconds) }),
    substitute: form.substitute,
    spectators: form.spectators,
    spectatorDelayDecisions: form.spectators ? Number(form.spectatorDelay) : 0,
    spectatorsSeeHands: form.spectators && form.spectatorsSeeHands,
    hints: form.hints,
    chat: form.chat,
    visibility: VISIBILITIES[form.visibility],
  } satisfies MessageInitShape<typeof RoomPolicySchema>;
}

const VISIBILITIES = {
  public: Visibility.PUBLIC,
  unlisted: Visibility.UNLISTED,
  private: Visibility.PRIVATE,
};

/** The fields by their names in the protocol. */
export const GAME_FIELDS: Record<string, GameField> = {
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
  absence_time_ms: "absenceSeconds",
  spectator_delay_decisions: "spectatorDelay",
  spectators_see_hands: "spectatorsSeeHands",
  visibility: "visibility",
};

function isEmpty(typed: string): boolean {
  return typed.trim() === "";
}

/** Converts typed seconds to milliseconds. */
export function milliseconds(seconds: string): number {
  return Math.round(Number(seconds.trim().replace(",", ".")) * 1000);
}
