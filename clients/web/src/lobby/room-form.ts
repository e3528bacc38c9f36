// What the form for a new room holds, and the request that it makes: who has which seat, and the fields of every game (game-form.ts). Values
// without a page: how they are asked for is in NewRoom.tsx.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { AbortPolicy, ParticipantKind } from "../gen/chefshat/v1/room_pb";
import type { CreateRoomRequestSchema } from "../gen/chefshat/v1/room_service_pb";
import { GAME_FIELDS, type GameForm, newGame, policyOf, rulesOf } from "./game-form";

/** Longest name of a room or participant, characters. */
export const MAX_NAME = 64;

/** For whom a seat is free, or by which built-in agent it is filled. */
export type SeatChoice = "human" | "robot" | "agent" | "anybody" | `built-in ${string}`;

/** The form; numbers as they were typed. */
export interface RoomForm extends GameForm {
  name: string;
  seats: SeatChoice[];
  abort: "allLost" | "anyLost" | "never";
}

/** Names of the fields that hold one value. */
export type FieldName = Exclude<keyof RoomForm, "seats">;

/** A form to begin with: a person against three built-in agents, by the standard rules. */
export function newForm(opponents: readonly string[]): RoomForm {
  return {
    ...newGame(),
    name: "",
    seats: ["human", ...threeOf(opponents).map((agent): SeatChoice => `built-in ${agent}`)],
    abort: "allLost",
  };
}

/** The form with so many seats: the last ones go, new ones are free for people. Points of another number of seats fit no more. */
export function withPlayers(form: RoomForm, players: number): RoomForm {
  const seats = form.seats.slice(0, players);
  while (seats.length < players) seats.push("human");
  return { ...form, seats, points: seats.length === form.seats.length ? form.points : "" };
}

/** The request that a form makes; its numbers must be readable. */
export function requestOf(form: RoomForm): MessageInitShape<typeof CreateRoomRequestSchema> {
  return {
    name: form.name.trim(),
    rules: rulesOf(form, form.seats.length),
    seats: form.seats.map(seatConfig),
    policy: { ...policyOf(form), abort: ABORTS[form.abort] },
  };
}

/** The request for a game of one person against three built-in agents, with the relaxed clock. */
export function quickGame(
  name: string,
  builtInAgents: readonly string[],
): MessageInitShape<typeof CreateRoomRequestSchema> {
  return { ...requestOf(newForm(builtInAgents)), name: Array.from(name).slice(0, MAX_NAME).join("") };
}

/** The fields by the names that the protocol has for what is typed in them. */
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
