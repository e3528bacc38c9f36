// The wall view of a tournament: name, standings and current tables, as large as the screen allows;
// before the start, the participants and the way in. What does not fit is shown in turns; a large screen
// has the standings of up to 64 at once.

import type { ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";
import { TournamentFormat, type TournamentStanding, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { QrCode } from "../lobby/Invite";
import { Drawing } from "../parts/Drawing";
import { pathOf } from "../router";
import { Bracket } from "./Bracket";
import { Countdown } from "./Countdown";
import { Entrants } from "./Entrants";
import { useFit } from "./fit";
import { type LiveTournament, useGames } from "./following";
import { hostedTournament, invitationTo } from "./hosting";
import { TablesOnWall } from "./Rounds";
import { Standings, standingsTitle } from "./Standings";
import { bracket, playedRounds } from "./structure";
import css from "./Wall.module.css";
import { inShort, playWords, TournamentStateChip } from "./words";

/** Most lines of the standings at a time. */
const LINES = 12;
/** Most names at a time on a large screen, which has several columns, and the most lines of one. */
const MOST_NAMES = 64;
const COLUMN_LINES = 22;
/** Screens on which names in columns can be read from afar. */
const LARGE_SCREEN = "(min-width: 1600px) and (min-height: 900px)";
/** Most tables at a time. */
const TABLES = 12;
/** Most tables per round for a readable bracket: with more, the tables are shown side by side. */
const BRACKET_TABLES = 4;
/** Duration of each part, milliseconds. */
const EVERY_MS = 9_000;

/** The wall. */
export function Wall({ live }: { live: LiveTournament }) {
  const { tournament } = live;
  const words = t().tournaments;
  const code = tournament.state === TournamentState.OPEN ? codeFor(tournament.tournamentId) : undefined;
  return (
    <div class={css.wall}>
      <header class={css.head}>
        <Drawing name="joker" />
        <h1>{tournament.settings?.name}</h1>
        <TournamentStateChip tournament={tournament} />
        <span class={css.course}>{inShort(tournament)}</span>
        <Countdown tournament={tournament} />
        <a class={css.leave} href={pathOf({ page: "tournament", tournamentId: tournament.tournamentId })}>
          <span aria-hidden="true">×</span>
          <span class="visually-hidden">{words.wall.close}</span>
        </a>
      </header>
      {tournament.round === 0 ? (
        <>
          <section class={`${css.part} ${css.field} ${code ? "" : css.alone}`}>
            <h2>{words.standings.field}</h2>
            <Fitted>
              <Entrants tournament={tournament} large />
            </Fitted>
            <p class={css.play}>{playWords(tournament).join(" · ")}</p>
          </section>
          {code && <WayIn tournamentId={tournament.tournamentId} code={code} />}
        </>
      ) : (
        <Played live={live} />
      )}
    </div>
  );
}

/** The address with the join code as a QR code, and both in letters, while anybody may join. */
function WayIn({ tournamentId, code }: { tournamentId: string; code: string }) {
  const words = t().tournaments.wall;
  return (
    <section class={`${css.part} ${css.wayIn}`} data-part="wall-invitation">
      <h2>{words.join}</h2>
      <QrCode text={invitationTo(tournamentId, code)} label={t().lobby.invite.qr} />
      <p>
        {words.orCode(location.host)} <b class={css.code}>{code}</b>
      </p>
    </section>
  );
}

/** The join code: in the address, or known to the organiser's device. */
function codeFor(tournamentId: string): string | undefined {
  return new URLSearchParams(location.search).get("code") ?? hostedTournament(tournamentId)?.joinCode;
}

/** The standings and the tables after the start. */
function Played({ live }: { live: LiveTournament }) {
  const { tournament, standings } = live;
  const words = t().tournaments;
  const largeScreen = useMatches(LARGE_SCREEN);
  const lines = useParts(standings, largeScreen ? MOST_NAMES : LINES);
  const columns = inColumns(lines.shown);
  return (
    <>
      <section class={`${css.part} ${columns.length > 1 ? css.wide : ""}`}>
        <h2>
          {standingsTitle(tournament)}
          {lines.several && <span class="soft number"> {words.wall.more(lines.from, lines.to)}</span>}
        </h2>
        <Fitted>
          {columns.length > 1 ? (
            <div class={css.columns} data-part="wall-columns">
              {columns.map((column, index) => (
                <div key={index} style={{ "--share": column.length / (columns[0]?.length ?? 1) }}>
                  <Standings tournament={tournament} standings={column} large />
                </div>
              ))}
            </div>
          ) : (
            <Standings tournament={tournament} standings={lines.shown} large />
          )}
        </Fitted>
      </section>
      <Tables live={live} />
    </>
  );
}

/** The current tables: those of the round, or the rest of a bracket. */
function Tables({ live }: { live: LiveTournament }) {
  const { tournament } = live;
  const words = t().tournaments;
  const games = useGames(live);
  const rounds = playedRounds(games);
  const newest = rounds.find(({ round }) => round === tournament.round) ?? rounds.at(-1);
  const tables = useParts(newest?.tables ?? [], TABLES);
  const knockout = tournament.settings?.format === TournamentFormat.KNOCKOUT;
  if (knockout && newest && newest.tables.length <= BRACKET_TABLES) {
    const first = bracket(tournament, games).find((round) => round.tables.length <= BRACKET_TABLES)?.round ?? 1;
    return (
      <section class={css.part}>
        <h2>{words.games.bracket}</h2>
        <Fitted>
          <Bracket tournament={tournament} games={games} from={first} large />
        </Fitted>
      </section>
    );
  }
  return (
    <section class={css.part}>
      <h2>
        {newest && words.round(newest.round)}
        {tables.several && <span class="soft number"> · {words.wall.tables(tables.from, tables.to)}</span>}
      </h2>
      <Fitted>
        <TablesOnWall tournament={tournament} tables={tables.shown} />
      </Fitted>
    </section>
  );
}

/** A box whose text is as large as possible. */
function Fitted({ children }: { children: ComponentChildren }) {
  const box = useFit<HTMLDivElement>();
  return (
    <div ref={box} class={css.fitted} data-part="wall-fitted">
      {children}
    </div>
  );
}

/** Columns of about equal length, none longer than can be read; one for a screen that has no more lines. */
function inColumns(shown: readonly TournamentStanding[]): TournamentStanding[][] {
  const length = Math.ceil(shown.length / Math.max(1, Math.ceil(shown.length / COLUMN_LINES)));
  const columns = Math.ceil(shown.length / Math.max(1, length));
  return Array.from({ length: columns }, (_, index) => shown.slice(index * length, (index + 1) * length));
}

/** Whether the screen matches a media query, also after it has changed. */
function useMatches(query: string): boolean {
  const [matches, setMatches] = useState(() => matchMedia(query).matches);
  useEffect(() => {
    const media = matchMedia(query);
    const changed = () => setMatches(media.matches);
    media.addEventListener("change", changed);
    return () => media.removeEventListener("change", changed);
  }, [query]);
  return matches;
}

/** Splits a list into parts of about equal length, none longer than `most`. */
function useParts<Item>(all: readonly Item[], most: number) {
  const parts = Math.max(1, Math.ceil(all.length / most));
  const length = Math.ceil(all.length / parts);
  const [turn, setTurn] = useState(0);
  useEffect(() => {
    if (parts < 2) return;
    const timer = setInterval(() => setTurn((before) => before + 1), EVERY_MS);
    return () => clearInterval(timer);
  }, [parts]);
  const begin = (turn % parts) * length;
  const shown = all.slice(begin, begin + length);
  return { shown, several: parts > 1, from: begin + 1, to: begin + shown.length };
}
