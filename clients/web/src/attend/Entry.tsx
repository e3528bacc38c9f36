// Entering a report by hand: everything that a camera could report. Nothing is forbidden here: what
// was seen is reported, and the referee judges it.

import type { ComponentChildren } from "preact";
import { Role } from "../gen/chefshat/v1/rules_pb";
import { TableStage, type TableState } from "../gen/chefshat/v1/table_service_pb";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import type { TableState as Table } from "../table/model/state";
import { distinctName, playWords, roleWord } from "../table/words";
import css from "./Attend.module.css";
import type { Outcome, ReportKind } from "./attending";
import {
  awaitedEntry,
  cardsOfDraft,
  type Deck,
  deckOf,
  type EntryKind,
  entriesAt,
  isBeforePlay,
  NO_PLAY,
  type PlayDraft,
  parseHand,
  seenOf,
} from "./entries";
import { Choice, HandPick, Option, PlayPick, SeatPick } from "./Picks";

/** What is being entered. */
export interface Draft {
  /** Undefined: what the table waits for. */
  readonly kind: EntryKind | undefined;
  /** Undefined: the seat that the table waits for. */
  readonly seat: number | undefined;
  readonly play: PlayDraft;
  /** The typed cards of a hand or gift. */
  readonly hand: string;
  readonly golden: boolean;
  readonly role: Role;
}

/** Nothing is entered. */
export const NO_DRAFT: Draft = {
  kind: undefined,
  seat: undefined,
  play: NO_PLAY,
  hand: "",
  golden: false,
  role: Role.UNSPECIFIED,
};

interface FieldsProps {
  state: TableState;
  table: Table;
  draft: Draft;
  /** The seat, chosen or awaited. */
  seat: number | undefined;
  change: (changed: Partial<Draft>) => void;
  /** Sends a report. */
  send: (what: ReportKind) => void;
}

interface EntryProps {
  state: TableState;
  table: Table;
  draft: Draft;
  /** What came of the last entry. */
  outcome: Outcome | undefined;
  onDraft: (draft: Draft) => void;
  /** Sends a report. */
  onSend: (what: ReportKind) => void;
}

/** The form. */
export function Entry({ state, table, draft, outcome, onDraft, onSend }: EntryProps) {
  const words = t().attend.enter;
  const kinds = entriesAt(state);
  const awaited = awaitedEntry(state);
  const kind = draft.kind && kinds.includes(draft.kind) ? draft.kind : kinds.includes(awaited) ? awaited : "turn";
  const seat = draft.seat ?? state.seat;
  // What is entered is about this seat, also when the table waits for another meanwhile.
  const change = (changed: Partial<Draft>) => onDraft({ ...draft, seat, ...changed });
  const props = { state, table, draft, seat, change, send: onSend };
  return (
    <section class={`${css.part} sheet`} data-part="entry" aria-labelledby="entry-title">
      <h2 id="entry-title" tabIndex={-1}>
        {words.title}
      </h2>
      <Choice label={words.what} quiet>
        {kinds.map((one) => (
          <Option key={one} chosen={one === kind} onChoose={() => change({ kind: one })}>
            {words.kinds[one]}
          </Option>
        ))}
      </Choice>
      {kind === "turn" && <TurnFields {...props} />}
      {kind === "hand" && <HandFields {...props} />}
      {kind === "gift" && <GiftFields {...props} />}
      {kind === "special" && <SpecialFields {...props} />}
      {kind === "role" && <RoleFields {...props} />}
      {kind === "passWithdrawn" && <PassWithdrawnFields {...props} />}
      {kind === "cleared" && (
        <>
          <p class="soft">{words.clearedText}</p>
          <Actions>
            <Button look="main" onClick={() => onSend({ case: "cleared", value: {} })}>
              {t().attend.reports.cleared}
            </Button>
          </Actions>
        </>
      )}
      <OutcomeNotice outcome={outcome} />
    </section>
  );
}

/** What came of a report, if the rest of the page does not show it. */
export function OutcomeNotice({ outcome }: { outcome: Outcome | undefined }) {
  const words = t().attend.outcome;
  switch (outcome?.kind) {
    case "known":
    case "held":
      return <Notice kind="hint">{words[outcome.kind]}</Notice>;
    case "void":
      return <Notice kind="hint">{words.void(outcome.count)}</Notice>;
    case "fault":
      return <Notice kind="fault">{outcome.words}</Notice>;
    default:
      return null;
  }
}

