// The answers of a participant to a questionnaire while they are entered: what is missing, and what
// is sent. The server keeps them until they are given: a reload or another device shows them again.

import type { StudyItemAnswer, StudyShownItem } from "../gen/chefshat/v1/study_pb";
import type { ItemAnswer } from "./participating";

/** An entered value: a point or the value of a slider, chosen options, or a text. */
export type Value = number | readonly number[] | string;

/** What was entered for an item, and when it last changed, milliseconds from reaching the step. */
export interface Entered {
  readonly value: Value;
  readonly afterMs: number;
}

/** What was entered so far, by item. */
export type Draft = Readonly<Record<number, Entered>>;

/** The items that must be answered and are not. */
export function missingItems(items: readonly StudyShownItem[], draft: Draft): number[] {
  return items.flatMap(({ item, optional }) => (optional || isAnswered(draft[item]) ? [] : [item]));
}

function isAnswered(entered: Entered | undefined): boolean {
  if (!entered) return false;
  const { value } = entered;
  if (typeof value === "number") return true;
  return typeof value === "string" ? value.trim() !== "" : value.length > 0;
}

/** The answers to send, in the order of the items. */
export function answersOf(items: readonly StudyShownItem[], draft: Draft): ItemAnswer[] {
  return items.flatMap(({ item }): ItemAnswer[] => {
    const entered = draft[item];
    if (!entered || !isAnswered(entered)) return [];
    return [{ item, value: sentOf(entered.value), answeredAfterMs: Math.round(entered.afterMs) }];
  });
}

function sentOf(value: Value): NonNullable<ItemAnswer["value"]> {
  if (typeof value === "number") return { case: "number", value };
  if (typeof value === "string") return { case: "text", value };
  return { case: "options", value: { options: [...value].sort((one, other) => one - other) } };
}

/** What was entered, from the answers that the server has kept. */
export function draftOf(saved: readonly StudyItemAnswer[]): Draft {
  const entered = saved.flatMap(({ item, value, answeredAfterMs }): [number, Entered][] => {
    if (value.case === undefined) return [];
    const what = value.case === "options" ? value.value.options : value.value;
    return [[item, { value: what, afterMs: answeredAfterMs ?? 0 }]];
  });
  return Object.fromEntries(entered);
}
