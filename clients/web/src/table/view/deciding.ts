// A person's picks, for the open decision or before it for the next turn, and what becomes of them.
// Clicks on cards and buttons (Hand.tsx, ActionBar.tsx) and the keys of the table end here.

import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { DecisionKind } from "../../gen/chefshat/v1/decision_pb";
import { t } from "../../i18n";
import { announce } from "../../parts/Announcer";
import type { Automatic, GivenHint } from "../acting";
import { ADD_JOKER, cardsOf } from "../keys";
import { actionOf, type Move, moveOf } from "../model/actions";
import { type Card, faceOf } from "../model/cards";
import type { OpenDecision } from "../model/live";
import {
  canPick,
  heldPlays,
  legalMoves,
  missing,
  type Picked,
  pickedMove,
  picksOf,
  pressFace,
  pressJoker,
  reasonAgainst,
  toggle,
} from "../model/picking";
import { allows, publicRequirement } from "../model/requirement";
import type { TableState } from "../model/state";
import { moveWords, reasonWords } from "../words";

interface DecidingUse {
  table: TableState;
  own: number | undefined;
  decision: OpenDecision | undefined;
  /** An answer is being sent. */
  sending: boolean;
  /** The hint for this decision. */
  given: GivenHint | undefined;
  /** Replaces the reason why a card cannot be picked. */
  refusal: string | undefined;
  /** Whether a play can be chosen before the turn. */
  plans: boolean;
  onAnswer: ((action: number, automatic?: Automatic) => void) | undefined;
  /** The person picked a card or put it back; its name is the face, or J for a joker. */
  onPick?: ((card: string, picked: boolean) => void) | undefined;
}

export interface Deciding {
  readonly hand: readonly Card[];
  /** The legal moves; before the turn, the plays that would be legal now. */
  readonly moves: readonly Move[];
  readonly picked: Picked;
  /** The move formed by the picked cards. */
  readonly move: Move | undefined;
  /** The last reason or error; empty if there is none. */
  readonly remark: string;
  /** Whether picks are for the next turn. */
  readonly planning: boolean;
  /** What is done on the next turn. */
  readonly plan: Move | undefined;
  /** Why a card cannot be picked; undefined if it can. */
  refusal(index: number): string | undefined;
  setRemark(text: string): void;
  /** Picks a card or puts it back. */
  toggle(index: number): void;
  putBack(): void;
  /** Plays, gives or plans the picked cards; false if they form no move. */
  play(): boolean;
  /** Passes, or plans to. */
  pass(): void;
  unplan(): void;
  answer(move: Move): void;
  /** A key of the table; returns whether it meant something. */
  press(key: string): boolean;
}

/** What is done on the next turn, as long as the pizza lasts for which it was chosen. */
interface Plan {
  readonly move: Move;
  readonly shift: number;
  readonly pizza: number;
}

/** How long a planned play stays visible, and can be taken back, before it is sent. */
const PLAN_MS = 900;
const NOTHING: Picked = new Set();
const PASS: Move = { kind: "pass" };

