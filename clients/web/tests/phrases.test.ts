// Quick phrases: sent as an id and a text, shown in the reader's language.

import { expect, test } from "vitest";
import { en } from "../src/i18n/en";
import { PHRASES, type Phrase, phraseGesture, phraseOf } from "../src/table/expressions";

/** The longest label that the protocol allows, bytes. */
const MAX_LABEL = 64;

test("the text that is sent is the English one", () => {
  expect(en.table.expressions.phrases).toEqual(PHRASES);
});

test.each(Object.keys(PHRASES) as Phrase[])("%s is sent and understood", (phrase) => {
  const { label } = phraseGesture(phrase);
  expect(new TextEncoder().encode(label).length).toBeLessThanOrEqual(MAX_LABEL);
  expect(phraseOf(label)).toEqual({ id: phrase, text: PHRASES[phrase] });
});

test.each([
  ["joy", undefined],
  ["say:from-later Buon appetito!", { id: undefined, text: "Buon appetito!" }],
  ["say:oops", { id: "oops", text: "oops" }],
])("the label %j", (label, expected) => {
  expect(phraseOf(label)).toEqual(expected);
});
