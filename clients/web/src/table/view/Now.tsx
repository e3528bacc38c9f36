// What the table waits for: whose decision is open and what a play must be, to be read from afar.

import { DecisionKind } from "../../gen/chefshat/v1/decision_pb";
import { Role } from "../../gen/chefshat/v1/rules_pb";
import { t } from "../../i18n";
import { SeatNumber } from "../../parts/SeatNumber";
import { demandOf, giftOf } from "../model/demand";
import type { OpenDecision } from "../model/live";
import type { TableState } from "../model/state";
import { distinctName, headingWords } from "../words";
import css from "./Now.module.css";

interface NowProps {
  table: TableState;
  /** The reader's seat, if there is one. */
  own: number | undefined;
  /** The reader's own open decision. */
  decision: Pick<OpenDecision, "kind" | "hand" | "given"> | undefined;
  /** Whose decision is open, as far as the reader may know. */
  next: number | undefined;
  /** Of which kind that decision is; undefined: a turn. */
  kind?: DecisionKind | undefined;
  /** Whether the open turn may be a pass. */
  mayPass?: boolean;
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
      {turn && <Demands table={table} mayPass={props.mayPass ?? false} />}
      {deciding === DecisionKind.EXCHANGE && <p class={css.gift}>{giftWords(table, own)}</p>}
      {deciding === DecisionKind.SPECIAL_ACTION && (
        <p>{own !== undefined && table.seats[own]?.role === Role.DISHWASHER ? words.foodFight : words.dinner}</p>
      )}
      {!turn && next === undefined && <OwnState table={table} own={own} />}
    </section>
  );
}

/** Who decides, in a few words. */
export function nowHeading({ table, own, decision, next, kind }: NowProps): string {
  const words = t().table.now;
  const deciding = decision?.kind;
  switch (deciding) {
    case DecisionKind.EXCHANGE: {
      const gift = decision && giftOf(table, own, decision);
      return gift ? words.youGiveOf(gift.number, gift.of) : words.youGive;
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

/** The demands on a play as tiles, and a sentence. */
function Demands({ table, mayPass }: { table: TableState; mayPass: boolean }) {
  const words = t().table.now;
  const demand = demandOf(table);
  switch (demand.kind) {
    case "anything":
      return <p>{words.anything}</p>;
    case "opening":
      return (
        <>
          <div class={css.tiles}>
            <Tile number={demand.face} text={demand.golden ? words.openingGolden : words.openingFace} />
          </div>
          <p>{mayPass ? words.opensMayPass : words.opens}</p>
        </>
      );
    case "beat":
      if (demand.face === 0) return <p>{words.nothing}</p>;
      return (
        <>
          <div class={css.tiles}>
            <Tile sign="≤" number={demand.face} text={words.face} />
            <Tile sign="≥" number={demand.size} text={words.cards(demand.size)} />
          </div>
          <p>{words.beat}</p>
        </>
      );
  }
}

function Tile({ sign = "", number, text }: { sign?: string; number: number; text: string }) {
  return (
    <p class={css.tile}>
      <strong class="number">
        {sign && <small>{sign}</small>} {number}
      </strong>
      <span>{text}</span>
    </p>
  );
}

/** To whom a card is given, where there is a choice. */
export function giftWords(table: TableState, own: number | undefined): string {
  const words = t().table.now;
  const role = own === undefined ? undefined : table.seats[own]?.role;
  const partner = role === Role.CHEF ? Role.DISHWASHER : role === Role.SOUS_CHEF ? Role.WAITER : undefined;
  const seat = table.seats.find((other) => other.role === partner && partner !== undefined);
  return seat ? words.giveTo(distinctName(table, seat.seat)) : words.give;
}
