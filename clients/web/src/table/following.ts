// What goes with what happens at a table: it is read out to those who listen, and heard. Whoever catches up with a game after a reload is not
// told all of it again.

import { useEffect, useMemo, useRef } from "preact/hooks";
import { hidden } from "../experiment/hiding";
import { t } from "../i18n";
import { announce } from "../parts/Announcer";
import type { OpenDecision } from "./model/live";
import { isPresence, worthSaying } from "./model/log";
import { isOpening } from "./model/requirement";
import type { TableState } from "./model/state";
import { tellPresence } from "./presence";
import { play, soundOf } from "./sounds";
import { nowHeading } from "./view/Now";
import { spokenLine } from "./words";

/** More happenings than this at once are a past that is being caught up with. */
const MOST_AT_ONCE = 14;

/** Announces what happens, with sounds, for as long as the table is drawn. */
export function useAnnounced(table: TableState, own: number | undefined, decision: OpenDecision | undefined): void {
  const heard = useRef<number | undefined>(undefined);
  const seen = useRef(table);
  seen.current = table;
  const presence = useMemo(() => tellPresence((line) => announce(spokenLine(seen.current, line))), []);
  useEffect(() => presence.stop, []);
  const last = table.log.at(-1)?.sequence ?? 0;
  useEffect(() => {
    const before = heard.current;
    heard.current = last;
    if (before === undefined) return;
    const fresh = table.log.filter(({ sequence }) => sequence > before);
    if (fresh.length > MOST_AT_ONCE) return;
    const said = worthSaying(fresh, !hidden.peek().includes("expressions"));
    for (const line of said) {
      if (isPresence(line)) presence.hear(line);
      else announce(spokenLine(table, line));
    }
    const sounds = said.flatMap((line) => soundOf(line) ?? []);
    // Together they would be a noise: the last is heard, and it is the most telling.
    const sound = sounds.at(-1);
    if (sound) play(sound);
  }, [last]);
  useEffect(() => {
    if (!decision) return;
    play("yourTurn");
    announce(`${nowHeading({ table, own, decision, next: own })}. ${requirementWords(decision)}`);
  }, [decision?.id]);
}

/** What the open turn asks for, to be read out. */
function requirementWords({ requirement }: OpenDecision): string {
  const words = t().table.now;
  if (!requirement) return "";
  const { lowestFace, highestFace, fewestCards, goldenCard, loneJoker } = requirement;
  if (isOpening(requirement)) return `${lowestFace} ${goldenCard ? words.openingGolden : words.openingFace}.`;
  if (loneJoker) return words.anything;
  if (highestFace === 0) return words.nothing;
  return `${words.face} ≤ ${highestFace}, ${fewestCards} ${words.cards(fewestCards)}.`;
}
