// Paginated lists and their bounds, and the seats for people.

import { create } from "@bufbuild/protobuf";
import { beforeAll, expect, test } from "vitest";
import { type AskPage, allPages, countWords, firstOf } from "../src/api/pages";
import { AnswerResultSchema, AnswerStatus } from "../src/gen/chefshat/v1/decision_pb";
import { ParticipantKind, ParticipantSchema } from "../src/gen/chefshat/v1/room_pb";
import { setLanguage } from "../src/i18n";
import { freeForPeople } from "../src/lobby/rooms";
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

test.each([
  [1, [0], true, 1],
  [3, [0, 1, 2], true, 2],
  [4, [0, 1, 2, 3], true, 3],
  [5, [0, 1, 2, 3, 4], false, 3],
  [12, [0, 1, 2, 3, 4], false, 3],
])(
  "of five things in pages of two the first %i are shown, and no page is asked for that is not needed",
  async (count, items, more, asked) => {
    const tokens: string[] = [];
    const ask: AskPage<number> = async ({ pageSize, pageToken }) => {
      tokens.push(pageToken);
      const from = Number(pageToken);
      const size = Math.min(pageSize, 2);
      return {
        items: [0, 1, 2, 3, 4].slice(from, from + size),
        nextPageToken: from + size < 5 ? String(from + size) : "",
      };
    };
    expect(await firstOf(ask, count, new AbortController().signal)).toEqual({ items, more });
    expect(tokens.length).toBe(asked);
  },
);

test("an incomplete count says so", () => {
  expect([countWords(12, true), countWords(12, false)]).toEqual(["12+", "12"]);
});

test("people can take the free seats that are not reserved for others", () => {
  const seats = [
    create(ParticipantSchema, { name: "P02" }),
    create(ParticipantSchema, { builtInAgent: "greedy" }),
    create(ParticipantSchema, { reservedFor: ParticipantKind.HUMAN }),
    create(ParticipantSchema, { reservedFor: ParticipantKind.AGENT }),
    create(ParticipantSchema, {}),
  ];
  expect(freeForPeople(seats)).toEqual([2, 4]);
});

test.each([
  [AnswerStatus.ACCEPTED, undefined, ""],
  [AnswerStatus.INVALID, undefined, "This action is illegal. Choose again."],
  [AnswerStatus.INVALID, 1, "This action is illegal. Choose again: 1 attempt left."],
  [AnswerStatus.INVALID, 0, "This action is illegal. The default decision was taken for you."],
  [AnswerStatus.CLOSED, undefined, "Too late: this has already been decided."],
])("an answer of status %i with %s attempts left is said as %j", (status, left, expected) => {
  const result = create(AnswerResultSchema, {
    status,
    detail: "the server's own words",
    ...(left === undefined ? {} : { invalidAttemptsLeft: left }),
  });
  expect(answerWords(result)).toBe(expected);
});
