// A study as a link carries it: who takes part, in which seat, what is left out at the table, what is asked before and after. Nothing of it
// goes to the server but the name and, where the link says so, times as annotations. On this device it is kept with the seat, or with the place
// in a tournament, so that a reload does not lose it; and of one that is over its last questionnaire, so that the link leads to that again.

import { recall, recallObject, remember, remembered } from "../store";

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

/** What is filled into the address of a questionnaire, each empty while it is not known. */
export interface Blanks {
  readonly name: string;
  readonly room?: string;
  readonly tournament?: string;
}

/** The address of a questionnaire for one participant: {name}, {room} and {tournament} filled in. */
export function filledIn(address: string, { name, room = "", tournament = "" }: Blanks): string {
  return address
    .replaceAll("{name}", encodeURIComponent(name))
    .replaceAll("{room}", encodeURIComponent(room))
    .replaceAll("{tournament}", encodeURIComponent(tournament));
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

/** Keeps a study with the seat that was taken for it in a room, or with the place in a tournament. */
export function rememberStudy(id: string, study: Study): void {
  remember(`study.${id}`, searchOf(study, ""));
  remember(`timed.${id}`, study.times ? "1" : null);
}

/** The study that this device takes part in, in a room or a tournament. */
export function studyIn(id: string): Study | null {
  const kept = recall(`study.${id}`);
  return kept === null ? null : studyOf(kept);
}

/** The questionnaire after a study's game that is over, of one who has left the table. */
export interface Finished {
  readonly name: string;
  readonly roomId: string;
  readonly after: string;
}

/** Keeps the last questionnaire of the study in a room, before its seat is forgotten; nothing if there is none. */
export function rememberFinished(roomId: string, code: string): void {
  const study = studyIn(roomId);
  if (!study?.after) return;
  const finished: Finished = { name: study.name, roomId, after: study.after };
  remember(`${FINISHED}${code}.${study.name}`, JSON.stringify(finished));
}

/** The questionnaires after games that this device took part in by the links with this code; of one participant, or with an empty name of all. */
export function finishedBy(code: string, name: string): Finished[] {
  return allFinished(`${FINISHED}${code}.`).filter((finished) => name === "" || finished.name === name);
}

/** The questionnaires after the game of a room. */
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
