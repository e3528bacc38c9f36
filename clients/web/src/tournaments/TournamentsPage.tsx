// The tournaments of the server: those that can be joined, those that are being played, those that are over.

import { wordsOf } from "../api/faults";
import { usePolled } from "../api/poll";
import { type Tournament, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { Notice } from "../parts/Notice";
import { pathOf } from "../router";
import { isEnded } from "./course";
import { listTournaments } from "./list";
import { inShort, StateChip } from "./words";
import "./tournaments.css";

/** How often the list is asked for, milliseconds. */
const EVERY_MS = 4_000;

/** The page. */
export function TournamentsPage() {
  const words = t().tournaments;
  const { value, fault } = usePolled(listTournaments, EVERY_MS, "tournaments");
  const tournaments = value ?? [];
  const inState = (state: TournamentState) => tournaments.filter((tournament) => tournament.state === state);
  return (
    <div class="tournaments">
      <h1>{words.title}</h1>
      {fault && <Notice kind="fault">{wordsOf(fault)}</Notice>}
      {value === null && !fault && <p class="soft">{t().common.loading}</p>}
      {value?.length === 0 && <p class="sheet">{words.none}</p>}
      <Section title={words.sections.open} tournaments={inState(TournamentState.OPEN)} />
      <Section title={words.sections.playing} tournaments={inState(TournamentState.PLAYING)} />
      <Section title={words.sections.over} tournaments={tournaments.filter(isEnded)} />
    </div>
  );
}

function Section({ title, tournaments }: { title: string; tournaments: readonly Tournament[] }) {
  if (tournaments.length === 0) return null;
  return (
    <section class="tournaments-section">
      <h2>
        {title} <span class="soft number">{tournaments.length}</span>
      </h2>
      <ul class="tournaments-list">
        {tournaments.map((tournament) => (
          <li key={tournament.tournamentId}>
            <a
              class="sheet tournaments-card"
              href={pathOf({ page: "tournament", tournamentId: tournament.tournamentId })}
            >
              <b>{tournament.settings?.name}</b>
              <StateChip tournament={tournament} />
              <span class="soft small">{inShort(tournament)}</span>
            </a>
          </li>
        ))}
      </ul>
    </section>
  );
}
