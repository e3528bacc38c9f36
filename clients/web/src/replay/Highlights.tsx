// A player's best and costliest decision of the game that is over, on request: the server estimates
// each of the player's choices first.

import { useEffect, useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import { t } from "../i18n";
import { announce } from "../parts/Announcer";
import { Button } from "../parts/Button";
import type { TableState } from "../table/model/state";
import { choices, costliest, type EstimatedChoice, finest } from "./choices";
import { EstimatingProgress } from "./EstimatingProgress";
import css from "./Highlights.module.css";
import { useEstimatedChoices, useFilm } from "./hooks";
import { choiceWords } from "./words";

/** For the holder of a seat; nothing until the game is over. */
export function Highlights({ table, own }: { table: TableState; own: number | undefined }) {
  const [asked, setAsked] = useState(false);
  // At a table with real cards the server does not know all hands.
  if (own === undefined || table.phase !== "gameOver" || table.physical) return null;
  if (!asked) return <Button onClick={() => setAsked(true)}>{t().replay.highlights.ask}</Button>;
  return <Found gameId={table.gameId} own={own} faces={table.faces} />;
}

function Found({ gameId, own, faces }: { gameId: string; own: number; faces: number }) {
  const words = t().replay.highlights;
  const { film, fault } = useFilm(gameId);
  const asked = useMemo(() => (film ? choices(film, own) : []), [film, own]);
  const estimates = useEstimatedChoices(gameId, asked);
  const done = film !== undefined && estimates.looked === asked.length;
  const [best, worst] = [finest(estimates.estimated), costliest(estimates.estimated, 1)[0]];
  // The button that was pressed is gone.
  const section = useRef<HTMLElement>(null);
  useLayoutEffect(() => section.current?.focus(), []);
  useEffect(() => {
    if (done) announce(section.current?.textContent ?? "");
  }, [done]);
  const line = (choice: EstimatedChoice, title: string) => (
    <li>
      <a href={`/replay/${gameId}?decision=${choice.decisions + 1}`}>{title}</a>: {choiceWords(choice, faces)}
    </li>
  );
  return (
    <section ref={section} class={css.highlights} data-part="highlights" tabIndex={-1} aria-label={words.ask}>
      {fault && <p role="alert">{fault}</p>}
      {film && !done && <EstimatingProgress estimates={estimates} all={asked.length} />}
      {done && (
        <ul>
          {best && line(best, words.best(best.shift))}
          {worst && line(worst, words.worst(worst.shift))}
          {!best && !worst && <li>{estimates.estimated.length > 0 ? words.none : t().replay.graph.unknown}</li>}
        </ul>
      )}
    </section>
  );
}
