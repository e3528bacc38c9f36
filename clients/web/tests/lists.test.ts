// Lists: all pages are asked for, up to a bound; what of the log is said; which seats the links of a study are for.

import { create } from "@bufbuild/protobuf";
import { beforeAll, expect, test } from "vitest";
import { allPages } from "../src/api/pages";
import { freeForPeople, placed } from "../src/experiment/places";
import { AnswerResultSchema, AnswerStatus } from "../src/gen/chefshat/v1/decision_pb";
import { ParticipantKind, ParticipantSchema } from "../src/gen/chefshat/v1/room_pb";
import { setLanguage } from "../src/i18n";
import { worthSaying } from "../src/table/model/log";
import type { Happening, LogLine } from "../src/table/model/state";
import { answerWords } from "../src/table/words";

beforeAll(() => setLanguage("en"));

test.each([
  [10, [0, 1, 2, 3, 4]],
  [2, [0, 1, 2, 3]],
  [0, []],
])("of three pages at most %i are asked for", async (most, expected) => {
  const pages = new Map([
    ["", { items: [0, 1], nextPageToken: "a" }],
    ["a", { items: [2, 3], nextPageToken: "b" }],
    ["b", { items: [4], nextPageToken: "" }],
  ]);
  const ask = async (token: string) => pages.get(token) ?? { items: [-1], nextPageToken: "" };
  expect(await allPages(ask, most)).toEqual(expected);
});

test("a connection that comes and goes takes one line, and expressions can be left out", () => {
  const happenings: Happening[] = [
    { kind: "lost", seat: 1 },
    { kind: "back", seat: 1 },
    { kind: "expressed", seat: 2, label: "joy" },
    { kind: "lost", seat: 1 },
    { kind: "lost", seat: 0 },
    { kind: "back", seat: 1 },
  ];
  const log: LogLine[] = happenings.map((happening, sequence) => ({ sequence, happening }));
  const sequences = (expressions: boolean) => worthSaying(log, expressions).map(({ sequence }) => sequence);
  expect(sequences(true)).toEqual([1, 2, 3, 4, 5]);
  expect(sequences(false)).toEqual([3, 4, 5]);
});

test("links are for seats that people can take, and stay with those who have sat down", () => {
  const seats = [
    create(ParticipantSchema, { name: "P02" }),
    create(ParticipantSchema, { builtInAgent: "greedy" }),
    create(ParticipantSchema, { reservedFor: ParticipantKind.HUMAN }),
    create(ParticipantSchema, { reservedFor: ParticipantKind.AGENT }),
    create(ParticipantSchema, {}),
  ];
  expect(freeForPeople(seats)).toEqual([2, 4]);
  expect(placed(seats, ["P01", "P02", "P03", "P04"], 0)).toEqual([
    { name: "P01", seat: 2 },
    { name: "P02", seat: 0 },
    { name: "P03", seat: 4 },
  ]);
  expect(placed(seats, [""], 3)).toEqual([{ name: "", seat: 4 }]);
});

test.each([
  [AnswerStatus.ACCEPTED, undefined, ""],
  [AnswerStatus.INVALID, undefined, "This is not legal. Choose again."],
  [AnswerStatus.INVALID, 1, "This is not legal. Choose again: 1 attempt is left."],
  [AnswerStatus.INVALID, 0, "This is not legal. It was decided for you."],
  [AnswerStatus.CLOSED, undefined, "Too late: this has been decided already."],
])("an answer of status %i with %s attempts left is said as %j", (status, left, expected) => {
  const result = create(AnswerResultSchema, {
    status,
    detail: "the server's own words",
    ...(left === undefined ? {} : { invalidAttemptsLeft: left }),
  });
  expect(answerWords(result)).toBe(expected);
});
