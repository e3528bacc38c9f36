// The participants that a host adds to a study, and the list of their links.

import { expect, test } from "vitest";
import { tableOf } from "../src/studies/LinkList";
import { MAX_ADDED, participantsIn } from "../src/studies/participants";

test.each([
  ["", []],
  ["P01\n P02 \n\nP01", ["P01", "P02"]],
  ["P08-P11", ["P08", "P09", "P10", "P11"]],
  ["P08 – 11", ["P08", "P09", "P10", "P11"]],
  ["9-11", ["9", "10", "11"]],
  ["Anne-Marie\nP3-Q9\nP9-P3", ["Anne-Marie", "P3-Q9", "P9-P3"]],
])("%j names %j", (typed, names) => {
  expect(participantsIn(typed)).toEqual(names);
});

test("an excess of participants is cut off after one more than the maximum", () => {
  expect(participantsIn("P1-P5000").length).toBe(MAX_ADDED + 1);
  expect(participantsIn("A1-A900\nB1-B900").length).toBe(MAX_ADDED + 1);
});

test("no cell of the table of links is a formula", () => {
  const formula = { name: "=1+2", address: "\tx" };
  expect(tableOf([formula])).toBe("name,link\r\n'=1+2,'\tx\r\n");
});

test("links are a valid CSV table", () => {
  const link = (name: string) => ({ name, address: "https://a.example/study/X" });
  expect(tableOf([link("P07"), link('Ann, "A"')])).toBe(
    'name,link\r\nP07,https://a.example/study/X\r\n"Ann, ""A""",https://a.example/study/X\r\n',
  );
});
