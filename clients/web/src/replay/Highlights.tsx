// A player's best and costliest decision of the game that is over, on request: the server estimates
// each of the player's choices first.

import { useMemo, useState } from "preact/hooks";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import type { TableState } from "../table/model/state";
import css from "./Highlights.module.css";
import { useFilm, useJudgements } from "./hooks";
import { JudgingProgress } from "./JudgingProgress";
import { choices, costliest, finest, type Judgement } from "./judging";
import { judgementWords } from "./words";

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
  const { film, fault: unread } = useFilm(gameId);
  const asked = useMemo(() => (film ? choices(film, own) : []), [film, own]);
  const { judgements, looked, fault } = useJudgements(gameId, asked);
  if (unread || fault) return <p role="alert">{unread || fault}</p>;
  if (!film || looked < asked.length) return <JudgingProgress done={looked} all={asked.length} />;
  const [best, worst] = [finest(judgements), costliest(judgements, 1)[0]];
  const link = (of: Judgement, title: string) => (
    <li>
      <a href={`/replay/${gameId}?decision=${of.decisions + 1}`}>{title}</a>: {judgementWords(of, faces)}
    </li>
  );
  return (
    <ul class={css.highlights} data-part="highlights">
      {best && link(best, words.best(best.shift))}
      {worst && link(worst, words.worst(worst.shift))}
      {!best && !worst && <li>{words.none}</li>}
    </ul>
  );
}
