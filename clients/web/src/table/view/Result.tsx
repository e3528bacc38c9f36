// The result of a Shift or game, over the pizza: places, points, and next steps.

import type { ComponentChildren } from "preact";
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { t } from "../../i18n";
import { Button, ButtonLink } from "../../parts/Button";
import { Chart } from "../../parts/Chart";
import { Drawing } from "../../parts/Drawing";
import { SeatNumber } from "../../parts/SeatNumber";
import { PersonName } from "../../people/PersonName";
import type { ShiftResult, TableState } from "../model/state";
import { distinctName, nameOf } from "../words";
import { useArrivals } from "./arrivals";
import { showsMoments } from "./Moment";
import css from "./Result.module.css";

/** Pieces of confetti. */
const CONFETTI = 16;

interface ResultProps {
  table: TableState;
  own: number | undefined;
  /**
   * Whether to show links after the game; not in a replay, where the names of the players lead to
   * their pages instead.
   */
  links?: boolean;
  /** The next step, before all links. */
  nextStep?: ComponentChildren;
  /**
   * Whether the reader plays on: then the result of a Shift stays until it is closed. Otherwise it
   * goes with the next Shift's first turn.
   */
  playing?: boolean;
  /** The reader has begun an action of the next Shift. */
  acted?: boolean;
}

/** The result to show: the game's once it is over, otherwise the last Shift's. */
export function Result({ table, own, links = true, nextStep, playing = false, acted = false }: ResultProps) {
  const result = table.results.at(-1);
  const { closed, close } = useClosing(table, acted);
  const reader = links ? own : undefined;
  const ways = links && <Ways table={table} nextStep={nextStep} />;
  if (table.phase === "gameOver") return <GameResult table={table} own={reader} profiles={!links} ways={ways} />;
  if (table.phase === "aborted") return <Aborted table={table} ways={ways} />;
  if (!result || (playing ? closed : table.phase === "pizza")) return null;
  return <ShiftTable table={table} own={reader} result={result} onClose={playing ? close : undefined} />;
}

/**
 * Whether the result of the last Shift has been closed, by a button or by an action in the next one.
 * What ended before the page was opened, or while it was away, counts as closed.
 */
function useClosing(table: TableState, acted: boolean) {
  // A correction at a table with real cards may change it, and makes new values of all.
  const result = JSON.stringify(table.results.at(-1));
  const [seen, setSeen] = useState(table.phase === "pizza" ? result : undefined);
  const close = () => setSeen(result);
  useArrivals(table, (_, caughtUp) => {
    if (caughtUp && table.phase === "pizza") close();
  });
  useEffect(() => {
    if (acted) close();
  }, [acted, result]);
  return { closed: seen === result, close };
}

/** The main step, and links. An aborted game has no replay. */
function Ways({ table, nextStep }: Pick<ResultProps, "table" | "nextStep">) {
  const words = t().table.result;
  const ended = table.phase === "gameOver";
  return (
    <div class={css.ways} data-part="result-ways">
      {nextStep}
      <span class={css.links} data-part="result-links">
        {ended && (
          <ButtonLink href={`/replay/${table.gameId}`} look={nextStep ? "plain" : "main"}>
            {words.replay}
          </ButtonLink>
        )}
        <ButtonLink href="/" look={nextStep || ended ? "plain" : "main"}>
          {t().common.toLobby}
        </ButtonLink>
      </span>
    </div>
  );
}

interface ShiftTableProps {
  table: TableState;
  own: number | undefined;
  result: ShiftResult;
  onClose: (() => void) | undefined;
}

function ShiftTable({ table, own, result, onClose }: ShiftTableProps) {
  const words = t().table.result;
  return (
    <section class={`${css.result} sheet`} data-part="result" aria-label={words.shift(result.shift)}>
      <h2>{words.shift(result.shift)}</h2>
      <Ranking points={[t().common.columns.points, words.total]}>
        {result.order.map((seat, index) => (
          <Row key={seat} table={table} own={own} seat={seat} place={index + 1}>
            <td class="number">+{result.shiftPoints[seat] ?? 0}</td>
            <td class="number">{result.points[seat] ?? 0}</td>
          </Row>
        ))}
      </Ranking>
      {result.adjudicated && <p class="soft">{words.adjudicated}</p>}
      {onClose && (
        <div class={css.ways}>
          <Button onClick={onClose}>{t().common.close}</Button>
        </div>
      )}
    </section>
  );
}

