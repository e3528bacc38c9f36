// A knockout as a bracket: a column for each round, a box for each table, the first two of each marked by word and sign as those who go on.
// On a narrow page the rounds stand one below the other.

import type { Tournament, TournamentGame } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { type BracketRound, type BracketSeat, type BracketTable, bracket, isOver, nameOf } from "./course";
import { GameLink } from "./GameLink";
import "./bracket.css";

interface BracketProps {
  tournament: Tournament;
  games: readonly TournamentGame[];
  mine?: number | undefined;
  /** For a wall: without links. */
  large?: boolean;
  /** The first round that is drawn. */
  from?: number;
}

/** The bracket. */
export function Bracket({ tournament, games, mine, large = false, from = 1 }: BracketProps) {
  const words = t().tournaments;
  const rounds = bracket(tournament, games);
  if (rounds.length === 0) return <p class="soft">{words.games.none}</p>;
  return (
    <ol class={`bracket ${large ? "bracket-large" : ""}`} style={{ "--rounds": rounds.length - from + 1 }}>
      {rounds.slice(from - 1).map((round) => (
        <li key={round.round} class="bracket-round">
          <h3>{isFinal(rounds, round) ? words.final : words.round(round.round)}</h3>
          <ol class="bracket-tables">
            {round.tables.map((table) => (
              <li key={table.table} class={round.round < rounds.length ? "bracket-leads" : ""}>
                <Box
                  {...{ tournament, table, mine, large }}
                  final={isFinal(rounds, round)}
                  several={games.length > 1}
                />
              </li>
            ))}
          </ol>
        </li>
      ))}
    </ol>
  );
}

function isFinal(rounds: readonly BracketRound[], { round }: BracketRound): boolean {
  return round === rounds.length;
}

interface BoxProps {
  tournament: Tournament;
  table: BracketTable;
  mine: number | undefined;
  final: boolean;
  large: boolean;
  several: boolean;
}

function Box({ tournament, table, mine, final, large }: BoxProps) {
  const words = t().tournaments;
  const over = table.games.length > 0 && table.games.every(isOver);
  const playing = table.games.length > 0 && !over;
  return (
    <div class={`bracket-table ${playing ? "bracket-playing" : ""} ${table.seats.length === 0 ? "bracket-empty" : ""}`}>
      <header>
        <span>{final ? "" : words.table(table.table)}</span>
        {!large && (
          <span class="bracket-links">
            {table.games.map((game) => (
              <GameLink key={game.game} tournament={tournament} game={game} several={table.games.length > 1} />
            ))}
          </span>
        )}
      </header>
      {table.seats.length === 0 ? (
        <ul>
          {table.from.map((from) => (
            <li key={from} class="soft">
              {words.games.from(from)}
            </li>
          ))}
        </ul>
      ) : (
        <ol>
          {table.seats.map((seat) => (
            <Seat key={seat.participant} {...{ tournament, seat, final, over }} mine={seat.participant === mine} />
          ))}
        </ol>
      )}
    </div>
  );
}

interface SeatProps {
  tournament: Tournament;
  seat: BracketSeat;
  mine: boolean;
  final: boolean;
  over: boolean;
}

function Seat({ tournament, seat, mine, final, over }: SeatProps) {
  const words = t().tournaments.games;
  return (
    <li class={`bracket-seat ${seat.wentOn ? "bracket-on" : ""} ${mine ? "bracket-mine" : ""}`}>
      <span class="bracket-name">{nameOf(tournament, seat.participant)}</span>
      {seat.wentOn && (
        <span class="bracket-sign">
          <span aria-hidden="true">{final ? "★" : "→"}</span>
          <span class="only-heard">{final ? words.champion : words.advances}</span>
        </span>
      )}
      {over && <span class="number">{seat.score}</span>}
    </li>
  );
}
