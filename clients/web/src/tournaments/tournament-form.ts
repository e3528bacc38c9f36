// The form for a new tournament and its settings: format, participants, start, and the fields of
// every game (lobby/game-form.ts). Drawn by NewTournament.tsx. The bounds are the server's.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { TournamentDeals, TournamentFormat, type TournamentSettingsSchema } from "../gen/chefshat/v1/tournament_pb";
import { fromHex } from "../hex";
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

/** The form; numbers as typed. */
export interface TournamentForm extends GameForm {
  name: string;
  format: "knockout" | "roundRobin" | "swiss";
  /** Seats per table. */
  players: "2" | "3" | "4" | "5" | "6";
  /** Empty for as many as the format suggests. */
  rounds: string;
  gamesPerPairing: string;
  deals: "independent" | "same" | "rotated";
  /** Number of each built-in agent, by name. */
  builtIn: Readonly<Record<string, string>>;
  people: boolean;
  agents: boolean;
  robots: boolean;
  models: boolean;
  maxParticipants: string;
  physicalTables: string;
  start: "byHand" | "joined" | "time";
  startWhen: string;
  /** As a date field has it: local time, without a zone. */
  startAt: string;
  noShowSeconds: string;
  maxCalls: string;
  maxParallel: string;
  filler: string;
  /** Whether agents, robots and language models have their own times. */
  otherClocks: boolean;
  agentSeconds: string;
  robotSeconds: string;
  modelSeconds: string;
  /** 64 hexadecimal digits, or empty. */
  drawSeed: string;
  dealSeed: string;
}

/** Names of the fields. */
export type TournamentField = keyof TournamentForm;

/** Why a field is invalid. */
export type Problem = NumberProblem | OwnProblem;
export type OwnProblem = "nameMissing" | "tooMany" | "nobody" | "notASeed" | "realOpening" | "startPassed";

/** Most participants of a tournament in the protocol. */
const MAX_PARTICIPANTS = 1024;

/** The initial form: a knockout for people and agents that its organiser starts. */
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
    models: true,
    maxParticipants: "64",
    physicalTables: "0",
    start: "byHand",
    startWhen: "8",
    startAt: "",
    noShowSeconds: "60",
    maxCalls: "2",
    maxParallel: "64",
    filler: "random",
    otherClocks: false,
    agentSeconds: "10",
    robotSeconds: "30",
    modelSeconds: "60",
    drawSeed: "",
    dealSeed: "",
  };
}

/**
 * Changes the format. A knockout has tables of four; points for another number of seats are
 * cleared.
 */
export function withFormat(form: TournamentForm, format: TournamentForm["format"]): TournamentForm {
  return format === "knockout" ? { ...withTable(form, "4"), format, rounds: "" } : { ...form, format };
}

/** Changes the number of seats per table. */
export function withTable(form: TournamentForm, players: TournamentForm["players"]): TournamentForm {
  return { ...form, players, points: players === form.players ? form.points : "" };
}

/**
 * The form without spectators if deals are shared: they are not allowed then, and the fields for
 * them are ignored.
 */
function asWatched(form: TournamentForm): TournamentForm {
  return { ...form, spectators: form.spectators && form.deals === "independent" };
}