interface EndProps {
  table: TableState;
  ways: ComponentChildren;
}

function GameResult({ table, own, profiles, ways }: EndProps & { own: number | undefined; profiles: boolean }) {
  const words = t().table.result;
  const winner = table.standings[0]?.seat;
  const heading = useRef<HTMLHeadingElement>(null);
  // Who played with the keyboard goes on from the result: the hand is empty.
  useLayoutEffect(() => {
    if (document.activeElement?.closest('[data-part~="own"]')) heading.current?.focus();
  }, []);
  return (
    <section class={`${css.result} sheet`} data-part="result" aria-label={words.game}>
      {showsMoments() && <Celebration />}
      <h2 ref={heading} tabIndex={-1}>
        {winner !== undefined && (winner === own ? words.youWon : words.wins(distinctName(table, winner)))}
      </h2>
      <div class={css.summary}>
        <Ranking points={[t().common.columns.points]}>
          {table.standings.map(({ seat, place, points }) => (
            <Row key={seat} table={table} own={own} seat={seat} place={place} profile={profiles}>
              <td class="number">{points}</td>
            </Row>
          ))}
        </Ranking>
        <Curve table={table} />
      </div>
      {ways}
    </section>
  );
}

/** The points of the game after each Shift, if the viewer has seen them all and there were several. */
function Curve({ table: { results, seats } }: { table: TableState }) {
  const points = results.map((result) => result.points);
  if (results.length < 2 || results[0]?.shift !== 1 || results.at(-1)?.shift !== results.length) return null;
  return (
    <Chart
      label={t().table.result.curve}
      lines={seats.map(({ seat }) => ({
        seat,
        parts: [[[0, 0], ...points.map((of, index) => [index + 1, of[seat] ?? 0] as const)]],
      }))}
      width={results.length}
      top={Math.max(...points.flat())}
    />
  );
}

/** The Chef's hat, and confetti that falls once. */
function Celebration() {
  return (
    <div class={css.celebration} data-part="celebration" aria-hidden="true">
      <Drawing name="role-chef" class={css.hat} />
      {Array.from({ length: CONFETTI }, (_, piece) => (
        <i
          key={piece}
          style={{ "--piece": String(piece), "--of": String(CONFETTI), background: `var(--seat-${piece % 4})` }}
        />
      ))}
    </div>
  );
}

/** A game without a result: the reason, and a link. */
function Aborted({ table, ways }: EndProps) {
  const words = t().table;
  return (
    <section class={`${css.result} sheet`} data-part="result" aria-label={words.heading.aborted}>
      <h2>{words.heading.aborted}</h2>
      <p>{words.aborted[table.abortReason]}</p>
      {ways}
    </section>
  );
}

/** The seats by place, a row each; `points`: the headings of the columns after place and name. */
function Ranking({ points, children }: { points: readonly string[]; children: ComponentChildren }) {
  const { place, name } = t().common.columns;
  return (
    <table>
      <thead>
        <tr>
          {[place, name, ...points].map((heading) => (
            <th scope="col" key={heading}>
              {heading}
            </th>
          ))}
        </tr>
      </thead>
      <tbody>{children}</tbody>
    </table>
  );
}

interface RowProps {
  table: TableState;
  own: number | undefined;
  seat: number;
  place: number;
  profile?: boolean;
  children: ComponentChildren;
}

function Row({ table, own, seat, place, profile = false, children }: RowProps) {
  const name = nameOf(table, seat);
  return (
    <tr data-own={seat === own ? "" : undefined}>
      <td>{t().common.place(place)}</td>
      <th scope="row">
        <SeatNumber seat={seat} />{" "}
        {profile ? (
          <PersonName
            name={name}
            builtIn={table.seats[seat]?.builtIn ?? ""}
            fingerprint={table.seats[seat]?.nameFingerprint ?? ""}
          />
        ) : (
          name
        )}
        {seat === own && <span class="soft"> ({t().table.you})</span>}
      </th>
      {children}
    </tr>
  );
}
