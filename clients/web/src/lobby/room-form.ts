// The form for a new room and its request: the seats, and the fields of every game (game-form.ts).
// Drawn by NewRoom.tsx.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { AbortPolicy, ParticipantKind } from "../gen/chefshat/v1/room_pb";
import type { CreateRoomRequestSchema } from "../gen/chefshat/v1/room_service_pb";
import { GAME_FIELDS, type GameForm, newGame, policyOf, rulesOf } from "./game-form";

/** Longest name of a room or participant, characters. */
export const MAX_NAME = 64;

/**
 * Whom a seat is reserved for, who sits at the table with real cards, or the built-in agent that
 * fills it.
 */
export type SeatChoice = Remote | AtTable | `built-in ${string}`;
type Remote = "human" | "robot" | "model" | "wizard" | "agent" | "anybody";
export type AtTable = "at-table human" | "at-table robot";

/** The form; numbers as typed. */
export interface RoomForm extends GameForm {
  name: string;
  /** Whether the server deals, or real cards lie on a table. */
  cards: "dealt" | "real";
  seats: SeatChoice[];
  /** Names of the players at the table, by seat; others choose theirs. */
  seatNames: string[];
  abort: "allLost" | "anyLost" | "never";
}

/** Names of the fields with a single value. */
export type FieldName = Exclude<keyof RoomForm, "seats" | "cards">;

/** The initial form: a person and three built-in agents, with the default rules. */
export function newForm(opponents: readonly string[]): RoomForm {
  return {
    ...newGame(),
    name: "",
    cards: "dealt",
    seatNames: [],
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
  while (seats.length < players) seats.push(form.cards === "real" ? "at-table human" : "human");
  return { ...form, seats, points: seats.length === form.seats.length ? form.points : "" };
}

/** The built-in agent that does not play with real cards. */
export const SEARCHING: SeatChoice = "built-in monte_carlo";

/**
 * Changes whether the cards are real: then everybody but built-in agents sits at the table at first,
 * else nobody.
 */
export function withCards(form: RoomForm, cards: RoomForm["cards"]): RoomForm {
  const seats = form.seats.map((choice): SeatChoice => {
    if (cards === "real") return choice.startsWith("built-in ") && choice !== SEARCHING ? choice : "at-table human";
    return choice === "at-table robot" ? "robot" : isAtTable(choice) ? "human" : choice;
  });
  return { ...form, cards, seats };
}

/** Whether a player of this choice sits at the table with real cards. */
export function isAtTable(choice: SeatChoice): choice is AtTable {
  return choice.startsWith("at-table ");
}

/** What is wrong with a room for real cards, by field. */
export function physicalProblems(form: RoomForm): { seatNames?: "nameMissing"; opening?: "realOpening" } {
  return {
    ...(namesMissing(form) ? { seatNames: "nameMissing" } : {}),
    // Nobody draws a seat there.
    ...(form.cards === "real" && form.opening !== "golden" ? { opening: "realOpening" } : {}),
  };
}

/** Whether a player at the table has no name yet. */
function namesMissing({ seats, seatNames }: RoomForm): boolean {
  return seats.some((choice, seat) => isAtTable(choice) && (seatNames[seat] ?? "").trim() === "");
}

/** The request of a form without problems; `agentNames`: what built-in agents are called, by seat. */
export function requestOf(
  form: RoomForm,
  agentNames: readonly string[] = [],
): MessageInitShape<typeof CreateRoomRequestSchema> {
  return {
    name: form.name.trim(),
    rules: rulesOf(form, form.seats.length),
    seats: form.seats.map((choice, seat) => seatConfig(choice, form.seatNames[seat] ?? "", agentNames[seat] ?? "")),
    policy: { ...policyOf(form), abort: ABORTS[form.abort] },
    physical: form.cards === "real",
  };
}

/** What the agents of a quick game are called; by the second name if the person has the first. */
const NAMES: Record<string, readonly [string, string]> = {
  trained: ["Greta", "Pia"],
  greedy: ["Gustav", "Udo"],
  random: ["Rolf", "Emil"],
};

/** The request for a game of one person and three built-in agents with names, with the relaxed clock. */
export function quickGame(
  name: string,
  player: string,
  builtInAgents: readonly string[],
): MessageInitShape<typeof CreateRoomRequestSchema> {
  const form = { ...newForm(builtInAgents), name: Array.from(name).slice(0, MAX_NAME).join("") };
  const names = threeOf(builtInAgents).map((agent, index, agents) => {
    // A server without one of them has another twice.
    const [first = "", second = ""] = agents.indexOf(agent) === index ? (NAMES[agent] ?? []) : [];
    return first.toLowerCase() === player.trim().toLowerCase() ? second : first;
  });
  return requestOf(form, ["", ...names]);
}

/** The fields by their names in the protocol. */
export const ROOM_FIELDS: Record<string, FieldName> = { ...GAME_FIELDS, name: "name", seats: "seatNames" };

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
  model: ParticipantKind.MODEL,
  agent: ParticipantKind.AGENT,
  anybody: ParticipantKind.UNSPECIFIED,
};

function seatConfig(choice: SeatChoice, name: string, agentName: string) {
  switch (choice) {
    case "at-table human":
      return { filledBy: { case: "atTable" as const, value: KINDS.human }, name: name.trim() };
    case "at-table robot":
      return { filledBy: { case: "atTable" as const, value: KINDS.robot }, name: name.trim() };
    case "wizard":
      return { filledBy: { case: "wizard" as const, value: KINDS.robot } };
    case "human":
    case "robot":
    case "model":
    case "agent":
    case "anybody":
      return { filledBy: { case: "reservedFor" as const, value: KINDS[choice] } };
    default:
      return { filledBy: { case: "builtInAgent" as const, value: choice.slice("built-in ".length) }, name: agentName };
  }
}
