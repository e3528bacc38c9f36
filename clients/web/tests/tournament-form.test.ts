// The request of the form for a new tournament, and its invalid fields.

import { create } from "@bufbuild/protobuf";
import { Code } from "@connectrpc/connect";
import { expect, test } from "vitest";
import { ParticipantKind } from "../src/gen/chefshat/v1/room_pb";
import {
  TournamentDeals,
  TournamentFormat,
  TournamentSchema,
  TournamentSettingsSchema,
} from "../src/gen/chefshat/v1/tournament_pb";
import { refusedField } from "../src/lobby/form-state";
import { fieldFor } from "../src/tournaments/Organiser";
import {
  newTournament,
  problemsOf,
  settingsOf,
  TOURNAMENT_FIELDS,
  type TournamentForm,
  withFormat,
  withTable,
} from "../src/tournaments/tournament-form";

const form = (changed: Partial<TournamentForm> = {}): TournamentForm => ({
  ...newTournament(["random", "greedy"]),
  name: "Spring cup",
  ...changed,
});
const asked = (changed: Partial<TournamentForm> = {}) => create(TournamentSettingsSchema, settingsOf(form(changed)));

test("the initial form is a knockout for everyone that its organiser starts", () => {
  const settings = asked({ name: " Spring cup " });
  expect([settings.name, settings.format, settings.rounds]).toEqual(["Spring cup", TournamentFormat.KNOCKOUT, 0]);
  expect([settings.kinds, settings.builtInAgents, settings.startWhenJoined]).toEqual([[], [], 0]);
  expect([settings.rules?.players, settings.noShowTimeMs, settings.policy?.spectators]).toEqual([4, 60_000, true]);
  // The tournament sets these.
  expect([settings.policy?.abort, settings.policy?.waitingTimeMs]).toEqual([0, undefined]);
});

test("built-in agents are listed as often as they take part", () => {
  const settings = asked({ builtIn: { random: "2", greedy: " 1 ", trained: "" }, start: "joined", startWhen: "5" });
  expect(settings.builtInAgents).toEqual(["random", "random", "greedy"]);
  expect(settings.startWhenJoined).toBe(5);
});

test("a start time is sent as the moment it names here, and must not have passed", () => {
  const at = { start: "time", startAt: "2199-05-01T20:00" } as const;
  expect(asked(at).startAtMs).toBe(BigInt(new Date(2199, 4, 1, 20).getTime()));
  expect(problemsOf(form(at))).toEqual({});
  expect(asked({ ...at, start: "byHand" }).startAtMs).toBe(0n);
  for (const startAt of ["", "2001-05-01T20:00"])
    expect(problemsOf(form({ ...at, startAt }))).toEqual({ startAt: "startPassed" });
});

test("with physical tables the holder of the Golden card opens", () => {
  const tables = { physicalTables: "2", opening: "anyTopFace" } as const;
  expect(asked(tables).physicalTables).toBe(2);
  expect(problemsOf(form(tables))).toEqual({ opening: "realOpening" });
  expect(problemsOf(form({ ...tables, opening: "golden" }))).toEqual({});
  expect(problemsOf(form({ ...tables, physicalTables: "0" }))).toEqual({});
});

test("kinds, clocks and seeds are sent as picked and typed", () => {
  const settings = asked({
    robots: false,
    otherClocks: true,
    agentSeconds: "0,5",
    robotSeconds: "20",
    modelSeconds: "90",
    drawSeed: `0a${"ff".repeat(31)}`,
  });
  expect(settings.kinds).toEqual([ParticipantKind.HUMAN, ParticipantKind.AGENT, ParticipantKind.MODEL]);
  expect(settings.policy?.clocks.map(({ kind, decisionTimeMs, bankMs }) => [kind, decisionTimeMs, bankMs])).toEqual([
    [ParticipantKind.AGENT, 500, 0],
    [ParticipantKind.ROBOT, 20_000, 0],
    [ParticipantKind.MODEL, 90_000, 0],
  ]);
  expect([settings.drawSeed.length, settings.drawSeed[0], settings.drawSeed[1], settings.dealSeed.length]).toEqual([
    32, 10, 255, 0,
  ]);
});

