// The whole game at a glance: what each choice was worth to its seat, as lines, and the choices that
// cost most, as a list. The server estimates while the section is open.

import { useMemo, useState } from "preact/hooks";
import { t } from "../i18n";
import { Chart } from "../parts/Chart";
import type { TableState } from "../table/model/state";
import { distinctName } from "../table/words";
import { choices, costliest, type EstimatedChoice } from "./choices";
import { EstimatingProgress } from "./EstimatingProgress";
import { type Film, marked } from "./frames";
import css from "./Graph.module.css";
import { useEstimatedChoices } from "./hooks";
import type { Perspective } from "./perspective";
import replayCss from "./Replay.module.css";
import { choiceWords } from "./words";

/** The most turning points listed. */
const MOST_LISTED = 6;

interface GraphProps {
  gameId: string;
  film: Film;
  table: TableState;
  perspective: Perspective;
  /** Decisions before the moment shown. */
  decisions: number;
  onGo: (frame: number) => void;
}

export function Graph({ gameId, film, table, perspective, decisions, onGo }: GraphProps) {
  const [shown, setShown] = useState(false);
  // Nothing is computed for those who never open it.
  const top = useMemo(() => (shown ? mostPoints(film) : 1), [film, shown]);
  const asked = useMemo(() => (shown ? choices(film) : []), [film, shown]);
  const estimates = useEstimatedChoices(gameId, asked);
  // Only a seat itself knows what it gave, or might have declared.
  const estimated = estimates.estimated.filter(({ seat }) => perspective === "all" || seat === perspective);
  const words = t().replay.graph;
  const turning = costliest(estimated, MOST_LISTED).sort((a, b) => a.frame - b.frame);
  const done = shown && estimates.looked === asked.length;
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
      {estimated.length > 0 && (
        <Chart
          label={words.label}
          lines={table.seats.map(({ seat }) => ({ seat, parts: byShift(estimated, seat) }))}
          width={film.decisions}
          top={top}
          marks={marked(film).map((shift) => shift.decisions)}
          at={decisions}
          onGo={(x) => onGo(film.after(Math.round(x)) ?? film.length - 1)}
        />
      )}
      {shown && !done && <EstimatingProgress estimates={estimates} all={asked.length} />}
      {turning.length > 0 && (
        <>
          <h2 class={css.title}>{words.turning}</h2>
          <ol class={css.turning} data-part="turning-points">
            {turning.map((choice) => (
              <li key={choice.decisions}>
                <button type="button" onClick={() => onGo(choice.frame)}>
                  {words.turningPoint(choice.shift, distinctName(table, choice.seat), choiceWords(choice, table.faces))}
                </button>
              </li>
            ))}
          </ol>
        </>
      )}
      {done && turning.length === 0 && (
        <p class="soft">{asked.length > 0 && estimates.estimated.length === 0 ? words.unknown : words.none}</p>
      )}
    </details>
  );
}

/** The most points that a Shift of the game gave. */
function mostPoints(film: Film): number {
  const { results } = film.at(film.length - 1).table;
  return results.reduce((most, { shiftPoints }) => Math.max(most, ...shiftPoints), 1);
}

/** A seat's worth of its choices, a part for each Shift. */
function byShift(estimated: readonly EstimatedChoice[], seat: number): (readonly [number, number])[][] {
  const parts = new Map<number, (readonly [number, number])[]>();
  for (const { seat: of, shift, decisions, points } of estimated) {
    if (of !== seat) continue;
    const part = parts.get(shift) ?? [];
    part.push([decisions, points]);
    parts.set(shift, part);
  }
  return [...parts.values()];
}
