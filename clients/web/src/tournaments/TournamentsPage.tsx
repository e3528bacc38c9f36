// The tournaments of the server: open, running and finished.

import { wordsOf } from "../api/faults";
import { countWords, type Shown, useShown } from "../api/pages";
import { type Tournament, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { ButtonLink } from "../parts/Button";
import { MoreButton } from "../parts/MoreButton";
import { Notice } from "../parts/Notice";
import { pathOf } from "../router";
import { tournamentsIn } from "./list";
import css from "./Tournaments.module.css";
import { inShort, madeWords, TournamentStateChip } from "./words";

/** Polling interval of the lists, milliseconds. */
const EVERY_MS = 4_000;
/** Polling interval of finished tournaments, milliseconds: nobody is waiting for them. */
const OVER_EVERY_MS = 20_000;
/** Tournaments shown at first, and more at a time. */
const AT_A_TIME = 12;

/** The page. */
export function TournamentsPage() {
  const words = t().tournaments;
  const { sections } = words;
  const open = useShown(tournamentsIn(TournamentState.OPEN), AT_A_TIME, EVERY_MS, "open");
  const playing = useShown(tournamentsIn(TournamentState.PLAYING), AT_A_TIME, EVERY_MS, "playing");
  const finished = useShown(tournamentsIn(TournamentState.FINISHED), AT_A_TIME, OVER_EVERY_MS, "finished");
  const closed = useShown(tournamentsIn(TournamentState.CLOSED), AT_A_TIME, OVER_EVERY_MS, "closed");
  const all = [open, playing, finished, closed];
  const fault = all.find((shown) => shown.fault)?.fault;
  const known = all.every(({ list }) => list !== null);
  const none = known && all.every(({ list }) => list?.items.length === 0);
  return (
    <div class={css.tournaments}>
      <header class={css.listHead}>
        <h1>{t().common.nav.tournaments}</h1>
        <ButtonLink href={pathOf({ page: "newTournament" })} look={none ? "main" : "plain"}>
          {t().organise.link}
        </ButtonLink>
      </header>
      {fault && <Notice kind="fault">{wordsOf(fault)}</Notice>}
      {!known && !fault && <p class="soft">{t().common.loading}</p>}
      {none && <p class="sheet">{words.none}</p>}
      <Section title={sections.open} shown={open} />
      <Section title={sections.playing} shown={playing} />
      <Section title={sections.over} shown={finished} />
      <Section title={sections.closed} shown={closed} />
    </div>
  );
}

function Section({ title, shown }: { title: string; shown: Shown<Tournament> }) {
  const { list } = shown;
  if (list === null || list.items.length === 0) return null;
  return (
    <section class={css.listSection}>
      <h2>
        {title} <span class="soft number">{countWords(list.items.length, list.more)}</span>
      </h2>
      <ul class={css.listList}>
        {list.items.map((tournament) => (
          <li key={tournament.tournamentId}>
            <a
              class={`sheet ${css.listCard}`}
              href={pathOf({ page: "tournament", tournamentId: tournament.tournamentId })}
            >
              <b>{tournament.settings?.name}</b>
              <TournamentStateChip tournament={tournament} />
              <span class="soft small">
                {inShort(tournament)} · {madeWords(tournament)}
              </span>
            </a>
          </li>
        ))}
      </ul>
      <MoreButton shown={shown} what={title} />
    </section>
  );
}
