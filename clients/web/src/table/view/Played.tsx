// The cards of each face played in this Shift, out of those in the deck. A face fills up, and turns
// dark once all are played.

import { t } from "../../i18n";
import type { TableState } from "../model/state";
import css from "./Played.module.css";

export function Played({ table }: { table: TableState }) {
  const words = t().table.played;
  const cells = table.played
    .map((count, index) => ({
      name: index < table.faces ? String(index + 1) : "J",
      count,
      all: index < table.faces ? index + 1 : table.jokers,
    }))
    .filter(({ all }) => all > 0);
  if (cells.length === 0) return null;
  return (
    <section class={css.played} data-part="played" aria-label={words.title}>
      <h3 class={css.title}>
        {words.title}
        <span class={css.key} aria-hidden="true">
          <i class={css.out} /> {words.allOut}
        </span>
      </h3>
      <ul>
        {cells.map(({ name, count, all }) => (
          <li
            key={name}
            class={`number ${count === 0 ? css.none : ""} ${count === all ? css.out : ""}`}
            style={{ "--share": (count / all).toFixed(3) }}
          >
            <b>{name}</b>{" "}
            <span>
              {count}/{all}
            </span>
            {count === all && <span class="visually-hidden">, {words.allOut}</span>}
          </li>
        ))}
      </ul>
    </section>
  );
}
