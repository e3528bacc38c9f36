// The table: the other seats, the pizza, history and requirements, the reader's hand and decision.
// It renders a table from any source (a seat, a spectator's stream, a record, the tutorial) and
// reports actions.

import type { ComponentChildren } from "preact";
import { useRef, useState } from "preact/hooks";
import { DecisionKind } from "../../gen/chefshat/v1/decision_pb";
import { hidden } from "../../hiding";
import { t } from "../../i18n";
import { clockOfPeople } from "../../lobby/rooms";
import { Shows } from "../../parts/marks";
import { Notice } from "../../parts/Notice";
import { isOn } from "../../preferences";
import type { Automatic, GivenHint } from "../acting";
import type { Gesture } from "../expressions";
import type { AwaitedSeat } from "../model/awaited";
import type { OpenDecision } from "../model/live";
import { awaitsHand, isOver, type TableState } from "../model/state";
import { distinctName, headingWords, violationWords } from "../words";
import { ActionBar } from "./ActionBar";
import { useDealt } from "./arrivals";
import { Board } from "./Board";
import { useDeciding } from "./deciding";
import { Hand } from "./Hand";
import { Help } from "./Help";
import { useKeptFocus } from "./kept-focus";
import { Log } from "./Log";
import { Moment } from "./Moment";
import { Now } from "./Now";
import { Played } from "./Played";
import { Result } from "./Result";
import { SeatPanel } from "./SeatPanel";
import { useShortcuts } from "./shortcuts";
import css from "./TableView.module.css";
import { Expressions, type ShownTurn, Tools } from "./Tools";
import { Travel } from "./Travel";

interface TableViewProps {
  table: TableState;
  /** The reader's seat; undefined if all seats are others'. */
  own: number | undefined;
  /** The reader's open decision. */
  decision?: OpenDecision | undefined;
  /** Whom of the others the game waits for. */
  awaited?: AwaitedSeat | undefined;
  /** The seat whose decision is open, where the table does not contain it: in a replay. */
  next?: number | undefined;
  /** The kind of that decision. */
  nextKind?: DecisionKind | undefined;
  sending?: boolean;
  /** The last error, in words. */
  trouble?: string;
  /** Shown above everything: a lost connection, a lesson. */
  banner?: ComponentChildren;
  /** Replaces the reason why a card cannot be picked. */
  refusal?: string | undefined;
  /** Hides the clock: nobody waits. */
  untimed?: boolean;
  /** A record is shown: no seat is "you", and no links follow the end. */
  replayed?: boolean;
  /** Name of the room or record. */
  caption?: ComponentChildren;
  /** The next step after the game, before the links. */
  nextStep?: ComponentChildren;
  /** Additional tools of the table. */
  tools?: ComponentChildren;
  /** Below the table: the controls of a replay. */
  children?: ComponentChildren;
  /** The last hint. */
  hint?: GivenHint | undefined;
  /** Asks for a hint; undefined if the room gives none. */
  onHint?: (() => void) | undefined;
  /** Whether a play can be chosen before the turn. */
  plans?: boolean;
  /** Whether the page is about to pass by itself. */
  autoPassing?: boolean;
  onAnswer?: (action: number, automatic?: Automatic) => void;
  /** The person picked a card or put it back. */
  onPick?: ((card: string, picked: boolean) => void) | undefined;
  /** Shows an expression; resolves to whether it was sent. */
  onExpress?: ((gesture: Gesture) => Promise<boolean>) | undefined;
  /** Whether there are quick phrases beside the expressions. */
  phrases?: boolean;
  /** Whether people may write. */
  chat?: boolean;
}

/** The heading wraps only between its parts, not before a number or dot. */
const INSIDE = / (?=[\d·])/g;
const NO_BREAK = "\u00a0";