export function useDeciding(use: DecidingUse): Deciding {
  const { table, own, decision, sending } = use;
  const mine = own === undefined ? undefined : table.seats[own];
  const planning = use.plans && !decision && !sending && isBetweenTurns(table, own);
  // Picks belong to one decision, or before the turn to one pizza: the next starts without picks.
  const pizza = `${table.shift}.${table.pizza}`;
  const phase = decision?.id ?? (planning ? pizza : undefined);
  const [choice, setChoice] = useState<{ id: bigint | string | undefined; picked: Picked }>({
    id: undefined,
    picked: NOTHING,
  });
  const picked = phase !== undefined && choice.id === phase ? choice.picked : NOTHING;
  const [remark, setRemark] = useState("");
  const [plan, setPlan] = useState<Plan | undefined>(undefined);
  const report = (index: number, isPicked: boolean) => {
    const card = hand[index];
    if (card) use.onPick?.(String(faceOf(card) ?? "J"), isPicked);
  };
  // Other cards mean another play: the one chosen before is not sent.
  const setPicked = (next: Picked) => {
    if (next !== picked) setPlan(undefined);
    setChoice({ id: phase, picked: next });
    for (const index of picked) if (!next.has(index)) report(index, false);
    for (const index of next) if (!picked.has(index)) report(index, true);
  };

  // A given card has left the hand, although the table's hand keeps it until the exchange is
  // complete.
  const gave = useRef<{ of: unknown; hand: readonly Card[] } | undefined>(undefined);
  const left = gave.current && gave.current.of === mine?.hand ? gave.current.hand : mine?.hand;
  const hand = decision?.hand ?? left ?? [];
  const requirement = decision?.requirement ?? (planning ? publicRequirement(table) : undefined);
  const moves = decision
    ? legalMoves(decision.legal, table.faces)
    : planning
      ? heldPlays(hand).filter((move) => allows(publicRequirement(table), move))
      : [];
  const move = pickedMove(hand, picked, moves);
  const golden = requirement?.goldenCard ?? false;
  const special = decision?.kind === DecisionKind.SPECIAL_ACTION;

  const holds = plan !== undefined && isPossible(plan, table, decision);
  // Cards picked before the turn stay picked, if they can be played in the same pizza.
  const wish = useRef<{ readonly move: Move | undefined; readonly pizza: string } | undefined>(undefined);
  if (planning) wish.current = { move: holds ? plan.move : move, pizza };
  // Before the browser handles a key: a card that is picked at once stays picked.
  useLayoutEffect(() => {
    setRemark("");
    const wanted = wish.current?.pizza === pizza ? wish.current.move : undefined;
    wish.current = undefined;
    if (!decision) return;
    const legal = wanted && decision.legal.includes(actionOf(wanted, table.faces));
    setChoice({ id: decision.id, picked: legal ? picksOf(decision.hand, wanted, golden) : NOTHING });
  }, [decision?.id]);

  // The suggested cards are picked, so that one click plays them.
  useEffect(() => {
    const suggested = use.given?.hint && moveOf(use.given.hint.action, table.faces);
    if (!decision || !suggested) return;
    setPlan(undefined);
    setChoice({ id: decision.id, picked: picksOf(decision.hand, suggested, golden) });
  }, [use.given?.hint]);

  useEffect(() => {
    if (!plan) return;
    if (!holds) {
      setPlan(undefined);
      const text = t().table.actions.planOff(moveWords(plan.move));
      setRemark(text);
      announce(text);
      return;
    }
    if (!decision) return;
    const timer = setTimeout(() => {
      setPlan(undefined);
      use.onAnswer?.(actionOf(plan.move, table.faces), "planned");
    }, PLAN_MS);
    return () => clearTimeout(timer);
  }, [plan, holds, decision?.id]);

  const refusal = (index: number): string | undefined => {
    const words = t().table.reasons;
    if (!decision && !planning) return words.notYourTurn;
    if (canPick(hand, index, moves)) return undefined;
    if (special) return words.declareFirst;
    if (use.refusal) return use.refusal;
    if (decision?.kind === DecisionKind.EXCHANGE) return words.gift;
    return reasonWords(requirement ? reasonAgainst(requirement, hand, index) : { kind: "other" });
  };
  const putBack = () => {
    setPicked(NOTHING);
    setRemark("");
  };
  const answer = (chosen: Move) => {
    setRemark("");
    setPlan(undefined);
    if (decision?.kind === DecisionKind.EXCHANGE) {
      gave.current = { of: mine?.hand, hand: hand.filter((_, index) => !picked.has(index)) };
    }
    use.onAnswer?.(actionOf(chosen, table.faces));
  };
  const decide = (chosen: Move) => {
    if (!planning) return answer(chosen);
    setRemark("");
    setPlan({ move: chosen, shift: table.shift, pizza: table.pizza });
    announce(t().table.actions.planned(moveWords(chosen)));
  };
  const play = () => {
    if (!move || sending) return false;
    decide(move);
    return true;
  };

  /** Picks what a key named, and says what that would play. */
  const take = (next: Picked | undefined, reason: () => string): true => {
    const words = t().table.actions;
    if (next) {
      setPicked(next);
      setRemark("");
      const made = pickedMove(hand, next, moves);
      announce(made ? words.playCards(moveWords(made)) : words.more(missing(hand, next, moves) ?? 0));
    } else {
      setRemark(reason());
      announce(reason());
    }
    return true;
  };
  const takeFace = (face: number | undefined) =>
    take(pressFace(hand, picked, face, moves, golden), () => {
      const index = hand.findIndex((card) => faceOf(card) === face);
      if (index < 0) return t().table.reasons.notHeld(face);
      return refusal(index) ?? t().table.reasons.other;
    });
  const press = (key: string): boolean => {
    if (!use.onAnswer || sending || !(decision || planning)) return false;
    const mayPass = planning || moves.some(({ kind }) => kind === "pass");
    const cards = cardsOf(key);
    if (special) {
      const named: Partial<Record<string, Move>> = { d: { kind: "declare" }, n: { kind: "decline" } };
      const chosen = named[key];
      if (chosen) answer(chosen);
      return chosen !== undefined;
    }
    if (cards) return takeFace(cards.face);
    switch (key) {
      case ADD_JOKER:
        return take(pressJoker(hand, picked, moves, golden), () => t().table.reasons.noJoker);
      case "p":
        if (decision?.kind === DecisionKind.EXCHANGE) return false;
        if (mayPass) decide(PASS);
        else take(undefined, () => t().table.reasons.mayNotPass);
        return true;
      case "Enter":
        return play();
      case "Escape":
        if (plan) setPlan(undefined);
        else if (picked.size > 0) putBack();
        else return false;
        return true;
      case "Backspace":
        if (picked.size === 0) return false;
        setPicked(new Set([...picked].slice(0, -1)));
        return true;
      default:
        return false;
    }
  };

  return {
    hand,
    moves,
    picked,
    move,
    remark,
    planning,
    plan: plan?.move,
    refusal,
    setRemark,
    toggle: (index) => {
      setRemark("");
      setPicked(toggle(hand, picked, index, moves, golden));
    },
    putBack,
    play,
    pass: () => decide(PASS),
    unplan: () => setPlan(undefined),
    answer,
    press,
  };
}

/** Whether the seat is in a pizza and others decide. */
function isBetweenTurns(table: TableState, own: number | undefined): boolean {
  const mine = own === undefined ? undefined : table.seats[own];
  return (
    table.phase === "pizza" &&
    !table.physical &&
    mine !== undefined &&
    mine.hand !== undefined &&
    mine.cardsLeft > 0 &&
    !mine.passed &&
    table.next !== own
  );
}

/** Whether a plan can still be carried out: the pizza lasts, and the board allows it. */
function isPossible({ move, shift, pizza }: Plan, table: TableState, decision: OpenDecision | undefined): boolean {
  if (shift !== table.shift || pizza !== table.pizza) return false;
  if (decision) return decision.kind === DecisionKind.TURN && decision.legal.includes(actionOf(move, table.faces));
  return move.kind === "pass" || allows(publicRequirement(table), move);
}
