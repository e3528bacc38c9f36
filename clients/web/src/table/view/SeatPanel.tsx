// A seat: name and kind, role, points, cards, last action, expression.

import { DecisionKind } from "../../gen/chefshat/v1/decision_pb";
import { ParticipantKind } from "../../gen/chefshat/v1/room_pb";
import { Role } from "../../gen/chefshat/v1/rules_pb";
import { t } from "../../i18n";
import { Card } from "../../parts/Card";
import { Drawing } from "../../parts/Drawing";
import { KindBadge, kindWord } from "../../parts/KindBadge";
import { SeatNumber } from "../../parts/SeatNumber";
import { isLabel, phraseOf } from "../expressions";
import { type Card as CardValue, faceOf, stacks } from "../model/cards";
import { isTaken, type SeatState, type TableState } from "../model/state";
import { cardWord, expressionWord, nameOf, playWords, presenceWords, roleWord } from "../words";
import { Face } from "./Face";
import css from "./SeatPanel.module.css";

/** Most card backs drawn for a hidden hand; the number beside them is exact. */
const MOST_BACKS = 17;

/**
 * Number of last events within which an expression is shown, so that a reload does not show an old
 * one.
 */
const FRESH = 10;

const ROLE_DRAWINGS: Record<Role, string> = {
  [Role.UNSPECIFIED]: "",
  [Role.CHEF]: "role-chef",
  [Role.SOUS_CHEF]: "role-sous-chef",
  [Role.COOK]: "role-cook",
  [Role.WAITER]: "role-waiter",
  [Role.DISHWASHER]: "role-dishwasher",
};

interface SeatPanelProps {
  table: TableState;
  seat: SeatState;
  /** Whether this is the reader's seat. */
  own?: boolean;
  /** Whether its decision is open, if the reader may know. */
  deciding: boolean;
  /** The kind of that decision, if known. */
  kind?: DecisionKind | undefined;
  /** Whether to draw its cards; the reader's own are in the hand. */
  cards?: boolean;
}

export function SeatPanel({ table, seat, own = false, deciding, kind, cards = true }: SeatPanelProps) {
  const words = t().table;
  const waiting = table.phase === "waiting";
  const state = !isTaken(seat)
    ? "free"
    : seat.place > 0
      ? "placed"
      : deciding
        ? "deciding"
        : seat.passed
          ? "passed"
          : "";
  const presence = presenceWords(seat);
  // After the game its places stand there: the roles were those of the last Shift.
  const role = table.standings.length > 0 ? "" : roleWord(seat.role);
  return (
    <article class={`${css.seat} ${css[state] ?? ""}`} data-part="seat" data-seat={seat.seat}>
      <SeatNumber seat={seat.seat} />
      <div class={css.who}>
        <h2 class={css.name}>
          {isTaken(seat) ? nameOf(table, seat.seat) : freeWords(seat)}
          {own && <span class="soft"> ({words.you})</span>}
        </h2>
        <p class={css.kind}>
          {isTaken(seat) && <KindBadge kind={seat.kind} builtIn={seat.builtIn} name={seat.name} />}
          {isTaken(seat) && presence && <span class={css.presence}>{presence}</span>}
        </p>
      </div>
      {!waiting && (
        <p class={css.points} data-part="seat-points">
          <strong class="number">{seat.points}</strong> <span class="soft small">{words.pointsWord(seat.points)}</span>
        </p>
      )}
      {!waiting && (
        <p class={css.state}>
          {role && (
            <span class={css.role}>
              <Drawing name={ROLE_DRAWINGS[seat.role]} /> {role}
            </span>
          )}
          <Chip table={table} seat={seat} state={state} kind={kind} />
        </p>
      )}
      {cards && !waiting && <Cards seat={seat} />}
      {seat.expression && table.nextSequence - seat.expression.sequence <= FRESH && (
        <Bubble key={seat.expression.sequence} label={seat.expression.label} />
      )}
    </article>
  );
}

/** Whom a free seat is reserved for. */
function freeWords({ reservedFor }: SeatState): string {
  if (reservedFor === ParticipantKind.UNSPECIFIED) return t().table.freeSeat;
  return t().lobby.seats.reservedFor(kindWord(reservedFor));
}

interface ChipProps {
  table: TableState;
  seat: SeatState;
  state: string;
  kind: DecisionKind | undefined;
}

function Chip({ table, seat, state, kind }: ChipProps) {
  const words = t().table.chips;
  const chip = (look: string | undefined, text: string) => (
    <span class={`${css.chip} ${look}`} data-part="chip">
      {text}
    </span>
  );
  if (state === "placed") return chip(css.chipPlaced, t().common.place(gamePlace(table, seat) ?? seat.place));
  if (state === "deciding") {
    if (kind === DecisionKind.EXCHANGE) return chip(css.chipDeciding, words.toGive);
    return chip(css.chipDeciding, kind === DecisionKind.SPECIAL_ACTION ? words.toDeclare : words.toPlay);
  }
  if (seat.lastMove === "pass") return chip(css.chipPassed, words.passed);
  return seat.lastMove ? <Play cards={seat.lastMove} /> : null;
}

/** The cards of a play, small and one over the other: said to be played, since cards in the hand look alike. */
function Play({ cards }: { cards: readonly CardValue[] }) {
  const words = playWords(cards);
  return (
    <span class={`${css.chip} ${css.play}`} data-part="chip" title={words}>
      <small>{t().table.chips.played}</small>
      <span class="visually-hidden">{words}</span>
      {cards.map((card, index) => (
        <b key={index} class={`number ${card.kind === "golden" ? css.playGolden : ""}`} aria-hidden="true">
          {faceOf(card) ?? "J"}
        </b>
      ))}
    </span>
  );
}

/** The place in the game, once it is over. */
function gamePlace(table: TableState, seat: SeatState): number | undefined {
  return table.standings.find((line) => line.seat === seat.seat)?.place;
}

function Cards({ seat }: { seat: SeatState }) {
  const count = t().common.cards(seat.cardsLeft);
  if (seat.hand) {
    return (
      <div class={css.cards} data-part="seat-cards">
        <span class="visually-hidden">{seat.hand.map(cardWord).join("; ")}</span>
        <div class={css.open} data-part="seat-open" aria-hidden="true">
          {stacks(seat.hand).map((stack) => (
            <span class={css.stack} key={stack[0]?.kind === "joker" ? "J" : stack[0]?.face}>
              {stack[0] && <Card card={stack[0]} />}
              {stack.length > 1 && <b class={`${css.stackCount} number`}>×{stack.length}</b>}
            </span>
          ))}
        </div>
      </div>
    );
  }
  return (
    <div class={css.cards} data-part="seat-cards">
      <span class={`${css.count} number`}>{count}</span>
      <span class={`${css.deck} number`} aria-hidden="true">
        {seat.cardsLeft}
      </span>
      <div class={css.backs} aria-hidden="true">
        {Array.from({ length: Math.min(MOST_BACKS, seat.cardsLeft) }, (_, index) => (
          <Card key={index} card={undefined} />
        ))}
      </div>
    </div>
  );
}

/** An expression or a phrase, shown for a few seconds. */
function Bubble({ label }: { label: string }) {
  return (
    <p class={`${css.bubble} ${phraseOf(label) ? css.phrase : ""}`} data-part="bubble">
      {isLabel(label) && <Face label={label} />}
      <span>{expressionWord(label)}</span>
    </p>
  );
}
