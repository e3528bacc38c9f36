// The rounds of a round robin or Swiss tournament, the newest one open; and the tables of one round
// for the wall view.

import {
  type Tournament,
  type TournamentGame,
  type TournamentGameSeat,
  TournamentGameState,
} from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { GameLink } from "./GameLink";
import css from "./Rounds.module.css";
import { nameIn, type PlayedTable, playedRounds } from "./structure";
import wallCss from "./Wall.module.css";

interface RoundsProps {
  tournament: Tournament;
  games: readonly TournamentGame[];
  mine?: number | undefined;
}

/** The rounds, newest first. */
export function Rounds({ tournament, games, mine }: RoundsProps) {
  const words = t().tournaments;
  const rounds = playedRounds(games).reverse();
  const newest = rounds.find(({ round }) => round === tournament.round) ?? rounds[0];
  if (!newest) return <p class="soft">{words.games.none}</p>;
  return (
    <div class="stack">
      {rounds.map(({ round, tables }) => (
        <details key={round} class={`sheet ${css.one}`} open={round === newest.round}>
          <summary>{words.round(round)}</summary>
          <Tables {...{ tournament, tables, mine }} />
        </details>
      ))}
    </div>
  );
}

interface TablesProps {
  tournament: Tournament;
  tables: readonly PlayedTable[];
  mine: number | undefined;
}

function Tables({ tournament, tables, mine }: TablesProps) {
  const words = t().tournaments;
  return (
    <ul class={css.tables}>
      {tables.map(({ table, games }) => (
        <li key={table} class={css.table}>
          <h3>{words.table(table)}</h3>
          <ul>
            {games.map((game) => (
              <li key={game.game} class={css.game}>
                <ol>
                  {byPlace(game).map((seat) => (
                    <Seat key={seat.participant} {...{ tournament, game, seat }} mine={seat.participant === mine} />
                  ))}
                </ol>
                <GameLink tournament={tournament} game={game} several={games.length > 1} />
              </li>
            ))}
          </ul>
        </li>
      ))}
    </ul>
  );
}

/** Tables for the wall view: the running game of each, or its newest result. */
export function TablesOnWall({ tournament, tables }: Omit<TablesProps, "mine">) {
  const words = t().tournaments;
  return (
    <ol class={wallCss.tables}>
      {tables.map(({ table, games }) => {
        const game = ofTheMoment(games);
        if (!game) return null;
        const playing = game.state === TournamentGameState.PLAYING;
        return (
          <li key={table} class={playing ? wallCss.playing : ""}>
            <h3>
              {words.table(table)}
              {games.length > 1 && ` · ${words.game(game.number)}`}
              {playing && (
                <>
                  <span aria-hidden="true"> ▶</span>
                  <span class="visually-hidden"> {words.states.playing}</span>
                </>
              )}
            </h3>
            <ol>
              {byPlace(game).map((seat) => (
                <Seat key={seat.participant} {...{ tournament, game, seat }} mine={false} />
              ))}
            </ol>
          </li>
        );
      })}
    </ol>
  );
}

/** The table's game to show now. */
function ofTheMoment(games: readonly TournamentGame[]): TournamentGame | undefined {
  return (
    games.find(({ state }) => state === TournamentGameState.PLAYING) ??
    games.findLast(({ state }) => state === TournamentGameState.COUNTED) ??
    games[0]
  );
}

interface SeatProps {
  tournament: Tournament;
  game: TournamentGame;
  seat: TournamentGameSeat;
  mine: boolean;
}

function Seat({ tournament, game, seat, mine }: SeatProps) {
  const counted = game.state === TournamentGameState.COUNTED;
  return (
    <li
      class={`${css.seat} ${mine ? css.mine : ""} ${counted && seat.place === 1 ? css.first : ""}`}
      data-part="rounds-seat"
    >
      {counted && <span class="number soft">{t().common.place(seat.place)}</span>}
      <span class={css.name}>{nameIn(tournament, seat)}</span>
      {counted &&
        (seat.forfeited ? (
          <span class="soft small">{t().tournaments.games.forfeited}</span>
        ) : (
          <span class="number">+{seat.score}</span>
        ))}
    </li>
  );
}

/** The seats of a game: by place once it counts, otherwise in order. */
function byPlace(game: TournamentGame): TournamentGameSeat[] {
  if (game.state !== TournamentGameState.COUNTED) return [...game.seats];
  return [...game.seats].sort((one, other) => one.place - other.place);
}
