// The middle of the table: the pizza with everything played on it, and the cards on the board.

import type { ComponentChildren } from "preact";
import { t } from "../../i18n";
import { Card } from "../../parts/Card";
import { Drawing, faceDrawing } from "../../parts/Drawing";
import type { TableState } from "../model/state";
import { distinctName, playWords } from "../words";
import css from "./Board.module.css";

/** Most toppings drawn. */
const MOST_TOPPINGS = 44;
/** The golden angle between toppings keeps them from lining up. */
const GOLDEN_ANGLE = Math.PI * (3 - Math.sqrt(5));

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
      <div
        class={`${css.cards} ${board.length > 6 ? css.many : ""}`}
        style={{ "--cards": board.length }}
        key={`${table.shift}-${table.turn}-${board.length}`}
      >
        {board.map((card, index) => (
          <Card key={index} card={card} class={css.card} />
        ))}
      </div>
      <p class={`${css.words} ${board.length === 0 ? css.empty : ""}`} data-part="board-words">
        {children ?? boardWords(table)}
      </p>
    </section>
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
