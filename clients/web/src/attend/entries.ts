// What an attendant enters by hand: cards of a play, cards of a hand or gift, and which reports fit
// the moment. The forms are in Entry.tsx; the referee in the server judges what was entered.

import type { MessageInitShape } from "@bufbuild/protobuf";
import type { RuleSet } from "../gen/chefshat/v1/rules_pb";
import { type SeenCards, type SeenCardsSchema, TableStage, type TableState } from "../gen/chefshat/v1/table_service_pb";
import { type Card, cardsFromNumbers, playedCards } from "../table/model/cards";

/** The cards of a game. */
export interface Deck {
  /** Number of faces F. */
  readonly faces: number;
  readonly jokers: number;
}

export function deckOf(rules: RuleSet | undefined): Deck {
  return { faces: rules?.faces ?? 11, jokers: rules?.jokers ?? 2 };
}

/** A play as it is entered. */
export interface PlayDraft {
  /** The face, F+1 for a joker alone; undefined before one was picked. */
  readonly face: number | undefined;
  readonly quantity: number;
  readonly jokers: number;
  readonly golden: boolean;
}

/** Nothing is picked. */
export const NO_PLAY: PlayDraft = { face: undefined, quantity: 1, jokers: 0, golden: false };

/** The cards of a play; empty before a face was picked. */
export function cardsOfDraft({ face, quantity, jokers, golden }: PlayDraft, { faces }: Deck): Card[] {
  if (face === undefined) return [];
  return face > faces ? [{ kind: "joker" }] : playedCards(face, quantity, jokers, golden && face === faces);
}

/** The draft of cards that were seen. */
export function draftOf({ cards, golden }: SeenCards, { faces }: Deck): PlayDraft {
  const plain = cards.filter((card) => card <= faces);
  const jokers = cards.length - plain.length;
  const [face] = plain;
  if (face === undefined) return jokers > 0 ? { ...NO_PLAY, face: faces + 1 } : NO_PLAY;
  return { face, quantity: plain.length, jokers, golden: golden ?? false };
}

/** Cards as they are reported. */
export function seenOf(cards: readonly Card[], { faces }: Deck): MessageInitShape<typeof SeenCardsSchema> {
  return {
    cards: cards.map((card) => (card.kind === "joker" ? faces + 1 : card.face)),
    golden: cards.some(({ kind }) => kind === "golden"),
  };
}

/** The cards of a report. */
export function cardsOfSeen({ cards, golden }: SeenCards, { faces }: Deck): Card[] {
  return cardsFromNumbers(cards, golden ?? false, faces);
}

/** What is wrong with typed cards. */
export type HandProblem =
  | { readonly kind: "word"; readonly word: string }
  | { readonly kind: "tooMany"; readonly face: number; readonly all: number }
  | { readonly kind: "tooManyJokers"; readonly all: number };

/**
 * The numbers of typed cards, ascending, F+1 for a joker: "3 4 4 J", separated by spaces or commas,
 * "2x4" for two 4s.
 */
export function parseHand(
  text: string,
  { faces, jokers }: Deck,
): { cards: number[]; problem: HandProblem | undefined } {
  const cards: number[] = [];
  let problem: HandProblem | undefined;
  for (const word of text.split(/[\s,;]+/).filter((part) => part !== "")) {
    const [, times = "1", what = ""] = /^(?:(\d+)[x×*])?(\d+|j)$/i.exec(word) ?? [];
    const card = what.toLowerCase() === "j" ? faces + 1 : Number(what);
    const known = what !== "" && card >= 1 && card <= faces + 1 && (card <= faces || /j/i.test(what));
    if (known && Number(times) <= faces) cards.push(...Array<number>(Number(times)).fill(card));
    else problem ??= { kind: "word", word };
  }
  cards.sort((left, right) => left - right);
  for (const card of new Set(cards)) {
    const all = card > faces ? jokers : card;
    if (cards.filter((other) => other === card).length <= all) continue;
    problem ??= card > faces ? { kind: "tooManyJokers", all } : { kind: "tooMany", face: card, all };
  }
  return { cards, problem };
}

/** Typed cards, the inverse of `parseHand`. */
export function handText(cards: readonly number[], { faces }: Deck): string {
  return cards
    .toSorted((left, right) => left - right)
    .map((card) => (card > faces ? "J" : String(card)))
    .join(" ");
}

/** What can be entered. */
export type EntryKind = "turn" | "hand" | "special" | "gift" | "role" | "passWithdrawn" | "cleared";

/**
 * Whether nobody has played or passed in this Shift. Then the Golden card is in a hand: a table with
 * real cards opens with it.
 */
export function isBeforePlay({ observation }: TableState): boolean {
  return (
    observation === undefined ||
    (observation.pizza <= 1 && [...observation.played, ...observation.passed].every((count) => count === 0))
  );
}

/** What can be entered now, the most likely first. */
export function entriesAt(state: TableState): EntryKind[] {
  if (!isBeforePlay(state)) return ["turn", "passWithdrawn", "cleared", "hand"];
  const rules = state.room?.rules;
  const later = (state.observation?.shift ?? 1) > 1;
  const special: EntryKind[] = later && rules?.specialActions ? ["special"] : [];
  const exchange: EntryKind[] = later && rules?.exchange ? ["gift"] : [];
  return ["turn", ...special, ...exchange, "hand", ...(later ? (["role"] as const) : [])];
}

/** What the table waits for, as an entry. */
export function awaitedEntry({ stage }: TableState): EntryKind {
  switch (stage) {
    case TableStage.HAND:
      return "hand";
    case TableStage.SPECIAL_ACTION:
      return "special";
    case TableStage.GIFT:
      return "gift";
    default:
      return "turn";
  }
}
