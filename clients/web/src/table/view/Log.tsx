// The history of the table, newest last. The announcer reads it out line by line, not this list.

import { useId } from "preact/hooks";
import { hidden } from "../../hiding";
import { t } from "../../i18n";
import { SeatNumber } from "../../parts/SeatNumber";
import { visibleLines } from "../model/log";
import type { TableState } from "../model/state";
import { happeningWords, nameOf } from "../words";
import css from "./Log.module.css";

export function Log({ table }: { table: TableState }) {
  const title = useId();
  return (
    <div class={`${css.log} sheet`} data-part="log">
      <h2 id={title}>{t().table.log.title}</h2>
      {/* biome-ignore lint/a11y/noNoninteractiveTabindex: a scrollable region must be reachable by keyboard */}
      <section class={css.lines} tabIndex={0} aria-labelledby={title}>
        <ol>
          {visibleLines(table.log, !hidden.value.includes("expressions")).map((line) => {
            const { seat, text } = happeningWords(table, line.entry);
            return (
              <li key={line.sequence} class={seat === undefined ? "soft" : ""}>
                {seat !== undefined && (
                  <>
                    <SeatNumber seat={seat} />
                    <strong>{nameOf(table, seat)}</strong>{" "}
                  </>
                )}
                {text}
              </li>
            );
          })}
        </ol>
      </section>
    </div>
  );
}
