// The reader's cards. The arrow keys reach every card; a card that cannot be picked says why. The
// row itself can have the focus too, on no card: it does after a play, until an arrow key chooses a
// card.

import type { RefObject } from "preact";
import { useState } from "preact/hooks";
import { t } from "../../i18n";
import { announce } from "../../parts/Announcer";
import { Card } from "../../parts/Card";
import { keyOf } from "../keys";
import { type Card as CardValue, countOf, faceOf, stacks } from "../model/cards";
import type { Picked } from "../model/picking";
import { cardWord } from "../words";
import css from "./Hand.module.css";

interface HandProps {
  /** The row, for focusing it. */
  row: RefObject<HTMLDivElement | null>;
  cards: readonly CardValue[];
  picked: Picked;
  /** Cards received in the exchange, marked until the first play. */
  received: readonly CardValue[];
  /** Why a card cannot be picked; undefined if it can. */
  refusal: (index: number) => string | undefined;
  /** A card was clicked or chosen by key. */
  onToggle: (index: number) => void;
  /** Enter was pressed. Plays the picked cards if possible, and returns whether it did. */
  onPlay: () => boolean;
  /** Escape was pressed. */
  onPutBack: () => void;
  /** A card was refused for a reason to be shown. */
  onRefused: (reason: string) => void;
  label: string;
  /** Whether the cards are being dealt. */
  dealt?: boolean;
  /** Whether cards have keys: those that are not the number on the card are shown. */
  keys?: boolean;
  /** Shown in place of cards if there are none. */
  empty: string;
}

/**
 * Visible share of a card's width beside the next one of its stack; Hand.module.css has the same
 * value.
 */
const STRIP = 0.5;

/** Largest width of a hand in one row on a phone, in card widths. */
const ONE_ROW_UNITS = 7.5;

/** Width of stacks side by side without gaps, in card widths. */
function widthOf(runs: readonly (readonly CardValue[])[]): number {
  return runs.reduce((width, stack) => width + 1 + (stack.length - 1) * STRIP, 0);
}

/** The wider of two rows when the stacks are split most evenly. */
function fullerHalf(runs: readonly (readonly CardValue[])[]): readonly (readonly CardValue[])[] {
  const splits = runs.map((_, index) => {
    const [upper, lower] = [runs.slice(0, index), runs.slice(index)];
    return widthOf(upper) > widthOf(lower) ? upper : lower;
  });
  return splits.reduce((best, next) => (widthOf(next) < widthOf(best) ? next : best), runs);
}

export function Hand(props: HandProps) {
  const { row, cards, picked, received, refusal } = props;
  const [focus, setFocus] = useState(0);
  const last = cards.length - 1;
  const current = Math.min(focus, Math.max(0, last));

  const go = (index: number) => {
    const to = Math.max(0, Math.min(last, index));
    setFocus(to);
    row.current?.querySelectorAll<HTMLElement>('[data-part="hand-card"]')[to]?.focus();
  };
  const choose = (index: number) => {
    setFocus(index);
    const reason = refusal(index);
    if (reason === undefined) return props.onToggle(index);
    props.onRefused(reason);
    announce(reason);
  };
  const onKeyDown = (event: KeyboardEvent) => {
    // On no card: start where the last card left the hand.
    const onNone = event.target === row.current;
    const pick = () => (onNone ? announce(t().table.hand.help) : choose(current));
    const steps: Record<string, () => void> = {
      ArrowRight: () => go(onNone ? focus : current + 1),
      ArrowLeft: () => go((onNone ? focus : current) - 1),
      Home: () => go(0),
      End: () => go(last),
      Escape: props.onPutBack,
      Enter: () => {
        if (!props.onPlay()) return pick();
        setFocus(Math.min(current, ...picked));
        row.current?.focus({ preventScroll: true });
      },
      " ": pick,
    };
    const step = steps[event.key];
    if (!step || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    // A held key picks and plays only once.
    if (!event.repeat || event.key.startsWith("Arrow")) step();
  };

  const runs = stacks(cards);
  const units = widthOf(runs);
  const half = fullerHalf(runs);
  const style = {
    "--stacks": runs.length,
    "--strips": cards.length - runs.length,
    "--units": units,
    "--half-stacks": half.length,
    "--half-strips": half.flat().length - half.length,
    "--half-units": widthOf(half),
  };
  let index = -1;
  return (
    <div
      class={`${css.hand} ${units <= ONE_ROW_UNITS ? css.short : ""} ${props.dealt ? css.dealt : ""}`}
      role="toolbar"
      aria-label={props.label}
      aria-describedby="hand-help"
      style={style}
      ref={row}
      tabIndex={-1}
      onKeyDown={onKeyDown}
    >
      <p id="hand-help" class="visually-hidden">
        {t().table.hand.help} {props.keys && t().table.hand.keysHelp}
      </p>
      {cards.length === 0 && <p class="soft">{props.empty}</p>}
      {runs.map((stack) => {
        const face = stack[0] && faceOf(stack[0]);
        const fresh = countOf(received, face);
        const key = props.keys ? keyOf(face) : undefined;
        return (
          <div class={css.stack} data-part="hand-stack" key={face ?? "J"}>
            {stack.map((card, inStack) => {
              index += 1;
              const at = index;
              const reason = refusal(at);
              return (
                <button
                  key={inStack}
                  type="button"
                  style={{ "--nth": at }}
                  class={`${css.card} ${picked.has(at) ? css.picked : ""}`}
                  data-part="hand-card"
                  aria-pressed={picked.has(at)}
                  aria-disabled={reason !== undefined}
                  aria-label={cardWord(card) + (inStack < fresh ? `, ${t().table.card.received}` : "")}
                  title={reason}
                  tabIndex={at === current ? 0 : -1}
                  onFocus={() => setFocus(at)}
                  onClick={() => choose(at)}
                  aria-keyshortcuts={key}
                  data-card={card.kind === "joker" ? "J" : card.face}
                >
                  <Card card={card} />
                  {inStack < fresh && <span class={css.fresh} aria-hidden="true" />}
                  {picked.has(at) && (
                    <span class={css.check} aria-hidden="true">
                      ✓
                    </span>
                  )}
                </button>
              );
            })}
            {key !== undefined && key !== String(face) && <kbd class={css.key}>{key}</kbd>}
            {stack.length > 1 && (
              <span class={`${css.count} number`} aria-hidden="true">
                ×{stack.length}
              </span>
            )}
          </div>
        );
      })}
    </div>
  );
}
