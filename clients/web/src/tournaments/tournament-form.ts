// What the form for a new tournament holds, and the settings that it asks for: the form of play, who takes part, when it begins, and the
// fields of every game (lobby/game-form.ts). Values without a page: how they are asked for is in NewTournament.tsx. Bounds are the server's.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { TournamentDeals, TournamentFormat, type TournamentSettingsSchema } from "../gen/chefshat/v1/tournament_pb";
import {
  GAME_FIELDS,
  type GameForm,
  gameProblems,
  milliseconds,
  newGame,
  policyOf,
  problemsAlone,
  rulesOf,
} from "../lobby/game-form";
import { type Bounds, type NumberProblem, secondsProblem, wholeProblem } from "../lobby/problems";

/** The form; numbers as they were typed. */
export interface TournamentForm extends GameForm {
  name: string;
  format: "knockout" | "roundRobin" | "swiss";
  /** Seats of a table. */
  players: "2" | "3" | "4" | "5" | "6";
  /** Empty: as many as the format suggests. */
  rounds: string;
  gamesPerPairing: string;
  deals: "independent" | "same" | "rotated";
  /** How many take part of each built-in agent, by its name. */
  builtIn: Readonly<Record<string, string>>;
  people: boolean;
  agents: boolean;
  robots: boolean;
  maxParticipants: string;
  start: "byHand" | "joined";
  startWhen: string;
  noShowSeconds: string;
  maxCalls: string;
  maxParallel: string;
  filler: string;
  /** Whether agents and robots have the times of all, or their own. */
  otherClocks: boolean;
  agentSeconds: string;
  robotSeconds: string;
  /** 64 hexadecimal digits, or empty. */
  drawSeed: string;
  dealSeed: string;
}

/** Names of the fields. */
export type TournamentField = keyof TournamentForm;

/** Why a field cannot be sent. */
export type Problem = NumberProblem | OwnProblem;
export type OwnProblem = "nameMissing" | "tooMany" | "nobody" | "notASeed";

/** Most participants of a tournament that the protocol has room for. */
const MAX_PARTICIPANTS = 1024;

/** A form to begin with: a knockout for people and agents that its organiser begins. */
export function newTournament(agents: readonly string[]): TournamentForm {
  return {
    ...newGame(),
    name: "",
    format: "knockout",
    players: "4",
    rounds: "",
    gamesPerPairing: "1",
    deals: "independent",
    builtIn: Object.fromEntries(agents.map((agent) => [agent, "0"])),
    people: true,
    agents: true,
    robots: true,
    maxParticipants: "64",
    start: "byHand",
    startWhen: "8",
    noShowSeconds: "60",
    maxCalls: "2",
    maxParallel: "64",
    filler: "random",
    otherClocks: false,
    agentSeconds: "10",
    robotSeconds: "30",
    drawSeed: "",
    dealSeed: "",
  };
}

/** The form with another format. A knockout is for tables of four; points of another number of seats fit no more. */
export function withFormat(form: TournamentForm, format: TournamentForm["format"]): TournamentForm {
  return format === "knockout" ? { ...withTable(form, "4"), format, rounds: "" } : { ...form, format };
}

/** The form with tables of another size. */
export function withTable(form: TournamentForm, players: TournamentForm["players"]): TournamentForm {
  return { ...form, players, points: players === form.players ? form.points : "" };
}

/** The form without spectators where games are dealt alike: nobody may watch there, and what was typed for it before is not asked for. */
function asWatched(form: TournamentForm): TournamentForm {
  return { ...form, spectators: form.spectators && form.deals === "independent" };
}

/** What can be seen to be wrong before it is sent. */
export function problemsOf(form: TournamentForm): Partial<Record<TournamentField, Problem>> {
  const problems: Partial<Record<TournamentField, Problem | undefined>> = gameProblems(
    asWatched(form),
    Number(form.players),
  );
  const whole: [TournamentField, Bounds][] = [
    ["gamesPerPairing", [1, 1000]],
    ["maxParticipants", [2, MAX_PARTICIPANTS]],
    ["maxCalls", [1, 10]],
    ["maxParallel", [1, 256]],
  ];
  if (form.rounds.trim() !== "") whole.push(["rounds", [1, 1000]]);
  if (form.start === "joined") whole.push(["startWhen", [2, MAX_PARTICIPANTS]]);
  const seconds: [TournamentField, Bounds][] = [["noShowSeconds", [1, 86_400]]];
  if (form.otherClocks) seconds.push(["agentSeconds", [0.01, 86_400]], ["robotSeconds", [0.01, 86_400]]);
  for (const [field, bounds] of whole) problems[field] = wholeProblem(String(form[field]), bounds);
  for (const [field, bounds] of seconds) problems[field] = secondsProblem(String(form[field]), bounds);
  const wrong = Object.values(form.builtIn).find(isNoCount);
  if (wrong !== undefined) problems.builtIn = wholeProblem(wrong, [0, MAX_PARTICIPANTS]);
  else if (builtIns(form) > MAX_PARTICIPANTS) problems.builtIn = "tooMany";
  for (const seed of ["drawSeed", "dealSeed"] as const)
    if (form[seed].trim() !== "" && !/^[0-9a-f]{64}$/i.test(form[seed].trim())) problems[seed] = "notASeed";
  if (!form.people && !form.agents && !form.robots) problems.people = "nobody";
  if (form.name.trim() === "") problems.name = "nameMissing";
  return problemsAlone(problems);
}

