// A study as a link carries it: who takes part, in which seat, what is left out at the table, what is asked before and after. Nothing of it
// goes to the server but the name and, where the link says so, times as annotations. On this device it is kept with the seat, so that a
// reload does not lose it.

import { recall, remember } from "../store";

/** Parts of the table that a study may leave out. */
export const HIDEABLE = ["log", "lookup", "expressions", "played", "pages"] as const;
export type Hideable = (typeof HIDEABLE)[number];

export interface Study {
  /** Name to play under; empty: the participant chooses one. */
  readonly name: string;
  /** Undefined: any free one. */
  readonly seat: number | undefined;
  /** Whether times are measured at the participant's side as well. */
  readonly times: boolean;
  readonly hide: readonly Hideable[];
  /** To be agreed to; empty: nothing. */
  readonly consent: string;
  /** Addresses of questionnaires; empty: none. */
  readonly before: string;
  readonly after: string;
}

/** Parameters that make an invitation one to a study. */
const MARKS = ["name", "seat", "hide", "times", "consent", "before", "after"];
const MAX_SEAT = 5;

/** The study that an address speaks of; null if it is an invitation like any other. */
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

/** What follows the "?" of a study's invitation, the inverse of `studyOf`; `language` fixes the language of the page, too. */
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

/** What an address says of the language, to be said by the next one too: so a reload there keeps what the link has fixed. */
export function languageOf(search: string): string {
  const language = new URLSearchParams(search).get("lang");
  return language === null ? "" : `?lang=${encodeURIComponent(language)}`;
}

/** An address that a questionnaire may have; empty if it is none: a link must not run anything. */
export function questionnaire(address: string | null): string {
  try {
    const url = new URL(address ?? "");
    return url.protocol === "https:" || url.protocol === "http:" ? (address ?? "") : "";
  } catch {
    return "";
  }
}

/** The address of a questionnaire for one participant: {name} and {room} filled in. */
export function filledIn(address: string, name: string, roomId: string): string {
  return address.replaceAll("{name}", encodeURIComponent(name)).replaceAll("{room}", encodeURIComponent(roomId));
}

/** Whose questionnaire it is, to be said before it is opened. */
export function hostOf(address: string): string {
  return new URL(address).host;
}

/** Whose the seat is that this device has already, under a name, when it opens an invitation: a device may be used by one participant after the other. */
export function holderOf(study: Study | null, name: string): "reader" | "another" | "unclear" {
  if (!study) return "reader";
  if (study.name === "") return "unclear";
  return study.name === name ? "reader" : "another";
}

/** Keeps a study with the seat that was taken for it. */
export function rememberStudy(roomId: string, study: Study): void {
  remember(`study.${roomId}`, searchOf(study, ""));
  remember(`timed.${roomId}`, study.times ? "1" : null);
}

/** The study that this device takes part in, in a room. */
export function studyIn(roomId: string): Study | null {
  const kept = recall(`study.${roomId}`);
  return kept === null ? null : studyOf(kept);
}
