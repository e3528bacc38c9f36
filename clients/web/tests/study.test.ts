// A study's link is parsed as it was written, and cannot carry anything else.

import { expect, test } from "vitest";
import {
  filledIn,
  finishedBy,
  finishedIn,
  holderOf,
  languageOf,
  questionnaire,
  rememberStudy,
  type Study,
  searchOf,
  studyIn,
  studyOf,
} from "../src/experiment/study";
import { leaveSeat } from "../src/lobby/seat";
import { forgetAll, remember } from "../src/store";
import { asksForTimes } from "../src/table/acting";

const full: Study = {
  name: "P07",
  seat: 2,
  times: true,
  hide: ["log", "pages"],
  consent: "You may stop at any time.\nAsk Ada & Ben: 50% + 1?",
  before: "https://forms.example/before?id={name}",
  after: "https://forms.example/after?id={name}&room={room}",
};
const nothing: Study = { name: "", seat: undefined, times: false, hide: [], consent: "", before: "", after: "" };

test.each([
  ["all of it", full],
  ["a name alone", { ...nothing, name: "Rosa Müßig" }],
  ["seat 0", { ...nothing, seat: 0 }],
])("what is written is read: %s", (_, study) => {
  const search = searchOf(study, "it");
  expect(studyOf(search)).toEqual(study);
  expect(new URLSearchParams(search).get("lang")).toBe("it");
});

test.each([
  ["", null],
  ["?lang=it", null],
  ["?name=P07&seat=9", { ...nothing, name: "P07" }],
  ["?seat=two&hide=log,kinds,", { ...nothing, hide: ["log"] }],
  ["?times=yes", nothing],
  ["?before=javascript:alert(1)&after=data:text/html,x", nothing],
])("of %j comes %j", (search, expected) => {
  expect(studyOf(search)).toEqual(expected);
});

test.each([
  ["https://a.example/q", "https://a.example/q"],
  ["http://localhost:8000/", "http://localhost:8000/"],
  ["javascript:alert(1)", ""],
  ["a.example/q", ""],
  [null, ""],
])("the questionnaire %j is %j", (address, expected) => {
  expect(questionnaire(address)).toBe(expected);
});

test.each([
  ["?name=P07&lang=it", "?lang=it"],
  ["?name=P07", ""],
])("of the address %j the next one says %j of the language", (search, expected) => {
  expect(languageOf(search)).toBe(expected);
});

test.each([
  [full.after, { name: "Rosa & Ben", room: "01ab" }, "https://forms.example/after?id=Rosa%20%26%20Ben&room=01ab"],
  ["https://a.example/{tournament}/{name}", { name: "P07", tournament: "89cd" }, "https://a.example/89cd/P07"],
  ["https://a.example/{tournament}/{room}?{name}", { name: "" }, "https://a.example//?"],
])("into %j is filled what is known, well encoded (%#)", (address, blanks, expected) => {
  expect(filledIn(address, blanks)).toBe(expected);
});

test("a study is stored with its room, and times are sent only if it asks for them", () => {
  rememberStudy("one", full);
  rememberStudy("two", { ...full, times: false });
  expect(studyIn("one")).toEqual(full);
  expect([asksForTimes("one"), asksForTimes("two"), asksForTimes("three")]).toEqual([true, false, false]);
  forgetAll();
  expect(studyIn("one")).toBeNull();
});

test.each([
  [null, "reader"],
  [full, "reader"],
  [{ ...full, name: "P08" }, "another"],
  [{ ...full, name: "" }, "unclear"],
] as const)("whose the seat is that P07 took on this device (%#)", (study, holder) => {
  expect(holderOf(study, "P07")).toBe(holder);
});

test("the questionnaire of a finished study is kept for its link until everything is deleted", () => {
  remember("code.BCDF2345", "room");
  for (const name of ["P07", "P08"]) {
    rememberStudy("room", { ...full, name });
    leaveSeat("room");
    remember("code.BCDF2345", "room");
  }
  rememberStudy("room", { ...full, name: "P09", after: "" });
  leaveSeat("room");
  expect(studyIn("room")).toBeNull();
  const one = { name: "P08", roomId: "room", after: full.after };
  expect(finishedBy("BCDF2345", "P08")).toEqual([one]);
  expect(finishedBy("BCDF2345", "").length).toBe(2);
  expect(finishedIn("room").length).toBe(2);
  expect([finishedBy("BCDF2345", "P09"), finishedBy("ZZZZ2345", "P08"), finishedIn("other")]).toEqual([[], [], []]);
  forgetAll();
  expect(finishedIn("room")).toEqual([]);
});
