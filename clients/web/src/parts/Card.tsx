// A card as it is drawn everywhere in the page, in the shapes and colours of the server's pictures: the number in the corner that stays to be
// seen when cards overlap, the ingredient below. Picking cards is a matter of the hand, not of the card.

import type { Card as CardValue } from "../table/model/cards";
import css from "./Card.module.css";
import { Drawing, faceDrawing } from "./Drawing";

interface CardProps {
  /** The card; undefined: its back. */
  card: CardValue | undefined;
  /** Classes besides the standard one. */
  class?: string | undefined;
}

/** The front of a card, or its back. Decoration: who draws it says in words what it is. */
export function Card({ card, class: more = "" }: CardProps) {
  if (!card) {
    return (
      <span class={`${css.card} ${css.back} ${more}`} data-part="card" aria-hidden="true">
        <Drawing name="joker" class={css.picture} />
      </span>
    );
  }
  if (card.kind === "joker") {
    return (
      <span class={`${css.card} ${css.joker} ${more}`} data-part="card" aria-hidden="true">
        <span class={css.number}>J</span>
        <Drawing name="joker" class={css.picture} />
      </span>
    );
  }
  const picture = card.kind === "golden" ? "golden" : faceDrawing(card.face);
  return (
    <span class={`${css.card} ${css[card.kind] ?? ""} ${more}`} data-part="card" aria-hidden="true">
      <span class={`${css.number} ${card.face > 9 ? css.numberWide : ""}`}>{card.face}</span>
      <Drawing name={picture} class={css.picture} />
    </span>
  );
}
