// The cards of the exchange, which travel from the one who gives them to the one who gets them.
// Decorative: the history says what was given.

import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { Card } from "../../parts/Card";
import type { LogEntry, TableState } from "../model/state";
import { useArrivals } from "./arrivals";
import { showsMoments } from "./Moment";
import css from "./Travel.module.css";

/** How long cards are under way, milliseconds; as in the style sheet. */
const UNDER_WAY_MS = 1600;

interface Gift extends Extract<LogEntry, { kind: "gave" }> {
  readonly sequence: number;
}

export function Travel({ table }: { table: TableState }) {
  const [gifts, setGifts] = useState<readonly Gift[]>([]);
  useArrivals(table, (since, caughtUp) => {
    if (caughtUp || !showsMoments()) return;
    const given = table.log.flatMap(({ entry, sequence }) =>
      entry.kind === "gave" && sequence > since ? [{ ...entry, sequence }] : [],
    );
    if (given.length > 0) setGifts((before) => [...before, ...given]);
  });
  const arrived = (sequence: number) => setGifts((before) => before.filter((gift) => gift.sequence !== sequence));
  return (
    <>
      {gifts.map((gift) => (
        <UnderWay key={gift.sequence} gift={gift} onArrived={() => arrived(gift.sequence)} />
      ))}
    </>
  );
}

function UnderWay({ gift, onArrived }: { gift: Gift; onArrived: () => void }) {
  const cards = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const timer = setTimeout(onArrived, UNDER_WAY_MS);
    return () => clearTimeout(timer);
  }, []);
  useLayoutEffect(() => {
    const { current } = cards;
    const table = current?.closest('[data-part~="table"]');
    const [from, to] = [gift.giver, gift.receiver].map((seat) => {
      const box = table?.querySelector(`[data-part~="seat"][data-seat="${seat}"]`)?.getBoundingClientRect();
      return box && ([box.left + box.width / 2, box.top + box.height / 2] as const);
    });
    if (!current) return;
    current.hidden = !from || !to;
    if (!from || !to) return;
    for (const [name, [x, y]] of [["from", from] as const, ["to", to] as const])
      current.style.setProperty(`--${name}`, `${x.toFixed(0)}px ${y.toFixed(0)}px`);
  }, []);
  const shown = gift.cards.length > 0 ? gift.cards : Array.from({ length: gift.count }, () => undefined);
  return (
    <div ref={cards} class={css.underWay} data-part="under-way" aria-hidden="true">
      {shown.map((card, index) => (
        <Card key={index} card={card} />
      ))}
    </div>
  );
}
