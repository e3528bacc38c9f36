// The tournaments that one can join or follow, in the lobby: a line each. Their own pages are in tournaments/.

import { usePolled } from "../api/poll";
import { type Tournament, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { pathOf } from "../router";
import { listTournaments } from "../tournaments/list";
import "./tournament-strip.css";

/** How often the list is asked for, milliseconds. */
const EVERY_MS = 6000;
/** Tournaments shown. */
const SHOWN = 6;

/** The section; nothing where there is no tournament to join or follow. */
export function TournamentStrip() {
  const words = t().lobby.tournaments;
  const { value: tournaments } = usePolled(listOpen, EVERY_MS, "tournaments");
  if (!tournaments || tournaments.length === 0) return null;
  return (
    <section class="lobby-section">
      <h2>{words.title}</h2>
      <ul class="tournament-strip">
        {tournaments.slice(0, SHOWN).map(({ tournamentId, settings, state, gamesOver, games }) => (
          <li key={tournamentId}>
            <a class="sheet" href={pathOf({ page: "tournament", tournamentId })}>
              <b>{settings?.name}</b>
              <span class="soft">{state === TournamentState.OPEN ? words.open : words.playing(gamesOver, games)}</span>
            </a>
          </li>
        ))}
      </ul>
      {tournaments.length > SHOWN && <a href="/tournaments">{words.all}</a>}
    </section>
  );
}

async function listOpen(signal: AbortSignal): Promise<Tournament[]> {
  const found = await listTournaments(signal);
  return found.filter(({ state }) => state === TournamentState.OPEN || state === TournamentState.PLAYING);
}
