// Numbers with the form of the word that goes with them, by the plural rules of the language. Texts use it; pages do not.

/** The forms that English and Italian have; Italian's rare "many" takes `other`. */
export interface Forms {
  one: string;
  other: string;
}

/** A function from a number to its form, in which "#" stands for the number. */
export function plurals(language: string): (count: number, forms: Forms) => string {
  const rules = new Intl.PluralRules(language);
  const digits = new Intl.NumberFormat(language);
  return (count, forms) =>
    (rules.select(count) === "one" ? forms.one : forms.other).replaceAll("#", digits.format(count));
}

/** A function from milliseconds to words: in seconds, minutes or hours, whichever is whole enough. */
export function durations(
  language: string,
  forms: Record<"second" | "minute" | "hour", Forms>,
): (ms: number) => string {
  const plural = plurals(language);
  return (ms) => {
    if (ms >= 3_600_000) return plural(Math.round(ms / 3_600_000), forms.hour);
    if (ms >= 120_000) return plural(Math.round(ms / 60_000), forms.minute);
    return plural(ms / 1000, forms.second);
  };
}

/** A function from a number to its ordinal, by the ends that the language's ordinal rules name. */
export function ordinals(
  language: string,
  ends: Partial<Record<Intl.LDMLPluralRule, string>>,
): (count: number) => string {
  const rules = new Intl.PluralRules(language, { type: "ordinal" });
  return (count) => `${count}${ends[rules.select(count)] ?? ends.other ?? ""}`;
}
