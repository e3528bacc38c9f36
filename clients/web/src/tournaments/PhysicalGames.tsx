// The physical games in progress, for the organiser: each opens the attendant's view of its table on
// this device, which shows the link for others.

import { type Tournament, type TournamentGame, TournamentGameState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { ActionButton } from "../parts/ActionButton";
import { navigateFromHere } from "../router";
import { takeTable } from "./hosting";
import { nameOf } from "./structure";
import css from "./Tournaments.module.css";

interface PhysicalGamesProps {
  tournament: Tournament;
  games: readonly TournamentGame[];
}

/** A button for each physical game in progress; null without one. */
export function PhysicalGames({ tournament, games }: PhysicalGamesProps) {
  const physical = games.filter(({ physical, state }) => physical && state === TournamentGameState.PLAYING);
  if (physical.length === 0) return null;
  const words = t().organise.own.tables;
  return (
    <section class={css.organiserBegin} data-part="physical-games">
      <h3>{words.title}</h3>
      <p class="soft small">{words.text}</p>
      {physical.map((game) => (
        <PhysicalGame key={game.game} tournament={tournament} game={game} />
      ))}
    </section>
  );
}

function PhysicalGame({ tournament, game }: { tournament: Tournament; game: TournamentGame }) {
  const { round, table, games } = t().tournaments;
  const names = game.seats.map(({ participant }) => nameOf(tournament, participant));
  const open = async () => {
    const navigate = navigateFromHere();
    navigate({ page: "attend", roomId: await takeTable(tournament.tournamentId, game.game) });
  };
  return (
    <>
      <p>
        <b>{games.of(`${round(game.round)}, ${table(game.table)}`, game.number)}</b> {names.join(", ")}
      </p>
      <ActionButton act={open}>{t().attend.title}</ActionButton>
    </>
  );
}
