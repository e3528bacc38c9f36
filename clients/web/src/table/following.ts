// Announcements and sounds for the events of a table. A reader who catches up after a reload does
// not hear every past event.

import { useEffect, useMemo, useRef } from "preact/hooks";
import { hidden } from "../hiding";
import { t } from "../i18n";
import { announce } from "../parts/Announcer";
import { mustPass } from "./auto-pass";
import type { OpenDecision } from "./model/live";
import { isPresence, MOST_AT_ONCE, visibleLines } from "./model/log";
import { isOpening } from "./model/requirement";
import type { TableState } from "./model/state";
import { createPresenceAnnouncer } from "./presence";
import { play, soundOf } from "./sounds";
import { momentWords } from "./view/Moment";
import { nowHeading } from "./view/Now";
import { outcomeWords, rolesWords, spokenLine } from "./words";

/** Announces events, with sounds, while the table is rendered. */
export function useAnnounced(table: TableState, own: number | undefined, decision: OpenDecision | undefined): void {
  const lastSequence = useRef<number | undefined>(undefined);
  const seen = useRef(table);
  seen.current = table;
  const presence = useMemo(() => createPresenceAnnouncer((line) => announce(spokenLine(seen.current, line))), []);
  useEffect(() => presence.stop, []);
  const last = table.log.at(-1)?.sequence ?? 0;
  useEffect(() => {
    const before = lastSequence.current;
    lastSequence.current = last;
    if (before === undefined) return;
    const fresh = table.log.filter(({ sequence }) => sequence > before);
    if (fresh.length > MOST_AT_ONCE) return;
    const lines = visibleLines(fresh, !hidden.peek().includes("expressions"));
    for (const line of lines) {
      if (isPresence(line)) presence.apply(line);
      // The notice of a violation is read out by itself.
      else if (line.entry.kind === "violated") continue;
      else announce([spokenLine(table, line), outcomeWords(table, line)].join(" ").trim());
    }
    const moment = momentWords(table, before);
    if (moment) announce(moment);
    const sounds = lines.flatMap((line) => soundOf(line) ?? []);
    // All at once would be noise: only the last one is played, which says the most.
    const sound = sounds.at(-1);
    if (sound) play(sound);
  }, [last]);
  useEffect(() => {
    if (!decision) return;
    play("yourTurn");
    const passes = mustPass(decision, table.faces) ? t().table.actions.onlyPass : "";
    announce(`${nowHeading({ table, own, decision, next: own })}. ${requirementWords(decision)} ${passes}`.trim());
  }, [decision?.id]);
  const roles = rolesWords(table);
  const lastRoles = useRef(roles);
  useEffect(() => {
    if (roles === lastRoles.current) return;
    lastRoles.current = roles;
    if (roles) announce(roles);
  }, [roles]);
}

/** The requirement of the open turn, as read out. */
function requirementWords({ requirement }: OpenDecision): string {
  const words = t().table.now;
  if (!requirement) return "";
  const { lowestFace, highestFace, fewestCards, goldenCard, loneJoker } = requirement;
  if (isOpening(requirement)) return `${lowestFace}: ${goldenCard ? words.openingGolden : words.openingFace}.`;
  if (loneJoker) return words.anything;
  if (highestFace === 0) return words.nothing;
  return words.beat(highestFace, fewestCards);
}
