// The request of the form for a new room, and its invalid fields.

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { ParticipantKind } from "../src/gen/chefshat/v1/room_pb";
import { CreateRoomRequestSchema } from "../src/gen/chefshat/v1/room_service_pb";
import { Opening, PassScope, RuleSetSchema } from "../src/gen/chefshat/v1/rules_pb";
import { gameProblems, withPreset } from "../src/lobby/game-form";
import {
  MAX_NAME,
  newForm,
  physicalProblems,
  quickGame,
  type RoomForm,
  requestOf,
  withCards,
  withPlayers,
} from "../src/lobby/room-form";

const AGENTS = ["random", "greedy", "trained"];
const form = (changed: Partial<RoomForm> = {}): RoomForm => ({ ...newForm(AGENTS), ...changed });
const asked = (changed: Partial<RoomForm> = {}) => create(CreateRoomRequestSchema, requestOf(form(changed)));

test("a new form has a person against the strongest agents", () => {
  expect(asked().seats.map(({ filledBy }) => filledBy.value)).toEqual([
    ParticipantKind.HUMAN,
    "trained",
    "greedy",
    "random",
  ]);
  const few = create(CreateRoomRequestSchema, requestOf(newForm(["random"])));
  expect(few.seats.slice(1).map(({ filledBy }) => filledBy.value)).toEqual(["random", "random", "random"]);
});

test("with real cards everybody but built-in agents sits at the table, with a name", () => {
  const real = withCards(form({ seats: ["human", "robot", "anybody", "built-in greedy"] }), "real");
  expect(real.seats).toEqual(["at-table human", "at-table human", "at-table human", "built-in greedy"]);
  expect(withPlayers(real, 5).seats.at(-1)).toBe("at-table human");
  const named = {
    ...real,
    seats: real.seats.with(1, "at-table robot").with(2, "agent"),
    seatNames: [" Ada ", "", "Cy"],
  };
  expect(physicalProblems(named)).toEqual({ seatNames: "nameMissing" });
  const complete = { ...named, seatNames: [" Ada ", "Bo", "Cy"] };
  expect(physicalProblems(complete)).toEqual({});
  expect(physicalProblems({ ...complete, opening: "anyTopFace" })).toEqual({ opening: "realOpening" });
  const request = asked(complete);
  expect(request.physical).toBe(true);
  expect(request.seats.map(({ filledBy, name }) => [filledBy.case, filledBy.value, name])).toEqual([
    ["atTable", ParticipantKind.HUMAN, "Ada"],
    ["atTable", ParticipantKind.ROBOT, "Bo"],
    ["reservedFor", ParticipantKind.AGENT, ""],
    ["builtInAgent", "greedy", ""],
  ]);
});

test("with cards dealt by the server nobody sits at the table", () => {
  const real = withCards(form({ seats: ["at-table human", "at-table robot", "agent", "built-in greedy"] }), "dealt");
  expect(real.seats).toEqual(["human", "robot", "agent", "built-in greedy"]);
  expect(physicalProblems({ ...real, opening: "anyTopFace" })).toEqual({});
  expect(asked(real).physical).toBe(false);
});

test("clocks are sent in milliseconds, and custom ones accept a decimal comma", () => {
  const own = asked({ clock: "own", decisionSeconds: "2,5", bankSeconds: "30", paceSeconds: "0.25" }).policy;
  expect([own?.decisionTimeMs, own?.bankMs, own?.paceMs]).toEqual([2500, 30_000, 250]);
  expect(asked({ spectators: false, spectatorDelay: "soon" }).policy?.spectatorDelayDecisions).toBe(0);
  const relaxed = asked({ clock: "relaxed", decisionSeconds: "nonsense" }).policy;
  expect([relaxed?.decisionTimeMs, relaxed?.bankMs]).toEqual([60_000, 300_000]);
});

test("the absence time is left to the server, whose default depends on who plays, unless it is entered", () => {
  expect(asked().policy?.absenceTimeMs).toBeUndefined();
  expect(asked({ absenceSeconds: " " }).policy?.absenceTimeMs).toBeUndefined();
  expect(asked({ absenceSeconds: "2,5" }).policy?.absenceTimeMs).toBe(2500);
  expect(asked({ absenceSeconds: "0" }).policy?.absenceTimeMs).toBe(0);
});