test("with shared deals spectators are turned off", () => {
  const settings = asked({ deals: "same", spectatorsSeeHands: true });
  expect(settings.deals).toBe(TournamentDeals.SAME_AT_ALL_TABLES);
  expect([settings.policy?.spectators, settings.policy?.spectatorsSeeHands]).toEqual([undefined, false]);
  // Values typed before are ignored, and so cannot be invalid.
  const typed: Partial<TournamentForm> = { deals: "rotated", spectatorDelay: "soon" };
  expect(problemsOf(form(typed))).toEqual({});
  expect(asked(typed).policy?.spectatorDelayDecisions).toBe(0);
  expect(problemsOf(form({ spectatorDelay: "soon" }))).toEqual({ spectatorDelay: "notANumber" });
});

test("a knockout has tables of four and no choice of rounds", () => {
  const before = withTable(form({ format: "swiss", rounds: "9", points: "5, 3, 1, 0" }), "6");
  expect(before.points).toBe("");
  expect(asked(before).rounds).toBe(9);
  const knockout = withFormat(before, "knockout");
  expect([knockout.players, asked(knockout).rounds]).toEqual(["4", 0]);
});

test.each<[Partial<TournamentForm>, object]>([
  [{}, {}],
  [{ name: " " }, { name: "nameMissing" }],
  [
    { rounds: "many", faces: "-1" },
    { rounds: "notANumber", faces: { bounds: [4, 15] } },
  ],
  [{ start: "byHand", startWhen: "" }, {}],
  [{ start: "joined", startWhen: "" }, { startWhen: "notANumber" }],
  [{ otherClocks: true, agentSeconds: "" }, { agentSeconds: "notANumber" }],
  [{ builtIn: { greedy: "some" } }, { builtIn: "notANumber" }],
  [
    { rounds: "2000", maxCalls: "2.5" },
    { rounds: { bounds: [1, 1000] }, maxCalls: "notWhole" },
  ],
  [{ builtIn: { greedy: "1000", random: "100" } }, { builtIn: "tooMany" }],
  [{ people: false, agents: false, robots: false, models: false }, { people: "nobody" }],
  [{ drawSeed: "abc" }, { drawSeed: "notASeed" }],
])("of %j is wrong: %j", (changed, problems) => {
  expect(problemsOf(form(changed))).toEqual(problems);
});

test.each([
  ["rounds", "rounds: 2000 is not within 1..=1000", { field: "rounds", words: "2000 is not within 1..=1000" }],
  ["rules", "rules: faces: 99 is too many", { field: "faces", words: "99 is too many" }],
  ["policy", "policy: pace_ms: at most 60000", { field: "paceSeconds", words: "at most 60000" }],
  ["rules", "rules: 4 players, points for 3", { field: "points", words: "4 players, points for 3" }],
  ["policy", "policy: durability: not here", null],
  ["", "the disk is full", null],
])("what the server says of %j in %j belongs to a field of the form", (field, message, expected) => {
  const fault = { reason: "SETTINGS_REFUSED", code: Code.InvalidArgument, message, metadata: field ? { field } : {} };
  expect(refusedField(fault, TOURNAMENT_FIELDS)).toEqual(expected);
});

test.each([
  [TournamentFormat.KNOCKOUT, 0, 4],
  [TournamentFormat.KNOCKOUT, 5, 8],
  [TournamentFormat.KNOCKOUT, 16, 16],
  [TournamentFormat.SWISS, 2, 4],
  [TournamentFormat.ROUND_ROBIN, 7, 7],
])("a field of format %i with %i is filled up to %i", (format, joined, field) => {
  const participants = Array.from({ length: joined }, (_, participant) => ({ participant }));
  const tournament = create(TournamentSchema, { participants, settings: { format, rules: { players: 4 } } });
  expect(fieldFor(tournament)).toBe(field);
});
