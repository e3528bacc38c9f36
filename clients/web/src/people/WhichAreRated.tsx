// Which games are rated, as in docs/ratings.md, folded.

import { t } from "../i18n";
import css from "./People.module.css";

/** The folded text. */
export function WhichAreRated({ open = false }: { open?: boolean }) {
  const words = t().people.which;
  return (
    <details class={`${css.which} small`} open={open}>
      <summary>{words.title}</summary>
      <p>{words.text}</p>
      <ul>
        {words.conditions.map((condition) => (
          <li key={condition}>{condition}</li>
        ))}
      </ul>
      <p>{words.losing}</p>
      <p>{words.toSee}</p>
    </details>
  );
}
