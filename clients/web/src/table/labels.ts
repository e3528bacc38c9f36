// The names that a study gives the other seats in place of their own. The server has them in English,
// such as "Robot 3"; the page says them in its language.

import { signal } from "@preact/signals";
import { t } from "../i18n";

/** Whether the other seats of the table that is shown have such names. */
export const labelled = signal(false);

/** Whether the table that is shown belongs to a study: there nothing says how a built-in agent plays. */
export const inStudy = signal(false);

/** The name of a seat as the page shows it. */
export function shownName(seat: number, name: string): string {
  if (!labelled.value) return name;
  const words = t().studies.labels;
  const number = seat + 1;
  switch (name) {
    case `Agent ${number}`:
      return words.agent(number);
    case `Player ${number}`:
      return words.player(number);
    case `Robot ${number}`:
      return words.robot(number);
    case `Model ${number}`:
      return words.model(number);
    default:
      return name;
  }
}
