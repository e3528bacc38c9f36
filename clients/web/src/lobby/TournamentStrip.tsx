// The open and running tournaments, in the lobby. Their own pages are in tournaments/.

import { firstOf } from "../api/pages";
import { usePolled } from "../api/poll";
import { type Tournament, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { ButtonLink } from "../parts/Button";
import { pathOf } from "../router";
import { tournamentsIn } from "../tournaments/list";
import { formatWord, madeWords } from "../tournaments/words";
import lobbyCss from "./Lobby.module.css";
import css from "./TournamentStrip.module.css";

/** Polling interval, milliseconds. */
const EVERY_MS = 6000;
/** Tournaments shown, open ones first. */
const SHOWN = 6;

/** The section. */
export function TournamentStrip() {
  const words = t().lobby.tournaments;
  const { value: found } = usePolled(listCurrent, EVERY_MS, "tournaments");
  if (!found) return null;
  return (
    <section class={`${lobbyCss.section} ${lobbyCss.beside}`} data-part="lobby-section">
      <h2>{t().common.nav.tournaments}</h2>
      {found.length === 0 && <p class="soft">{words.none}</p>}
      <ul class={css.tournamentStrip}>
        {found.map((tournament) => (
          <li key={tournament.tournamentId}>
            <a class="sheet" href={pathOf({ page: "tournament", tournamentId: tournament.tournamentId })}>
              <b>{tournament.settings?.name}</b>
              <span class="soft">
                {tournament.state === TournamentState.OPEN
                  ? words.open
                  : words.playing(tournament.gamesOver, tournament.games)}
              </span>
              <span class="soft small">
                {formatWord(tournament)} · {madeWords(tournament)}
              </span>
            </a>
          </li>
        ))}
      </ul>
      <div class="row">
        <ButtonLink href={pathOf({ page: "newTournament" })}>{t().organise.link}</ButtonLink>
        <ButtonLink href={pathOf({ page: "tournaments" })} look="quiet">
          {words.all}
        </ButtonLink>
      </div>
    </section>
  );
}

async function listCurrent(signal: AbortSignal): Promise<Tournament[]> {
  const [open, playing] = await Promise.all(
    [TournamentState.OPEN, TournamentState.PLAYING].map((state) => firstOf(tournamentsIn(state), SHOWN, signal)),
  );
  return [...(open?.items ?? []), ...(playing?.items ?? [])].slice(0, SHOWN);
}
