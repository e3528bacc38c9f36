// The language of the page: ?lang= in the address, else what was chosen on this device, else the browser's, else English. All texts
// are in en/ and it/, one file for each part of the page; English gives the form, and a language that lacks a text does not compile.

import { signal } from "@preact/signals";
import { recall, remember } from "../store";
import type { Texts } from "./en";

/** Languages there are texts for. */
export type Language = "en" | "it";

/** The languages by their own names. */
export const languages: Record<Language, string> = { en: "English", it: "Italiano" };

const loaders: Record<Language, () => Promise<Texts>> = {
  en: async () => (await import("./en")).en,
  it: async () => (await import("./it")).it,
};

/** The language in use. */
export const language = signal<Language>("en");
const texts = signal<Texts | null>(null);

/** The texts of the language in use. Read in a component it is drawn again when the language changes. */
export function t(): Texts {
  if (texts.value === null) throw new Error("texts are read before startLanguage has ended");
  return texts.value;
}

/** A number with so many digits after the point, or comma, of the language in use. */
export function decimal(value: number, digits: number): string {
  const options = { minimumFractionDigits: digits, maximumFractionDigits: digits };
  return new Intl.NumberFormat(language.value, options).format(value);
}

/** How dates are written where the reader is, if the browser says so for the page's language. */
export function dateLocale(): string {
  return navigator.languages.find((one) => one.startsWith(language.value)) ?? language.value;
}

/** Chooses the language to begin with and loads its texts. */
export async function startLanguage(): Promise<void> {
  const asked = new URLSearchParams(location.search).get("lang");
  await load(firstKnown([asked, recall("language"), ...navigator.languages]));
}

/** Changes the language and keeps the choice on this device. */
export async function setLanguage(chosen: Language): Promise<void> {
  remember("language", chosen);
  await load(chosen);
}

/** The first of these that there are texts for, by its main part ("it-CH" is Italian). */
export function firstKnown(candidates: readonly (string | null)[]): Language {
  for (const candidate of candidates) {
    const main = candidate?.toLowerCase().split("-")[0];
    if (main === "en" || main === "it") return main;
  }
  return "en";
}

async function load(chosen: Language): Promise<void> {
  texts.value = await loaders[chosen]();
  language.value = chosen;
  document.documentElement.lang = chosen;
}
