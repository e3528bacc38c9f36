// Cards as values: hands, boards and gifts are lists of cards in one fixed order.

/** An ingredient by its face from 1, the Golden card of the top face, or a joker. */
export type Card =
  | { readonly kind: "face"; readonly face: number }
  | { readonly kind: "golden"; readonly face: number }
  | { readonly kind: "joker" };

export const JOKER: Card = { kind: "joker" };

/** The face of a card; undefined for a joker. */
export function faceOf(card: Card): number | undefined {
  return card.kind === "joker" ? undefined : card.face;
}

/** Cards from face numbers, sorted (F+1 is a joker), the Golden card first of its face. */
export function cardsFromNumbers(numbers: readonly number[], golden: boolean, faces: number): Card[] {
  let goldenLeft = golden;
  return [...numbers]
    .sort((left, right) => left - right)
    .map((number) => {
      if (number > faces) return JOKER;
      if (number === faces && goldenLeft) {
        goldenLeft = false;
        return { kind: "golden", face: number };
      }
      return { kind: "face", face: number };
    });
}

/** Cards from F+1 counts, as in observations: index f-1 counts face f, index F the jokers. */
export function cardsFromCounts(counts: ArrayLike<number>, golden: boolean, faces: number): Card[] {
  const numbers = Array.from(counts).flatMap((count, index) => Array<number>(count).fill(index + 1));
  return cardsFromNumbers(numbers, golden, faces);
}

/** The cards of a play. */
export function playedCards(face: number, quantity: number, jokers: number, golden: boolean): Card[] {
  const plain = Array.from({ length: quantity }, (_, index): Card => {
    return golden && index === 0 ? { kind: "golden", face } : { kind: "face", face };
  });
  return [...plain, ...Array<Card>(jokers).fill(JOKER)];
}

/** The number of cards of a face; of jokers if the face is undefined. */
export function countOf(cards: readonly Card[], face: number | undefined): number {
  return cards.filter((card) => faceOf(card) === face).length;
}

/**
 * Removes cards. A plain card goes before the Golden card of its face, unless the Golden card is
 * named.
 */
export function without(cards: readonly Card[], taken: readonly Card[]): Card[] {
  const left = [...cards];
  for (const card of taken) {
    const face = faceOf(card);
    const exact = left.findIndex((other) => other.kind === card.kind && faceOf(other) === face);
    const index = exact >= 0 ? exact : left.findIndex((other) => faceOf(other) === face);
    if (index >= 0) left.splice(index, 1);
  }
  return left;
}

/** Both lists merged, in order. */
export function together(cards: readonly Card[], added: readonly Card[]): Card[] {
  const rank = (card: Card) => (faceOf(card) ?? Number.MAX_SAFE_INTEGER) * 2 - (card.kind === "golden" ? 1 : 0);
  return [...cards, ...added].sort((left, right) => rank(left) - rank(right));
}

/** Runs of cards of one face, in order. */
export function stacks(cards: readonly Card[]): Card[][] {
  const runs: Card[][] = [];
  for (const card of cards) {
    const last = runs.at(-1);
    const first = last?.[0];
    if (last && first && faceOf(first) === faceOf(card)) last.push(card);
    else runs.push([card]);
  }
  return runs;
}
