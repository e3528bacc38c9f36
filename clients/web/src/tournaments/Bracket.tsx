// A knockout as a bracket: a column per round, a box per table; the two who advance are marked by
// text and sign. On a narrow page the rounds are stacked.

import { type Tournament, type TournamentGame, TournamentGameState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import css from "./Bracket.module.css";
import { GameLink } from "./GameLink";
import { type BracketRound, type BracketSeat, type BracketTable, bracket, isOver, nameOf } from "./structure";

interface BracketProps {
  tournament: Tournament;
  games: readonly TournamentGame[];
  mine?: number | undefined;
  /** Wall view: without links. */
  large?: boolean;
  /** The first round shown. */
  from?: number;
}

/** The bracket. */
export function Bracket({ tournament, games, mine, large = false, from = 1 }: BracketProps) {
  const words = t().tournaments;
  const rounds = bracket(tournament, games);
  if (rounds.length === 0) return <p class="soft">{words.games.none}</p>;
  return (
    <ol
      class={`${css.bracket} ${large ? css.large : ""}`}
      data-part="bracket"
      style={{ "--rounds": rounds.length - from + 1 }}
    >
      {rounds.slice(from - 1).map((round) => (
        <li key={round.round} class={css.round} data-part="bracket-round">
          <h3>{isFinal(rounds, round) ? words.final : words.round(round.round)}</h3>
          <ol class={css.tables} data-part="bracket-tables">
            {round.tables.map((table) => (
              <li key={table.table} class={round.round < rounds.length ? css.leads : ""}>
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
  const playing = table.games.some(({ state }) => state === TournamentGameState.PLAYING);
  return (
    <div
      class={`${css.table} ${playing ? css.playing : ""} ${table.seats.length === 0 ? css.empty : ""}`}
      data-part="bracket-table"
    >
      <header>
        <span>{final ? "" : words.table(table.table)}</span>
        {!large && (
          <span class={css.links}>
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
    <li class={`${css.seat} ${seat.wentOn ? css.on : ""} ${mine ? css.mine : ""}`}>
      <span class={css.name}>{nameOf(tournament, seat.participant)}</span>
      {seat.wentOn && (
        <span>
          <span aria-hidden="true">{final ? "★" : "→"}</span>
          <span class="visually-hidden">{final ? words.champion : words.advances}</span>
        </span>
      )}
      {over && <span class="number">{seat.score}</span>}
    </li>
  );
}