/** The buttons of a form. */
export function Actions({ children }: { children: ComponentChildren }) {
  return <div class={css.actions}>{children}</div>;
}

/** Seats that still hold cards. */
function holders(table: Table): number[] {
  return table.seats.filter(({ cardsLeft }) => cardsLeft > 0).map(({ seat }) => seat);
}

/**
 * Seats at the table that still hold cards. What remote seats decide is laid for them, and reported
 * as done.
 */
function players(table: Table): number[] {
  return holders(table).filter((seat) => table.seats[seat]?.atTable);
}

/** The seat, if its player sits at the table. */
function playerOf(table: Table, seat: number | undefined): number | undefined {
  return seat !== undefined && table.seats[seat]?.atTable ? seat : undefined;
}

/**
 * A play or a pass. `fixed`: of this seat, in place of an earlier report; `movable`: or of another seat, if that one was only
 * assumed.
 */
export function TurnFields({
  state,
  table,
  draft,
  seat: named,
  change,
  send,
  fixed = false,
  movable = !fixed,
}: FieldsProps & { fixed?: boolean; movable?: boolean }) {
  const words = t().attend.enter;
  const seat = movable ? playerOf(table, named) : named;
  const deck = deckOf(table.rules);
  const cards = cardsOfDraft(draft.play, deck);
  const name = seat === undefined ? undefined : distinctName(table, seat);
  // The seat with the Golden card opens; the referee asks if nobody says which one it was.
  const open = state.stage === TableStage.OPENING;
  const ready = cards.length > 0 && (name !== undefined || open);
  const of = seat === undefined ? {} : { seat };
  const before = isBeforePlay(state);
  return (
    <>
      {movable && (
        <SeatPick table={table} seats={players(table)} value={seat} onPick={(picked) => change({ seat: picked })} />
      )}
      <PlayPick
        deck={deck}
        draft={draft.play}
        requirement={fixed ? undefined : state.playRequirement}
        golden={fixed || isBeforePlay(state)}
        onChange={(play) => change({ play })}
      />
      <Actions>
        <Button
          look="main"
          aria-disabled={!ready}
          onClick={() => ready && send({ case: "laid", value: { ...of, cards: seenOf(cards, deck) } })}
        >
          {cards.length > 0 && name !== undefined ? words.lays(name, playWords(cards)) : words.lay}
        </Button>
        {(fixed || !before || table.rules?.openingPass) && (
          <Button
            aria-disabled={name === undefined}
            onClick={() => name !== undefined && send({ case: "pass", value: of })}
          >
            {name === undefined ? words.pass : words.passes(name)}
          </Button>
        )}
      </Actions>
    </>
  );
}

/** A hand that became known. `fixed`: of this seat, in place of an earlier report. */
export function HandFields(props: FieldsProps & { fixed?: boolean }) {
  const { state, table, draft, seat, send, fixed = false } = props;
  const words = t().attend.enter;
  const deck = deckOf(table.rules);
  const { cards, problem } = parseHand(draft.hand, deck);
  // A corrected hand is as it was then.
  const expected = seat === undefined || fixed ? undefined : table.seats[seat]?.cardsLeft;
  const complete = expected === undefined || cards.length === expected;
  const ready = seat !== undefined && cards.length > 0 && problem === undefined && complete;
  return (
    <TypedForm
      {...props}
      seats={fixed ? [] : holders(table)}
      seat={seat}
      expected={expected}
      fault={expected !== undefined && cards.length > expected ? words.hand.mustBe(expected) : undefined}
      label={seat === undefined ? words.whoFirst : words.handSeen(distinctName(table, seat))}
      ready={ready}
      onSubmit={() =>
        ready && send({ case: "hand", value: { seat, cards: typedCards(draft, deck, asksGolden(state, fixed)) } })
      }
    />
  );
}

/** A gift of the exchange, whose cards may be unknown. `fixed`: as for a hand. */
export function GiftFields(props: FieldsProps & { fixed?: boolean }) {
  const { state, table, draft, send, fixed = false } = props;
  const words = t().attend.enter;
  const seat = fixed ? props.seat : playerOf(table, props.seat);
  const deck = deckOf(table.rules);
  const { cards, problem } = parseHand(draft.hand, deck);
  const name = seat === undefined ? undefined : distinctName(table, seat);
  const seen = cards.length === 0 ? {} : { cards: typedCards(draft, deck, asksGolden(state, fixed)) };
  const ready = seat !== undefined && problem === undefined;
  return (
    <TypedForm
      {...props}
      seats={fixed ? [] : players(table)}
      seat={seat}
      label={name === undefined ? words.whoFirst : cards.length === 0 ? words.giftUnseen(name) : words.giftSeen(name)}
      ready={ready}
      onSubmit={() => ready && send({ case: "gift", value: { seat, ...seen } })}
    />
  );
}

