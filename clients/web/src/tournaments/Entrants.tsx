// The participants before the tournament starts, in the order of joining. Places and scores come
// with the first game (Standings.tsx).

import type { Tournament } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { KindBadge } from "../parts/KindBadge";
import { PersonName } from "../people/PersonName";
import css from "./Entrants.module.css";
import { joinedIn, nameOf } from "./structure";

interface EntrantsProps {
  tournament: Tournament;
  /** The participant of this device. */
  mine?: number | undefined;
  /** Wall view: without links, and no more names than fit. */
  large?: boolean;
}

/** Most names in the wall view. */
const ON_WALL = 40;

/** The list. */
export function Entrants({ tournament, mine, large = false }: EntrantsProps) {
  const words = t().tournaments.standings;
  const participants = joinedIn(tournament);
  if (participants.length === 0) return <p class="soft">{words.none}</p>;
  // The wall view shows the newest participants.
  const shown = large ? participants.slice(-ON_WALL) : participants;
  return (
    <ul class={css.entrants} data-part="entrants">
      {shown.map(({ participant, kind, builtInAgent, connected, atTable, nameFingerprint }) => (
        <li key={participant} aria-current={participant === mine || undefined}>
          <PersonName
            name={nameOf(tournament, participant)}
            builtIn={builtInAgent}
            fingerprint={nameFingerprint}
            linked={!large}
          />
          <KindBadge kind={kind} builtIn={builtInAgent} />
          {atTable && <span class="soft small">{t().table.physical.atTable}</span>}
          {!connected && <span class="soft small">{t().table.presence.away}</span>}
        </li>
      ))}
    </ul>
  );
}
