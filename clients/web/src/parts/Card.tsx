// A card as it is drawn everywhere in the page, in the shapes and colours of the server's pictures: the number in the corner that stays to be
// seen when cards overlap, the ingredient below. Picking cards is a matter of the hand, not of the card.

import type { Card as CardValue } from "../table/model/cards";
import { Drawing, faceDrawing } from "./Drawing";
import "./card.css";

interface CardProps {
  /** The card; undefined: its back. */
  card: CardValue | undefined;
  /** Classes besides the standard one. */
  class?: string;
}

/** The front of a card, or its back. Decoration: who draws it says in words what it is. */
export function Card({ card, class: more = "" }: CardProps) {
  if (!card) {
    return (
      <span class={`card card-back ${more}`} aria-hidden="true">
        <Drawing name="joker" class="card-picture" />
      </span>
    );
  }
  if (card.kind === "joker") {
    return (
      <span class={`card card-joker ${more}`} aria-hidden="true">
        <span class="card-number">J</span>
        <Drawing name="joker" class="card-picture" />
      </span>
    );
  }
  const picture = card.kind === "golden" ? "golden" : faceDrawing(card.face);
  return (
    <span class={`card card-${card.kind} ${more}`} aria-hidden="true">
      <span class={`card-number ${card.face > 9 ? "card-number-wide" : ""}`}>{card.face}</span>
      <Drawing name={picture} class="card-picture" />
    </span>
  );
}
