// Cards on their way over the table: those that are dealt from the pizza, and those of the exchange
// from the one who gives them to the one who gets them. Decorative: the history says what was given.

import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { Card } from "../../parts/Card";
import type { Card as CardValue } from "../model/cards";
import type { LogEntry, TableState } from "../model/state";
import { useArrivals } from "./arrivals";
import { showsMoments } from "./Moment";
import css from "./Travel.module.css";

/** How long the cards of the exchange are under way, milliseconds; as in the style sheet. */
const UNDER_WAY_MS = 1600;
/** The backs that are dealt to a seat, for all its cards. */
const DEALT = [undefined, undefined, undefined];

interface Gift extends Extract<LogEntry, { kind: "gave" }> {
  readonly sequence: number;
}

interface TravelProps {
  table: TableState;
  /** The reader's seat, whose hand shows how it is dealt. */
  own: number | undefined;
  /** Whether the cards are being dealt. */
  dealt: boolean;
}

export function Travel({ table, own, dealt }: TravelProps) {
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
      {dealt &&
        showsMoments() &&
        table.seats.map(
          ({ seat }) =>
            seat !== own && (
              <UnderWay key={`${table.shift}-${seat}`} from={BOARD} to={seatPart(seat)} cards={DEALT} nth={seat} />
            ),
        )}
      {gifts.map(({ sequence, giver, receiver, cards, count }) => (
        <UnderWay
          key={sequence}
          from={seatPart(giver)}
          to={seatPart(receiver)}
          cards={cards.length > 0 ? cards : Array.from({ length: count }, () => undefined)}
          onArrived={() => arrived(sequence)}
        />
      ))}
    </>
  );
}

const BOARD = '[data-part~="board"]';

function seatPart(seat: number): string {
  return `[data-part~="seat"][data-seat="${seat}"]`;
}

interface UnderWayProps {
  /** Selectors of the parts of the table between whose middles the cards travel. */
  from: string;
  to: string;
  /** Undefined for backs. */
  cards: readonly (CardValue | undefined)[];
  /** Of cards that are dealt: whose turn it is. */
  nth?: number;
  onArrived?: () => void;
}

function UnderWay({ from, to, cards, nth, onArrived }: UnderWayProps) {
  const box = useRef<HTMLDivElement>(null);
  useEffect(() => {
    if (!onArrived) return;
    const timer = setTimeout(onArrived, UNDER_WAY_MS);
    return () => clearTimeout(timer);
  }, []);
  useLayoutEffect(() => {
    const { current } = box;
    if (!current) return;
    const table = current.closest('[data-part~="table"]');
    const [begin, end] = [from, to].map((part) => table?.querySelector(part)?.getBoundingClientRect());
    current.hidden = !begin || !end;
    for (const [name, at] of [["from", begin] as const, ["to", end] as const])
      if (at)
        current.style.setProperty(
          `--${name}`,
          `${(at.left + at.width / 2).toFixed(0)}px ${(at.top + at.height / 2).toFixed(0)}px`,
        );
  }, []);
  return (
    <div
      ref={box}
      class={`${css.underWay} ${nth === undefined ? "" : css.dealt}`}
      style={nth === undefined ? undefined : { "--nth": nth }}
      data-part="under-way"
      aria-hidden="true"
    >
      {cards.map((card, index) => (
        <Card key={index} card={card} />
      ))}
    </div>
  );
}
