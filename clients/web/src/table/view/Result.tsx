// The result of a Shift or game, over the pizza: places, points, and next steps.

import type { ComponentChildren } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";
import { t } from "../../i18n";
import { ButtonLink } from "../../parts/Button";
import { SeatNumber } from "../../parts/SeatNumber";
import { PersonName } from "../../people/PersonName";
import type { ShiftResult, TableState } from "../model/state";
import { distinctName, nameOf } from "../words";
import css from "./Result.module.css";

interface ResultProps {
  table: TableState;
  own: number | undefined;
  /**
   * Whether to show links after the game; not in a replay, where the names of the players lead to
   * their pages instead.
   */
  links?: boolean;
  /** The next step, before all links. */
  onward?: ComponentChildren;
}

/**
 * The result to show: the game's once it is over, otherwise the last Shift's until the next one
 * starts.
 */
export function Result({ table, own, links = true, onward }: ResultProps) {
  const ways = links && <Ways table={table} onward={onward} />;
  if (table.phase === "gameOver") return <GameResult table={table} own={own} profiles={!links} ways={ways} />;
  if (table.phase === "aborted") return <Aborted table={table} ways={ways} />;
  if (table.result && table.phase !== "pizza") {
    return <ShiftTable table={table} result={table.result} />;
  }
  return null;
}

/** The main step, and links. An aborted game has no replay. */
function Ways({ table, onward }: Pick<ResultProps, "table" | "onward">) {
  const words = t().table.result;
  const ended = table.phase === "gameOver";
  return (
    <div class={css.ways} data-part="result-ways">
      {onward}
      <span class={css.links} data-part="result-links">
        {ended && (
          <ButtonLink href={`/replay/${table.gameId}`} look={onward ? "plain" : "main"}>
            {words.replay}
          </ButtonLink>
        )}
        <ButtonLink href="/" look={onward || ended ? "plain" : "main"}>
          {words.lobby}
        </ButtonLink>
      </span>
    </div>
  );
}

function ShiftTable({ table, result }: { table: TableState; result: ShiftResult }) {
  const words = t().table.result;
  return (
    <section class={`${css.result} sheet`} data-part="result" aria-label={words.shift(result.shift)}>
      <h2>{words.shift(result.shift)}</h2>
      <table>
        <thead>
          <tr>
            <th scope="col">{words.place}</th>
            <th scope="col">{words.name}</th>
            <th scope="col">{words.points}</th>
            <th scope="col">{words.total}</th>
          </tr>
        </thead>
        <tbody>
          {result.order.map((seat, index) => (
            <Row key={seat} table={table} seat={seat} place={index + 1}>
              <td class="number">+{result.shiftPoints[seat] ?? 0}</td>
              <td class="number">{result.points[seat] ?? 0}</td>
            </Row>
          ))}
        </tbody>
      </table>
      {result.adjudicated && <p class="soft">{words.adjudicated}</p>}
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
      <h2 ref={heading} tabIndex={-1}>
        {winner !== undefined && (winner === own ? words.youWon : words.wins(distinctName(table, winner)))}
      </h2>
      <table>
        <thead>
          <tr>
            <th scope="col">{words.place}</th>
            <th scope="col">{words.name}</th>
            <th scope="col">{words.points}</th>
          </tr>
        </thead>
        <tbody>
          {table.standings.map(({ seat, place, points }) => (
            <Row key={seat} table={table} seat={seat} place={place} profile={profiles}>
              <td class="number">{points}</td>
            </Row>
          ))}
        </tbody>
      </table>
      {ways}
    </section>
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

interface RowProps {
  table: TableState;
  seat: number;
  place: number;
  profile?: boolean;
  children: ComponentChildren;
}

function Row({ table, seat, place, profile = false, children }: RowProps) {
  const name = nameOf(table, seat);
  return (
    <tr>
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
      </th>
      {children}
    </tr>
  );
}
