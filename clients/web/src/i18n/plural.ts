// Numbers with the right form of a word, by the plural rules of a language. For the texts only.

/** The plural forms of the page's languages; the rare "many" of Italian and Spanish uses `other`. */
export interface Forms {
  one: string;
  other: string;
}

/** Returns a function from a number to its form, in which "#" stands for the number. */
export function plurals(language: string): (count: number, forms: Forms) => string {
  const rules = new Intl.PluralRules(language);
  const digits = new Intl.NumberFormat(language);
  return (count, forms) =>
    (rules.select(count) === "one" ? forms.one : forms.other).replaceAll("#", digits.format(count));
}

/** Returns a function from a number, from 1, to its word; where there is none, to its digits. */
export function numerals(words: string): (count: number) => string {
  const known = words.split(" ");
  return (count) => known[count - 1] ?? String(count);
}

/** Returns a function from milliseconds to words, in the largest unit that is a whole number. */
export function durations(
  language: string,
  forms: Record<"second" | "minute" | "hour", Forms>,
): (ms: number) => string {
  const plural = plurals(language);
  return (ms) => {
    if (ms >= 3_600_000 && ms % 3_600_000 === 0) return plural(ms / 3_600_000, forms.hour);
    if (ms >= 120_000 && ms % 60_000 === 0) return plural(ms / 60_000, forms.minute);
    return plural(ms / 1000, forms.second);
  };
}

/** Returns a function from a number to its ordinal, with the suffixes of the language. */
export function ordinals(
  language: string,
  ends: Partial<Record<Intl.LDMLPluralRule, string>>,
): (count: number) => string {
  const rules = new Intl.PluralRules(language, { type: "ordinal" });
  return (count) => `${count}${ends[rules.select(count)] ?? ends.other ?? ""}`;
}