/** Whether to ask for the Golden card: an earlier report may be from before it was played. */
function asksGolden(state: TableState, fixed: boolean): boolean {
  return fixed || isBeforePlay(state);
}

/** The typed cards as they are reported. */
function typedCards({ hand, golden }: Draft, deck: Deck, asked: boolean) {
  const { cards } = parseHand(hand, deck);
  return { cards, golden: asked && golden && cards.includes(deck.faces) };
}

interface TypedFormProps extends FieldsProps {
  /** Seats to choose from; none if the seat is given. */
  seats: readonly number[];
  fixed?: boolean;
  expected?: number | undefined;
  fault?: string | undefined;
  /** The button. */
  label: string;
  ready: boolean;
  onSubmit: () => void;
}

/** A form with typed cards: Enter sends it. */
function TypedForm(props: TypedFormProps) {
  const { state, table, draft, seats, seat, change, fixed = false, expected, fault, label, ready, onSubmit } = props;
  return (
    <form
      class={css.part}
      noValidate
      onSubmit={(event) => {
        event.preventDefault();
        onSubmit();
      }}
    >
      {seats.length > 0 && (
        <SeatPick table={table} seats={seats} value={seat} onPick={(picked) => change({ seat: picked })} />
      )}
      <HandPick
        deck={deckOf(table.rules)}
        text={draft.hand}
        golden={draft.golden}
        asksGolden={asksGolden(state, fixed)}
        expected={expected}
        fault={fault}
        onChange={({ text = draft.hand, golden = draft.golden }) => change({ hand: text, golden })}
      />
      <Actions>
        <Button look="main" type="submit" aria-disabled={!ready}>
          {label}
        </Button>
      </Actions>
    </form>
  );
}

/** A special action, or nobody's. */
export function SpecialFields({ table, send }: Pick<FieldsProps, "table" | "send">) {
  const words = t().attend.enter;
  return (
    <Actions>
      <Button look="main" onClick={() => send({ case: "special", value: {} })}>
        {words.nobodyDeclares}
      </Button>
      {table.seats
        .filter(({ atTable }) => atTable)
        .map(({ seat }) => (
          <Button key={seat} onClick={() => send({ case: "special", value: { seat } })}>
            {words.declares(distinctName(table, seat))}
          </Button>
        ))}
    </Actions>
  );
}

const ROLES = [Role.CHEF, Role.SOUS_CHEF, Role.COOK, Role.WAITER, Role.DISHWASHER];

function RoleFields({ table, draft, seat, change, send }: FieldsProps) {
  const words = t().attend.enter;
  const used = ROLES.filter((role) => table.seats.some((other) => other.role === role));
  const role = roleWord(draft.role);
  const ready = seat !== undefined && role !== "";
  return (
    <>
      <SeatPick
        table={table}
        seats={table.seats.map((one) => one.seat)}
        value={seat}
        onPick={(picked) => change({ seat: picked })}
      />
      <Choice label={words.role}>
        {used.map((one) => (
          <Option key={one} chosen={one === draft.role} onChoose={() => change({ role: one })}>
            {roleWord(one)}
          </Option>
        ))}
      </Choice>
      <Actions>
        <Button
          look="main"
          aria-disabled={!ready}
          onClick={() => ready && send({ case: "role", value: { seat, role: draft.role } })}
        >
          {ready ? words.takesRole(distinctName(table, seat), role) : words.kinds.role}
        </Button>
      </Actions>
    </>
  );
}

function PassWithdrawnFields({ table, send }: FieldsProps) {
  const words = t().attend.enter;
  const passed = table.seats.filter((seat) => seat.passed && seat.atTable);
  return (
    <Actions>
      {(passed.length > 0 ? passed : table.seats.filter(({ atTable }) => atTable)).map(({ seat }) => (
        <Button key={seat} onClick={() => send({ case: "passWithdrawn", value: { seat } })}>
          {words.passWithdrawn(distinctName(table, seat))}
        </Button>
      ))}
    </Actions>
  );
}
