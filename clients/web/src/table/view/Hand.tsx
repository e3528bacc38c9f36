// The reader's own cards, to be picked. All cards can be reached with the arrow keys; those that cannot be picked now say why instead.

import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { t } from "../../i18n";
import { announce } from "../../parts/Announcer";
import { Card } from "../../parts/Card";
import { type Card as CardValue, countOf, faceOf, stacks } from "../model/cards";
import type { Picked } from "../model/picking";
import { cardWord } from "../words";

interface HandProps {
  cards: readonly CardValue[];
  picked: Picked;
  /** Cards received in the exchange, marked until the first play. */
  received: readonly CardValue[];
  /** Why a card cannot be picked; undefined if it can. */
  refusal: (index: number) => string | undefined;
  /** A card was clicked or chosen by key. */
  onToggle: (index: number) => void;
  /** Enter was pressed: plays what is picked if that can be played. Says whether it did. */
  onPlay: () => boolean;
  /** Escape was pressed. */
  onPutBack: () => void;
  /** Why a card cannot be picked is to be seen for a while. */
  onRefused: (reason: string) => void;
  label: string;
}

/** How much of a card stays to be seen beside the next one of its stack, as a share of its width; hand.css says the same. */
const STRIP = 0.5;

export function Hand(props: HandProps) {
  const { cards, picked, received, refusal } = props;
  const [focus, setFocus] = useState(0);
  const row = useRef<HTMLDivElement>(null);
  const inside = useRef(false);
  const current = Math.min(focus, Math.max(0, cards.length - 1));

  // A card that is played takes the keyboard's focus with it: it goes on at the card that comes after.
  useLayoutEffect(() => {
    if (!inside.current || document.activeElement !== document.body) return;
    row.current?.querySelectorAll<HTMLElement>(".hand-card")[current]?.focus();
  }, [cards.length]);

  const go = (index: number) => {
    setFocus(index);
    row.current?.querySelectorAll<HTMLElement>(".hand-card")[index]?.focus();
  };
  const choose = (index: number) => {
    setFocus(index);
    const reason = refusal(index);
    if (reason === undefined) return props.onToggle(index);
    props.onRefused(reason);
    announce(reason);
  };
  const onKeyDown = (event: KeyboardEvent) => {
    const last = cards.length - 1;
    const steps: Record<string, () => void> = {
      ArrowRight: () => go(Math.min(last, current + 1)),
      ArrowLeft: () => go(Math.max(0, current - 1)),
      Home: () => go(0),
      End: () => go(last),
      Escape: props.onPutBack,
      Enter: () => {
        if (!props.onPlay()) choose(current);
      },
      " ": () => choose(current),
    };
    const step = steps[event.key];
    if (!step || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    step();
  };

  const runs = stacks(cards);
  const style = { "--stacks": runs.length, "--units": runs.length + (cards.length - runs.length) * STRIP };
  let index = -1;
  return (
    <div
      class="hand"
      role="toolbar"
      aria-label={props.label}
      aria-describedby="hand-help"
      style={style}
      ref={row}
      onKeyDown={onKeyDown}
      onFocusIn={() => {
        inside.current = true;
      }}
      onFocusOut={(event) => {
        if (event.relatedTarget) inside.current = false;
      }}
    >
      <p id="hand-help" class="only-heard">
        {t().table.hand.help}
      </p>
      {cards.length === 0 && <p class="soft">{t().table.hand.empty}</p>}
      {runs.map((stack) => {
        const face = stack[0] && faceOf(stack[0]);
        const fresh = countOf(received, face);
        return (
          <div class="hand-stack" key={face ?? "J"}>
            {stack.map((card, inStack) => {
              index += 1;
              const at = index;
              const reason = refusal(at);
              return (
                <button
                  key={inStack}
                  type="button"
                  class={`hand-card ${picked.has(at) ? "hand-picked" : ""}`}
                  aria-pressed={picked.has(at)}
                  aria-disabled={reason !== undefined}
                  aria-label={cardWord(card) + (inStack < fresh ? `, ${t().table.card.received}` : "")}
                  title={reason}
                  tabIndex={at === current ? 0 : -1}
                  onFocus={() => setFocus(at)}
                  onClick={() => choose(at)}
                  data-card={card.kind === "joker" ? "J" : card.face}
                >
                  <Card card={card} />
                  {inStack < fresh && <span class="hand-fresh" aria-hidden="true" />}
                  {picked.has(at) && (
                    <span class="hand-check" aria-hidden="true">
                      ✓
                    </span>
                  )}
                </button>
              );
            })}
            {stack.length > 1 && (
              <span class="hand-count number" aria-hidden="true">
                ×{stack.length}
              </span>
            )}
          </div>
        );
      })}
    </div>
  );
}
