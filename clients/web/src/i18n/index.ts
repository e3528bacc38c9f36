// The language of the page: ?lang= in the address, else the stored choice, else the browser's, else
// English. The texts are in a folder per language, one file per part of the page, and are loaded
// when the language is shown. English defines their shape (texts.ts): a language that lacks a text
// does not compile. A new language needs its folder and a line in TABLE.

import { signal } from "@preact/signals";
import { reloadsForNewVersion } from "../api/update";
import { recall, remember } from "../store";
import type { Texts } from "./texts";

/** A language: its own name for itself, and how to load its texts. */
interface Entry {
  readonly label: string;
  readonly load: () => Promise<Texts>;
}

const TABLE = {
  en: { label: "English", load: () => import("./en") },
  de: { label: "Deutsch", load: () => import("./de") },
  es: { label: "Español", load: () => import("./es") },
  it: { label: "Italiano", load: () => import("./it") },
} satisfies Record<string, Entry>;

/** Languages with texts, by their ISO 639-1 codes. */
export type Language = keyof typeof TABLE;

/** The languages with their own names, for a list to choose from. */
export const languages = (Object.keys(TABLE) as Language[]).map((value) => ({ value, label: TABLE[value].label }));

/** The current language. */
export const language = signal<Language>("en");
const texts = signal<Texts | null>(null);

/**
 * The texts of the current language. A component that reads them is rendered again when the
 * language changes.
 */
export function t(): Texts {
  if (texts.value === null) throw new Error("texts are read before startLanguage has ended");
  return texts.value;
}

/** The texts of a language that need not be the current one. */
export function textsIn(chosen: Language): Promise<Texts> {
  return TABLE[chosen].load();
}

/** A number with a fixed count of digits after the decimal separator of the current language. */
export function decimal(value: number, digits: number): string {
  const options = { minimumFractionDigits: digits, maximumFractionDigits: digits };
  return new Intl.NumberFormat(language.value, options).format(value);
}

/** The locale of dates: the reader's, if the browser names one for the page's language. */
function dateLocale(): string {
  return navigator.languages.find((one) => one.startsWith(language.value)) ?? language.value;
}

/** A day, from milliseconds since the Unix epoch. */
export function dateOf(ms: bigint): string {
  return new Intl.DateTimeFormat(dateLocale(), { dateStyle: "long" }).format(Number(ms));
}

/** A point in time, from milliseconds since the Unix epoch. */
export function momentOf(ms: bigint, dateStyle: "short" | "medium" = "medium"): string {
  return new Intl.DateTimeFormat(dateLocale(), { dateStyle, timeStyle: "short" }).format(Number(ms));
}

/** Chooses the initial language and loads its texts. */
export async function startLanguage(): Promise<void> {
  const asked = new URLSearchParams(location.search).get("lang");
  await load(firstKnown([asked, recall("language"), ...navigator.languages]));
}

/**
 * The language parameter of an address, to be kept when navigating, so that a reload keeps the
 * link's language.
 */
export function languageOf(search: string): string {
  const language = new URLSearchParams(search).get("lang");
  return language === null ? "" : `?lang=${encodeURIComponent(language)}`;
}

/** Pauses before the texts of a language are loaded once more, milliseconds. */
const RETRY_AFTER_MS = [2_000, 8_000, 32_000];

/**
 * Shows the page in a language without storing it, as soon as its texts can be loaded; nothing happens
 * if it has none.
 */
export async function showLanguage(asked: string): Promise<void> {
  if (!isKnown(asked)) return;
  for (const pause of [...RETRY_AFTER_MS, undefined]) {
    try {
      return await load(asked);
    } catch {
      if ((await reloadsForNewVersion()) || pause === undefined) return;
      await new Promise((resume) => setTimeout(resume, pause));
      if (wanted !== asked) return;
    }
  }
}

/** Changes the language and stores the choice on this device. Throws if its texts cannot be loaded. */
export async function setLanguage(chosen: Language): Promise<void> {
  remember("language", chosen);
  try {
    await load(chosen);
  } catch (thrown) {
    if (!(await reloadsForNewVersion())) throw thrown;
  }
}

/** The first of these languages that has texts, by its main subtag ("it-CH" is Italian). */
export function firstKnown(candidates: readonly (string | null)[]): Language {
  for (const candidate of candidates) {
    const main = candidate?.toLowerCase().split("-")[0];
    if (main && isKnown(main)) return main;
  }
  return "en";
}

function isKnown(code: string): code is Language {
  return Object.hasOwn(TABLE, code);
}

/** The language that was chosen last. */
let wanted: Language | undefined;

async function load(chosen: Language): Promise<void> {
  wanted = chosen;
  const loaded = await textsIn(chosen);
  // Another was chosen meanwhile, whose texts may have come earlier.
  if (wanted !== chosen) return;
  texts.value = loaded;
  language.value = chosen;
  document.documentElement.lang = chosen;
}
