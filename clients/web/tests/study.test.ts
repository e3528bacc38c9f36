// The link of a study: what it says is read as it was written, and nothing else gets in with it.

import { expect, test } from "vitest";
import {
  filledIn,
  holderOf,
  languageOf,
  questionnaire,
  rememberStudy,
  type Study,
  searchOf,
  studyIn,
  studyOf,
} from "../src/experiment/study";
import { forgetAll } from "../src/store";
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

test("name and room are filled into the address of a questionnaire, well encoded", () => {
  expect(filledIn(full.after, "Rosa & Ben", "01ab")).toBe("https://forms.example/after?id=Rosa%20%26%20Ben&room=01ab");
});

test("a study is kept with its room, and times are sent only where it asks for them", () => {
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
