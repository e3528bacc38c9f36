// The attendant's view of a table with real cards: what it waits for, what is not allowed, questions,
// what to lay for remote players, entering reports by hand, and correcting them. It renders the
// state from the server and sends reports; it has no rules of its own.

import { create, equals } from "@bufbuild/protobuf";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { DecisionKind } from "../gen/chefshat/v1/decision_pb";
import {
  type CardsToLay,
  type TableQuestion,
  TableReportSchema,
  TableStage,
  type TableState,
} from "../gen/chefshat/v1/table_service_pb";
import { t } from "../i18n";
import { announce } from "../parts/Announcer";
import { Button, ButtonLink } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { SeatNumber } from "../parts/SeatNumber";
import { pathOf } from "../router";
import type { TableState as Table } from "../table/model/state";
import { Board } from "../table/view/Board";
import { useKeptFocus } from "../table/view/kept-focus";
import { Demands } from "../table/view/Now";
import css from "./Attend.module.css";
import type { Outcome, Report, ReportKind } from "./attending";
import { type Draft, Entry, NO_DRAFT } from "./Entry";
import { cardsOfSeen, deckOf, NO_PLAY } from "./entries";
import { Cards } from "./Picks";
import { Reports } from "./Reports";
import { SeatList } from "./SeatList";
import { awaitedWords, lastViolationWords, tableOf, toLayWords } from "./words";

interface AttendViewProps {
  state: TableState;
  report: Report;
  /** What is wrong with the connection; empty if nothing is. */
  trouble: string;
}

/** The view. */
export function AttendView({ state, report, trouble }: AttendViewProps) {
  const table = useMemo(() => tableOf(state), [state]);
  const [draft, setDraft] = useState<Draft>(NO_DRAFT);
  const [outcome, setOutcome] = useState<Outcome | undefined>(undefined);
  const [dismissed, setDismissed] = useState<bigint | undefined>(undefined);
  const sending = useRef<readonly ReportKind[]>([]);
  const last = useRef<Promise<Outcome>>(Promise.resolve({ kind: "accepted" }));
  const heading = useRef<HTMLHeadingElement>(null);
  const keepFocus = useKeptFocus(heading);
  const words = t().attend;
  useAnnouncedState(state, table);

  /**
   * Sends a report after those that are under way, unless one of them says the same (a button was
   * pressed twice) or does not count: then the table is not as the attendant believed. Returns
   * whether it counts.
   */
  const send = async (what: ReportKind): Promise<boolean> => {
    if (sending.current.some((other) => saysTheSame(what, other))) return false;
    const before = sending.current.length > 0 ? last.current : undefined;
    sending.current = [...sending.current, what];
    if (!before) setOutcome(undefined);
    last.current = sent(what, before);
    const came = await last.current;
    sending.current = sending.current.filter((other) => other !== what);
    setOutcome(came);
    if (came.kind === "accepted") announce(words.outcome.accepted);
    return came.kind === "accepted" || came.kind === "void";
  };
  /** What comes of a report after an earlier one. */
  const sent = async (what: ReportKind, earlier: Promise<Outcome> | undefined): Promise<Outcome> => {
    const before = (await earlier)?.kind;
    const isInVain = before === "fault" || before === "violation";
    return isInVain ? { kind: "fault", words: words.outcome.notSent } : report(what);
  };
  const enter = async (what: ReportKind) => {
    setDismissed(undefined);
    // What is entered meanwhile is another report.
    if (await send(what)) setDraft((current) => (current === draft ? NO_DRAFT : current));
  };
  const focusOn = (id: string) => document.getElementById(id)?.focus();
  const reenter = () => {
    const seat = state.violation?.seat;
    setDraft({ ...NO_DRAFT, kind: "turn", seat, play: NO_PLAY });
    focusOn("entry-title");
  };
  const violation = state.violation && state.violation.report !== dismissed ? state.violation : undefined;
  const over = state.stage === TableStage.OVER;
  const begun = state.observation !== undefined;
  return (
    <div class={css.attend} data-part="attend" {...keepFocus}>
      {trouble && <Notice kind="fault">{trouble}</Notice>}
      <Awaited
        state={state}
        table={table}
        heading={heading}
        onPause={(paused) => void send({ case: "pause", value: { paused } })}
        onConfirm={() => void send({ case: "endConfirmed", value: {} })}
      />
      <div class={css.columns}>
        <div class={css.column}>
          {violation && (
            <section class={css.violation} data-part="violation" role="alert" aria-label={words.violation.label}>
              <p class={css.large}>{lastViolationWords(state, table, violation)}</p>
              <p>{words.violation.todo}</p>
              <div class={css.actions}>
                <Button look="main" onClick={() => setDismissed(violation.report)}>
                  {words.violation.takenBack}
                </Button>
                <Button onClick={reenter}>{words.violation.reenter}</Button>
                {state.reports.length > 0 && (
                  <Button onClick={() => focusOn("reports-title")}>{words.violation.correct}</Button>
                )}
              </div>
            </section>
          )}
          {state.questions.map((question) => (
            <Question
              key={question.questionId}
              question={question}
              onAnswer={(option) =>
                void send({
                  case: "answer",
                  value: { questionId: question.questionId, ...(option === undefined ? {} : { option }) },
                })
              }
            />
          ))}
          {state.toLay.length > 0 && (
            <section class={`${css.part} sheet`} data-part="to-lay" aria-labelledby="to-lay-title">
              <h2 id="to-lay-title">{words.toLay.title}</h2>
              <ul class={css.list}>
                {state.toLay.map((one, index) => (
                  <ToLay key={index} table={table} one={one} onDone={() => void send(doneOf(one))} />
                ))}
              </ul>
            </section>
          )}
          {begun && !over && state.stage !== TableStage.CONFIRMATION && (
            <Entry
              state={state}
              table={table}
              draft={draft}
              outcome={outcome}
              onDraft={(next) => {
                setDraft(next);
                setOutcome(undefined);
              }}
              onSend={(what) => void enter(what)}
            />
          )}
        </div>
        <div class={css.column}>
          {begun && (
            <div class={css.board}>
              <Board table={table} />
            </div>
          )}
          <SeatList state={state} table={table} />
          {begun && <Reports state={state} table={table} report={report} onOutcome={setOutcome} />}
        </div>
      </div>
    </div>
  );
}