export function TableView(props: TableViewProps) {
  const { table, own, decision, sending = false } = props;
  const lastTurn = useRef<ShownTurn | undefined>(undefined);
  if (decision?.requirement) lastTurn.current = { table, decision: { ...decision, requirement: decision.requirement } };
  const row = useRef<HTMLDivElement>(null);
  const keepFocus = useKeptFocus(row);
  const given = decision && props.hint?.decision === decision.id ? props.hint : undefined;
  const deciding = useDeciding({
    table,
    own,
    decision,
    sending,
    given,
    refusal: props.refusal,
    plans: props.plans ?? false,
    onAnswer: props.onAnswer,
    onPick: props.onPick,
  });
  const { hand, moves } = deciding;
  const [helped, setHelped] = useState(false);
  const dealt = useDealt(table);
  // A study that hides what is possible hides its explanation too.
  const help = props.replayed || hidden.value.includes("lookup") ? undefined : () => setHelped(true);
  useShortcuts((key) => {
    if (key === "?") {
      help?.();
      return help !== undefined;
    }
    if (key === "e") {
      const [first] = document.querySelectorAll<HTMLElement>('[data-part~="expressions"] button');
      first?.focus();
      return first !== undefined;
    }
    if (!deciding.press(key)) return false;
    // Enter then plays, whatever had the focus before.
    if (!row.current?.contains(document.activeElement)) row.current?.focus({ preventScroll: true });
    return true;
  });

  const mine = own === undefined ? undefined : table.seats[own];
  const next = props.next ?? (decision ? own : table.next);
  const kind = decision?.kind ?? props.nextKind;
  const special = decision?.kind === DecisionKind.SPECIAL_ACTION;
  // While a physical table is paused, the clock stands still.
  const wholeMs = props.untimed || table.paused || !table.policy ? 0 : clockOfPeople(table.policy).decisionTimeMs;

  // A remote player at a table with real cards waits until somebody has shown them.
  const handAwaited = awaitsHand(table, own) && !props.replayed;
  const handLabel = props.replayed && mine ? t().table.hand.of(distinctName(table, mine.seat)) : t().table.hand.label;

  return (
    <div class={css.table} data-part="table" data-view={mine ? "own" : "watched"} {...keepFocus}>
      <Shows what="table" />
      <header class={css.head} data-part="table-head">
        <h1>{headingWords(table).replace(INSIDE, NO_BREAK)}</h1>
        {props.caption && <p class={`soft ${css.caption}`}>{props.caption}</p>}
        <Tools turn={lastTurn.current} lookup={mine !== undefined && !props.replayed}>
          {props.tools}
        </Tools>
      </header>
      <div class={css.banner} data-part="table-banner">
        {props.banner}
        <Physical table={table} />
      </div>
      <Seats table={table} own={own} next={next} kind={kind} />
      <div class={css.middle}>
        <Log table={table} />
        <div class={css.centre}>
          <Board table={table} />
          <Moment table={table} />
          <Result
            key={table.gameId}
            table={table}
            own={own}
            links={!props.replayed}
            nextStep={props.nextStep}
            playing={own !== undefined && !props.replayed && !props.untimed}
            acted={
              // The first turn of a Shift is open before its first pizza begins.
              (table.phase === "pizza" || decision?.kind === DecisionKind.TURN) &&
              (deciding.picked.size > 0 || (sending && !props.autoPassing))
            }
          />
        </div>
        <div class={`${css.side} sheet`}>
          <Now
            table={table}
            own={own}
            decision={decision}
            awaited={props.awaited}
            next={next}
            kind={kind}
            mayPass={moves.some((legal) => legal.kind === "pass")}
            handAwaited={handAwaited && table.phase === "dealt"}
            onHelp={help}
          />
          <Played table={table} />
        </div>
      </div>
      {mine ? (
        <section
          class={`${css.own} sheet`}
          data-part="own"
          data-deciding={decision && ""}
          data-waiting={decision || props.replayed ? undefined : ""}
          data-picking={decision && !special ? "" : undefined}
          aria-label={handLabel}
          data-decision={decision && String(decision.id)}
        >
          <SeatPanel
            table={table}
            seat={mine}
            own={!props.replayed}
            deciding={next === own}
            kind={kind}
            cards={false}
          />
          {/* Before the hand, so that the buttons are one Tab after the cards. */}
          {props.onExpress && (
            <Expressions onExpress={props.onExpress} phrases={props.phrases ?? false} chat={props.chat ?? false} />
          )}
          <div class={css.ownCards} data-part="own-cards">
            <Hand
              row={row}
              cards={hand}
              empty={
                handAwaited
                  ? t().table.physical.handAwaitedText
                  : mine.hand === undefined && mine.cardsLeft > 0
                    ? t().table.physical.handUnknown
                    : t().table.hand.empty
              }
              picked={deciding.picked}
              received={mine.received}
              refusal={deciding.refusal}
              label={handLabel}
              dealt={dealt}
              keys={props.onAnswer !== undefined && isOn("keys")}
              onToggle={deciding.toggle}
              onPlay={deciding.play}
              onPutBack={() => deciding.press("Escape")}
              onRefused={deciding.setRemark}
            />
          </div>
          {props.onAnswer && !isOver(table) && (
            <ActionBar
              table={table}
              own={own}
              decision={decision}
              deciding={deciding}
              sending={sending}
              remark={deciding.remark || props.trouble || ""}
              taught={props.refusal !== undefined}
              autoPassing={props.autoPassing ?? false}
              given={given}
              onHint={props.onHint}
              wholeMs={wholeMs}
            />
          )}
        </section>
      ) : (
        <Seats table={table} own={own} next={next} kind={kind} lower />
      )}
      {props.children}
      <Travel table={table} own={own} dealt={dealt} />
      {helped && (
        <Help
          table={table}
          own={own}
          decision={decision}
          next={next}
          plays={props.onAnswer !== undefined}
          onClose={() => setHelped(false)}
        />
      )}
    </div>
  );
}

