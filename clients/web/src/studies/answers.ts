// The answers of a participant to a questionnaire while they are entered: what is missing, and what
// is sent. The server keeps them until they are given: a reload or another device shows them again.

import type { StudyAnswerSet, StudyItemAnswer, StudyShownItem } from "../gen/chefshat/v1/study_pb";
import type { ItemAnswer } from "./participating";

/**
 * An entered value: a point, the value of a slider or a number, of which one that is not valid is
 * NaN; chosen options; or a text.
 */
export type Value = number | readonly number[] | string;

/** What was entered for an item, and when it last changed, milliseconds from reaching the step. */
export interface Entered {
  readonly value: Value;
  readonly afterMs: number;
}

/** What was entered so far, by item. */
export type Draft = Readonly<Record<number, Entered>>;

/** Those of the items that are shown for what was entered so far. */
export function shownItems(items: readonly StudyShownItem[], draft: Draft): StudyShownItem[] {
  const shown = new Set<number>();
  return items.filter(({ item, shownIf }) => {
    const holds = shownIf.every((condition) => {
      const entered = shown.has(condition.item) ? draft[condition.item] : undefined;
      const isOne = isAnswered(entered) && isAmong(entered.value, condition.answers);
      return isOne !== condition.not;
    });
    if (holds) shown.add(item);
    return holds;
  });
}

function isAmong(value: Value, answers: StudyAnswerSet | undefined): boolean {
  const { min = -Infinity, max = Infinity, options = [] } = answers ?? {};
  if (typeof value === "number") return min <= value && value <= max;
  return typeof value !== "string" && value.some((option) => options.includes(option));
}

/** What was entered, without numbers that are not valid in items that are not shown any more. */
export function withoutHiddenFaults(items: readonly StudyShownItem[], draft: Draft): Draft {
  const shown = shownItems(items, draft).map(({ item }) => item);
  const kept = Object.entries(draft).filter(
    ([item, { value }]) => !Number.isNaN(value) || shown.includes(Number(item)),
  );
  return Object.fromEntries(kept);
}

/** The shown items that must be answered and are not, and those whose answer is not valid. */
export function missingItems(shown: readonly StudyShownItem[], draft: Draft): number[] {
  const isMissing = ({ item, optional }: StudyShownItem) => {
    const entered = draft[item];
    return Number.isNaN(entered?.value) || (!optional && !isAnswered(entered));
  };
  return shown.filter(isMissing).map(({ item }) => item);
}

function isAnswered(entered: Entered | undefined): entered is Entered {
  if (!entered) return false;
  const { value } = entered;
  if (typeof value === "number") return !Number.isNaN(value);
  return typeof value === "string" ? value.trim() !== "" : value.length > 0;
}

/** The answers to send, in the order of the shown items. */
export function answersOf(shown: readonly StudyShownItem[], draft: Draft): ItemAnswer[] {
  return shown.flatMap(({ item }): ItemAnswer[] => {
    const entered = draft[item];
    if (!isAnswered(entered)) return [];
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
