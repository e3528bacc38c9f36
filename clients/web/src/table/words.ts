// The table in words: cards, events, decisions. Combines the texts with the model's values.

import { type AnswerResult, AnswerStatus } from "../gen/chefshat/v1/decision_pb";
import { Role, SpecialAction } from "../gen/chefshat/v1/rules_pb";
import { t } from "../i18n";
import { seatNumber } from "../parts/SeatNumber";
import { isLabel, phraseOf } from "./expressions";
import { shownName } from "./labels";
import type { Move } from "./model/actions";
import { type Card, faceOf } from "./model/cards";
import type { Reason } from "./model/picking";
import type { Breach, Demand, LogEntry, LogLine, SeatState, TableState } from "./model/state";

/** A seat's name, or its number while it is free. */
export function nameOf(table: TableState, seat: number): string {
  const name = table.seats[seat]?.name;
  return name ? shownName(seat, name) : t().common.seat(seat);
}

/** A seat's name, with its number if another seat has the same name. */
export function distinctName(table: TableState, seat: number): string {
  const name = nameOf(table, seat);
  const same = table.seats.some((other) => other.seat !== seat && nameOf(table, other.seat) === name);
  return same ? `${name} (${seatNumber(seat)})` : name;
}

/** A card, for screen readers and sentences. */
export function cardWord(card: Card): string {
  const words = t().table.card;
  if (card.kind === "joker") return words.joker;
  const ingredient = t().common.faces[card.face - 1] ?? "";
  const text = card.kind === "golden" ? words.golden(card.face, ingredient) : words.face(card.face, ingredient);
  return ingredient ? text : text.replace(/, $/, "");
}

/** The cards of a play: "three 9s with 2 jokers". */
export function playWords(cards: readonly Card[]): string {
  const jokers = cards.filter((card) => card.kind === "joker").length;
  const face = cards.map(faceOf).find((other) => other !== undefined);
  if (face === undefined) return t().table.jokers(jokers);
  const golden = cards.some((card) => card.kind === "golden");
  return t().table.play(cards.length - jokers, face, golden, jokers);
}

/** A move, as the cards it takes. */
export function moveWords(move: Move): string {
  const words = t().table;
  switch (move.kind) {
    case "play":
      return words.play(move.quantity, move.face, false, move.jokers);
    case "loneJoker":
    case "giveJoker":
      return words.jokers(1);
    case "give":
      return cardWord({ kind: "face", face: move.face });
    case "pass":
      return words.actions.pass;
    case "decline":
      return words.actions.decline;
    case "declare":
      return `${words.actions.foodFight} / ${words.actions.dinner}`;
  }
}

/** Cards of any faces. */
function giftWords(cards: readonly Card[], count: number): string {
  if (cards.length === 0) return t().common.cards(count);
  const faces = [...new Set(cards.map(faceOf))];
  return faces.map((face) => playWords(cards.filter((card) => faceOf(card) === face))).join(", ");
}

/** The seat that a line is about, and the rest of the sentence. */
export interface SaidLine {
  readonly seat: number | undefined;
  readonly text: string;
}

/** An event, in words. */
export function happeningWords(table: TableState, entry: LogEntry): SaidLine {
  const words = t().table.log;
  const because = (cause: keyof typeof words.causes) => (words.causes[cause] ? ` (${words.causes[cause]})` : "");
  switch (entry.kind) {
    case "dealt":
      return { seat: undefined, text: words.dealt(entry.shift) };
    case "played":
      return { seat: entry.seat, text: words.plays(playWords(entry.cards)) + because(entry.cause) };
    case "passed":
      return { seat: entry.seat, text: words.passes + because(entry.cause) };
    case "finished":
      return { seat: entry.seat, text: words.finishes(t().common.place(entry.place)) };
    case "pizzaDone":
      return { seat: undefined, text: words.pizzaDone(entry.pizza, distinctName(table, entry.nextLeader)) };
    case "declared": {
      const fight = entry.action === SpecialAction.FOOD_FIGHT;
      return { seat: entry.seat, text: fight ? words.foodFight : words.dinner };
    }
    case "gave": {
      const what = giftWords(entry.cards, entry.count);
      return { seat: entry.giver, text: words.gives(what, distinctName(table, entry.receiver)) };
    }
    case "shiftOver":
      return { seat: undefined, text: words.shiftOver(entry.shift, distinctName(table, entry.winner)) };
    case "expressed":
      return {
        seat: entry.seat,
        text: (phraseOf(entry.label) ? words.says : words.shows)(expressionWord(entry.label)),
      };
    case "substituted":
      return { seat: entry.seat, text: words.substituted(entry.agent) };
    case "handReported":
      return { seat: undefined, text: words.handReported(distinctName(table, entry.seat)) };
    case "violated": {
      const text = violationWords(table, entry.breach, entry.demand);
      return { seat: entry.breach.seat, text: entry.breach.seat === undefined ? text : words.violated(text) };
    }
    case "corrected":
      return { seat: undefined, text: words.corrected(entry.text) };
    case "seated":
    case "left":
    case "lost":
    case "back":
      return { seat: entry.seat, text: words[entry.kind] };
    default:
      return { seat: undefined, text: words[entry.kind] };
  }
}