/** The state of a physical table, if there is something to say. */
function Physical({ table }: { table: TableState }) {
  const words = t().table.physical;
  const { paused, violation } = table;
  if (!paused && !violation) return null;
  const seat = violation?.breach.seat;
  return (
    <>
      {paused && <Notice kind="hint">{words.paused}</Notice>}
      {violation && (
        <Notice kind="fault">
          {words.violation(
            seat === undefined ? "" : distinctName(table, seat),
            violationWords(table, violation.breach, violation.demand),
          )}
        </Notice>
      )}
    </>
  );
}

interface SeatsProps {
  table: TableState;
  own: number | undefined;
  next: number | undefined;
  kind: DecisionKind | undefined;
  /** The row below the pizza, if the reader has no seat. */
  lower?: boolean;
}

/**
 * The other seats in the order of play from the reader's left. Without a seat of the reader's they
 * go clockwise around the pizza.
 */
function Seats({ table, own, next, kind, lower = false }: SeatsProps) {
  const players = table.seats.length;
  const below = own === undefined ? Math.max(1, Math.floor(players / 2)) : 0;
  const numbers = Array.from({ length: players }, (_, index) => index);
  const shown =
    own !== undefined
      ? numbers.slice(1).map((distance) => (own + distance) % players)
      : lower
        ? numbers
            .slice(players - below + 1)
            .concat(0)
            .reverse()
        : numbers.slice(1, players - below + 1);
  return (
    <ol class={css.seats} data-part="seats" style={{ "--seats": shown.length }} aria-label={t().table.room.seats}>
      {shown.map((number) => {
        const seat = table.seats[number];
        if (!seat) return null;
        return (
          <li key={number}>
            <SeatPanel table={table} seat={seat} deciding={next === number && seat.place === 0} kind={kind} />
          </li>
        );
      })}
    </ol>
  );
}
