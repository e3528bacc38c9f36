// Quick phrases: sent as an id and a text, shown in the reader's language. Where the room allows it, people
// write lines of their own.

import { render } from "preact";
import { act } from "preact/test-utils";
import { expect, test } from "vitest";
import { ExpressionSource } from "../src/gen/chefshat/v1/decision_pb";
import { en } from "../src/i18n/en";
import { type Gesture, PHRASES, type Phrase, phraseGesture, phraseOf, shownLabel } from "../src/table/expressions";
import { Expressions } from "../src/table/view/Tools";
import { root } from "./mounted";

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

async function opened(phrases: boolean, chat: boolean): Promise<Gesture[]> {
  const said: Gesture[] = [];
  await act(() => render(<Expressions phrases={phrases} chat={chat} onExpress={(it) => said.push(it)} />, root));
  await act(() => root.querySelector<HTMLElement>(`[title="${en.table.expressions.say}"]`)?.click());
  return said;
}

test("people write where the room allows it", async () => {
  const said = await opened(true, true);
  expect(root.querySelectorAll("[data-part~=phrases] button")).toHaveLength(Object.keys(PHRASES).length);
  const line = root.querySelector<HTMLInputElement>("form input");
  const send = root.querySelector<HTMLButtonElement>("form button");
  if (!line || !send) throw new Error("there is no line to write");
  expect(send.disabled).toBe(true);
  await act(() => {
    line.value = "  Ciao, è bello! ";
    line.dispatchEvent(new Event("input", { bubbles: true }));
  });
  await act(() => send.click());
  expect(said).toHaveLength(1);
  const [{ label, media = "", source }] = said as [Gesture];
  expect(source).toBe(ExpressionSource.SELF_REPORT);
  expect(phraseOf(shownLabel({ label, media }))?.text).toBe("Ciao, è bello!");
  expect(root.querySelector("[data-part~=phrases]")).toBeNull();
});

test("elsewhere there are phrases alone, or nothing", async () => {
  await opened(true, false);
  expect(root.querySelector("form")).toBeNull();
  expect(root.querySelector("[data-part~=phrases]")).not.toBeNull();
  await opened(false, false);
  expect(root.querySelector(`[title="${en.table.expressions.say}"]`)).toBeNull();
});
