// Picking cards until they form a legal action: the effect of a click, which cards can be picked,
// and why the others cannot. Chooses among the legal actions from the server.

import { type Move, moveOf } from "./actions";
import { type Card, countOf, faceOf } from "./cards";
import { isOpening, type Requirement } from "./requirement";

/** Indices of the picked cards in the hand. */
export type Picked = ReadonlySet<number>;

/** Why a card cannot be picked. */
export type Reason =
  | { readonly kind: "opening"; readonly face: number; readonly golden: boolean }
  | { readonly kind: "notRarer"; readonly face: number; readonly board: number }
  | { readonly kind: "nothingRarer" }
  | { readonly kind: "tooFew"; readonly need: number; readonly have: number }
  | { readonly kind: "jokerAlone" }
  | { readonly kind: "other" };

/** The legal moves of a decision. */
export function legalMoves(actions: readonly number[], faces: number): Move[] {
  return actions.flatMap((action) => moveOf(action, faces) ?? []);
}

/** The cards that a move takes: the face, how many of it, and how many jokers. */
interface Needs {
  readonly face: number | undefined;
  readonly quantity: number;
  readonly jokers: number;
}

function needsOf(move: Move): Needs | undefined {
  switch (move.kind) {
    case "play":
      return move;
    case "give":
      return { face: move.face, quantity: 1, jokers: 0 };
    case "loneJoker":
    case "giveJoker":
      return { face: undefined, quantity: 0, jokers: 1 };
    default:
      return undefined;
  }
}

/** Whether a move takes at least these cards. */
function includes(move: Move, cards: readonly Card[]): boolean {
  const needs = needsOf(move);
  if (!needs) return false;
  const jokers = countOf(cards, undefined);
  const plain = cards.length - jokers;
  return (
    cards.every((card) => card.kind === "joker" || card.face === needs.face) &&
    plain <= needs.quantity &&
    jokers <= needs.jokers
  );
}

/** Whether a move takes exactly these cards. */
function isExactly(move: Move, cards: readonly Card[]): boolean {
  const needs = needsOf(move);
  return needs !== undefined && includes(move, cards) && needs.quantity + needs.jokers === cards.length;
}

function cardsAt(hand: readonly Card[], picked: Picked): Card[] {
  return [...picked].flatMap((index) => hand[index] ?? []);
}

/** The legal move formed by the picked cards. */
export function pickedMove(hand: readonly Card[], picked: Picked, moves: readonly Move[]): Move | undefined {
  const cards = cardsAt(hand, picked);
  return cards.length === 0 ? undefined : moves.find((move) => isExactly(move, cards));
}

/** Whether a card can be picked, with those already picked or in their place. */
export function canPick(hand: readonly Card[], index: number, moves: readonly Move[]): boolean {
  const card = hand[index];
  return card !== undefined && moves.some((move) => includes(move, [card]));
}

/**
 * The fewest cards to add for a legal move: 0 if the picked cards form one, undefined if no legal
 * move contains them.
 */
export function missing(hand: readonly Card[], picked: Picked, moves: readonly Move[]): number | undefined {
  const cards = cardsAt(hand, picked);
  const sizes = moves
    .filter((move) => includes(move, cards))
    .map((move) => needsOf(move))
    .map((needs) => (needs ? needs.quantity + needs.jokers - cards.length : 0));
  return sizes.length > 0 ? Math.min(...sizes) : undefined;
}

/**
 * The picked cards after a click. A picked card is put back. Any other card joins those picked if a
 * legal move contains them all; otherwise it replaces them, together with the rest of the smallest
 * legal move with it. `goldenFirst` if the play must include the Golden card.
 */
export function toggle(
  hand: readonly Card[],
  picked: Picked,
  index: number,
  moves: readonly Move[],
  goldenFirst = false,
): Picked {
  const card = hand[index];
  if (picked.has(index)) return new Set([...picked].filter((other) => other !== index));
  if (!card || !canPick(hand, index, moves)) return picked;
  const joined = [...cardsAt(hand, picked), card];
  if (picked.size > 0 && moves.some((move) => includes(move, joined))) {
    return inOrder(hand, new Set([...picked, index]), goldenFirst);
  }
  return inOrder(hand, smallest(hand, index, moves), goldenFirst);
}

/**
 * The picks of the smallest legal move with a card, with the fewest jokers. A joker waits for the
 * card it goes with.
 */
function smallest(hand: readonly Card[], index: number, moves: readonly Move[]): Picked {
  const card = hand[index];
  if (!card || (card.kind === "joker" && !moves.some((move) => isExactly(move, [card])))) return new Set([index]);
  const [best] = moves
    .filter((move) => includes(move, [card]))
    .flatMap((move) => needsOf(move) ?? [])
    .sort(bySize);
  return best ? pickFor(hand, best, [index]) : new Set([index]);
}

/** Indices of the cards that a move takes. */
export function picksOf(hand: readonly Card[], move: Move, goldenFirst = false): Picked {
  const needs = needsOf(move);
  return needs ? inOrder(hand, pickFor(hand, needs, []), goldenFirst) : new Set();
}

