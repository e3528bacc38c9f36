// A study as described by a link: participant, seat, hidden parts, consent and questionnaires. The
// server receives only the name and, if the link says so, times as annotations. This device stores
// it with the seat or place, so that a reload keeps it; after the game it keeps the last
// questionnaire for the link.

import { recall, recallObject, remember, remembered } from "../store";

/** Parts of the table that a study can hide. */
export const HIDEABLE = ["log", "lookup", "expressions", "played", "pages"] as const;
export type Hideable = (typeof HIDEABLE)[number];

export interface Study {
  /** Name of the participant; empty if the participant chooses one. */
  readonly name: string;
  /** Undefined for any free seat. */
  readonly seat: number | undefined;
  /** Whether times are measured in the browser too. */
  readonly times: boolean;
  readonly hide: readonly Hideable[];
  /** Text to agree to; empty for none. */
  readonly consent: string;
  /** Addresses of questionnaires; empty for none. */
  readonly before: string;
  readonly after: string;
}

/** Parameters that make an invitation one to a study. */
const MARKS = ["name", "seat", "hide", "times", "consent", "before", "after"];
const MAX_SEAT = 5;

/** The study of an address; null for a plain invitation. */
export function studyOf(search: string): Study | null {
  const asked = new URLSearchParams(search);
  if (!MARKS.some((mark) => asked.has(mark))) return null;
  const seat = asked.get("seat") ?? "";
  const hide = (asked.get("hide") ?? "").split(",");
  return {
    name: (asked.get("name") ?? "").trim(),
    seat: /^\d$/.test(seat) && Number(seat) <= MAX_SEAT ? Number(seat) : undefined,
    times: asked.get("times") === "1",
    hide: HIDEABLE.filter((part) => hide.includes(part)),
    consent: asked.get("consent") ?? "",
    before: questionnaire(asked.get("before")),
    after: questionnaire(asked.get("after")),
  };
}

/**
 * The query of a study's invitation, the inverse of `studyOf`; `language` sets the page's language
 * too.
 */
export function searchOf(study: Study, language: string): string {
  const asked = new URLSearchParams();
  const put = (name: string, value: string) => value !== "" && asked.set(name, value);
  put("name", study.name);
  put("seat", study.seat === undefined ? "" : String(study.seat));
  put("lang", language);
  put("hide", study.hide.join(","));
  put("times", study.times ? "1" : "");
  put("before", study.before);
  put("after", study.after);
  put("consent", study.consent);
  return `?${asked}`;
}

/**
 * The language parameter of an address, to be kept when navigating, so that a reload keeps the
 * link's language.
 */
export function languageOf(search: string): string {
  const language = new URLSearchParams(search).get("lang");
  return language === null ? "" : `?lang=${encodeURIComponent(language)}`;
}

/** A valid address of a questionnaire, or empty: a link must not run a script. */
export function questionnaire(address: string | null): string {
  try {
    const url = new URL(address ?? "");
    return url.protocol === "https:" || url.protocol === "http:" ? (address ?? "") : "";
  } catch {
    return "";
  }
}

/** Values for the address of a questionnaire, each empty while unknown. */
export interface Blanks {
  readonly name: string;
  readonly room?: string;
  readonly tournament?: string;
}

/** The address of a participant's questionnaire, with {name}, {room} and {tournament} replaced. */
export function filledIn(address: string, { name, room = "", tournament = "" }: Blanks): string {
  return address
    .replaceAll("{name}", encodeURIComponent(name))
    .replaceAll("{room}", encodeURIComponent(room))
    .replaceAll("{tournament}", encodeURIComponent(tournament));
}

/** The host of a questionnaire, shown before it is opened. */
export function hostOf(address: string): string {
  return new URL(address).host;
}

/**
 * Who holds this device's seat when it opens an invitation: several participants may use one device
 * in turn.
 */
export function holderOf(study: Study | null, name: string): "reader" | "another" | "unclear" {
  if (!study) return "reader";
  if (study.name === "") return "unclear";
  return study.name === name ? "reader" : "another";
}

/** Stores a study with the seat in a room or the place in a tournament. */
export function rememberStudy(id: string, study: Study): void {
  remember(`study.${id}`, searchOf(study, ""));
  remember(`timed.${id}`, study.times ? "1" : null);
}

/** The study that this device takes part in, in a room or tournament. */
export function studyIn(id: string): Study | null {
  const stored = recall(`study.${id}`);
  return stored === null ? null : studyOf(stored);
}

/** The last questionnaire of a participant who has left the table. */
export interface Finished {
  readonly name: string;
  readonly roomId: string;
  readonly after: string;
}

/**
 * Stores the last questionnaire of a room's study before the seat is deleted; does nothing without
 * one.
 */
export function rememberFinished(roomId: string, code: string): void {
  const study = studyIn(roomId);
  if (!study?.after) return;
  const finished: Finished = { name: study.name, roomId, after: study.after };
  remember(`${FINISHED}${code}.${study.name}`, JSON.stringify(finished));
}

/**
 * The last questionnaires of participants on this device who joined with this code; all of them if
 * the name is empty.
 */
export function finishedBy(code: string, name: string): Finished[] {
  return allFinished(`${FINISHED}${code}.`).filter((finished) => name === "" || finished.name === name);
}

/** The last questionnaires of a room. */
export function finishedIn(roomId: string): Finished[] {
  return allFinished(FINISHED).filter((finished) => finished.roomId === roomId);
}

const FINISHED = "finished.";

function allFinished(beginning: string): Finished[] {
  return [...remembered().keys()].flatMap((key) => {
    if (!key.startsWith(beginning)) return [];
    const finished = recallObject(key, ({ name, roomId, after }) =>
      typeof name === "string" && typeof roomId === "string" && typeof after === "string"
        ? { name, roomId, after: questionnaire(after) }
        : null,
    );
    return finished === null || finished.after === "" ? [] : [finished];
  });
}