test("points are parsed from a list, and left to the rules if it is empty", () => {
  expect(asked({ points: " 3, 2;1 0 " }).rules?.points).toEqual([3, 2, 1, 0]);
  expect(asked({ points: "" }).rules?.points).toEqual([]);
});

test("a preset sets all its fields", () => {
  const preset = create(RuleSetSchema, {
    preset: "original2020",
    players: 4,
    faces: 11,
    jokers: 2,
    stop: { case: "targetShifts", value: 7 },
    points: [5, 3, 1, 0],
    exchange: false,
    specialActions: false,
    opening: Opening.ANY_TOP_FACE,
    openingPass: true,
    passScope: PassScope.TURN,
    maxIdlePizzas: 4,
    maxTurns: 500,
  });
  const rules = asked(withPreset(form(), preset, 4)).rules;
  expect(rules).toEqual(preset);
});

test("another number of seats keeps the first ones and clears points that no longer fit", () => {
  const changed = withPlayers(form({ points: "5, 3, 1, 0" }), 6);
  expect(changed.seats.length).toBe(6);
  expect(changed.seats.slice(0, 4)).toEqual(form().seats);
  expect(changed.points).toBe("");
  expect(withPlayers(form(), 2).seats).toEqual(form().seats.slice(0, 2));
});

test.each<[Partial<RoomForm>, object]>([
  [{}, {}],
  [
    { faces: "many", target: "-1", jokers: "1.5", maxTimeouts: "0", points: "5, 3, banana, 0" },
    {
      faces: "notANumber",
      target: { bounds: [1, 4_294_967_295] },
      jokers: "notWhole",
      maxTimeouts: { bounds: [1, 1000] },
      points: "notPoints",
    },
  ],
  [{ faces: "99" }, { faces: { bounds: [4, 15] } }],
  [{ clock: "own", decisionSeconds: "" }, { decisionSeconds: "notANumber" }],
  [{ clock: "own", bankSeconds: "-1" }, { bankSeconds: { bounds: [0, 86_400] } }],
  [{ absenceSeconds: " " }, {}],
  [{ absenceSeconds: "-1" }, { absenceSeconds: { bounds: [0, 86_400] } }],
  [{ clock: "relaxed", decisionSeconds: "" }, {}],
  [{ points: "5, 3, -1, 0" }, { points: "notPoints" }],
  [{ points: "5, 3, 1" }, { points: { places: 4 } }],
  [{ points: "5, 3, 4, 0" }, { points: "rising" }],
  [{ points: "0 0 0 0" }, { points: "rising" }],
  [{ points: " 3, 2;1 0 " }, {}],
  [{ paceSeconds: "1.2.3" }, { paceSeconds: "notANumber" }],
  [{ paceSeconds: "61" }, { paceSeconds: { bounds: [0, 60] } }],
  [{ spectators: false, spectatorDelay: "soon" }, {}],
])("of %j is wrong, all at once: %j", (changed, problems) => {
  expect(gameProblems(form(changed), 4)).toEqual(problems);
});

test("the name of a quick game has a valid length", () => {
  expect(Array.from(quickGame("🍕".repeat(80), "Ada", AGENTS).name ?? "").length).toBe(MAX_NAME);
});

test.each([
  ["Ada", ["trained", "greedy", "random"], ["Greta", "Gustav", "Rolf"]],
  [" greta ", ["trained", "greedy", "random"], ["Pia", "Gustav", "Rolf"]],
  ["Ada", ["greedy"], ["Gustav", "", ""]],
  ["Ada", ["special"], ["", "", ""]],
])("the agents of a quick game of %j on a server with %j are called %j", (player, agents, names) => {
  const { seats = [] } = quickGame("Friday", player, agents);
  expect(seats.map(({ filledBy }) => filledBy?.case)).toEqual(["reservedFor", ...names.map(() => "builtInAgent")]);
  expect(seats.slice(1).map(({ name }) => name)).toEqual(names);
});