/**
 * The picked cards after the key of a face, or of the jokers alone (undefined): its smallest legal
 * move; pressed again, one more card of the face, and after the last one the smallest move again.
 * Undefined if no legal move has such cards.
 */
export function pressFace(
  hand: readonly Card[],
  picked: Picked,
  face: number | undefined,
  moves: readonly Move[],
  goldenFirst = false,
): Picked | undefined {
  const { face: before, quantity, jokers } = partsOf(cardsAt(hand, picked));
  const options = moves.flatMap((move) => needsOf(move) ?? []).filter((needs) => needs.face === face);
  const more = options
    .filter((needs) => before === face && needs.quantity > quantity && needs.jokers === jokers)
    .sort((left, right) => left.quantity - right.quantity);
  const needs = (quantity > 0 ? more[0] : undefined) ?? options.sort(bySize)[0];
  return needs && inOrder(hand, pickFor(hand, needs, []), goldenFirst);
}

/**
 * The picked cards after the key that adds a joker to them, or takes the jokers away after the last
 * one; a joker alone if nothing is picked. Undefined if no legal move is made that way.
 */
export function pressJoker(
  hand: readonly Card[],
  picked: Picked,
  moves: readonly Move[],
  goldenFirst = false,
): Picked | undefined {
  const { face, quantity, jokers } = partsOf(cardsAt(hand, picked));
  if (quantity === 0) return pressFace(hand, picked, undefined, moves);
  const options = moves
    .flatMap((move) => needsOf(move) ?? [])
    .filter((needs) => needs.face === face && needs.quantity === quantity)
    .sort(bySize);
  const needs = options.find((other) => other.jokers > jokers) ?? options[0];
  if (!needs || needs.jokers === jokers) return undefined;
  return inOrder(hand, pickFor(hand, needs, []), goldenFirst);
}

/** Every play that a hand holds the cards of. */
export function heldPlays(hand: readonly Card[]): Move[] {
  const jokers = countOf(hand, undefined);
  const faces = [...new Set(hand.flatMap((card) => faceOf(card) ?? []))];
  const plays = faces.flatMap((face) =>
    Array.from({ length: countOf(hand, face) }, (_, less) =>
      Array.from({ length: jokers + 1 }, (_, j): Move => ({ kind: "play", face, quantity: less + 1, jokers: j })),
    ).flat(),
  );
  return jokers > 0 ? [...plays, { kind: "loneJoker" }] : plays;
}

/** The face, the number of its cards and the jokers among picked cards. */
function partsOf(cards: readonly Card[]): Needs {
  const jokers = countOf(cards, undefined);
  return { face: cards.map(faceOf).find((face) => face !== undefined), quantity: cards.length - jokers, jokers };
}

/** Fewer cards first, then fewer jokers. */
function bySize(left: Needs, right: Needs): number {
  return left.quantity + left.jokers - right.quantity - right.jokers || left.jokers - right.jokers;
}

function pickFor(hand: readonly Card[], needs: Needs, first: readonly number[]): Picked {
  const picked = new Set(first);
  const left = { quantity: needs.quantity, jokers: needs.jokers };
  for (const index of picked) left[hand[index]?.kind === "joker" ? "jokers" : "quantity"] -= 1;
  hand.forEach((card, index) => {
    if (picked.has(index)) return;
    const part = card.kind === "joker" ? "jokers" : "quantity";
    const wanted = card.kind === "joker" || card.face === needs.face;
    if (!wanted || left[part] <= 0) return;
    left[part] -= 1;
    picked.add(index);
  });
  return picked;
}

/**
 * Picks the Golden card before or after the plain cards of its face: a move names only the face,
 * and this is the order in which its cards go.
 */
function inOrder(hand: readonly Card[], picked: Picked, goldenFirst: boolean): Picked {
  const golden = hand.findIndex(({ kind }) => kind === "golden");
  const top = hand[golden] && faceOf(hand[golden]);
  const isPlain = (card: Card) => card.kind === "face" && card.face === top;
  const plain = hand.findIndex((card, index) => isPlain(card) && picked.has(index) === goldenFirst);
  if (golden < 0 || plain < 0 || picked.has(golden) === goldenFirst) return picked;
  const [from, to] = goldenFirst ? [plain, golden] : [golden, plain];
  return new Set([...picked].map((index) => (index === from ? to : index)));
}

/** Why a card cannot be picked at a turn. */
export function reasonAgainst(requirement: Requirement, hand: readonly Card[], index: number): Reason {
  const card = hand[index];
  const face = card && faceOf(card);
  const { lowestFace, highestFace, fewestCards, goldenCard } = requirement;
  if (isOpening(requirement)) return { kind: "opening", face: lowestFace, golden: goldenCard };
  if (highestFace === 0) return { kind: "nothingRarer" };
  if (face === undefined) return requirement.loneJoker ? { kind: "other" } : { kind: "jokerAlone" };
  if (face > highestFace) return { kind: "notRarer", face, board: highestFace + 1 };
  const have = countOf(hand, face) + countOf(hand, undefined);
  return have < fewestCards ? { kind: "tooFew", need: fewestCards, have } : { kind: "other" };
}