/** Whether two reports say the same. */
function saysTheSame(one: ReportKind, other: ReportKind): boolean {
  const [first, second] = [one, other].map((kind) => create(TableReportSchema, { kind }));
  return first !== undefined && second !== undefined && equals(TableReportSchema, first, second);
}

interface AwaitedProps {
  state: TableState;
  table: Table;
  heading: { current: HTMLHeadingElement | null };
  onPause: (paused: boolean) => void;
  /** Confirms the play that ended the game. */
  onConfirm: () => void;
}

/** What the table waits for, large enough to read from a chair away. */
function Awaited({ state, table, heading, onPause, onConfirm }: AwaitedProps) {
  const words = t().attend.now;
  const { heading: what, text } = awaitedWords(state, table);
  const { stage, seat, paused, playRequirement } = state;
  const turn = (stage === TableStage.TURN || stage === TableStage.OPENING) && playRequirement;
  const running = state.observation !== undefined && stage !== TableStage.OVER;
  return (
    <section
      class={`${css.now} sheet`}
      data-part="awaited"
      data-paused={paused ? "" : undefined}
      aria-label={words.label}
    >
      <div class={css.what}>
        <h1 class={css.heading} ref={heading} tabIndex={-1} data-part="awaited-heading">
          {seat !== undefined && <SeatNumber seat={seat} />}
          {what}
        </h1>
        {paused ? (
          <p class={css.pausedText}>
            <strong>{words.paused}.</strong> {words.pausedText}
          </p>
        ) : (
          text && <p class="soft">{text}</p>
        )}
        {stage === TableStage.CONFIRMATION && (
          <p>
            <Button look="main" onClick={onConfirm}>
              {words.confirm}
            </Button>
          </p>
        )}
        {stage === TableStage.OVER && (
          <p>
            <ButtonLink look="main" href={pathOf({ page: "replay", gameId: table.gameId })}>
              {t().lobby.rooms.replay}
            </ButtonLink>
          </p>
        )}
      </div>
      {turn && (
        <div class={css.demands}>
          <Demands requirement={turn} mayPass={turn.mayPass} />
        </div>
      )}
      {running && (
        <div>
          <Button look={paused ? "main" : "plain"} onClick={() => onPause(!paused)}>
            <span aria-hidden="true">{paused ? "▶" : "❚❚"}</span> {paused ? words.resume : words.pause}
          </Button>
        </div>
      )}
    </section>
  );
}

