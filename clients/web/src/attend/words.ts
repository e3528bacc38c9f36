// A physical table in words: what it waits for, what is to be laid, reports, violations. The
// server's texts are in English; the page makes its own sentences where it can.

import { DecisionKind } from "../gen/chefshat/v1/decision_pb";
import { Role } from "../gen/chefshat/v1/rules_pb";
import type { Violation } from "../gen/chefshat/v1/table_pb";
import { type CardsToLay, type TableReport, TableStage, type TableState } from "../gen/chefshat/v1/table_service_pb";
import { t } from "../i18n";
import { faceOf } from "../table/model/cards";
import { isOpening } from "../table/model/requirement";
import { applyObservation } from "../table/model/snapshot";
import { type TableState as Table, tableFromRoom } from "../table/model/state";
import { cardWord, distinctName, playWords, roleWord, violationWords } from "../table/words";
import { cardsOfSeen, type Deck, deckOf } from "./entries";

/** The table as the other views know it, from the public part of the state. */
export function tableOf(state: TableState): Table {
  if (!state.room) throw new Error("the server did not say which room it is");
  const table = { ...tableFromRoom(state.room), history: undefined };
  if (!state.observation) return table;
  const seen = applyObservation(table, state.observation, undefined);
  const toppings = seen.board.map((card) => faceOf(card) ?? seen.faces + 1);
  return { ...seen, toppings, next: state.seat, paused: state.paused };
}

/** What the table waits for: a heading, and what to do about it. */
export interface Awaited {
  readonly heading: string;
  readonly text: string;
}

/** What the table waits for. */
export function awaitedWords(state: TableState, table: Table): Awaited {
  const words = t().attend.now;
  const { stage, seat } = state;
  const name = seat === undefined ? "" : distinctName(table, seat);
  const remote = seat !== undefined && !state.seats[seat]?.atTable;
  switch (stage) {
    case TableStage.WAITING:
      return { heading: words.waiting, text: words.waitingText };
    case TableStage.HAND:
      return { heading: words.hand(name), text: words.handText };
    case TableStage.SPECIAL_ACTION:
      return remote
        ? { heading: words.specialOf(name), text: words.remoteText }
        : { heading: words.special, text: words.specialText };
    case TableStage.GIFT:
      return remote
        ? { heading: words.giftOf(name), text: words.remoteText }
        : { heading: words.gift(name), text: words.giftText };
    case TableStage.OPENING:
      return { heading: words.opening(table.faces), text: "" };
    case TableStage.TURN:
      return remote ? { heading: words.turnOf(name), text: words.remoteText } : { heading: words.turn(name), text: "" };
    case TableStage.QUESTION:
      return { heading: words.question, text: words.questionText };
    case TableStage.CONFIRMATION:
      return { heading: words.confirmation, text: words.confirmationText };
    case TableStage.OVER:
      return { heading: words.over, text: "" };
    default:
      return { heading: state.waitingFor, text: "" };
  }
}

/** What is to be done at the table for a remote seat. */
export function toLayWords(table: Table, { seat, kind, cards, receiver }: CardsToLay): string {
  const words = t().attend.toLay;
  const name = distinctName(table, seat);
  switch (kind) {
    case DecisionKind.EXCHANGE:
      return words.give(name, receiver === undefined ? "" : distinctName(table, receiver));
    case DecisionKind.SPECIAL_ACTION:
      return table.seats[seat]?.role === Role.DISHWASHER ? words.foodFight(name) : words.dinner(name);
    default:
      return cards && cards.cards.length > 0 ? words.lay(name) : words.pass(name);
  }
}

/** A report that counts. */
export function reportWords(table: Table, { kind }: TableReport, seat: number | undefined, text: string): string {
  const words = t().attend.reports;
  const deck: Deck = deckOf(table.rules);
  const of = (named: number | undefined) => distinctName(table, named ?? seat ?? 0);
  switch (kind.case) {
    case "laid":
      return kind.value.cards ? words.laid(of(kind.value.seat), playWords(cardsOfSeen(kind.value.cards, deck))) : text;
    case "pass":
      return words.passed(of(kind.value.seat));
    case "passWithdrawn":
      return words.passWithdrawn(of(kind.value.seat));
    case "hand":
      return words.hand(of(kind.value.seat));
    case "cleared":
      return words.cleared;
    case "special":
      return kind.value.seat === undefined ? words.nobodyDeclared : words.declared(of(kind.value.seat));
    case "gift":
      return kind.value.cards
        ? words.gaveCards(of(kind.value.seat), cardsOfSeen(kind.value.cards, deck).map(cardWord).join("; "))
        : words.gave(of(kind.value.seat));
    case "role":
      return words.role(of(kind.value.seat), roleWord(kind.value.role));
    default:
      return text;
  }
}

/** The last violation. */
export function lastViolationWords(state: TableState, table: Table, { seat, rule, text }: Violation): string {
  const { playRequirement: required } = state;
  const sentence = violationWords(
    table,
    { seat, rule, text },
    {
      highestFace: required?.highestFace ?? table.faces,
      fewestCards: required?.fewestCards ?? 1,
      onBoard: required !== undefined && table.board.length > 0,
      opening: required !== undefined && isOpening(required),
      goldenCard: required?.goldenCard ?? false,
      next: state.seat,
    },
  );
  return t().table.physical.violation(seat === undefined ? "" : distinctName(table, seat), sentence);
}
