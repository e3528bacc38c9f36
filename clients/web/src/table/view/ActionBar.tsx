// The reader's decision: buttons to play, pass, give and declare, a hint, and the clock. A button
// that cannot be used now stays where it is, so that the keyboard focus is not lost.

import type { ComponentChildren } from "preact";
import { DecisionKind } from "../../gen/chefshat/v1/decision_pb";
import type { Hint } from "../../gen/chefshat/v1/play_service_pb";
import { SpecialAction } from "../../gen/chefshat/v1/rules_pb";
import { decimal, t } from "../../i18n";
import buttonCss from "../../parts/Button.module.css";
import { Clock } from "../../parts/Clock";
import { Shows } from "../../parts/marks";
import type { GivenHint } from "../acting";
import { mustPass } from "../auto-pass";
import { type Move, moveOf } from "../model/actions";
import type { OpenDecision } from "../model/live";
import { missing } from "../model/picking";
import { isOpening } from "../model/requirement";
import type { TableState } from "../model/state";
import { cardWord, moveWords } from "../words";
import css from "./ActionBar.module.css";
import type { Deciding } from "./deciding";
import { giftWords } from "./Now";

/** Actions that a hint names. */
const MAX_HINTED = 4;

interface ActionBarProps {
  table: TableState;
  own: number | undefined;
  decision: OpenDecision | undefined;
  /** The picks, and what can be done with them. */
  deciding: Deciding;
  /** An answer is being sent. */
  sending: boolean;
  /** A reason or error shown in place of the hint. */
  remark: string;
  /** Whether a lesson allows less than the rules do. */
  taught: boolean;
  /** Whether the page is about to pass by itself. */
  autoPassing: boolean;
  /** Milliseconds of a full decision; 0 for no clock. */
  wholeMs: number;
  /** The hint for this decision, if the reader asked for one. */
  given?: GivenHint | undefined;
  onHint?: (() => void) | undefined;
}

export function ActionBar(props: ActionBarProps) {
  const { table, decision, deciding, remark, sending, given } = props;
  const { moves, move, answer, play, plan } = deciding;
  const words = t().table.actions;
  const kind = decision?.kind;
  const special = kind === DecisionKind.SPECIAL_ACTION;
  const mayPass = moves.some((legal) => legal.kind === "pass");
  const passing = decision !== undefined && mustPass(decision, table.faces);
  return (
    <section class={css.actions} data-part="actions" aria-label={words.label}>
      <Shows what="actions" />
      <p class={`${css.hint} ${remark ? css.remark : ""}`} role="note">
        {remark || hint(props)}
      </p>
      {given && (
        <p class={css.hint} role="status" data-part="hint">
          {given.hint ? hintWords(given.hint, table.faces) : words.hintComes}
        </p>
      )}
      {decision && props.wholeMs > 0 && (
        <Clock
          key={String(decision.id)}
          timeLeftMs={decision.timeLeftMs}
          bankLeftMs={decision.bankLeftMs}
          sinceMs={decision.receivedAtMs}
          wholeMs={props.wholeMs}
        />
      )}
      <div class={css.buttons}>
        {special ? (
          <SpecialActions special={decision?.special} busy={sending} onAnswer={answer} />
        ) : kind === DecisionKind.EXCHANGE ? (
          <Act main ready={move !== undefined && !sending} onClick={play} id="give">
            {move ? words.giveCard(giftWord(props, move)) : words.give}
          </Act>
        ) : deciding.planning && !plan ? (
          <>
            <Act ready={move !== undefined} onClick={play} id="plan-play">
              {words.plan(move ? moveWords(move) : "")}
            </Act>
            <Act ready onClick={deciding.pass} id="plan-pass">
              {words.planPass}
            </Act>
          </>
        ) : deciding.planning ? null : (
          <>
            <Act main={!passing} ready={move !== undefined && !sending} onClick={play} id="play">
              {move ? words.playCards(moveWords(move)) : words.play}
            </Act>
            <Act main={passing} ready={mayPass && !sending} onClick={deciding.pass} id="pass">
              {words.pass}
            </Act>
          </>
        )}
        {props.onHint && decision && (
          <Act ready={!sending && (!given || given.hint !== undefined)} quiet onClick={props.onHint} id="hint">
            {words.hint}
          </Act>
        )}
        {plan ? (
          <Act ready quiet onClick={deciding.unplan} id="unplan">
            {words.unplan}
          </Act>
        ) : (
          deciding.picked.size > 0 && (
            <Act ready quiet onClick={deciding.putBack} id="put-back">
              {words.putBack}
            </Act>
          )
        )}
      </div>
    </section>
  );
}

