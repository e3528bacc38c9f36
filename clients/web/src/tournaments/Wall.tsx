// The wall view of a tournament: name, standings and current tables, as large as the screen allows;
// before the start, the participants. What does not fit is shown in turns.

import type { ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";
import { TournamentFormat } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { Drawing } from "../parts/Drawing";
import { pathOf } from "../router";
import { Bracket } from "./Bracket";
import { Entrants } from "./Entrants";
import { useFit } from "./fit";
import { type LiveTournament, useGames } from "./following";
import { TablesOnWall } from "./Rounds";
import { Standings } from "./Standings";
import { bracket, playedRounds } from "./structure";
import css from "./Wall.module.css";
import { inShort, playWords, TournamentStateChip } from "./words";

/** Most lines of the standings at a time. */
const LINES = 10;
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
  useWithoutFrame();
  return (
    <div class={css.wall}>
      <header class={css.head}>
        <Drawing name="joker" />
        <h1>{tournament.settings?.name}</h1>
        <TournamentStateChip tournament={tournament} />
        <span class={css.course}>{inShort(tournament)}</span>
        <a class={css.leave} href={pathOf({ page: "tournament", tournamentId: tournament.tournamentId })}>
          <span aria-hidden="true">×</span>
          <span class="visually-hidden">{words.wall.close}</span>
        </a>
      </header>
      {tournament.round === 0 ? (
        <section class={`${css.part} ${css.field}`}>
          <h2>{words.standings.field}</h2>
          <Fitted>
            <Entrants tournament={tournament} large />
          </Fitted>
          <p class={css.play}>{playWords(tournament).join(" · ")}</p>
        </section>
      ) : (
        <Played live={live} />
      )}
    </div>
  );
}

/** The standings and the tables after the start. */
function Played({ live }: { live: LiveTournament }) {
  const { tournament, standings } = live;
  const words = t().tournaments;
  const lines = useParts(standings, LINES);
  return (
    <>
      <section class={css.part}>
        <h2>
          {words.standings.title}
          {lines.several && <span class="soft number"> {words.wall.more(lines.from, lines.to)}</span>}
        </h2>
        <Fitted>
          <Standings tournament={tournament} standings={lines.shown} large />
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

/** Hides the frame of all pages while the wall view is shown. */
function useWithoutFrame(): void {
  useEffect(() => {
    document.documentElement.dataset.wall = "";
    return () => {
      delete document.documentElement.dataset.wall;
    };
  }, []);
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
