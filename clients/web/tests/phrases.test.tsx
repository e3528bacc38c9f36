// Quick phrases: sent as an id and a text, shown in the reader's language. Where the room allows it, people
// write lines of their own.

import { act } from "preact/test-utils";
import { expect, test } from "vitest";
import { ExpressionSource } from "../src/gen/chefshat/v1/decision_pb";
import * as en from "../src/i18n/en";
import { type Gesture, PHRASES, type Phrase, phraseGesture, phraseOf, shownLabel } from "../src/table/expressions";
import { Expressions } from "../src/table/view/Tools";
import { mount, root, type } from "./mounted";

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

const speak = () => act(() => root.querySelector<HTMLElement>(`[title="${en.table.expressions.say}"]`)?.click());

async function opened(phrases: boolean, chat: boolean, arrives = () => true): Promise<Gesture[]> {
  const said: Gesture[] = [];
  const onExpress = async (gesture: Gesture) => {
    said.push(gesture);
    return arrives();
  };
  await mount(<Expressions phrases={phrases} chat={chat} onExpress={onExpress} />);
  await speak();
  return said;
}

/** Writes a line and sends it. */
async function write(text: string) {
  const line = root.querySelector<HTMLInputElement>("form input");
  const send = root.querySelector<HTMLButtonElement>("form button");
  if (!line || !send) throw new Error("there is no line to write");
  expect(send.disabled).toBe(line.value === "");
  await type(line, text);
  await act(() => send.click());
}

test("words that did not arrive are there again, and others are not", async () => {
  let isCut = true;
  const said = await opened(false, true, () => !isCut);
  const line = () => root.querySelector<HTMLInputElement>("form input")?.value;
  await write("What a Shift!");
  await speak();
  expect([said.length, line()]).toEqual([1, "What a Shift!"]);
  isCut = false;
  await write("What a Shift!");
  await speak();
  expect([said.length, line()]).toEqual([2, ""]);
});

test("people write where the room allows it", async () => {
  const said = await opened(true, true);
  expect(root.querySelectorAll("[data-part~=phrases] button")).toHaveLength(Object.keys(PHRASES).length);
  await write("  Ciao, è bello! ");
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
