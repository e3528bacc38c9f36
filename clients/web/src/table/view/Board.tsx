// The middle of the table: the pizza with everything played on it, and the cards on the board.

import type { ComponentChildren } from "preact";
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { t } from "../../i18n";
import { Card } from "../../parts/Card";
import { Drawing, faceDrawing } from "../../parts/Drawing";
import { type Card as CardValue, faceOf } from "../model/cards";
import type { TableState } from "../model/state";
import { distinctName, playWords } from "../words";
import { useArrivals } from "./arrivals";
import css from "./Board.module.css";

/** Most toppings drawn. */
const MOST_TOPPINGS = 44;
/** The golden angle between toppings keeps them from lining up. */
const GOLDEN_ANGLE = Math.PI * (3 - Math.sqrt(5));

/** How long the cards of a pizza that is done are swept away, milliseconds; as in the style sheet. */
const SWEPT_MS = 750;

/** The board; `children` replace its text. */
export function Board({ table, children }: { table: TableState; children?: ComponentChildren }) {
  const words = t().table.board;
  const { board } = table;
  return (
    <section class={css.board} data-part="board" aria-label={words.label}>
      <div class={css.pizza} aria-hidden="true">
        {table.toppings.slice(-MOST_TOPPINGS).map((face, index) => (
          <Topping key={index} name={face > table.faces ? "joker" : faceDrawing(face)} index={index} />
        ))}
      </div>
      <Swept table={table} />
      <Laid key={`${table.shift}-${table.pizza}-${board.map(faceOf)}`} cards={board} by={table.boardBy} />
      <p class={`${css.words} ${board.length === 0 ? css.empty : ""}`} data-part="board-words">
        {children ?? boardWords(table)}
      </p>
    </section>
  );
}

/** The cards on the board, which come from the seat that plays them. */
function Laid({ cards, by }: { cards: readonly CardValue[]; by: number | undefined }) {
  const row = useRef<HTMLDivElement>(null);
  useLayoutEffect(() => {
    const { current } = row;
    const seat = current?.closest('[data-part~="table"]')?.querySelector(`[data-part~="seat"][data-seat="${by}"]`);
    if (!current || !seat) return;
    const [from, to] = [seat, current].map((part) => part.getBoundingClientRect());
    if (!from || !to) return;
    const [x, y] = [from.left + from.width / 2 - to.left - to.width / 2, from.top + from.height / 2 - to.top];
    current.style.setProperty("--from", `${x.toFixed(0)}px ${y.toFixed(0)}px`);
  }, []);
  return (
    <div ref={row} class={`${css.cards} ${cards.length > 6 ? css.many : ""}`} style={{ "--cards": cards.length }}>
      <Row cards={cards} />
    </div>
  );
}

function Row({ cards }: { cards: readonly CardValue[] }) {
  return cards.map((card, index) => (
    <span key={index} class={css.place} style={{ "--nth": index }}>
      <Card card={card} class={css.card} />
    </span>
  ));
}

/** The last cards of a pizza that is done, gathered and swept off the table. */
function Swept({ table }: { table: TableState }) {
  const [swept, setSwept] = useState<{ cards: readonly CardValue[]; sequence: number } | undefined>(undefined);
  const last = useRef(table.board);
  useArrivals(table, (since, caughtUp) => {
    const done = table.log.findLast(({ entry, sequence }) => entry.kind === "pizzaDone" && sequence > since);
    if (done && !caughtUp) setSwept({ cards: last.current, sequence: done.sequence });
  });
  useEffect(() => {
    if (table.board.length > 0) last.current = table.board;
  });
  useEffect(() => {
    if (!swept) return;
    const timer = setTimeout(() => setSwept(undefined), SWEPT_MS);
    return () => clearTimeout(timer);
  }, [swept]);
  if (!swept) return null;
  const { cards, sequence } = swept;
  return (
    <div
      key={sequence}
      class={`${css.cards} ${cards.length > 6 ? css.many : ""} ${css.swept}`}
      style={{ "--cards": cards.length }}
      data-part="swept"
      aria-hidden="true"
    >
      <Row cards={cards} />
    </div>
  );
}

function boardWords(table: TableState): string {
  const words = t().table.board;
  const { board, boardBy } = table;
  if (board.length === 0) return words.empty;
  return boardBy === undefined ? playWords(board) : words.by(playWords(board), distinctName(table, boardBy));
}

/** An ingredient on the pizza, between the cards and the crust. */
function Topping({ name, index }: { name: string; index: number }) {
  const angle = index * GOLDEN_ANGLE + 0.6;
  const radius = 0.72 + 0.12 * Math.sin(index * 2.3);
  const left = 50 + 50 * radius * Math.cos(angle);
  const top = 50 + 50 * radius * Math.sin(angle);
  const style = { left: `${left.toFixed(1)}%`, top: `${top.toFixed(1)}%`, rotate: `${(index * 67) % 360}deg` };
  return (
    <span class={css.topping} style={style}>
      <Drawing name={name} />
    </span>
  );
}