interface QuestionProps {
  question: TableQuestion;
  /** The index of the right option; undefined: the question is withdrawn. */
  onAnswer: (option: number | undefined) => void;
}

/** A question of a camera or of the referee. */
function Question({ question, onAnswer }: QuestionProps) {
  const words = t().attend.questions;
  const { text, options, picture } = question;
  const source = useMemo(() => pictureSource(picture), [picture]);
  return (
    <section class={css.question} data-part="question-card" aria-label={words.words(text)}>
      <h2 class={css.large}>{words.words(text)}</h2>
      {source && <img src={source} alt={words.picture} class={css.picture} />}
      <div class={css.actions}>
        {options.map((option, index) => (
          <Button key={index} look="main" onClick={() => onAnswer(index)}>
            {words.option(option)}
          </Button>
        ))}
        <Button look="quiet" onClick={() => onAnswer(undefined)}>
          {words.withdraw}
        </Button>
      </div>
    </section>
  );
}

/** First byte of a JPEG; a PNG starts otherwise. */
const JPEG = 0xff;

/** The address of a picture; undefined if there is none. */
export function pictureSource(picture: Uint8Array): string | undefined {
  if (picture.length === 0) return undefined;
  const kind = picture[0] === JPEG ? "jpeg" : "png";
  return `data:image/${kind};base64,${btoa(Array.from(picture, (byte) => String.fromCharCode(byte)).join(""))}`;
}

/** A decision of a remote seat that somebody carries out at the table. */
function ToLay({ table, one, onDone }: { table: Table; one: CardsToLay; onDone: () => void }) {
  const words = t().attend.toLay;
  const what = toLayWords(table, one);
  return (
    <li class={css.toLay} data-part="to-lay-item">
      <p class={css.large}>
        <SeatNumber seat={one.seat} /> {what}
      </p>
      {one.cards && <Cards cards={cardsOfSeen(one.cards, deckOf(table.rules))} />}
      <Button look="main" aria-label={`${words.done}: ${what}`} onClick={onDone}>
        {words.done}
      </Button>
    </li>
  );
}

/** The report that a decision was carried out. */
export function doneOf({ seat, kind, cards }: CardsToLay): ReportKind {
  const laid = cards && cards.cards.length > 0 ? cards : undefined;
  switch (kind) {
    case DecisionKind.EXCHANGE:
      return { case: "gift", value: { seat, ...(laid ? { cards: laid } : {}) } };
    case DecisionKind.SPECIAL_ACTION:
      return { case: "special", value: { seat } };
    default:
      return laid ? { case: "laid", value: { seat, cards: laid } } : { case: "pass", value: { seat } };
  }
}

/** Announces what the table waits for, questions, and what is to be laid. Violations are alerts. */
function useAnnouncedState(state: TableState, table: Table): void {
  const heard = useRef<ReadonlySet<string> | undefined>(undefined);
  useEffect(() => {
    const before = heard.current;
    const lines = [
      ...state.questions.map(({ text }) => t().attend.questions.words(text)),
      ...state.toLay.map((one) => toLayWords(table, one)),
      awaitedWords(state, table).heading,
    ];
    heard.current = new Set(lines);
    if (before) for (const line of lines) if (!before.has(line)) announce(line.endsWith("?") ? line : `${line}.`);
  }, [state.version]);
}
