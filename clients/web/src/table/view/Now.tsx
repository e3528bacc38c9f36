// What the table waits for: whose decision is open and what a play must be, large enough to read
// from afar.

import { DecisionKind } from "../../gen/chefshat/v1/decision_pb";
import { SpecialAction } from "../../gen/chefshat/v1/rules_pb";
import { t } from "../../i18n";
import { SeatNumber } from "../../parts/SeatNumber";
import type { AwaitedSeat } from "../model/awaited";
import type { OpenDecision } from "../model/live";
import { isOpening, publicRequirement, type Requirement } from "../model/requirement";
import { isOver, type TableState } from "../model/state";
import { distinctName, headingWords } from "../words";
import { AwaitedLine } from "./AwaitedLine";
import css from "./Now.module.css";

interface NowProps {
  table: TableState;
  /** The reader's seat, if any. */
  own: number | undefined;
  /** The reader's own open decision. */
  decision: Pick<OpenDecision, "kind" | "requirement" | "gift" | "special"> | undefined;
  /** Whom of the others the game waits for, if the server has said so. */
  awaited?: AwaitedSeat | undefined;
  /** The seat whose decision is open, if the reader may know. */
  next: number | undefined;
  /** The kind of that decision; undefined for a turn. */
  kind?: DecisionKind | undefined;
  /** Whether passing is legal at the open turn. */
  mayPass?: boolean;
  /** Whether the reader's real cards are not known to the server yet. */
  handAwaited?: boolean;
  /** Explains what the reader can do. */
  onHelp?: (() => void) | undefined;
}

export function Now(props: NowProps) {
  const { table, own, decision, next, kind } = props;
  const deciding = decision?.kind;
  const words = t().table.now;
  const asked = deciding ?? kind ?? DecisionKind.TURN;
  const turn = asked === DecisionKind.TURN && next !== undefined;
  return (
    <section class={css.now} aria-label={nowHeading(props)}>
      <h2 class={css.heading} data-part="now-heading">
        {next !== undefined && next !== own && <SeatNumber seat={next} />}
        {nowHeading(props)}
      </h2>
      {props.onHelp && (
        <button
          type="button"
          class={css.help}
          data-part="help"
          aria-label={t().rules.help.title}
          title={t().rules.help.title}
          onClick={props.onHelp}
        >
          ?
        </button>
      )}
      {props.awaited && !decision && !isOver(table) && <AwaitedLine table={table} awaited={props.awaited} />}
      {turn && (
        <Demands requirement={decision?.requirement ?? publicRequirement(table)} mayPass={props.mayPass ?? false} />
      )}
      {deciding === DecisionKind.EXCHANGE && <p class={css.gift}>{giftWords(table, decision)}</p>}
      {deciding === DecisionKind.SPECIAL_ACTION && (
        <p>{decision?.special === SpecialAction.FOOD_FIGHT ? words.foodFight : words.dinner}</p>
      )}
      {!turn && next === undefined && <OwnState table={table} own={own} />}
    </section>
  );
}

/** Who decides, in a few words. */
export function nowHeading({ table, own, decision, next, kind, handAwaited }: NowProps): string {
  const words = t().table.now;
  const deciding = decision?.kind;
  if (handAwaited) return t().table.physical.handAwaited;
  switch (deciding) {
    case DecisionKind.EXCHANGE: {
      const { number = 1, total = 1 } = decision?.gift ?? {};
      return total > 1 ? words.youGiveOf(number, total) : words.youGive;
    }
    case DecisionKind.SPECIAL_ACTION:
      return words.youMayDeclare;
    case DecisionKind.TURN:
      return words.yourTurn;
    default:
  }
  if (next !== undefined && (next !== own || deciding === undefined)) {
    const name = distinctName(table, next);
    if (kind === DecisionKind.EXCHANGE) return words.giveOf(name);
    return kind === DecisionKind.SPECIAL_ACTION ? words.declareOf(name) : words.turnOf(name);
  }
  if (table.phase === "dealt") return words.waitExchange;
  return table.phase === "pizza" ? words.wait : headingWords(table);
}

function OwnState({ table, own }: { table: TableState; own: number | undefined }) {
  const seat = own === undefined ? undefined : table.seats[own];
  if (!seat || table.phase !== "pizza") return null;
  if (seat.place > 0) return <p>{t().table.now.finished(t().common.place(seat.place))}</p>;
  return seat.passed ? <p>{t().table.now.outOfPizza}</p> : null;
}

/** The requirement as tiles; at the opening with a sentence. */
export function Demands({ requirement, mayPass }: { requirement: Requirement; mayPass: boolean }) {
  const words = t().table.now;
  const { lowestFace, highestFace, fewestCards, goldenCard, loneJoker } = requirement;
  if (isOpening(requirement)) {
    return (
      <>
        <div class={css.tiles} data-part="requirement">
          <Tile number={String(lowestFace)} text={goldenCard ? words.openingGolden : words.openingFace} />
        </div>
        <p>{mayPass ? words.opensMayPass : words.opens}</p>
      </>
    );
  }
  if (loneJoker) return <p>{words.anything}</p>;
  if (highestFace === 0) return <p>{words.nothing}</p>;
  return (
    <div class={css.tiles} data-part="requirement">
      <Tile number={String(highestFace)} text={highestFace > 1 ? words.orLower : words.openingFace} />
      <Tile number={`${fewestCards}+`} text={words.cards} />
    </div>
  );
}

function Tile({ number, text }: { number: string; text: string }) {
  return (
    <p class={css.tile}>
      <strong class="number">{number}</strong> <span>{text}</span>
    </p>
  );
}

/** Who receives the card. */
export function giftWords(table: TableState, decision: Pick<OpenDecision, "gift"> | undefined): string {
  const words = t().table.now;
  const { gift } = decision ?? {};
  return gift ? words.giveTo(distinctName(table, gift.receiver)) : words.give;
}
