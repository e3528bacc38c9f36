// The reports of this Shift, newest first, each of which can be changed or removed within what the
// referee allows.

import { useState } from "preact/hooks";
import type { AcceptedReport, TableState } from "../gen/chefshat/v1/table_service_pb";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { ConfirmButton } from "../parts/ConfirmButton";
import { Dialog } from "../parts/Dialog";
import { Notice } from "../parts/Notice";
import { SeatNumber } from "../parts/SeatNumber";
import type { TableState as Table } from "../table/model/state";
import css from "./Attend.module.css";
import type { Outcome, Report, ReportKind } from "./attending";
import { type Draft, GiftFields, HandFields, NO_DRAFT, OutcomeNotice, SpecialFields, TurnFields } from "./Entry";
import { deckOf, draftOf, handText } from "./entries";
import { reportWords } from "./words";

interface ReportsProps {
  state: TableState;
  table: Table;
  report: Report;
  /** What came of a correction. */
  onOutcome: (outcome: Outcome) => void;
}

/** Reports shown at first: older ones are rarely corrected. */
const SHOWN = 8;

/** The list. */
export function Reports({ state, table, report, onOutcome }: ReportsProps) {
  const words = t().attend.reports;
  const [changing, setChanging] = useState<AcceptedReport | undefined>(undefined);
  const [all, setAll] = useState(false);
  /** The report whose removal was refused. */
  const [refused, setRefused] = useState<bigint | undefined>(undefined);
  const correct = async (number: bigint, instead: ReportKind | undefined): Promise<Outcome> => {
    const outcome = await report({
      case: "correction",
      value: { report: number, ...(instead === undefined ? {} : { instead: { kind: instead } }) },
    });
    onOutcome(outcome);
    return outcome;
  };
  const remove = async (number: bigint): Promise<boolean> => {
    setRefused(undefined);
    const { kind } = await correct(number, undefined);
    if (kind === "violation") setRefused(number);
    return kind === "accepted" || kind === "void";
  };
  const reports = state.reports.toReversed();
  return (
    <section class={`${css.part} sheet`} data-part="reports" aria-labelledby="reports-title">
      <h2 id="reports-title" tabIndex={-1}>
        {words.title}
      </h2>
      {reports.length === 0 && <p class="soft">{words.none}</p>}
      <ol class={css.list} reversed>
        {reports.slice(0, all ? undefined : SHOWN).map((one, index) => {
          const text = wordsOf(table, one);
          // Passes that were confirmed with one answer have one number.
          return (
            <li key={`${one.report} ${reports.length - index}`} class={css.report} data-part="report">
              <p>
                {one.seat !== undefined && <SeatNumber seat={one.seat} />} {text}
                {one.assumedSeat && <span class="soft"> {words.assumed}</span>}
              </p>
              <div class={css.reportActions}>
                {isChangeable(one) && (
                  <Button look="quiet" aria-label={`${words.change}: ${text}`} onClick={() => setChanging(one)}>
                    {words.change}
                  </Button>
                )}
                <ConfirmButton label={words.remove} act={() => remove(one.report)}>
                  {words.removeSure}
                </ConfirmButton>
              </div>
              {refused === one.report && <Notice kind="fault">{refusal(state)}</Notice>}
            </li>
          );
        })}
      </ol>
      {!all && reports.length > SHOWN && (
        <div>
          <Button onClick={() => setAll(true)}>{t().common.showMore}</Button>
        </div>
      )}
      {changing && (
        <Change
          state={state}
          table={table}
          one={changing}
          onSend={(instead) => correct(changing.report, instead)}
          onClose={() => setChanging(undefined)}
        />
      )}
    </section>
  );
}

function wordsOf(table: Table, { content, seat, text }: AcceptedReport): string {
  return content ? reportWords(table, content, seat, text) : text;
}

/** Whether something else of the same kind can have happened instead. */
function isChangeable({ content }: AcceptedReport): boolean {
  return ["laid", "pass", "hand", "gift", "special"].includes(content?.kind.case ?? "");
}

interface ChangeProps {
  state: TableState;
  table: Table;
  one: AcceptedReport;
  onSend: (instead: ReportKind) => Promise<Outcome>;
  onClose: () => void;
}

/** Asks what happened instead. */
function Change({ state, table, one, onSend, onClose }: ChangeProps) {
  const words = t().attend;
  const [draft, setDraft] = useState<Draft>(() => draftBefore(table, one));
  const [outcome, setOutcome] = useState<Outcome | undefined>(undefined);
  const send = async (instead: ReportKind) => {
    const came = await onSend(instead);
    if (came.kind === "fault" || came.kind === "violation") setOutcome(came);
    else onClose();
  };
  const fields = {
    state,
    table,
    draft,
    seat: draft.seat ?? one.seat,
    change: (changed: Partial<Draft>) => setDraft((before) => ({ ...before, ...changed })),
    send: (what: ReportKind) => void send(what),
    fixed: true,
  };
  const kind = one.content?.kind.case;
  return (
    <Dialog title={words.reports.changeTitle(wordsOf(table, one))} onClose={onClose}>
      <div class={css.dialog} data-part="change">
        <p>{words.reports.changeText}</p>
        {(kind === "laid" || kind === "pass") && <TurnFields {...fields} movable={one.assumedSeat} />}
        {kind === "hand" && <HandFields {...fields} />}
        {kind === "gift" && <GiftFields {...fields} />}
        {kind === "special" && <SpecialFields {...fields} />}
        <OutcomeNotice outcome={outcome?.kind === "violation" ? { kind: "fault", words: refusal(state) } : outcome} />
      </div>
    </Dialog>
  );
}

/** Why the referee refused a correction. */
function refusal({ violation }: TableState): string {
  return violation?.text ?? t().attend.outcome.violation;
}

/** The form with what was reported. */
function draftBefore(table: Table, { content }: AcceptedReport): Draft {
  const kind = content?.kind;
  const deck = deckOf(table.rules);
  const cards = kind?.case === "laid" || kind?.case === "gift" ? kind.value.cards : undefined;
  if (kind?.case === "laid" && cards) return { ...NO_DRAFT, play: draftOf(cards, deck) };
  if (kind?.case === "gift" && cards) {
    return { ...NO_DRAFT, hand: handText(cards.cards, deck), golden: cards.golden ?? false };
  }
  return NO_DRAFT;
}
