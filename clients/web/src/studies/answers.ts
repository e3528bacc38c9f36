// The answers of a participant to a questionnaire while they are entered: what is missing, and what
// is sent. They survive a reload of this tab; after they were sent, nothing stays.

import type { StudyShownItem } from "../gen/chefshat/v1/study_pb";
import type { ItemAnswer } from "./participating";

/** An entered value: a point or the value of a slider, chosen options, or a text. */
export type Value = number | readonly number[] | string;

/** What was entered for an item, and when it last changed, milliseconds from the first rendering. */
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

const STORED = "chefshat.answers";

/** Stores what was entered at a step of a participant, for a reload. */
export function keepDraft(link: string, step: number, draft: Draft): void {
  try {
    sessionStorage.setItem(STORED, JSON.stringify({ link, step, draft }));
  } catch {
    // Storage is blocked or full: a reload starts with empty items.
  }
}

/** What was entered at this step before a reload; empty if it was another step or participant. */
export function keptDraft(link: string, step: number): Draft {
  try {
    const stored: unknown = JSON.parse(sessionStorage.getItem(STORED) ?? "null");
    const { link: whose, step: at, draft }: Partial<Record<string, unknown>> = { ...(stored as object) };
    if (whose !== link || at !== step || typeof draft !== "object" || draft === null) return {};
    return Object.fromEntries(Object.entries(draft).filter(([, entered]) => isEntered(entered)));
  } catch {
    return {};
  }
}

function isEntered(entered: unknown): entered is Entered {
  const { value, afterMs }: Partial<Record<string, unknown>> = { ...(entered as object) };
  const isValue = typeof value === "number" || typeof value === "string" || Array.isArray(value);
  return isValue && typeof afterMs === "number";
}

/** Forgets what was entered. */
export function dropDraft(): void {
  try {
    sessionStorage.removeItem(STORED);
  } catch {
    // There is nothing then.
  }
}
