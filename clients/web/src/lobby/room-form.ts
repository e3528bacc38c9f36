// The form for a new room and its request: the seats, and the fields of every game (game-form.ts).
// Drawn by NewRoom.tsx.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { AbortPolicy, ParticipantKind } from "../gen/chefshat/v1/room_pb";
import type { CreateRoomRequestSchema } from "../gen/chefshat/v1/room_service_pb";
import { GAME_FIELDS, type GameForm, newGame, policyOf, rulesOf } from "./game-form";

/** Longest name of a room or participant, characters. */
export const MAX_NAME = 64;

/** Whom a seat is reserved for, or the built-in agent that fills it. */
export type SeatChoice = "human" | "robot" | "agent" | "anybody" | `built-in ${string}`;

/** The form; numbers as typed. */
export interface RoomForm extends GameForm {
  name: string;
  seats: SeatChoice[];
  abort: "allLost" | "anyLost" | "never";
}

/** Names of the fields with a single value. */
export type FieldName = Exclude<keyof RoomForm, "seats">;

/** The initial form: a person and three built-in agents, with the default rules. */
export function newForm(opponents: readonly string[]): RoomForm {
  return {
    ...newGame(),
    name: "",
    seats: ["human", ...threeOf(opponents).map((agent): SeatChoice => `built-in ${agent}`)],
    abort: "allLost",
  };
}

/**
 * Changes the number of seats: removes the last ones, or adds ones free for people. Points for
 * another number of seats are cleared.
 */
export function withPlayers(form: RoomForm, players: number): RoomForm {
  const seats = form.seats.slice(0, players);
  while (seats.length < players) seats.push("human");
  return { ...form, seats, points: seats.length === form.seats.length ? form.points : "" };
}

/** The request of a form without problems. */
export function requestOf(form: RoomForm): MessageInitShape<typeof CreateRoomRequestSchema> {
  return {
    name: form.name.trim(),
    rules: rulesOf(form, form.seats.length),
    seats: form.seats.map(seatConfig),
    policy: { ...policyOf(form), abort: ABORTS[form.abort] },
  };
}

/** The request for a game of one person and three built-in agents, with the relaxed clock. */
export function quickGame(
  name: string,
  builtInAgents: readonly string[],
): MessageInitShape<typeof CreateRoomRequestSchema> {
  return { ...requestOf(newForm(builtInAgents)), name: Array.from(name).slice(0, MAX_NAME).join("") };
}

/** The fields by their names in the protocol. */
export const ROOM_FIELDS: Record<string, FieldName> = { ...GAME_FIELDS, name: "name" };

const ABORTS = { allLost: AbortPolicy.ALL_LOST, anyLost: AbortPolicy.ANY_LOST, never: AbortPolicy.NEVER };

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
