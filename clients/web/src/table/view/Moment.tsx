// A special moment of the game, over the pizza for a few seconds, with what it means. It is read out
// after its event (following.ts).

import { useEffect, useState } from "preact/hooks";
import { hidden } from "../../hiding";
import { t } from "../../i18n";
import { Drawing } from "../../parts/Drawing";
import { isOn } from "../../preferences";
import { type Moment as GameMoment, type MomentKind, momentSince } from "../model/moments";
import type { TableState } from "../model/state";
import { distinctName } from "../words";
import { useArrivals } from "./arrivals";
import css from "./Moment.module.css";

/** How long a moment is shown, milliseconds. */
const SHOWN_MS = 4500;

const DRAWINGS: Record<MomentKind, string> = {
  foodFight: "face-10-tomato",
  dinner: "role-chef",
  exchange: "role-dishwasher",
  opening: "golden",
  lastCard: "face-1-truffle",
};

export function Moment({ table }: { table: TableState }) {
  const [shown, setShown] = useState<GameMoment | undefined>(undefined);
  useArrivals(table, (since, caughtUp) => {
    const found = caughtUp ? undefined : shownMoment(table, since);
    if (found) setShown(found);
  });
  useEffect(() => {
    if (!shown) return;
    const timer = setTimeout(() => setShown(undefined), SHOWN_MS);
    return () => clearTimeout(timer);
  }, [shown]);
  if (!shown || isPast(table, shown)) return null;
  const words = t().table.moments[shown.kind];
  return (
    <div class={css.moment} data-part="moment" key={shown.sequence} aria-hidden="true">
      <Drawing name={DRAWINGS[shown.kind]} class={css.picture} />
      <p class={css.title}>{words.title(distinctName(table, shown.seat))}</p>
      <p>{words.text}</p>
    </div>
  );
}

/** Whether moments are shown, and cards on their way: not where a study hides what happened. */
export function showsMoments(): boolean {
  return isOn("moments") && !hidden.peek().includes("log");
}

/** The last moment after an event, if moments are shown. */
function shownMoment(table: TableState, since: number): GameMoment | undefined {
  return showsMoments() ? momentSince(table, since) : undefined;
}

/** The last moment after an event as it is read out after its event; empty for none. */
export function momentWords(table: TableState, since: number): string {
  const moment = shownMoment(table, since);
  if (!moment) return "";
  const words = t().table.moments[moment.kind];
  return moment.kind === "lastCard" ? `${words.title(distinctName(table, moment.seat))}.` : words.text;
}

/** Whether a moment no longer holds: the last card has been played. */
function isPast({ seats }: TableState, { kind, seat }: GameMoment): boolean {
  return kind === "lastCard" && seats[seat]?.cardsLeft !== 1;
}