function isCount(typed: string): boolean {
  return wholeProblem(typed, [0, MAX_PARTICIPANTS]) === undefined;
}

/** Whether what was typed for a built-in agent is no number of participants; nothing typed is none. */
export function isNoCount(typed: string): boolean {
  return typed.trim() !== "" && !isCount(typed);
}

/** How many built-in agents take part, as far as numbers were typed. */
export function builtIns(form: TournamentForm): number {
  return Object.values(form.builtIn).reduce((sum, count) => sum + (isCount(count) ? Number(count) : 0), 0);
}

/** The settings that a form asks for; it must have no problems. */
export function settingsOf(form: TournamentForm): MessageInitShape<typeof TournamentSettingsSchema> {
  const { spectators, ...policy } = policyOf(asWatched(form));
  // Where games are dealt alike, the server does not take it as said that nobody may watch.
  const watched = form.deals === "independent" ? { spectators } : {};
  const clocks = form.otherClocks
    ? [
        { kind: ParticipantKind.AGENT, decisionTimeMs: milliseconds(form.agentSeconds), bankMs: 0 },
        { kind: ParticipantKind.ROBOT, decisionTimeMs: milliseconds(form.robotSeconds), bankMs: 0 },
      ]
    : [];
  const joined = form.start === "joined" ? Number(form.startWhen) : 0;
  return {
    name: form.name.trim(),
    format: FORMATS[form.format],
    rules: rulesOf(form, Number(form.players)),
    policy: { ...policy, ...watched, clocks },
    rounds: form.format === "knockout" ? 0 : Number(form.rounds),
    gamesPerPairing: Number(form.gamesPerPairing),
    deals: DEALS[form.deals],
    kinds: kindsOf(form),
    maxParticipants: Number(form.maxParticipants),
    builtInAgents: Object.entries(form.builtIn).flatMap(([agent, count]) => Array<string>(Number(count)).fill(agent)),
    startWhenJoined: joined,
    noShowTimeMs: milliseconds(form.noShowSeconds),
    maxCalls: Number(form.maxCalls),
    maxParallelGames: Number(form.maxParallel),
    filler: form.filler,
    drawSeed: seedOf(form.drawSeed),
    dealSeed: seedOf(form.dealSeed),
  };
}

/** The fields by the names that the protocol has for what is typed in them. */
export const TOURNAMENT_FIELDS: Record<string, TournamentField> = {
  ...GAME_FIELDS,
  name: "name",
  format: "format",
  players: "players",
  rules: "points",
  rounds: "rounds",
  games_per_pairing: "gamesPerPairing",
  deals: "deals",
  max_participants: "maxParticipants",
  built_in_agents: "builtIn",
  start_when_joined: "startWhen",
  no_show_time_ms: "noShowSeconds",
  max_calls: "maxCalls",
  max_parallel_games: "maxParallel",
};

const FORMATS = {
  knockout: TournamentFormat.KNOCKOUT,
  roundRobin: TournamentFormat.ROUND_ROBIN,
  swiss: TournamentFormat.SWISS,
};

const DEALS = {
  independent: TournamentDeals.INDEPENDENT,
  same: TournamentDeals.SAME_AT_ALL_TABLES,
  rotated: TournamentDeals.ROTATED,
};

/** Kinds that may join; none are named if all may. */
function kindsOf(form: TournamentForm): ParticipantKind[] {
  const { people, agents, robots } = form;
  if (people && agents && robots) return [];
  return [
    ...(people ? [ParticipantKind.HUMAN] : []),
    ...(agents ? [ParticipantKind.AGENT] : []),
    ...(robots ? [ParticipantKind.ROBOT] : []),
  ];
}

function seedOf(typed: string): Uint8Array {
  return Uint8Array.from(typed.trim().match(/../g) ?? [], (byte) => Number.parseInt(byte, 16));
}
