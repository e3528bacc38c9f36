// The results of a tournament, to print or to store as PDF, and certificates for the participants.

import { wordsOf } from "../api/faults";
import type { PageProps } from "../app";
import {
  type Tournament,
  type TournamentGame,
  TournamentGameState,
  type TournamentStanding,
} from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { useAttempt } from "../parts/attempt";
import { Button, ButtonLink } from "../parts/Button";
import { download, fileName } from "../parts/download";
import { Notice } from "../parts/Notice";
import { pathOf } from "../router";
import { type Certificate, certificatesOf } from "./certificate";
import { type LiveTournament, useGames, useTournament } from "./following";
import css from "./Results.module.css";
import { Standings } from "./Standings";
import { isEnded, nameOf, playedRounds } from "./structure";
import { dateOf, dealsWords, formatWord, inShort, settingsWords } from "./words";

/** The page. */
export function ResultsPage({ route }: PageProps<"results">) {
  const followed = useTournament(route.tournamentId);
  const live = followed?.live.value;
  const fault = followed?.following.link.value === "failed" && followed.following.fault.value;
  if (fault) return <Notice kind="fault">{wordsOf(fault)}</Notice>;
  return live ? <Results live={live} /> : <p class="soft">{t().common.loading}</p>;
}

/** The results, as they are on paper, with controls that are not printed. */
export function Results({ live }: { live: LiveTournament }) {
  const { tournament, standings } = live;
  const words = t().tournaments;
  const games = useGames(live);
  const deals = dealsWords(tournament);
  return (
    <article class={css.results} data-part="results">
      <nav class={css.controls} aria-label={words.results.controls}>
        <Button look="main" onClick={() => window.print()}>
          {words.print}
        </Button>
        <ButtonLink href={pathOf({ page: "tournament", tournamentId: tournament.tournamentId })}>
          {words.results.back}
        </ButtonLink>
      </nav>
      <header>
        <h1>{tournament.settings?.name}</h1>
        <p>
          {dateOf(tournament.createdAtMs)} · {inShort(tournament)}
        </p>
        {!isEnded(tournament) && <p>{words.results.provisional(dateOf(BigInt(Date.now())))}</p>}
      </header>
      {standings.length > 0 && (
        <section>
          <h2>{isEnded(tournament) ? words.standings.final : words.standings.title}</h2>
          <Standings tournament={tournament} standings={standings} />
        </section>
      )}
      <section>
        <h2>{words.results.settings}</h2>
        <ul class={css.settings}>
          {[formatWord(tournament), ...settingsWords(tournament), ...(deals ? [deals] : [])].map((line) => (
            <li key={line}>{line}</li>
          ))}
        </ul>
      </section>
      <Games tournament={tournament} games={games} />
      <Certificates tournament={tournament} standings={standings} />
      <footer class={css.foot}>{words.results.foot(tournament.tournamentId)}</footer>
    </article>
  );
}

/** The games that count, a table for each round. */
function Games({ tournament, games }: { tournament: Tournament; games: readonly TournamentGame[] }) {
  const words = t().tournaments;
  const counted = games.filter(({ state }) => state === TournamentGameState.COUNTED);
  if (counted.length === 0) return null;
  return (
    <section>
      <h2>{words.games.title}</h2>
      {playedRounds(counted).map(({ round, tables }) => (
        <table key={round} class={css.games}>
          <caption>{words.round(round)}</caption>
          <thead>
            <tr>
              <th scope="col">{words.results.table}</th>
              <th scope="col">{words.results.game}</th>
              <th scope="col">{words.results.result}</th>
            </tr>
          </thead>
          <tbody>
            {tables.flatMap(({ table, games }) =>
              games.map((game) => (
                <tr key={game.game}>
                  <td class="number">{table}</td>
                  <td class="number">{game.number}</td>
                  <td>{resultWords(tournament, game)}</td>
                </tr>
              )),
            )}
          </tbody>
        </table>
      ))}
    </section>
  );
}

/** The seats of a game by place, with their scores. */
function resultWords(tournament: Tournament, { seats }: TournamentGame): string {
  return [...seats]
    .sort((one, other) => one.place - other.place)
    .map(({ participant, place, score, forfeited }) => {
      const name = `${place}. ${nameOf(tournament, participant)}`;
      return forfeited ? `${name} (${t().tournaments.games.forfeited})` : `${name} +${score}`;
    })
    .join(" · ");
}

interface CertificatesProps {
  tournament: Tournament;
  standings: readonly TournamentStanding[];
}

/** Buttons that save certificates; null before the end. */
function Certificates({ tournament, standings }: CertificatesProps) {
  const words = t().tournaments.certificate;
  const { busy, fault, run } = useAttempt();
  const all = certificatesOf(tournament, standings);
  if (all.length === 0) return null;
  const save = (certificates: readonly Certificate[], name: string) =>
    run(async () => {
      const { certificatesPdf } = await import("./certificate-pdf");
      const pdf = await certificatesPdf(certificates);
      download(pdf.slice().buffer, `${fileName(`${tournament.settings?.name} ${name}`)}.pdf`, "application/pdf");
      return false;
    });
  return (
    <section class={css.certificates} data-part="certificates">
      <h2>{words.heading}</h2>
      <p class="soft">{words.text}</p>
      {fault && <Notice kind="fault">{fault}</Notice>}
      <Button busy={busy} onClick={() => save(all, words.heading)}>
        {words.all(all.length)}
      </Button>
      <ul>
        {all.map((certificate) => (
          <li key={certificate.participant}>
            <Button look="quiet" busy={busy} onClick={() => save([certificate], certificate.name)}>
              <span class="visually-hidden">{words.of} </span>
              {certificate.name}
            </Button>
          </li>
        ))}
      </ul>
    </section>
  );
}