/** Problems that can be found before submitting. */
export function problemsOf(form: TournamentForm): Partial<Record<TournamentField, Problem>> {
  const problems: Partial<Record<TournamentField, Problem | undefined>> = gameProblems(
    asWatched(form),
    Number(form.players),
  );
  const whole: [TournamentField, Bounds][] = [
    ["gamesPerPairing", [1, 1000]],
    ["maxParticipants", [2, MAX_PARTICIPANTS]],
    ["physicalTables", [0, 64]],
    ["maxCalls", [1, 10]],
    ["maxParallel", [1, 256]],
  ];
  if (form.rounds.trim() !== "") whole.push(["rounds", [1, 1000]]);
  if (form.start === "joined") whole.push(["startWhen", [2, MAX_PARTICIPANTS]]);
  const seconds: [TournamentField, Bounds][] = [["noShowSeconds", [1, 86_400]]];
  if (form.otherClocks)
    seconds.push(["agentSeconds", [0.01, 86_400]], ["robotSeconds", [0.01, 86_400]], ["modelSeconds", [0.01, 86_400]]);
  for (const [field, bounds] of whole) problems[field] = wholeProblem(String(form[field]), bounds);
  for (const [field, bounds] of seconds) problems[field] = secondsProblem(String(form[field]), bounds);
  const wrong = Object.values(form.builtIn).find(isNoCount);
  if (wrong !== undefined) problems.builtIn = wholeProblem(wrong, [0, MAX_PARTICIPANTS]);
  else if (builtIns(form) > MAX_PARTICIPANTS) problems.builtIn = "tooMany";
  for (const seed of ["drawSeed", "dealSeed"] as const)
    if (form[seed].trim() !== "" && !/^[0-9a-f]{64}$/i.test(form[seed].trim())) problems[seed] = "notASeed";
  if (Number(form.physicalTables) > 0 && form.opening !== "golden") problems.opening = "realOpening";
  if (!form.people && !form.agents && !form.robots && !form.models) problems.people = "nobody";
  if (form.start === "time" && !(Date.parse(form.startAt) > Date.now())) problems.startAt = "startPassed";
  if (form.name.trim() === "") problems.name = "nameMissing";
  return problemsAlone(problems);
}

function isCount(typed: string): boolean {
  return wholeProblem(typed, [0, MAX_PARTICIPANTS]) === undefined;
}

/** Whether the typed number of a built-in agent is invalid; empty is valid. */
export function isNoCount(typed: string): boolean {
  return typed.trim() !== "" && !isCount(typed);
}

/** Number of built-in agents, as far as valid numbers were typed. */
export function builtIns(form: TournamentForm): number {
  return Object.values(form.builtIn).reduce((sum, count) => sum + (isCount(count) ? Number(count) : 0), 0);
}

/** The settings of a form without problems. */
export function settingsOf(form: TournamentForm): MessageInitShape<typeof TournamentSettingsSchema> {
  const { spectators, ...policy } = policyOf(asWatched(form));
  // With shared deals the server requires that spectators are turned off explicitly.
  const watched = form.deals === "independent" ? { spectators } : {};
  const clocks = form.otherClocks
    ? [
        { kind: ParticipantKind.AGENT, decisionTimeMs: milliseconds(form.agentSeconds), bankMs: 0 },
        { kind: ParticipantKind.ROBOT, decisionTimeMs: milliseconds(form.robotSeconds), bankMs: 0 },
        { kind: ParticipantKind.MODEL, decisionTimeMs: milliseconds(form.modelSeconds), bankMs: 0 },
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
    physicalTables: Number(form.physicalTables),
    builtInAgents: Object.entries(form.builtIn).flatMap(([agent, count]) => Array<string>(Number(count)).fill(agent)),
    startWhenJoined: joined,
    startAtMs: form.start === "time" ? BigInt(Date.parse(form.startAt)) : 0n,
    noShowTimeMs: milliseconds(form.noShowSeconds),
    maxCalls: Number(form.maxCalls),
    maxParallelGames: Number(form.maxParallel),
    filler: form.filler,
    drawSeed: fromHex(form.drawSeed.trim()),
    dealSeed: fromHex(form.dealSeed.trim()),
  };
}

/** The fields by their names in the protocol. */
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
  physical_tables: "physicalTables",
  built_in_agents: "builtIn",
  start_when_joined: "startWhen",
  start_at_ms: "startAt",
  no_show_time_ms: "noShowSeconds",
  max_calls: "maxCalls",
  max_parallel_games: "maxParallel",
  deal_seed: "dealSeed",
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

/** Kinds that may join; none are listed if all may. */
function kindsOf(form: TournamentForm): ParticipantKind[] {
  const { people, agents, robots, models } = form;
  if (people && agents && robots && models) return [];
  return [
    ...(people ? [ParticipantKind.HUMAN] : []),
    ...(agents ? [ParticipantKind.AGENT] : []),
    ...(robots ? [ParticipantKind.ROBOT] : []),
    ...(models ? [ParticipantKind.MODEL] : []),
  ];
}
