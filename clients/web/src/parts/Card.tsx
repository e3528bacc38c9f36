// A card in the shapes and colours of the server's pictures: the number in the corner stays visible
// when cards overlap, the ingredient is below. Picking cards is in table/view/Hand.tsx.

import type { Card as CardValue } from "../table/model/cards";
import css from "./Card.module.css";
import { Drawing, faceDrawing } from "./Drawing";

interface CardProps {
  /** The card; undefined for a card back. */
  card: CardValue | undefined;
  /** Additional classes. */
  class?: string | undefined;
}

/** The front or the back of a card. Decorative: the surrounding part names it in words. */
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