/** A line as it is read out. */
export function spokenLine(table: TableState, { entry }: LogLine): string {
  const { seat, text } = happeningWords(table, entry);
  const sentence = seat === undefined ? text : `${distinctName(table, seat)} ${text}`;
  return sentence.endsWith(".") ? sentence : `${sentence}.`;
}

/** How a Shift or the game ended, as it is read out; empty for any other line. */
export function outcomeWords(table: TableState, { entry }: LogLine): string {
  const line = (seat: number, place: number, points: number) =>
    `${t().common.place(place)} ${distinctName(table, seat)}, ${t().common.points(points)}.`;
  const { results, standings } = table;
  const result = results.at(-1);
  // Of the last Shift it is that of the game, which follows.
  if (entry.kind === "shiftOver" && result?.shift === entry.shift && standings.length === 0)
    return result.order.map((seat, index) => line(seat, index + 1, result.points[seat] ?? 0)).join(" ");
  const [winner] = standings;
  if (entry.kind !== "gameOver" || winner === undefined) return "";
  const lines = standings.map(({ seat, place, points }) => line(seat, place, points));
  return [`${t().table.result.wins(distinctName(table, winner.seat))}.`, ...lines].join(" ");
}

/** The roles of all seats, as they are read out; empty before there are any. */
export function rolesWords(table: TableState): string {
  const of = ({ seat, role }: TableState["seats"][number]) => `${distinctName(table, seat)}: ${roleWord(role)}.`;
  return table.seats.every(({ role }) => roleWord(role) !== "") ? table.seats.map(of).join(" ") : "";
}

/** What the rules or the cards do not allow: the page's own sentence, or the server's. */
export function violationWords(table: TableState, { rule, text }: Breach, demand: Demand): string {
  return t().table.violation({
    rule,
    text,
    top: table.faces,
    highest: demand.highestFace,
    fewest: demand.fewestCards,
    onBoard: demand.onBoard,
    golden: demand.opening && demand.goldenCard,
    next: demand.next === undefined ? "" : distinctName(table, demand.next),
  });
}

/** The word of an expression, the text of a phrase, or a label that has none. */
export function expressionWord(label: string): string {
  const phrase = phraseOf(label);
  if (phrase) return phrase.id ? t().table.expressions.phrases[phrase.id] : phrase.text;
  return isLabel(label) ? t().table.expressions.words[label] : label;
}

const ROLES = {
  [Role.CHEF]: "chef",
  [Role.SOUS_CHEF]: "sousChef",
  [Role.COOK]: "cook",
  [Role.WAITER]: "waiter",
  [Role.DISHWASHER]: "dishwasher",
} as const;

/** A role's name; empty for none. */
export function roleWord(role: Role): string {
  return role === Role.UNSPECIFIED ? "" : t().common.roles[ROLES[role]];
}

/** Why a card cannot be picked. */
export function reasonWords(reason: Reason): string {
  const words = t().table.reasons;
  switch (reason.kind) {
    case "opening":
      return reason.golden ? words.openingGolden(reason.face) : words.openingFace(reason.face);
    case "notRarer":
      return words.notRarer(reason.face, reason.board);
    case "tooFew":
      return words.tooFew(reason.need, reason.have);
    default:
      return words[reason.kind];
  }
}

/** Why the server refused a seat or a place: the page's own sentence, or the server's. */
export function refusedWords({ reason, message }: { readonly reason: string; readonly message: string }): string {
  const own = (t().faults.byReason as Record<string, string>)[reason];
  return own ?? `${t().table.link.refused} ${message}`;
}

/** The state of the game, for the heading. */
export function headingWords(table: TableState): string {
  const words = t().table.heading;
  switch (table.phase) {
    case "waiting":
      return words.waiting;
    case "dealt":
      return words.before(table.shift);
    case "pizza":
      return words.turn(table.shift, table.pizza, table.turn);
    case "shiftOver":
      return words.shiftOver(table.shift);
    case "gameOver":
      return words.gameOver;
    case "aborted":
      return words.aborted;
  }
}

/** The state of a seat's connection: lost, or replaced by a substitute. */
export function presenceWords(seat: SeatState): string {
  const words = t().table.presence;
  if (seat.substitute) return words.substituted(seat.substitute);
  return seat.connected || seat.builtIn ? "" : words.away;
}

/** The result of an answer that was not accepted. */
export function answerWords({ status, invalidAttemptsLeft }: AnswerResult): string {
  const words = t().table.answers;
  switch (status) {
    case AnswerStatus.INVALID:
      return invalidAttemptsLeft === undefined ? words.notLegal : words.notLegalLeft(invalidAttemptsLeft);
    case AnswerStatus.CLOSED:
      return words.closed;
    case AnswerStatus.UNKNOWN_DECISION:
      return words.unknownDecision;
    default:
      return "";
  }
}