/** The suggested action first, then the others by their points. */
function hintWords({ action, actions }: Hint, faces: number): string {
  const words = t().table.actions;
  const sorted = [...actions].sort(
    (a, b) => Number(b.action === action) - Number(a.action === action) || b.points - a.points,
  );
  const named = (number: number) => {
    const move = moveOf(number, faces);
    return move ? moveWords(move) : "";
  };
  const [first, ...others] = sorted.slice(0, MAX_HINTED);
  if (!first) return words.suggested(named(action));
  const points = (of: { points: number; standardError: number }) =>
    words.points(decimal(of.points, 1), decimal(of.standardError, 1));
  const rest = others.map((other) => `${named(other.action)}: ${points(other)}`);
  return [`${words.suggested(named(first.action))}: ${points(first)}`, ...rest].join(" · ");
}

/** The card that will be given. */
function giftWord({ decision, deciding }: ActionBarProps, move: Move): string {
  const [index] = deciding.picked;
  const card = index === undefined ? undefined : decision?.hand[index];
  return card ? cardWord(card) : moveWords(move);
}

function hint({ table, decision, deciding, sending, taught, autoPassing }: ActionBarProps): string {
  const { moves, picked, move, plan, planning, hand } = deciding;
  const words = t().table.actions;
  if (sending) return words.sending;
  if (plan) return words.planned(moveWords(plan));
  if (planning) {
    const more = missing(hand, picked, moves);
    return picked.size > 0 && more ? words.more(more) : words.planHint;
  }
  if (!decision) return table.phase === "pizza" || table.phase === "dealt" ? t().table.reasons.notYourTurn : "";
  if (decision.kind === DecisionKind.SPECIAL_ACTION) return "";
  if (decision.kind === DecisionKind.EXCHANGE) return giftWords(table, decision);
  if (move) return words.ready;
  const mayPass = moves.some((legal) => legal.kind === "pass");
  if (picked.size > 0) {
    const more = missing(decision.hand, picked, moves);
    return more === undefined || more === 0 ? words.pick : words.more(more);
  }
  if (mustPass(decision, table.faces)) return autoPassing ? words.autoPassing : words.onlyPass;
  if (!mayPass && decision.requirement && isOpening(decision.requirement)) return words.noPass;
  if (!mayPass) return table.board.length === 0 && !taught ? words.mustPlay : words.pickMust;
  return words.pick;
}

interface SpecialProps {
  special: SpecialAction | undefined;
  busy: boolean;
  onAnswer: (move: Move) => void;
}

function SpecialActions({ special, busy, onAnswer }: SpecialProps) {
  const words = t().table.actions;
  const fight = special === SpecialAction.FOOD_FIGHT;
  return (
    <>
      <Act main ready={!busy} onClick={() => onAnswer({ kind: "declare" })} id="declare">
        {fight ? words.foodFight : words.dinner}
      </Act>
      <Act ready={!busy} onClick={() => onAnswer({ kind: "decline" })} id="decline">
        {words.decline}
      </Act>
    </>
  );
}

interface ActProps {
  id: string;
  ready: boolean;
  main?: boolean;
  quiet?: boolean;
  onClick: () => void;
  children: ComponentChildren;
}

function Act({ id, ready, main = false, quiet = false, onClick, children }: ActProps) {
  return (
    <button
      type="button"
      class={buttonCss.button}
      data-part="button"
      data-look={main ? "main" : quiet ? "quiet" : "plain"}
      aria-disabled={!ready}
      data-action={id}
      onClick={() => ready && onClick()}
    >
      {children}
    </button>
  );
}
