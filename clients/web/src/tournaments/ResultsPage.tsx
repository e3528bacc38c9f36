// The results of a tournament and certificates for the participants, to print or, from the dialog of
// the browser, to store as PDF.

import { useEffect, useState } from "preact/hooks";
import { wordsOf } from "../api/faults";
import { type Tournament, type TournamentGame, TournamentGameState } from "../gen/chefshat/v1/tournament_pb";
import { dateOf, t } from "../i18n";
import { Button, ButtonLink } from "../parts/Button";
import { Drawing } from "../parts/Drawing";
import { Notice } from "../parts/Notice";
import { type PageProps, pathOf } from "../router";
import { type Certificate, certificatesOf } from "./certificate";
import { type LiveTournament, useGames, useTournament } from "./following";
import css from "./Results.module.css";
import { Standings, standingsTitle } from "./Standings";
import { isEnded, nameIn, playedRounds } from "./structure";
import { dayWords, dealsWords, formatWord, inShort, settingsWords } from "./words";

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
  const certificates = certificatesOf(tournament, standings);
  const [printing, print] = usePrinting();
  return (
    <article class={css.results} data-part="results" data-printing={printing && ""}>
      <nav class={css.controls} aria-label={words.results.title}>
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
          {dayWords(tournament)} · {inShort(tournament)}
        </p>
        {!isEnded(tournament) && <p>{words.results.provisional(dateOf(BigInt(Date.now())))}</p>}
      </header>
      {standings.length > 0 && (
        <section>
          <h2>{standingsTitle(tournament)}</h2>
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
      {certificates.length > 0 && <Certificates certificates={certificates} onPrint={print} />}
      <footer class={css.foot}>{words.results.foot(tournament.tournamentId)}</footer>
      {printing?.map((certificate) => (
        <Sheet key={certificate.participant} certificate={certificate} />
      ))}
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
    .map((seat) => {
      const { place, score, forfeited } = seat;
      const name = `${place}. ${nameIn(tournament, seat)}`;
      return forfeited ? `${name} (${t().tournaments.games.forfeited})` : `${name} +${score}`;
    })
    .join(" · ");
}

/** The certificates that are printed in place of the results, until the dialog is closed; and what opens it. */
function usePrinting(): [readonly Certificate[] | undefined, (certificates: readonly Certificate[]) => void] {
  const [printing, setPrinting] = useState<readonly Certificate[]>();
  useEffect(() => {
    if (!printing) return;
    const end = () => setPrinting(undefined);
    window.addEventListener("afterprint", end);
    window.print();
    return () => window.removeEventListener("afterprint", end);
  }, [printing]);
  return [printing, setPrinting];
}

interface CertificatesProps {
  certificates: readonly Certificate[];
  onPrint(certificates: readonly Certificate[]): void;
}

/** Buttons that print certificates. */
function Certificates({ certificates, onPrint }: CertificatesProps) {
  const words = t().tournaments.certificate;
  return (
    <section class={css.certificates} data-part="certificates">
      <h2>{words.heading}</h2>
      <p class="soft">{words.text}</p>
      <Button onClick={() => onPrint(certificates)}>{words.all(certificates.length)}</Button>
      <ul>
        {certificates.map((certificate) => (
          <li key={certificate.participant}>
            <Button look="quiet" onClick={() => onPrint([certificate])}>
              <span class="visually-hidden">{words.of} </span>
              {certificate.name}
            </Button>
          </li>
        ))}
      </ul>
    </section>
  );
}

/** A certificate on a sheet of its own, seen only on paper. */
function Sheet({ certificate }: { certificate: Certificate }) {
  return (
    <section class={css.sheet} data-part="certificate">
      <Drawing name="role-chef" class={css.hat} />
      <p class={css.title}>{certificate.title}</p>
      <p class={css.name}>{certificate.name}</p>
      <p>{certificate.achieved}</p>
      <p class={css.tournament}>{certificate.tournament}</p>
      {certificate.lines.map((line) => (
        <p key={line} class={css.line}>
          {line}
        </p>
      ))}
      <p class={css.signature}>{certificate.signature}</p>
    </section>
  );
}
