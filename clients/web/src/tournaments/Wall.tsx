// A tournament for a wall: nothing but its name, the standings and the tables of the moment, as large as the wall allows. Standings that do
// not fit are shown a part at a time.

import { useEffect, useState } from "preact/hooks";
import { TournamentFormat } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { Drawing } from "../parts/Drawing";
import { pathOf } from "../router";
import { Bracket } from "./Bracket";
import { type Heard, useGames } from "./following";
import { Rounds } from "./Rounds";
import { Standings } from "./Standings";
import { inShort, StateChip } from "./words";
import "./wall.css";

/** Lines of the standings that are read at a time. */
const LINES = 10;
/** How long each part of longer standings stays, milliseconds. */
const EVERY_MS = 9_000;

/** The wall. */
export function Wall({ heard }: { heard: Heard }) {
  const { tournament, standings } = heard;
  const words = t().tournaments;
  const games = useGames(heard);
  useWithoutFrame();
  const parts = Math.max(1, Math.ceil(standings.length / LINES));
  const part = useTurning(parts);
  const from = part * LINES;
  const shown = standings.slice(from, from + LINES);
  const knockout = tournament.settings?.format === TournamentFormat.KNOCKOUT;
  return (
    <div class="wall">
      <header class="wall-head">
        <Drawing name="joker" />
        <h1>{tournament.settings?.name}</h1>
        <StateChip tournament={tournament} />
        <span class="wall-course">{inShort(tournament)}</span>
        <a class="wall-leave" href={pathOf({ page: "tournament", tournamentId: tournament.tournamentId })}>
          <span aria-hidden="true">×</span>
          <span class="only-heard">{words.wall.close}</span>
        </a>
      </header>
      <section class="wall-standings">
        <Standings tournament={tournament} standings={shown} large />
        {parts > 1 && <p class="soft number">{words.wall.more(from + 1, from + shown.length)}</p>}
      </section>
      <section class="wall-games">
        {knockout ? (
          <>
            <h2 class="only-heard">{words.games.bracket}</h2>
            <Bracket tournament={tournament} games={games} large />
          </>
        ) : (
          <Rounds tournament={tournament} games={games} large />
        )}
      </section>
    </div>
  );
}

/** Takes the frame of all pages away for as long as the wall is drawn. */
function useWithoutFrame(): void {
  useEffect(() => {
    document.documentElement.dataset.wall = "";
    return () => {
      delete document.documentElement.dataset.wall;
    };
  }, []);
}

/** The number of the part to show, one after the other. */
function useTurning(parts: number): number {
  const [turn, setTurn] = useState(0);
  useEffect(() => {
    if (parts < 2) return;
    const timer = setInterval(() => setTurn((before) => before + 1), EVERY_MS);
    return () => clearInterval(timer);
  }, [parts]);
  return turn % parts;
}
