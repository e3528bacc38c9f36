// The whole game at a glance: what each choice was worth to its seat, as lines, and the choices that
// cost most, as a list. The server estimates while the section is open.

import { useMemo, useState } from "preact/hooks";
import { t } from "../i18n";
import { Chart } from "../parts/Chart";
import type { TableState } from "../table/model/state";
import { distinctName } from "../table/words";
import type { Film } from "./frames";
import css from "./Graph.module.css";
import { useJudgements } from "./hooks";
import { JudgingProgress } from "./JudgingProgress";
import { choices, costliest, type Judgement } from "./judging";
import replayCss from "./Replay.module.css";
import { judgementWords } from "./words";

/** The most turning points listed. */
const MOST_LISTED = 6;

interface GraphProps {
  gameId: string;
  film: Film;
  table: TableState;
  /** Decisions before the moment shown. */
  decisions: number;
  onGo: (frame: number) => void;
}

export function Graph({ gameId, film, table, decisions, onGo }: GraphProps) {
  const [shown, setShown] = useState(false);
  const top = useMemo(() => mostPoints(film), [film]);
  const asked = useMemo(() => (shown ? choices(film) : []), [film, shown]);
  const { judgements, looked, fault } = useJudgements(gameId, asked);
  const words = t().replay.graph;
  const turning = costliest(judgements, MOST_LISTED).sort((a, b) => a.frame - b.frame);
  const done = shown && looked === asked.length;
  return (
    <details
      class={`${replayCss.decision} sheet`}
      data-part="replay-graph"
      open={shown}
      onToggle={(event) => setShown(event.currentTarget.open)}
    >
      <summary>
        <strong>{words.title}</strong> <span class="soft">{words.subtitle}</span>
      </summary>
      {judgements.length > 0 && (
        <Chart
          label={words.label}
          lines={table.seats.map(({ seat }) => ({ seat, parts: byShift(judgements, seat) }))}
          width={film.decisions}
          top={top}
          scale={[0, top].map((value) => ({ value, text: String(value) }))}
          marks={film.shifts.slice(1).map(({ frame }) => film.at(frame).decisions)}
          at={decisions}
          onGo={(x) => onGo(film.after(Math.round(x)) ?? film.length - 1)}
        />
      )}
      {fault && <p role="alert">{fault}</p>}
      {shown && !fault && !done && <JudgingProgress done={looked} all={asked.length} />}
      {turning.length > 0 && (
        <>
          <h2 class={css.title}>{words.turning}</h2>
          <ol class={css.turning} data-part="turning-points">
            {turning.map((judgement) => (
              <li key={judgement.decisions}>
                <button type="button" onClick={() => onGo(judgement.frame)}>
                  {words.turningPoint(
                    judgement.shift,
                    distinctName(table, judgement.seat),
                    judgementWords(judgement, table.faces),
                  )}
                </button>
              </li>
            ))}
          </ol>
        </>
      )}
      {done && turning.length === 0 && <p class="soft">{words.none}</p>}
    </details>
  );
}

/** The most points that a Shift of the game gave. */
function mostPoints(film: Film): number {
  const { results } = film.at(film.length - 1).table;
  return results.reduce((most, { shiftPoints }) => Math.max(most, ...shiftPoints), 1);
}

/** A seat's worth of its choices, a part for each Shift. */
function byShift(judgements: readonly Judgement[], seat: number): (readonly [number, number])[][] {
  const parts = new Map<number, (readonly [number, number])[]>();
  for (const { seat: of, shift, decisions, points } of judgements) {
    if (of !== seat) continue;
    const part = parts.get(shift) ?? [];
    part.push([decisions, points]);
    parts.set(shift, part);
  }
  return [...parts.values()];
}
