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

/** A function from a number to its ordinal, by the ends that the language's ordinal rules name. */
export function ordinals(
  language: string,
  ends: Partial<Record<Intl.LDMLPluralRule, string>>,
): (count: number) => string {
  const rules = new Intl.PluralRules(language, { type: "ordinal" });
  return (count) => `${count}${ends[rules.select(count)] ?? ends.other ?? ""}`;
}
